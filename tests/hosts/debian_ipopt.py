#!/usr/bin/env python3
"""Debian's Ipopt, which knows MUMPS alone, on our solver and on its own: the same answers, and how long each took.

    apt-get install coinor-libipopt1v5; pip install casadi numpy
    tests/hosts/debian_ipopt.py --library build/release/hosts/libespalier_mumps.so [--quick]

The problems are those of ipopt.py; CasADi differentiates, Ipopt is called by its C interface. Fails where status or
objective (1e-8 relative) differ, or where iterations differ by more than 20 % (and more than two).
"""
import argparse
import ctypes as ct
import json
import os
import pathlib
import subprocess
import sys
import time

STATUS = {0: "Solve_Succeeded", 1: "Solved_To_Acceptable_Level", 2: "Infeasible_Problem_Detected", -1: "Maximum_Iterations_Exceeded",
          -2: "Restoration_Failed"}
Real, Int, Bool = ct.c_double, ct.c_int, ct.c_int
Reals, Ints = ct.POINTER(Real), ct.POINTER(Int)


def solve(library, name, repeat):
    """In a process of its own (--child): LD_PRELOAD counts from the start."""
    import casadi as ca
    import numpy as np

    import nlps

    nlp, arguments = nlps.PROBLEMS[name]()
    x, f, g = nlp["x"], nlp["f"], nlp.get("g", ca.MX(0, 1) if isinstance(nlp["x"], ca.MX) else ca.SX(0, 1))
    n, m = x.numel(), g.numel()
    kind = type(x)
    sigma, multipliers = kind.sym("sigma"), kind.sym("multipliers", m)
    hessian = ca.tril(ca.hessian(sigma * f + ca.dot(multipliers, g), x)[0])
    jacobian = ca.jacobian(g, x)
    functions = {key: ca.Function("the_" + key, inputs, [ca.densify(out) if key != "jac" and key != "hess" else out]) for key, inputs, out in [
        ("f", [x], f), ("grad", [x], ca.gradient(f, x)), ("g", [x], g), ("jac", [x], jacobian), ("hess", [x, sigma, multipliers], hessian)]}
    patterns = {key: functions[key].sparsity_out(0) for key in ("jac", "hess")}
    iterations = [0]

    def vector(pointer, length):
        return np.ctypeslib.as_array(pointer, (length,)) if length else np.zeros(0)

    def sparse(key, rows, columns, values, *inputs):
        pattern = patterns[key]
        if not pattern.nnz():
            return 1
        if not values:
            vector(rows, pattern.nnz())[:] = pattern.row()
            vector(columns, pattern.nnz())[:] = pattern.get_col()
        else:
            vector(values, pattern.nnz())[:] = np.array(functions[key](*inputs).nonzeros())
        return 1

    def fill(key, pointer, length, *inputs):
        if length:
            vector(pointer, length)[:] = np.array(functions[key](*inputs)).ravel(order="F")
        return 1

    callbacks = [
        ct.CFUNCTYPE(Bool, Int, Reals, Bool, Reals, ct.c_void_p)(lambda n, x, new, out, user: fill("f", out, 1, vector(x, n))),
        ct.CFUNCTYPE(Bool, Int, Reals, Bool, Int, Reals, ct.c_void_p)(lambda n, x, new, m, out, user: fill("g", out, m, vector(x, n))),
        ct.CFUNCTYPE(Bool, Int, Reals, Bool, Reals, ct.c_void_p)(lambda n, x, new, out, user: fill("grad", out, n, vector(x, n))),
        ct.CFUNCTYPE(Bool, Int, Reals, Bool, Int, Int, Ints, Ints, Reals, ct.c_void_p)(
            lambda n, x, new, m, k, rows, columns, values, user: sparse("jac", rows, columns, values, vector(x, n) if x else None)),
        ct.CFUNCTYPE(Bool, Int, Reals, Bool, Real, Int, Reals, Bool, Int, Ints, Ints, Reals, ct.c_void_p)(
            lambda n, x, new, factor, m, multipliers, new2, k, rows, columns, values, user: sparse(
                "hess", rows, columns, values, vector(x, n) if x else None, factor, vector(multipliers, m) if multipliers else None)),
    ]
    count = ct.CFUNCTYPE(Bool, Int, Int, Real, Real, Real, Real, Real, Real, Real, Real, Int, ct.c_void_p)(
        lambda mode, k, *rest: iterations.__setitem__(0, k) or 1)
    ipopt = ct.CDLL(library)
    ipopt.CreateIpoptProblem.restype = ct.c_void_p

    def bounds(low, high, length):
        return [(Real * max(length, 1))(*np.clip(np.broadcast_to(np.array(arguments.get(key, default), float).ravel(), (length,)), -1e20, 1e20))
                for key, default in ((low, -np.inf), (high, np.inf))]

    seconds, work = [], []
    for _ in range(repeat):
        problem = ct.c_void_p(ipopt.CreateIpoptProblem(
            Int(n), *bounds("lbx", "ubx", n), Int(m), *bounds("lbg", "ubg", m), Int(patterns["jac"].nnz()), Int(patterns["hess"].nnz()), Int(0), *callbacks))
        for key, value in (("print_level", 0), ("max_iter", 500)):
            ipopt.AddIpoptIntOption(problem, key.encode(), Int(value))
        ipopt.AddIpoptStrOption(problem, b"sb", b"yes")
        ipopt.AddIpoptStrOption(problem, b"linear_solver", b"mumps")
        ipopt.SetIntermediateCallback(problem, count)
        point = (Real * n)(*np.broadcast_to(np.array(arguments.get("x0", 0.0), float).ravel(), (n,)))
        objective = Real()
        begin, used = time.perf_counter(), time.process_time()
        status = ipopt.IpoptSolve(problem, point, None, ct.byref(objective), None, None, None, None)
        seconds.append(time.perf_counter() - begin)
        work.append(time.process_time() - used)
        ipopt.FreeIpoptProblem(problem)
    return {"status": STATUS.get(status, str(status)), "iterations": iterations[0], "objective": objective.value, "seconds": min(seconds),
            "cpu_seconds": min(work), "unknowns": n + m}


def in_child(arguments, name, preload):
    environment = dict(os.environ)
    if preload:
        environment["LD_PRELOAD"] = str(arguments.library.resolve())
    done = subprocess.run([sys.executable, __file__, "--child", name, "--ipopt", arguments.ipopt, "--repeat", str(arguments.repeat)],
                          env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{name}: {done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", type=pathlib.Path)
    parser.add_argument("--ipopt", default="libipopt.so.1")
    parser.add_argument("--problems", nargs="+")
    parser.add_argument("--quick", action="store_true", help="leave out what takes long")
    parser.add_argument("--repeat", type=int, default=1, help="the best time counts")
    parser.add_argument("--out", help="all results as JSON")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        print(json.dumps(solve(arguments.ipopt, arguments.child, arguments.repeat)))
        return 0
    try:
        ct.CDLL(arguments.ipopt)
    except OSError:
        print("skipped: coinor-libipopt1v5 is not installed")
        return 0
    import ipopt as casadis

    import nlps

    results, wrong = {}, 0
    for name in arguments.problems or [name for name in nlps.PROBLEMS if name in casadis.QUICK or not arguments.quick]:
        own, ours = in_child(arguments, name, False), in_child(arguments, name, True)
        ours["wrong"] = casadis.differences(ours, own)
        wrong += bool(ours["wrong"])
        results[name] = {"own": own, "ours": ours}
        print(f"{name:18} {own['unknowns']:6}  own {own['iterations']:4} it {own['seconds']:8.3f} s   ours {ours['iterations']:4} it "
              f"{ours['seconds']:8.3f} s  {own['status']}  {ours['wrong'] or 'same'}", flush=True)
    if arguments.out:
        pathlib.Path(arguments.out).write_text(json.dumps(results))
    print(f"{len(results)} problems, {wrong} differences")
    return 1 if wrong or not results else 0


if __name__ == "__main__":
    sys.exit(main())
