"""31 nonlinear programs for Ipopt, from two unknowns to tens of thousands.

Each function returns (problem, arguments) as casadi.nlpsol() and its solver take them. The numbers HS... are those of Hock and
Schittkowski, Test Examples for Nonlinear Programming Codes (1981).
"""
import casadi as ca
import numpy as np

INF = float("inf")
PROBLEMS = {}


def problem(function):
    PROBLEMS[function.__name__] = function
    return function


def small(x0, objective, constraints=None, lbx=-INF, ubx=INF, lbg=0.0, ubg=0.0):
    """A program in len(x0) unknowns; objective and constraints take them as a list."""
    x = ca.MX.sym("x", len(x0))
    parts = ca.vertsplit(x)
    nlp = {"x": x, "f": objective(parts)}
    arguments = {"x0": x0, "lbx": lbx, "ubx": ubx}
    if constraints:
        nlp["g"] = ca.vertcat(*constraints(parts))
        arguments |= {"lbg": lbg, "ubg": ubg}
    return nlp, arguments


@problem
def hs001():
    return small([-2, 1], lambda x: 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2, lbx=[-INF, -1.5])


@problem
def hs006():
    return small([-1.2, 1], lambda x: (1 - x[0]) ** 2, lambda x: [10 * (x[1] - x[0] ** 2)])


@problem
def hs007():
    return small([2, 2], lambda x: ca.log(1 + x[0] ** 2) - x[1], lambda x: [(1 + x[0] ** 2) ** 2 + x[1] ** 2 - 4])


@problem
def hs010():
    return small([-10, 10], lambda x: x[0] - x[1], lambda x: [-3 * x[0] ** 2 + 2 * x[0] * x[1] - x[1] ** 2 + 1], ubg=INF)


@problem
def hs012():
    return small([0, 0], lambda x: 0.5 * x[0] ** 2 + x[1] ** 2 - x[0] * x[1] - 7 * x[0] - 7 * x[1],
                 lambda x: [25 - 4 * x[0] ** 2 - x[1] ** 2], ubg=INF)


@problem
def hs013():
    """No constraint qualification holds at the solution."""
    return small([-2, -2], lambda x: (x[0] - 2) ** 2 + x[1] ** 2, lambda x: [(1 - x[0]) ** 3 - x[1]], lbx=0, ubg=INF)


@problem
def hs026():
    """The Hessian is singular at the solution."""
    return small([-2.6, 2, 2], lambda x: (x[0] - x[1]) ** 2 + (x[1] - x[2]) ** 4,
                 lambda x: [(1 + x[1] ** 2) * x[0] + x[2] ** 4 - 3])


@problem
def hs039():
    return small([2, 2, 2, 2], lambda x: -x[0], lambda x: [x[1] - x[0] ** 3 - x[2] ** 2, x[0] ** 2 - x[1] - x[3] ** 2])


@problem
def hs040():
    return small([0.8] * 4, lambda x: -x[0] * x[1] * x[2] * x[3],
                 lambda x: [x[0] ** 3 + x[1] ** 2 - 1, x[0] ** 2 * x[3] - x[2], x[3] ** 2 - x[1]])


@problem
def hs043():
    return small([0] * 4, lambda x: x[0] ** 2 + x[1] ** 2 + 2 * x[2] ** 2 + x[3] ** 2 - 5 * x[0] - 5 * x[1] - 21 * x[2] + 7 * x[3],
                 lambda x: [8 - x[0] ** 2 - x[1] ** 2 - x[2] ** 2 - x[3] ** 2 - x[0] + x[1] - x[2] + x[3],
                            10 - x[0] ** 2 - 2 * x[1] ** 2 - x[2] ** 2 - 2 * x[3] ** 2 + x[0] + x[3],
                            5 - 2 * x[0] ** 2 - x[1] ** 2 - x[2] ** 2 - 2 * x[0] + x[1] + x[3]], ubg=INF)


@problem
def hs071():
    return small([1, 5, 5, 1], lambda x: x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2],
                 lambda x: [x[0] * x[1] * x[2] * x[3] - 25, x[0] ** 2 + x[1] ** 2 + x[2] ** 2 + x[3] ** 2 - 40],
                 lbx=1, ubx=5, ubg=[INF, 0])


@problem
def hs077():
    return small([2] * 5, lambda x: (x[0] - 1) ** 2 + (x[0] - x[1]) ** 2 + (x[2] - 1) ** 2 + (x[3] - 1) ** 4 + (x[4] - 1) ** 6,
                 lambda x: [x[0] ** 2 * x[3] + ca.sin(x[3] - x[4]) - 2 * 2 ** 0.5, x[1] + x[2] ** 4 * x[3] ** 2 - 8 - 2 ** 0.5])


@problem
def hs079():
    return small([2] * 5, lambda x: (x[0] - 1) ** 2 + (x[0] - x[1]) ** 2 + (x[1] - x[2]) ** 2 + (x[2] - x[3]) ** 4 + (x[3] - x[4]) ** 4,
                 lambda x: [x[0] + x[1] ** 2 + x[2] ** 3 - 2 - 3 * 2 ** 0.5, x[1] - x[2] ** 2 + x[3] + 2 - 2 * 2 ** 0.5, x[0] * x[4] - 2])


@problem
def hs100():
    return small([1, 2, 0, 4, 0, 1, 1],
                 lambda x: (x[0] - 10) ** 2 + 5 * (x[1] - 12) ** 2 + x[2] ** 4 + 3 * (x[3] - 11) ** 2 + 10 * x[4] ** 6 + 7 * x[5] ** 2
                 + x[6] ** 4 - 4 * x[5] * x[6] - 10 * x[5] - 8 * x[6],
                 lambda x: [127 - 2 * x[0] ** 2 - 3 * x[1] ** 4 - x[2] - 4 * x[3] ** 2 - 5 * x[4],
                            282 - 7 * x[0] - 3 * x[1] - 10 * x[2] ** 2 - x[3] + x[4],
                            196 - 23 * x[0] - x[1] ** 2 - 6 * x[5] ** 2 + 8 * x[6],
                            -4 * x[0] ** 2 - x[1] ** 2 + 3 * x[0] * x[1] - 2 * x[2] ** 2 - 5 * x[5] + 11 * x[6]], ubg=INF)


@problem
def hs118():
    """A convex quadratic program of 15 unknowns."""
    def objective(x):
        return sum(2.3 * x[3 * k] + 1e-4 * x[3 * k] ** 2 + 1.7 * x[3 * k + 1] + 1e-4 * x[3 * k + 1] ** 2 + 2.2 * x[3 * k + 2]
                   + 1.5e-4 * x[3 * k + 2] ** 2 for k in range(5))

    def constraints(x):
        steps = [x[3 * j + i] - x[3 * j + i - 3] + 7 for j in range(1, 5) for i in range(3)]
        return steps + [x[3 * k] + x[3 * k + 1] + x[3 * k + 2] - need for k, need in enumerate([60, 50, 70, 85, 100])]

    return small([20, 55, 15, 20, 60, 20, 20, 60, 20, 20, 60, 20, 20, 60, 20], objective, constraints,
                 lbx=[8, 43, 3] + [0] * 12, ubx=[21, 57, 16] + [90, 120, 60] * 4, ubg=[13, 14, 13] * 4 + [INF] * 5)


@problem
def redundant():
    """Every constraint stands there twice: each Jacobian has half its rank."""
    x = ca.MX.sym("x", 40)
    g = x[1:16] * x[:15] - 1
    return {"x": x, "f": ca.sumsqr(x - 2), "g": ca.vertcat(g, g)}, {"x0": 1.5, "lbg": 0, "ubg": 0}


@problem
def infeasible():
    x = ca.MX.sym("x", 20)
    return {"x": x, "f": ca.sumsqr(x), "g": ca.vertcat(ca.sumsqr(x) - 1, ca.sum1(x) - 10)}, {"x0": 0.3, "lbg": 0, "ubg": 0}


@problem
def flat():
    """Some unknowns are in no function: zero rows of the Hessian."""
    x = ca.MX.sym("x", 60)
    return {"x": x, "f": ca.sumsqr(x[:30] ** 2 - 1), "g": x[10:20] - x[11:21] ** 3}, {"x0": 0.7, "lbg": 0, "ubg": 0.1}


@problem
def saddle():
    """The start is a saddle point: the inertia is wrong at first."""
    x = ca.MX.sym("x", 50)
    return {"x": x, "f": ca.sum1(x ** 4 / 4 - x ** 2 / 2) + 0.01 * ca.sum1(x[1:] * x[:-1])}, {"x0": 1e-3, "lbx": -3, "ubx": 3}


@problem
def complementarity():
    """0 <= x, 0 <= y, x y <= 0: no constraint qualification anywhere."""
    x, y = ca.MX.sym("x", 30), ca.MX.sym("y", 30)
    target = np.sin(np.arange(30))
    f = ca.sumsqr(x - target) + ca.sumsqr(y + target)
    return {"x": ca.vertcat(x, y), "f": f, "g": x * y}, {"x0": 0.1, "lbx": 0, "lbg": -INF, "ubg": 0}


@problem
def badly_scaled():
    """Constraints over twelve decades."""
    x = ca.MX.sym("x", 100)
    scale = np.logspace(-6, 6, 99)
    return {"x": x, "f": ca.sumsqr(x - 1) * 1e-3, "g": scale * (x[1:] - x[:-1] ** 2)}, {"x0": 0.9, "lbx": 0.1, "ubx": 3, "lbg": 0, "ubg": 0}


def rosenbrock(n):
    x = ca.MX.sym("x", n)
    f = ca.sum1((x[1:] - x[:-1] ** 2) ** 2 * 100 + (1 - x[:-1]) ** 2)
    return {"x": x, "f": f, "g": x[1:] * x[:-1]}, {"x0": 0.5, "lbg": -1, "ubg": 0.9}


@problem
def rosenbrock_600():
    return rosenbrock(600)


@problem
def rosenbrock_5000():
    return rosenbrock(5000)


def laplacian(k, dimensions):
    total = ca.DM(k ** dimensions, k ** dimensions)
    line = ca.DM(2 * np.eye(k) - np.eye(k, k=1) - np.eye(k, k=-1))
    line = ca.sparsify(line)
    for axis in range(dimensions):
        term = ca.DM.eye(1)
        for other in range(dimensions):
            term = ca.kron(term, line if other == axis else ca.DM.eye(k))
        total = total + term
    return ca.sparsify(total)


def grid_function(k, dimensions):
    axes = np.meshgrid(*[np.linspace(0, 1, k)] * dimensions, indexing="ij")
    return (np.sin(3 * axes[0]) * np.prod(axes[1:], axis=0)).ravel()


def control(k, dimensions, cubic=0.1):
    """Elliptic control with bounds: 3 k^dimensions rows in the linear systems."""
    n = k ** dimensions
    y, u = ca.MX.sym("y", n), ca.MX.sym("u", n)
    f = 0.5 * ca.sumsqr(y - grid_function(k, dimensions)) + 0.5e-3 * ca.sumsqr(u)
    lower, upper = np.r_[np.full(n, -INF), np.full(n, -0.3)], np.r_[np.full(n, INF), np.full(n, 0.3)]
    return ({"x": ca.vertcat(y, u), "f": f, "g": laplacian(k, dimensions) @ y + cubic * y ** 3 - u},
            {"x0": 0, "lbx": lower, "ubx": upper, "lbg": 0, "ubg": 0})


@problem
def control_2d_30():
    return control(30, 2)


@problem
def control_2d_80():
    return control(80, 2)


@problem
def control_3d_10():
    return control(10, 3)


@problem
def control_3d_16():
    return control(16, 3)


@problem
def control_3d_24():
    return control(24, 3)


def arm_motion(steps):
    """A planar arm of two links swings up and comes to rest, by the trapezoidal rule; least torque squared, 2 s."""
    q, v, u = (ca.MX.sym(name, 2) for name in "qvu")
    cosine, sine = ca.cos(q[1]), ca.sin(q[1])
    mass = ca.vertcat(ca.horzcat(3 + 2 * cosine, 1 + cosine), ca.horzcat(1 + cosine, 1))
    bias = ca.vertcat(-sine * v[1] * (2 * v[0] + v[1]) + 9.81 * (2 * ca.cos(q[0]) + ca.cos(q[0] + q[1])),
                      sine * v[0] ** 2 + 9.81 * ca.cos(q[0] + q[1]))
    motion = ca.Function("motion", [ca.vertcat(q, v), u], [ca.vertcat(v, ca.solve(mass, u - bias))])
    states, torques = ca.MX.sym("X", 4, steps + 1), ca.MX.sym("U", 2, steps + 1)
    rates = motion.map(steps + 1)(states, torques)
    h = 2 / steps
    g = ca.vec(states[:, 1:] - states[:, :-1] - h / 2 * (rates[:, 1:] + rates[:, :-1]))
    begin, end = [-np.pi / 2, 0, 0, 0], [np.pi / 2, 0, 0, 0]
    start = np.linspace(begin, end, steps + 1).ravel()
    free = 4 * (steps - 1)
    lower = np.r_[begin, np.full(free, -INF), end, np.full(2 * steps + 2, -60)]
    upper = np.r_[begin, np.full(free, INF), end, np.full(2 * steps + 2, 60)]
    return ({"x": ca.vertcat(ca.vec(states), ca.vec(torques)), "f": h * ca.sumsqr(torques), "g": g},
            {"x0": np.r_[start, np.zeros(2 * steps + 2)], "lbx": lower, "ubx": upper, "lbg": 0, "ubg": 0})


@problem
def arm_50():
    return arm_motion(50)


@problem
def arm_1000():
    return arm_motion(1000)


def obstacle(k):
    """The smallest surface over an obstacle."""
    z = ca.MX.sym("z", k, k)
    dx, dy = (z[1:, :-1] - z[:-1, :-1]) * (k - 1), (z[:-1, 1:] - z[:-1, :-1]) * (k - 1)
    g = np.linspace(0, 1, k)
    floor = np.where(np.add.outer((g - 0.5) ** 2, (g - 0.5) ** 2) < 0.06, 0.6, 0.0)
    lower, upper = floor.copy(), np.full((k, k), INF)
    for edge in (np.s_[0, :], np.s_[-1, :], np.s_[:, 0], np.s_[:, -1]):
        lower[edge] = upper[edge] = 0
    f = ca.sum1(ca.vec(ca.sqrt(1 + dx ** 2 + dy ** 2))) / (k - 1) ** 2
    return {"x": ca.vec(z), "f": f}, {"x0": lower.ravel("F"), "lbx": lower.ravel("F"), "ubx": upper.ravel("F")}


@problem
def obstacle_60():
    return obstacle(60)
