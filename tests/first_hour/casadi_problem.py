"""Problem 71 of Hock and Schittkowski by CasADi's Ipopt, with a linear solver that Ipopt loads: HSL's interface."""

import casadi

x = casadi.SX.sym("x", 4)
problem = {"x": x, "f": x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2], "g": casadi.vertcat(x[0] * x[1] * x[2] * x[3], casadi.sumsqr(x))}
options = {"ipopt.linear_solver": "ma57", "ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}
solver = casadi.nlpsol("solver", "ipopt", problem, options)
found = solver(x0=[1, 5, 5, 1], lbx=1, ubx=5, lbg=[25, 40], ubg=[casadi.inf, 40])
print(f"objective {float(found['f']):.9f} {solver.stats()['return_status']}")
