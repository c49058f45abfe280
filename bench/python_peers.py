#!/usr/bin/env python3
"""espalier in Python beside PyPardiso and SciPy's SuperLU, on the same matrices, as one table.

    python3 -m venv venv && venv/bin/pip install './python[scipy]' pypardiso
    venv/bin/python bench/python_peers.py [--seconds 120] [--repeats 5] [--only poisson2-100,...] [--json FILE]

For every system the solvers take turns: analysis and factorization from nothing (with the thread start-up of a first
call, in a process of its own, in column `first`), the next factorization of the same pattern, one solve. Times are the
least of the repeats, in milliseconds. Every answer is checked by one residual, |b - A x| / (|A| |x| + |b|) in the
maximum norm; above 1e-10 the time is not printed. A solver that takes longer than --seconds is left out. PyPardiso
factorizes and analyzes in one call, SuperLU too: their `next` is that call once more.
"""
import argparse
import json
import os
import subprocess
import sys
import time

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla


def poisson(dimensions, n):
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
    one, a = sp.eye_array(n), line
    for _ in range(dimensions - 1):
        a = sp.kron(a, one) + sp.kron(sp.eye_array(a.shape[0]), line)
    return a.tocsr()


def unsymmetric(a):
    """With a flow: the same pattern, other values above the diagonal."""
    a = a.copy()
    row = np.repeat(np.arange(a.shape[0]), np.diff(a.indptr))
    a.data[a.indices > row] *= 0.5
    return a


SYSTEMS = {
    **{f"poisson2-{n}": (lambda n=n: poisson(2, n)) for n in (10, 30, 70, 100, 200, 400, 700)},
    **{f"poisson3-{n}": (lambda n=n: poisson(3, n)) for n in (10, 17, 25, 35, 50)},
    **{f"flow2-{n}": (lambda n=n: unsymmetric(poisson(2, n))) for n in (30, 100, 300)},
    **{f"flow3-{n}": (lambda n=n: unsymmetric(poisson(3, n))) for n in (10, 25, 35)},
}


class Espalier:
    def __init__(self):
        import espalier
        self.new = espalier.Solver

    def first(self, a):
        self.solver = self.new(a)

    def next(self, a):
        self.solver.factorize(a.data)

    def solve(self, b):
        return self.solver.solve(b)


class Pardiso:
    def __init__(self):
        import pypardiso
        self.new = pypardiso.PyPardisoSolver

    def first(self, a):
        self.solver, self.a = self.new(), a
        self.solver.factorize(a)

    def next(self, a):
        self.solver.remove_stored_factorization()
        self.solver.factorize(a)

    def solve(self, b):
        return self.solver.solve(self.a, b)


class SuperLU:
    def first(self, a):
        options = {"SymmetricMode": True} if abs(a - a.T).nnz == 0 else {}
        self.lu = spla.splu(a.tocsc(), "MMD_AT_PLUS_A" if options else "COLAMD", options=options)

    next = first

    def solve(self, b):
        return self.lu.solve(b)


RIVALS = {"espalier": Espalier, "pypardiso": Pardiso, "superlu": SuperLU}


def timed(call, *args):
    begin = time.perf_counter()
    answer = call(*args)
    return time.perf_counter() - begin, answer


def error_of(a, x, b):
    return abs(b - a @ x).max() / (abs(a).sum(axis=1).max() * abs(x).max() + abs(b).max())


def child(name, rival, repeats):
    """One solver on one system, in a process of its own: seconds, or what went wrong."""
    a = SYSTEMS[name]()
    b = np.random.default_rng(0).normal(size=a.shape[0])
    solver = RIVALS[rival]()
    first = timed(solver.first, a)[0] + timed(solver.solve, b)[0]
    fresh, again, solves, errors = [], [], [], []
    for k in range(repeats):
        fresh.append(timed(solver.first, a)[0])
        scaled = (k + 2) * a
        again.append(timed(solver.next, scaled)[0])
        if rival == "pypardiso":
            solver.a = scaled
        seconds, x = timed(solver.solve, b)
        solves.append(seconds)
        errors.append(error_of(scaled, x, b))
    print(json.dumps({"first": first, "factor": min(fresh), "next": min(again), "solve": min(solves),
                      "error": max(errors)}))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=120)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--only", default="")
    parser.add_argument("--json", default="")
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        return child(*args.child, args.repeats)
    found = {}
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}; milliseconds\n")
    print(f"| {'system':12} | {'n':>7} | {'solver':10} | {'first':>9} | {'factor':>9} | {'next':>9} | {'solve':>8} | {'error':>7} |")
    print("|---|--:|---|--:|--:|--:|--:|--:|")
    for name in filter(None, args.only.split(",")) if args.only else SYSTEMS:
        n = SYSTEMS[name]().shape[0]
        for rival in RIVALS:
            command = [sys.executable, __file__, "--child", name, rival, "--repeats", str(args.repeats)]
            row = f"| {name:12} | {n:7} | {rival:10} | "
            try:
                run = subprocess.run(command, capture_output=True, text=True, timeout=args.seconds)
            except subprocess.TimeoutExpired:
                print(row + f"longer than {args.seconds:g} s |||||")
                continue
            if run.returncode != 0:
                print(row + (run.stderr.strip().splitlines() or ["failed"])[-1] + " |||||")
                continue
            t = found[f"{name} {rival}"] = json.loads(run.stdout)
            if not t["error"] <= 1e-10:
                print(row + f"wrong: error {t['error']:.1e} |||||")
                continue
            print(row + f"{1e3 * t['first']:9.2f} | {1e3 * t['factor']:9.2f} | {1e3 * t['next']:9.2f} | "
                        f"{1e3 * t['solve']:8.3f} | {t['error']:.0e} |", flush=True)
    if args.json:
        with open(args.json, "w") as f:
            json.dump(found, f, indent=1)


if __name__ == "__main__":
    main()
