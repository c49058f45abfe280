#!/usr/bin/env python3
"""Matrices that are no mechanics, beside PARDISO and SuperLU on two cores, as a page of the notebook.

    scripts/get_rivals.sh; ./run bench
    python3 -m venv venv && venv/bin/pip install numpy scipy ngsolve
    venv/bin/python bench/everyones_matrices.py --matrices FOLDER [--seconds 600] [--out docs/notebook/everyones_matrices.md]

Makes what is missing in FOLDER (here and by bench/pivot_cases.py, which needs NGSolve for flows), then, system by system:
`espalier bench peers` lets Espalier and MKL PARDISO take turns, SciPy's SuperLU (one thread; COLAMD, or, for a symmetric
pattern, its symmetric mode) follows in a process of its own, and analysis_bench compares the flops of our ordering with those
of METIS_NodeND. Each program says its own backward error: that of `bench peers` is checked by one residual for both rivals,
SuperLU's is computed here. No system is begun after --seconds; those left out are named on the page.
"""
import argparse
import datetime
import json
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
# In the order in which they run: words of `espalier generate`, files below --data, systems of bench/pivot_cases.py and of MADE.
SYSTEMS = ["ipm3-48", "ipm3-192", "ipm3-712", "poisson 22", "ns-0.05-0.001", "poisson 300 300 1", "lp-2000", "ipm3-4000", "ipm3-40000", "stokes-0.1", "graph-20000", "circuit-40000",
           "control3-40000", "kkt-4000", "hachtel-4000", "ns-0.1-0.01", "indef/meg4.mtx", "spd/C9840.mtx",
           "spd/bcsstk16.mtx.gz", "indef/hangGlider_2.mtx", "indef/resolve_matrix_ACTIVSg200_AC_renumbered_add9_01.mtx",
           "spd/s1rmq4m1.mtx.gz", "spd/1138_bus.mtx", "indef/bcsstm34.mtx", "stokes-0.05", "nsc-0.1-0.001", "lp-5000",
           "poisson 500 500 1", "graph-100000", "poisson 36", "ns-0.025-0.01"]
SUPERLU_SECONDS = 25


def graph_laplacian(n, rng):
    """Points in the unit square, joined to their six nearest; one vertex is grounded."""
    import scipy.sparse as sp
    from scipy.spatial import cKDTree
    points = rng.random((n, 2))
    _, near = cKDTree(points).query(points, 7)
    row = [i for i in range(n) for _ in range(6)]
    a = sp.csr_matrix(([1.0] * len(row), (row, near[:, 1:].ravel())), shape=(n, n))
    a = a.maximum(a.T)
    laplacian = sp.diags(a.sum(axis=1).A1 if hasattr(a.sum(axis=1), "A1") else a.sum(axis=1).ravel()) - a
    return laplacian[1:, 1:], True


def circuit(n, rng):
    """A grid of resistors with wires to nodes near by, a few nets that touch many nodes, and unsymmetric controlled sources."""
    import numpy as np
    import scipy.sparse as sp
    side = int(math.sqrt(n))
    n = side * side
    one = sp.diags([-1, 2, -1], [-1, 0, 1], shape=(side, side), dtype=float)
    a = sp.kron(one, sp.eye(side)) + sp.kron(sp.eye(side), one)
    def ends(count):
        first = rng.integers(0, n, count)
        return first, (first + rng.integers(1, 100, count)) % n

    wires = sp.coo_matrix((10.0 ** rng.uniform(-3, 3, n // 20), ends(n // 20)), shape=(n, n))
    wires = wires + wires.T
    nets = sp.coo_matrix((np.full(600, 0.1), (np.repeat([3, n // 2], 300), rng.integers(0, n, 600))), shape=(n, n))
    sources = sp.coo_matrix((rng.uniform(-0.5, 0.5, n // 10), ends(n // 10)), shape=(n, n))
    off = -(wires + nets + nets.T)
    return a + off - sp.diags(np.asarray(off.sum(axis=1)).ravel()) + sources + 1e-6 * sp.eye(n), False


def three_blocks(hessian, a, mu, active, rng):
    """[H A' -Z; A -d 0; -Z 0 -X] of an interior-point method late in its run, with z = mu / x and Z the root of z."""
    import numpy as np
    import scipy.sparse as sp
    n = hessian.shape[0]
    x = np.where(rng.random(n) < active, mu, 1.0) * np.exp(rng.standard_normal(n))
    root = sp.diags(np.sqrt(mu / x))
    return sp.bmat([[hessian, a.T, -root], [a, -1e-8 * sp.eye(a.shape[0]), None], [-root, None, -sp.diags(x)]]), True


def interior_point(n, rng, reach=30):
    """Each row of A joins one variable of its own with four up to `reach` places away, as stages of a plan do."""
    import numpy as np
    import scipy.sparse as sp
    variables, rows = 3 * n // 8, n // 4
    column = (np.arange(rows)[:, None] * variables // rows + rng.integers(-reach, reach, (rows, 5))) % variables
    column[:, 0] = np.arange(rows) * variables // rows  # one of its own
    a = sp.csr_matrix((rng.standard_normal(5 * rows), (np.repeat(np.arange(rows), 5), column.ravel())), shape=(rows, variables))
    hessian = sp.diags(rng.random(variables) * (rng.random(variables) < 0.3) + 1e-8)
    return three_blocks(hessian, a, 1e-8, 0.5, rng)


def far_interior_point(n, rng):
    """Four variables anywhere: matchings find no near end. Its factor is nearly dense; for analyses alone."""
    return interior_point(n, rng, n)


def control(n, rng):
    """Steps of ten states and five inputs."""
    import numpy as np
    import scipy.sparse as sp
    steps = n // 40
    dynamics = np.hstack([np.eye(10) + 0.05 * rng.standard_normal((10, 10)), rng.standard_normal((10, 5))])
    following = sp.diags([np.ones(steps - 1)], [1], shape=(steps, steps))
    a = sp.kron(sp.eye(steps), dynamics) + sp.kron(following, np.hstack([-np.eye(10), np.zeros((10, 5))]))
    return three_blocks(sp.diags(np.tile(np.r_[np.ones(10), 0.1 * np.ones(5)], steps)), a, 1e-7, 0.4, rng)


MADE = {"graph": graph_laplacian, "circuit": circuit, "ipm3": interior_point, "ipm3far": far_interior_point, "control3": control}


def make(name, folder):
    """The file of a system; made where it is missing."""
    path = folder / f"{name.replace(' ', '-')}.mtx"
    if path.exists():
        return path
    print(f"making {path}", flush=True)
    kind, *numbers = name.split("-")
    if kind in MADE:
        import numpy as np
        sys.path.insert(0, str(ROOT / "bench"))
        from pivot_cases import write
        write(path, *MADE[kind](int(numbers[0]), np.random.default_rng(16)))
    elif numbers:
        subprocess.run([sys.executable, ROOT / "bench/pivot_cases.py", folder, name], check=True)
    else:
        subprocess.run([ROOT / "build/release/espalier", "generate", *name.split(), "--out", path], check=True, stdout=subprocess.DEVNULL)
    return path


def superlu(file):
    """Prints what SuperLU needs for one file; runs in a process of its own."""
    import numpy as np
    import scipy.io
    import scipy.sparse as sp
    import scipy.sparse.linalg as spl
    a = sp.csc_matrix(scipy.io.mmread(file))
    symmetric = (abs(a) > 0).astype(int)
    symmetric = (symmetric != symmetric.T).nnz == 0
    # SuperLU's guide: symmetric mode prefers diagonal pivots, with a threshold that still refuses small ones.
    settings = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.01, "options": {"SymmetricMode": True}} if symmetric else {}
    start = time.perf_counter()
    factor = spl.splu(a, **settings)
    first = time.perf_counter() - start
    b = a @ np.ones(a.shape[0])
    start = time.perf_counter()
    x = factor.solve(b)
    solve = time.perf_counter() - start
    error = np.abs(b - a @ x).max() / (abs(a).sum(axis=1).max() * np.abs(x).max() + np.abs(b).max())
    print(json.dumps({"first": first, "solve": solve, "error": float(error)}))


def measure_superlu(path):
    try:
        out = subprocess.run([sys.executable, __file__, "--superlu", path], capture_output=True, text=True, timeout=SUPERLU_SECONDS)
    except subprocess.TimeoutExpired:
        return {"message": f"more than {SUPERLU_SECONDS} s"}
    return json.loads(out.stdout) if out.returncode == 0 else {"message": (out.stderr.strip().splitlines() or ["failed"])[-1][:60]}


def measure_peers(path):
    """Rows of Espalier and PARDISO by name."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "rows.json"
        done = subprocess.run([ROOT / "build/release/espalier", "bench", "peers", "--system", path, "--rivals", "espalier:device=cpu,pardiso",
                        "-k", "3", "--analyses", "1", "--rhs", "1", "--threads", "2", "--timeout", "30", "--out", file],
                       capture_output=True, text=True, check=False)
        if not file.exists():
            raise SystemExit(f"espalier bench peers did not run on {path}: {done.stderr.strip()}")
        return {row["rival"].split(":")[0]: row for row in json.loads(file.read_text())["rows"]}


def measure_flops(path):
    out = subprocess.run([ROOT / "build/release/bench/analysis_bench", "2", path], capture_output=True, text=True, check=False).stdout
    found = re.search(r"flops/NodeND ([\d.]+)", out)
    return float(found[1]) if found else None


def phase(row, name):
    found = row.get(name) if row else None
    return found["median"] if found and row["outcome"] == "ok" else None


def first_of(row):
    parts = [phase(row, "analysis"), phase(row, "first_factorization")]
    return sum(parts) if None not in parts else None


def text(seconds):
    return "-" if seconds is None else f"{1e3 * seconds:.3g}"


def error_of(row):
    if not row:
        return "did not run"
    if row["outcome"] != "ok":
        return row["outcome"].replace("_", " ")
    return f"{row['backward_error']['normwise']:.0e}"


def mean(ratios):
    return math.exp(sum(map(math.log, ratios)) / len(ratios)) if ratios else float("nan")


def page(rows, left, load):
    """The markdown page."""
    commit = subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True).stdout.strip()
    lines = ["# Everyone's matrices", "",
             f"Made by `bench/everyones_matrices.py` (its head says how), never edited: {datetime.date.today()}, commit {commit}, two threads, "
             f"load average {load[0]:.1f} at the start and {load[1]:.1f} at the end"
             + (" (a busy machine: PARDISO's threads wait for each other and suffer more than ours, so ratios flatter us, most on small systems)" if max(load) > 2.5 else "") + ".", "",
             "Milliseconds, Espalier / MKL PARDISO; medians of 3 in alternation; \"first\" is one analysis and one factorization. SuperLU: first and solve, one thread. "
             "Errors are normwise backward errors, or what happened instead of an answer. \"METIS\": flops of our ordering over those of METIS_NodeND.", "",
             "| system | n | kind | first | refactorization | solve | error, Espalier / PARDISO | SuperLU: first, solve, error | METIS |",
             "|---|---|---|---|---|---|---|---|---|"]
    for name, peers, slu, flops in rows:
        ours, theirs = peers.get("espalier"), peers.get("pardiso")
        some = ours or theirs or {}
        pair = lambda what: f"{text(phase(ours, what))} / {text(phase(theirs, what))}"
        rival = slu.get("message") or f"{text(slu['first'])}, {text(slu['solve'])}, {slu['error']:.0e}"
        lines.append(f"| {name} | {some.get('unknowns', 0):,} | {some.get('kind', '-')} | {text(first_of(ours))} / {text(first_of(theirs))} | "
                     f"{pair('refactorization')} | {pair('solve_one')} | {error_of(ours)} / {error_of(theirs)} | {rival} | "
                     f"{'-' if flops is None else f'{flops:.2f}'} |")
    both = [(p["espalier"], p["pardiso"]) for _, p, _, _ in rows if first_of(p.get("espalier")) and first_of(p.get("pardiso"))]
    metis = [f for _, _, _, f in rows if f]
    refactorizations = [phase(t, "refactorization") / phase(o, "refactorization") for o, t in both]
    firsts = [first_of(t) / first_of(o) for o, t in both]
    if both and metis:
        lines += ["", f"Times as fast as PARDISO, geometric mean of the {len(both)} systems that both solved: first {mean(firsts):.2f} (least {min(firsts):.2f}), "
                  f"refactorization {mean(refactorizations):.2f} (least {min(refactorizations):.2f}). Flops over METIS's: mean {mean(metis):.2f}, most {max(metis):.2f}."]
    if left:
        lines += ["", "No time was left for (or not there): " + ", ".join(left) + "."]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--matrices", type=pathlib.Path, help="folder of the systems; what is missing is made there")
    parser.add_argument("--data", type=pathlib.Path, default=ROOT / "../shared/data", help="folder of collected matrices")
    parser.add_argument("--seconds", type=float, default=600, help="no system is begun later")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "docs/notebook/everyones_matrices.md")
    parser.add_argument("--only", help="these systems, with commas, instead of all; also ipm3far-N")
    parser.add_argument("--make", action="store_true", help="make the matrices and stop")
    parser.add_argument("--superlu", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.superlu:
        return superlu(arguments.superlu)
    if arguments.matrices is None:
        parser.error("--matrices FOLDER is missing")
    arguments.matrices.mkdir(parents=True, exist_ok=True)
    systems = arguments.only.split(",") if arguments.only else SYSTEMS
    if arguments.make:
        for name in systems:
            if "/" not in name:
                make(name, arguments.matrices)
        return 0
    start, rows, left = time.monotonic(), [], []
    before = os.getloadavg()[0]
    for name in systems:
        collected = "/" in name
        if time.monotonic() - start > arguments.seconds or (collected and not (arguments.data / name).exists()):
            left.append(name)
            continue
        path = arguments.data / name if collected else make(name, arguments.matrices)
        label = pathlib.Path(name).name.split(".mtx")[0]
        rows.append((label, measure_peers(path), measure_superlu(path), measure_flops(path)))
        print(f"{time.monotonic() - start:5.0f} s  {label}", flush=True)
    arguments.out.write_text(page(rows, left, (before, os.getloadavg()[0])))
    return 0


if __name__ == "__main__":
    sys.exit(main())
