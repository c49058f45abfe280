#!/usr/bin/env python3
"""Clarabel's quadratic programs (elliptic control with bounds, 5 k^3 rows in the linear systems) with MKL's interface from our
library, beside its own solvers: the same answers, and how long each took.

    pip install clarabel
    tests/hosts/clarabel_qp.py --library build/release/hosts/libespalier_mkl_pardiso.so --sizes 8 12

Each run is a process of its own. Fails where status or objective (1e-7 relative) differ, or where iterations differ by more than two.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile


def run(k, method):
    import time

    import clarabel
    import numpy as np
    import scipy.sparse as sp

    line = sp.diags([-np.ones(k - 1), 2 * np.ones(k), -np.ones(k - 1)], [-1, 0, 1])
    one = sp.eye(k)
    laplacian = sum(sp.kron(sp.kron(*pair[:2]), pair[2]) for pair in [(line, one, one), (one, line, one), (one, one, line)]).tocsc()
    n = laplacian.shape[0]
    grid = np.linspace(0, 1, k)
    x, y, z = np.meshgrid(grid, grid, grid, indexing="ij")
    target = (np.sin(3 * x) * y * z).ravel()
    hessian = sp.triu(sp.block_diag([sp.eye(n), 1e-3 * sp.eye(n)])).tocsc()
    zero = sp.csc_matrix((n, n))
    constraints = sp.vstack([sp.hstack([laplacian, -sp.eye(n)]), sp.hstack([zero, sp.eye(n)]), sp.hstack([zero, -sp.eye(n)])]).tocsc()
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.direct_solve_method = method
    begin, work = time.perf_counter(), time.process_time()
    solver = clarabel.DefaultSolver(hessian, np.r_[-target, np.zeros(n)], constraints, np.r_[np.zeros(n), 0.3 * np.ones(2 * n)],
                                    [clarabel.ZeroConeT(n), clarabel.NonnegativeConeT(2 * n)], settings)
    result = solver.solve()
    print(json.dumps({"method": method, "rows": 5 * n, "status": str(result.status), "iterations": result.iterations, "objective": result.obj_val,
                      "seconds": time.perf_counter() - begin, "cpu_seconds": time.process_time() - work}))


def measure(k, method, library, repeat):
    with tempfile.TemporaryDirectory() as root:
        (pathlib.Path(root) / "lib").mkdir()
        (pathlib.Path(root) / "lib" / "libmkl_rt.so").symlink_to(pathlib.Path(library).resolve())
        environment = os.environ | ({"MKLROOT": root} if method == "mkl" else {})
        runs = [json.loads(subprocess.run([sys.executable, __file__, "--run", str(k), method], env=environment, check=True,
                                          capture_output=True, text=True).stdout) for _ in range(repeat)]
    return min(runs, key=lambda r: r["seconds"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library")
    parser.add_argument("--sizes", type=int, nargs="+", default=[8, 12], help="points along an edge")
    parser.add_argument("--own", nargs="+", default=["faer", "qdldl"])
    parser.add_argument("--repeat", type=int, default=1, help="the best time counts")
    parser.add_argument("--out", help="all results as JSON")
    parser.add_argument("--run", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.run:
        return run(int(arguments.run[0]), arguments.run[1])
    if not arguments.library:
        parser.error("--library is needed")
    results, wrong = [], 0
    for k in arguments.sizes:
        ours = measure(k, "mkl", arguments.library, arguments.repeat)
        results.append([ours])
        for method in arguments.own:
            own = measure(k, method, arguments.library, arguments.repeat)
            results[-1].append(own)
            same = (own["status"] == ours["status"] and abs(own["iterations"] - ours["iterations"]) <= 2
                    and abs(own["objective"] - ours["objective"]) <= 1e-7 * abs(own["objective"]))
            wrong += not same
            print(f"{own['rows']:7} rows  ours {ours['iterations']} it {ours['seconds']:.3f} s (CPU {ours['cpu_seconds']:.3f})  {method} "
                  f"{own['iterations']} it {own['seconds']:.3f} s (CPU {own['cpu_seconds']:.3f})  {'same' if same else 'DIFFERENT'}", flush=True)
    if arguments.out:
        pathlib.Path(arguments.out).write_text(json.dumps(results, indent=1))
    print(f"{len(results)} sizes, {wrong} differences")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
