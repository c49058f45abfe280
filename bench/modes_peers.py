#!/usr/bin/env python3
"""espalier.modes beside SciPy's eigsh (with SuperLU and with our factor) and SLEPc with MUMPS, as one table.

    python3 -m venv venv && venv/bin/pip install './python[scipy]'
    sudo apt-get install python3-slepc4py python3-scipy        # Debian 12; left out where it is not there
    venv/bin/python bench/modes_peers.py [--espalier build/release/espalier] [--sizes 10,20,40] [--count 50] [--repeats 3]
                                         [--seconds 600] [--threads 2] [--only espalier,slepc] [--json FILE]

Systems: the generator's elasticity N^3 with its consistent mass, the lowest modes from shift 0. Solvers take turns, each time in
a new process that has loaded the matrices; what counts is the whole search, analysis and factorizations in it. `factor` is the
median of three factorizations by espalier in the same run. Every answer is checked here by the same sums: the largest
||K x - l M x|| / ((||K|| + |l| ||M||) ||x||), and whether as many eigenvalues were found below the last one as the inertia of
K - s M says; a time is printed only where both are right.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np
import scipy.sparse as sp

# Where Debian puts the bindings of its real PETSc and SLEPc.
DEBIAN = ["/usr/lib/petscdir/petsc3.18/x86_64-linux-gnu-real/lib/python3/dist-packages",
          "/usr/lib/slepcdir/slepc3.18/x86_64-linux-gnu-real/lib/python3/dist-packages"]


def load(folder, name):
    with np.load(f"{folder}/{name}.npz") as f:
        n = len(f["indptr"]) - 1
        return sp.csr_matrix((f["data"], f["indices"], f["indptr"]), shape=(n, n))


def by_espalier(k, m, count, threads):
    import espalier

    found = espalier.modes(k, m, count, threads=threads)
    return found.eigenvalues, found.vectors, {"factorizations": found.factorizations, "columns": found.solved_columns,
                                              "complete": found.complete, "parts": found.seconds}


def by_eigsh(k, m, count, threads):
    import scipy.sparse.linalg as spla

    values, vectors = spla.eigsh(k.tocsc(), count, m.tocsc(), sigma=0)
    return values, vectors, {}


def by_eigsh_ours(k, m, count, threads):
    import espalier
    import scipy.sparse.linalg as spla

    solver, solves = espalier.Solver(k, threads=threads, refinement_steps=0, required_backward_error=float("inf")), [0]

    def solve(b):
        solves[0] += 1
        return solver.solve(b)

    inverse = spla.LinearOperator(k.shape, matvec=solve, dtype=float)
    values, vectors = spla.eigsh(k.tocsc(), count, m.tocsc(), sigma=0, OPinv=inverse)
    return values, vectors, {"columns": solves[0]}


def by_slepc(k, m, count, threads):
    sys.path[:0] = DEBIAN
    import slepc4py

    slepc4py.init([])
    from petsc4py import PETSc
    from slepc4py import SLEPc

    mats = []
    for a in (k, m):
        mat = PETSc.Mat().createAIJ(size=a.shape, csr=(a.indptr.astype(np.int32), a.indices.astype(np.int32), a.data))
        mat.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        mats.append(mat)
    eps = SLEPc.EPS().create()
    eps.setOperators(*mats)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setDimensions(count)
    eps.setTarget(0.0)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    eps.setTolerances(1e-10, 1000)
    st = eps.getST()
    st.setType(SLEPc.ST.Type.SINVERT)
    pc = st.getKSP().getPC()
    st.getKSP().setType("preonly")
    pc.setType("cholesky")
    pc.setFactorSolverType("mumps")
    eps.solve()
    found = min(eps.getConverged(), count)
    values, vectors = np.empty(found), np.empty((k.shape[0], found))
    x = mats[0].createVecRight()
    for i in range(found):
        values[i] = eps.getEigenpair(i, x).real
        vectors[:, i] = x.getArray()
    return values, vectors, {}


PEERS = {"espalier": by_espalier, "eigsh": by_eigsh, "eigsh-espalier": by_eigsh_ours, "slepc": by_slepc}


def residual(k, m, values, vectors):
    norms = [abs(a).sum(axis=1).max() for a in (k, m)]
    r = np.linalg.norm(k @ vectors - (m @ vectors) * values, axis=0)
    return float((r / ((norms[0] + np.abs(values) * norms[1]) * np.linalg.norm(vectors, axis=0))).max())


def work(folder, peer, count, threads):
    """In a process of its own: one search, as one line of JSON."""
    k, m = load(folder, "k"), load(folder, "m")
    start = time.perf_counter()
    values, vectors, more = PEERS[peer](k, m, count, threads)
    seconds = time.perf_counter() - start
    order = np.argsort(values)
    values, vectors = values[order], vectors[:, order]
    print(json.dumps({"seconds": seconds, "found": len(values), "last": float(values[-1]), "values": values.tolist(),
                      "residual": residual(k, m, values, vectors), **more}))


def run(folder, peer, a):
    python = "/usr/bin/python3" if peer == "slepc" else sys.executable
    env = {**os.environ, "OMP_NUM_THREADS": str(a.threads), "OPENBLAS_NUM_THREADS": str(a.threads)}
    command = [python, __file__, "--work", folder, peer, str(a.count), str(a.threads)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=a.seconds, env=env, check=False)
    except subprocess.TimeoutExpired:
        return {"failed": f"more than {a.seconds} s"}
    if done.returncode != 0:
        return {"failed": (done.stderr.strip().splitlines() or ["no answer"])[-1][:100]}
    return json.loads(done.stdout.splitlines()[-1])


def factor(k, m, last, a):
    """Median seconds of a factorization, and how many eigenvalues lie below a number next to `last`."""
    import espalier

    solver = espalier.Solver(k, kind="ldlt", threads=a.threads, refinement_steps=0, symmetry="symmetric")
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        solver.factorize(k)
        seconds.append(time.perf_counter() - start)
    both = k - last * (1 + 1e-7) * m
    return statistics.median(seconds), espalier.Solver(both, kind="ldlt", threads=a.threads).factor.inertia.negative


def make(folder, size, program):
    import scipy.io

    for name, system in (("k", "elasticity"), ("m", "elasticity-mass")):
        path = f"{folder}/{name}.mtx"
        subprocess.run([program, "generate", system, str(size), "--out", path], check=True, capture_output=True)
        matrix = scipy.io.mmread(path).tocsr()
        os.remove(path)
        np.savez(f"{folder}/{name}.npz", indptr=matrix.indptr, indices=matrix.indices, data=matrix.data)


def compare(size, a):
    with tempfile.TemporaryDirectory() as folder:
        make(folder, size, a.espalier)
        k, m = load(folder, "k"), load(folder, "m")
        answers = {peer: [] for peer in a.only}
        for _ in range(a.repeats):
            for peer in a.only:
                if not answers[peer] or "failed" not in answers[peer][-1]:
                    answers[peer].append(run(folder, peer, a))
        last = max((r["last"] for rows in answers.values() for r in rows if "last" in r), default=0.0)
        one_factor, below = factor(k, m, last, a)
        rows = []
        for peer, all_runs in answers.items():
            good = [r for r in all_runs if "failed" not in r]
            row = {"size": size, "unknowns": k.shape[0], "peer": peer, "factor": one_factor, "runs": all_runs}
            if not good:
                row["note"] = all_runs[-1]["failed"]
            elif max(r["residual"] for r in good) > 1e-9:
                row["note"] = f"residual {max(r['residual'] for r in good):.1e}"
            elif any(r["found"] < a.count or abs(r["last"] / last - 1) > 1e-8 for r in good) or below != a.count:
                row["note"] = f"{good[0]['found']} found, {below} are there"
            else:
                row["median"] = statistics.median(r["seconds"] for r in good)
            rows.append(row)
            print(line(row, a), flush=True)
        return rows


def line(row, a):
    runs = [r for r in row["runs"] if "failed" not in r]
    if "median" not in row:
        return f"| {row['size']}^3 | {row['peer']} | - | | {row['note']} |"
    columns = runs[0].get("columns", "")
    return (f"| {row['size']}^3 ({row['unknowns']:,}) | {row['peer']} | {row['median']:.3g} s | "
            f"{row['median'] / row['factor']:.2f} | {columns} | {max(r['residual'] for r in runs):.1e} |")


def main():
    if len(sys.argv) == 6 and sys.argv[1] == "--work":
        return work(sys.argv[2], sys.argv[3], int(sys.argv[4]), int(sys.argv[5]))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--espalier", default="build/release/espalier")
    parser.add_argument("--sizes", default="10,20", type=lambda s: [int(x) for x in s.split(",")])
    parser.add_argument("--count", default=50, type=int)
    parser.add_argument("--repeats", default=3, type=int)
    parser.add_argument("--seconds", default=600, type=float)
    parser.add_argument("--threads", default=2, type=int)
    parser.add_argument("--only", default=list(PEERS), type=lambda s: s.split(","))
    parser.add_argument("--json")
    a = parser.parse_args()
    print(f"{a.count} modes, {a.threads} threads\n\n| elasticity | solver | total | in factorizations | solves | residual |")
    print("|---|---|---|---|---|---|")
    rows = [row for size in a.sizes for row in compare(size, a)]
    if a.json:
        with open(a.json, "w") as file:
            json.dump(rows, file)


if __name__ == "__main__":
    main()
