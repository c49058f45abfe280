#!/usr/bin/env python3
"""Ipopt, as CasADi's wheel brings it, on our solver and on its own MUMPS: the same answers, and how long each took.

    pip install casadi
    tests/hosts/ipopt.py --library build/release/hosts/libespalier_hsl.so [--solvers ma97] [--problems hs001 arm_50] [--quick]

Fails where status or objective (1e-8 relative) differ, or where iterations differ by more than 20 % (and more than two).
"""
import argparse
import json
import sys
import time

import casadi as ca

import nlps

QUICK = [name for name in nlps.PROBLEMS if name not in ("rosenbrock_5000", "control_2d_80", "control_3d_16", "control_3d_24", "arm_1000")]


def solve(name, options, repeat):
    nlp, arguments = nlps.PROBLEMS[name]()
    quiet = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": 500}
    solver = ca.nlpsol("solver", "ipopt", nlp, quiet | options)
    seconds, work = [], []
    for _ in range(repeat):
        begin, used = time.perf_counter(), time.process_time()
        result = solver(**arguments)
        seconds.append(time.perf_counter() - begin)
        work.append(time.process_time() - used)
    stats = solver.stats()
    return {"status": stats["return_status"], "iterations": stats["iter_count"], "objective": float(result["f"]), "seconds": min(seconds), "cpu_seconds": min(work),
            "unknowns": nlp["x"].numel() + (nlp["g"].numel() if "g" in nlp else 0)}


def differences(ours, own):
    """What must not differ, and does. Where the status is no success, neither objective nor path is defined."""
    if ours["status"] != own["status"]:
        return f"status {ours['status']} instead of {own['status']}"
    if own["status"] not in ("Solve_Succeeded", "Solved_To_Acceptable_Level"):
        return ""
    if abs(ours["objective"] - own["objective"]) > 1e-8 * max(1, abs(own["objective"])):
        return f"objective {ours['objective']!r} instead of {own['objective']!r}"
    if abs(ours["iterations"] - own["iterations"]) > max(2, 0.2 * own["iterations"]):
        return f"{ours['iterations']} iterations instead of {own['iterations']}"
    return ""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", required=True)
    parser.add_argument("--solvers", nargs="+", default=["ma97"])
    parser.add_argument("--problems", nargs="+", default=list(nlps.PROBLEMS), choices=list(nlps.PROBLEMS), metavar="NAME")
    parser.add_argument("--quick", action="store_true", help="leave out what takes long")
    parser.add_argument("--repeat", type=int, default=1, help="the best time counts")
    parser.add_argument("--out", help="all results as JSON")
    arguments = parser.parse_args()
    place = "ipopt.pardisolib" if "pardiso" in arguments.solvers else "ipopt.hsllib"
    results, wrong = {}, 0
    for name in [name for name in arguments.problems if name in QUICK or not arguments.quick]:
        runs = results[name] = {"mumps": solve(name, {"ipopt.linear_solver": "mumps"}, arguments.repeat)}
        own = runs["mumps"]
        print(f"{name:18} {own['unknowns']:6}  mumps {own['iterations']:4} it {own['seconds']:8.3f} s  {own['status']}", flush=True)
        for solver in arguments.solvers:
            ours = runs[solver] = solve(name, {"ipopt.linear_solver": solver, place: arguments.library}, arguments.repeat)
            ours["wrong"] = differences(ours, own)
            wrong += bool(ours["wrong"])
            print(f"{'':25}  {solver:5} {ours['iterations']:4} it {ours['seconds']:8.3f} s  {ours['wrong'] or 'same'}", flush=True)
    if arguments.out:
        with open(arguments.out, "w", encoding="utf-8") as file:
            json.dump(results, file, indent=1)
    print(f"{len(results)} problems, {wrong} differences")
    return 1 if wrong or not results else 0


if __name__ == "__main__":
    sys.exit(main())
