"""Quadratic programs by examples/active_set_qp.py, Clarabel and OSQP (PyPI: clarabel, osqp), in one process.

    python bench/qp_peers.py FOLDER [NAME ...]       problems of Maros and Meszaros as FOLDER/NAME.mat (P, q, A, l, u, r), for instance
                                                     of https://github.com/osqp/osqp_benchmarks; the smaller ones by default
    python bench/qp_peers.py random [COUNT]          random problems

A line for each: sizes, seconds, the relative difference of the objectives, and rows whose multipliers have other signs than Clarabel's
(of those above 1e-5 of the largest; multipliers are not unique where active rows depend on each other).
"""

import sys
import time
from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse as sp

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
import active_set_qp as ours

BOUND = 1e19


def by_clarabel(P, q, A, l, u):
    import clarabel
    equal, upper, lower = l == u, (l != u) & (u < BOUND), (l != u) & (l > -BOUND)
    G = sp.vstack([A[equal], A[upper], -A[lower]]).tocsc()
    h = np.concatenate([u[equal], u[upper], -l[lower]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-9
    cones = [clarabel.ZeroConeT(int(equal.sum())), clarabel.NonnegativeConeT(int(upper.sum() + lower.sum()))]
    r = clarabel.DefaultSolver(sp.triu(P).tocsc(), q, G, h, cones, settings).solve()
    z, y = np.array(r.z), np.zeros(len(l))
    y[equal] = z[:equal.sum()]
    y[upper] += z[equal.sum():equal.sum() + upper.sum()]
    y[lower] -= z[equal.sum() + upper.sum():]
    return r.obj_val, y, str(r.status)


def by_osqp(P, q, A, l, u):
    import osqp
    solver = osqp.OSQP()
    solver.setup(sp.triu(P).tocsc(), q, A.tocsc(), l, u, verbose=False, eps_abs=1e-7, eps_rel=1e-7, max_iter=50000, polishing=True, time_limit=60)
    r = solver.solve()
    return r.info.obj_val, np.array(r.y), r.info.status


def timed(call, *problem):
    start = time.perf_counter()
    try:
        result = call(*problem)
    except Exception as error:  # a peer may give up in its own way
        result = np.nan, np.zeros(problem[2].shape[0]), f"{type(error).__name__}"
    return time.perf_counter() - start, result


def compare(name, P, q, A, l, u):
    seconds, r = timed(ours.solve_qp, P, q, A, l, u)
    if not isinstance(r, ours.QpResult):
        print(f"{name:12s} ours: {r[2]}")
        return False
    of_clarabel, (f_clarabel, y_clarabel, how_clarabel) = timed(by_clarabel, P, q, A, l, u)
    of_osqp, (f_osqp, _, how_osqp) = timed(by_osqp, P, q, A, l, u)
    equal = l == u

    def signs(y):
        return np.where(np.abs(y) > 1e-5 * np.abs(y).max(initial=0), np.sign(y), 0)

    other = int(((signs(r.y) * signs(y_clarabel) < 0) & ~equal).sum())
    apart = int(((signs(r.y) != signs(y_clarabel)) & ~equal).sum())
    near = abs(r.objective - f_clarabel) / (1 + abs(f_clarabel))
    near_osqp = abs(r.objective - f_osqp) / (1 + abs(f_osqp))
    print(f"{name:12s} {len(q):6d} {len(l):6d}  ours {seconds:7.3f} s {'ok' if r.solved else 'NO'} {r.steps:4d} solves {r.flips:6d} flips {r.factorizations:3d} factorizations, "
          f"residuals {r.primal_residual:.0e} {r.dual_residual:.0e} | Clarabel {of_clarabel:7.3f} s {how_clarabel} {near:.1e}, active set: {apart} rows apart, {other} of other sign | "
          f"OSQP {of_osqp:7.3f} s {how_osqp} {near_osqp:.1e}", flush=True)
    return r.solved and min(near, near_osqp) < 1e-5


def main():
    good, names = 0, sys.argv[2:]
    if sys.argv[1] == "random":
        cases = [(f"random {k}", ours.random_qp(40 * (k + 1), 20 * (k + 1), seed=k, rank=None if k % 2 else 10 * (k + 1))) for k in range(int(names[0]) if names else 6)]
    else:
        def read(path):
            m = scipy.io.loadmat(path)
            return sp.csc_matrix(m["P"]), m["q"].ravel().astype(float), sp.csr_matrix(m["A"]), m["l"].ravel().astype(float), m["u"].ravel().astype(float)

        paths = [Path(sys.argv[1]) / f"{n}.mat" for n in names] or sorted(p for p in Path(sys.argv[1]).glob("*.mat") if p.stat().st_size < 100_000)
        cases = ((p.stem, read(p)) for p in paths)
    count = 0
    for name, problem in cases:
        count += 1
        good += compare(name, *problem)
    print(f"{good} of {count} solved, with the objective of a peer to 1e-5")


if __name__ == "__main__":
    main()
