#!/usr/bin/env python3
"""Time of solve(b, rows=...) beside whole solves of the same loads, in turns; the answers are compared.

    PYTHONPATH=build/release/python python3 bench/few_unknowns.py [--espalier build/release/espalier] [--divisions 28]

A block of elastic elements; loads and unknowns are chosen at random. Prints medians and the share of the factor that was read."""

import argparse
import pathlib
import subprocess
import tempfile
import time

import numpy as np
import scipy.io
import scipy.sparse as sp

import espalier


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--espalier", default="build/release/espalier")
    parser.add_argument("--divisions", type=int, default=28)
    parser.add_argument("--repeat", type=int, default=15)
    parser.add_argument("--threads", type=int, default=0)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "a.mtx"
        subprocess.run([arguments.espalier, "generate", "elasticity", str(arguments.divisions), "--out", path], check=True,
                       capture_output=True)
        a = scipy.io.mmread(path).tocsc()
    n = a.shape[0]
    whole = espalier.Solver(a, threads=arguments.threads)
    bare = espalier.Solver(a, threads=arguments.threads, refinement_steps=0, required_backward_error=float("inf"))
    rng = np.random.default_rng(1)
    print(f"elasticity {arguments.divisions}: {n:,} unknowns; milliseconds, medians of {arguments.repeat}")
    print("loads  unknowns      rows   whole, bare  whole, refined  rows / bare   read")
    for loads, unknowns in ((1, 1), (1, 10), (10, 10), (10, 100), (32, 32)):
        times = {"rows": [], "bare": [], "whole": []}
        for turn in range(arguments.repeat + 1):
            places = rng.integers(0, n, loads)
            b = sp.csc_array((rng.standard_normal(loads), (places, np.arange(loads))), shape=(n, loads))
            dense, rows = b.toarray(order="F"), rng.integers(0, n, unknowns)
            found = {}
            for name, call in (("rows", lambda: whole.solve(b, rows=rows)), ("bare", lambda: bare.solve(dense)),
                               ("whole", lambda: whole.solve(dense))):
                start = time.perf_counter()
                found[name] = call()
                if turn > 0:  # the first one measures the factor
                    times[name].append(time.perf_counter() - start)
                if name == "rows":
                    share = whole.last_solve.share
            error = np.abs(found["rows"] - found["whole"][rows]).max() / np.abs(found["whole"]).max()
            assert error < 1e-12, error
        rows_ms, bare_ms, whole_ms = (1e3 * float(np.median(times[k])) for k in ("rows", "bare", "whole"))
        print(f"{loads:5d} {unknowns:9d} {rows_ms:9.2f} {bare_ms:13.2f} {whole_ms:15.2f} {rows_ms / bare_ms:12.2f} {share:6.2f}")


if __name__ == "__main__":
    main()
