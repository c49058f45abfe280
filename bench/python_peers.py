#!/usr/bin/env python3
"""espalier in Python beside PyPardiso, SciPy's SuperLU, UMFPACK and CHOLMOD, or on a GPU beside nvmath-python (cuDSS) and
CuPy, on the same matrices, as one table.

    python3 -m venv venv && venv/bin/pip install './python[scipy]' pypardiso scikit-sparse scikit-umfpack
    venv/bin/python bench/python_peers.py [--gpu] [--seconds 120] [--repeats 5] [--only poisson2-100,...] [--rivals nvmath,...] [--json FILE]

The last two need SuiteSparse and a compiler to install; what is not there is left out. For every system the solvers take
turns, each time in a new process: the first call (analysis, factorization and one solve, with all that starts then;
imports not), the same once more without the solve (`factor`), the next factorization of the same pattern, one solve.
The last two are medians of three in a process, all are medians of the processes, in milliseconds. Every answer is checked
by one residual, |b - A x| / (|A| |x| + |b|) in the maximum norm; above 1e-10 the time is not printed. A solver that takes
longer than --seconds is left out. PyPardiso and SuperLU factorize and analyze in one call: their `next` is that call once
more.

--gpu: matrix, right-hand side and solution are arrays of CuPy in the memory of the GPU before the clock starts; every call
is waited for. It needs espalier-cuda, cupy, nvmath-python and cuDSS (nvidia-cudss-cu13 in the same environment, or on
LD_LIBRARY_PATH). nvmath is told that a matrix is symmetric, espalier
finds that out; CuPy's spsolve knows no next factorization and no solve alone.
"""
import argparse
import glob
import json
import os
import re
import statistics
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


class Rival:
    def matrix(self, a):
        """What is made of a matrix before the clock starts."""
        return a

    def vector(self, b):
        return b

    def host(self, x):
        return x

    def wait(self):
        """Until what was begun is done."""


class Espalier(Rival):
    def __init__(self):
        import espalier
        self.new = espalier.Solver

    def first(self, a):
        self.solver = self.new(a)

    def next(self, a):
        self.solver.factorize(a.data)

    def solve(self, b):
        return self.solver.solve(b)


class Pardiso(Rival):
    def __init__(self):
        import pypardiso
        self.solver = pypardiso.PyPardisoSolver()

    def first(self, a):
        self.solver.remove_stored_factorization()
        self.a = a
        self.solver.factorize(a)

    next = first

    def solve(self, b):
        return self.solver.solve(self.a, b)


class SuperLU(Rival):
    def first(self, a):
        options = {"SymmetricMode": True} if abs(a - a.T).nnz == 0 else {}
        self.lu = spla.splu(a.tocsc(), "MMD_AT_PLUS_A" if options else "COLAMD", options=options)

    next = first

    def solve(self, b):
        return self.lu.solve(b)


class Umfpack(Rival):
    def __init__(self):
        import scikits.umfpack
        self.module = scikits.umfpack

    def first(self, a):
        self.context, self.a = self.module.UmfpackContext("di"), a.tocsc()
        self.context.symbolic(self.a)
        self.context.numeric(self.a)

    def next(self, a):
        self.a = a.tocsc()
        self.context.numeric(self.a)

    def solve(self, b):
        return self.context.solve(self.module.UMFPACK_A, self.a, b, autoTranspose=False)


class Cholmod(Rival):
    def __init__(self):
        import sksparse.cholmod
        self.module = sksparse.cholmod

    def first(self, a):
        if abs(a - a.T).nnz > 0:
            raise SystemExit("symmetric matrices alone")
        self.factor = self.module.analyze(a.tocsc())
        self.next(a)

    def next(self, a):
        self.factor.cholesky_inplace(a.tocsc())

    def solve(self, b):
        return self.factor(b)


class OnGpu(Rival):
    def __init__(self):
        import cupy
        import cupyx.scipy.sparse
        self.cupy, self.sparse = cupy, cupyx.scipy.sparse

    def matrix(self, a):
        return self.sparse.csr_matrix(sp.csr_matrix(a))

    def vector(self, b):
        return self.cupy.asarray(b)

    def host(self, x):
        return self.cupy.asnumpy(x)

    def wait(self):
        self.cupy.cuda.Device().synchronize()


class EspalierOnGpu(OnGpu):
    def first(self, a):
        import espalier
        self.solver = espalier.Solver(a)

    def next(self, a):
        self.solver.factorize(a.data)

    def solve(self, b):
        return self.solver.solve(b)


def threads_of_cudss():
    """The library by which cuDSS uses the host's threads, as its wheel brings it; None where it is not on the path."""
    found = [f for folder in sys.path for f in glob.glob(f"{folder}/nvidia/*/lib/libcudss_mtlayer_gomp.so*")]
    return found[0] if found else None


class Nvmath(OnGpu):
    def __init__(self):
        super().__init__()
        from nvmath.sparse import advanced
        self.module, self.solver, self.symmetric = advanced, None, False

    def matrix(self, a):
        self.symmetric = abs(a - a.T).nnz == 0
        return super().matrix(a)

    def first(self, a):
        if self.solver is not None:
            self.solver.free()
        kind = self.module.DirectSolverMatrixType
        options = self.module.DirectSolverOptions(sparse_system_type=kind.SPD if self.symmetric else kind.GENERAL,
                                                  multithreading_lib=threads_of_cudss())
        self.a, self.b = a, self.cupy.zeros(a.shape[0])
        self.solver = self.module.DirectSolver(self.a, self.b, options=options)
        self.solver.plan()
        self.solver.factorize()

    def next(self, a):
        self.a.data[...] = a.data
        self.solver.factorize()

    def solve(self, b):
        self.b[...] = b
        return self.solver.solve()


class Cupy(OnGpu):
    def first(self, a):
        self.a = a

    next = first

    def solve(self, b):
        import cupyx.scipy.sparse.linalg
        return cupyx.scipy.sparse.linalg.spsolve(self.a, b)


ON_GPU = {"espalier-gpu": EspalierOnGpu, "nvmath": Nvmath, "cupy": Cupy}
RIVALS = {"espalier": Espalier, "pypardiso": Pardiso, "superlu": SuperLU, "umfpack": Umfpack, "cholmod": Cholmod}


def timed(rival, call, *args):
    rival.wait()
    begin = time.perf_counter()
    answer = call(*args)
    rival.wait()
    return time.perf_counter() - begin, answer


def error_of(a, x, b):
    return abs(b - a @ x).max() / (abs(a).sum(axis=1).max() * abs(x).max() + abs(b).max())


def child(name, rival):
    """One solver on one system, in a process of its own: seconds, or what went wrong."""
    a = SYSTEMS[name]()
    b = np.random.default_rng(0).normal(size=a.shape[0])
    solver = {**RIVALS, **ON_GPU}[rival]()
    matrix, vector = solver.matrix(a), solver.vector(b)
    first = timed(solver, solver.first, matrix)[0] + timed(solver, solver.solve, vector)[0]
    factor = timed(solver, solver.first, matrix)[0]
    again, solves, errors = [], [], []
    for k in range(3):
        scaled = (k + 2) * a
        given = solver.matrix(scaled)
        again.append(timed(solver, solver.next, given)[0])
        seconds, x = timed(solver, solver.solve, vector)
        solves.append(seconds)
        errors.append(error_of(scaled, solver.host(x), b))
    print(json.dumps({"first": first, "factor": factor, "next": statistics.median(again),
                      "solve": statistics.median(solves), "error": max(errors)}))


def run(name, rival, seconds):
    """What child() found, or a sentence."""
    command = [sys.executable, __file__, "--child", name, rival]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        return f"longer than {seconds:g} s"
    if done.returncode != 0:  # the exception, whose text may go on for lines
        lines = done.stderr.strip().splitlines() or ["failed"]
        return next((line for line in reversed(lines) if re.match(r"[\w.]+(Error|Exception|Exit)\b", line)), lines[-1])
    found = json.loads(done.stdout)
    return found if found["error"] <= 1e-10 else f"wrong: error {found['error']:.1e}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gpu", action="store_true", help="arrays on a GPU")
    parser.add_argument("--seconds", type=float, default=120)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--only", default="")
    parser.add_argument("--rivals", default="", help="these alone, separated by commas")
    parser.add_argument("--json", default="")
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        return child(*args.child)
    table, rivals = {}, ON_GPU if args.gpu else RIVALS
    if args.rivals:
        rivals = {name: rivals[name] for name in args.rivals.split(",")}
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}; milliseconds, medians of {args.repeats}\n")
    print(f"| {'system':12} | {'n':>7} | {'solver':10} | {'first':>9} | {'factor':>9} | {'next':>9} | {'solve':>8} | {'error':>7} |")
    print("|---|--:|---|--:|--:|--:|--:|--:|")
    for name in filter(None, args.only.split(",")) if args.only else SYSTEMS:
        n = SYSTEMS[name]().shape[0]
        found = {rival: [] for rival in rivals}
        for _ in range(args.repeats):
            for rival, runs in found.items():
                if not runs or isinstance(runs[-1], dict):
                    runs.append(run(name, rival, args.seconds))
        for rival, runs in found.items():
            row = f"| {name:12} | {n:7} | {rival:10} | "
            if not isinstance(runs[-1], dict):
                print(row + runs[-1] + " |||||")
                continue
            t = table[f"{name} {rival}"] = {key: statistics.median(r[key] for r in runs) for key in runs[0]}
            print(row + f"{1e3 * t['first']:9.2f} | {1e3 * t['factor']:9.2f} | {1e3 * t['next']:9.2f} | "
                        f"{1e3 * t['solve']:8.3f} | {t['error']:.0e} |", flush=True)
    if args.json:
        with open(args.json, "w") as f:
            json.dump(table, f, indent=1)


if __name__ == "__main__":
    main()
