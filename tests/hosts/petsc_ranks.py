#!/usr/bin/env python3
"""KSP on matrices of several processes (MATMPIAIJ) with our package for PETSc: factor, right-hand sides and solutions are
distributed.

    apt-get install petsc-dev python3-petsc4py
    /usr/bin/python3 tests/hosts/petsc_ranks.py --library build/release/hosts/libespalier_petsc.so [--processes 2,3,4]

Each number of processes solves the same systems; one of three or more has no rows. Truth: the solutions are known, the
inertia of a diagonal shift too, and every number of processes gives the same bits. Leaves with 77 where petsc4py or mpiexec
is missing.
"""
import argparse
import hashlib
import importlib.util
import json
import os
import pathlib
import shutil
import subprocess
import sys

SIDE = 9  # unknowns along an edge
BOUND = 1e-10  # of errors


def empty(PETSc):
    n = SIDE**3
    comm = PETSc.COMM_WORLD
    # The second of three and more has nothing.
    owners = [r for r in range(comm.size) if comm.size < 3 or r != 1]
    mine = 0
    if comm.rank in owners:
        at = owners.index(comm.rank)
        mine = n * (at + 1) // len(owners) - n * at // len(owners)
    a = PETSc.Mat().create(comm)
    a.setSizes([[mine, n], [mine, n]])
    a.setType("aij")
    a.setPreallocationNNZ(9)
    return a


def saddle_point(PETSc, size):
    """[0 B; B^T -size I] with B of 2 on the diagonal and 0.5 beside it, and one unknown more."""
    a = empty(PETSc)
    half = SIDE**3 // 2
    for row in range(*a.getOwnershipRange()):
        if row == 2 * half:
            a.setValue(row, row, 1.0)
        elif row < half:
            a.setValue(row, half + row, 2.0)
            a.setValue(row, half + (row + 1) % half, 0.5)
        else:
            a.setValue(row, row - half, 2.0)
            a.setValue(row, (row - half - 1) % half, 0.5)
            a.setValue(row, row, -size)
    a.assemble()
    return a


def grid(PETSc, shift=0.0, wind=0.0, scale=1.0, far=False):
    """The 7-point Laplacian, shifted, with wind; `far` couples the first with the last unknown, too."""
    a = empty(PETSc)
    n = SIDE**3
    for row in range(*a.getOwnershipRange()):
        x, y, z = row % SIDE, row // SIDE % SIDE, row // SIDE**2
        a.setValue(row, row, scale * (6.0 + shift))
        for inside, column, value in ((x > 0, row - 1, -1 - wind), (x + 1 < SIDE, row + 1, -1 + wind), (y > 0, row - SIDE, -1.0),
                                      (y + 1 < SIDE, row + SIDE, -1.0), (z > 0, row - SIDE**2, -1.0),
                                      (z + 1 < SIDE, row + SIDE**2, -1.0), (far and row == 0, n - 1, -0.5), (far and row == n - 1, 0, -0.5)):
            if inside:
                a.setValue(row, column, scale * value)
    a.assemble()
    return a


def solver_of(PETSc, a, factor, method):
    solver = PETSc.KSP().create(a.comm)
    solver.setOperators(a)
    solver.setType(method)
    solver.setTolerances(rtol=1e-12)
    solver.getPC().setType(factor)
    solver.getPC().setFactorSolverType("espalier")
    solver.setErrorIfNotConverged(False)
    return solver


def digest(x):
    """Of all entries, in the first process."""
    parts = x.comm.tompi4py().gather(x.getArray().tobytes(), 0)
    return hashlib.sha256(b"".join(parts)).hexdigest() if parts else ""


def solve(PETSc, solver, a, results, name, transposed=False):
    x, b = a.createVecs()
    truth = x.duplicate()
    first, last = truth.getOwnershipRange()
    truth.setValues(range(first, last), [1.0 + k % 7 for k in range(first, last)])
    truth.assemble()
    if transposed:
        a.multTranspose(truth, b)
        solver.solveTranspose(b, x)
    else:
        a.mult(truth, b)
        solver.solve(b, x)
    entry = {"bits": digest(x), "reason": int(solver.getConvergedReason()), "steps": solver.getIterationNumber()}
    x.axpy(-1.0, truth)
    entry["error"] = x.norm(PETSc.NormType.NORM_INFINITY) / 7
    results[name] = entry


def child():
    from petsc4py import PETSc

    results = {}
    a = grid(PETSc, wind=0.5)
    solver = solver_of(PETSc, a, "lu", "preonly")
    solve(PETSc, solver, a, results, "LU")
    solve(PETSc, solver, a, results, "LU, transposed", transposed=True)
    a.scale(2.0)
    solver.setOperators(a)
    solve(PETSc, solver, a, results, "LU, new values")
    other = grid(PETSc, wind=0.5, far=True)
    solver.setOperators(other)
    solve(PETSc, solver, other, results, "LU, another pattern")
    # The factor of a neighbour as a preconditioner, all vectors distributed.
    near = grid(PETSc, wind=0.5, shift=0.2)
    gmres = solver_of(PETSc, near, "lu", "gmres")
    gmres.setOperators(near, other)
    solve(PETSc, gmres, near, results, "GMRES")
    a = grid(PETSc)
    a.setOption(PETSc.Mat.Option.SPD, True)
    solve(PETSc, solver_of(PETSc, a, "cholesky", "preonly"), a, results, "L L^T")
    near = grid(PETSc, shift=0.1)
    near.setOption(PETSc.Mat.Option.SPD, True)
    cg = solver_of(PETSc, near, "cholesky", "cg")
    cg.setOperators(near, a)
    solve(PETSc, cg, near, results, "CG")
    a = grid(PETSc, shift=-6.1)
    solver = solver_of(PETSc, a, "cholesky", "preonly")
    solve(PETSc, solver, a, results, "L D L^T")
    results["inertia"] = list(map(int, solver.getPC().getFactorMatrix().getInertia()))
    for size in (1e-8, 1e-14, 1e-25):
        a = saddle_point(PETSc, size)
        for factor in ("lu", "cholesky"):
            solve(PETSc, solver_of(PETSc, a, factor, "preonly"), a, results, f"saddle point {size:g}, {factor}")
    singular = grid(PETSc, scale=0.0)
    solver = solver_of(PETSc, singular, "lu", "preonly")
    x, b = singular.createVecs()
    b.set(1.0)
    solver.solve(b, x)
    results["reason of a singular one"] = int(solver.getConvergedReason())
    if PETSc.COMM_WORLD.rank == 0:
        print(json.dumps(results), flush=True)


def expected_inertia():
    """Of the Laplacian less 6.1: its eigenvalues are known."""
    import math

    line = [2 - 2 * math.cos(math.pi * k / (SIDE + 1)) for k in range(1, SIDE + 1)]
    negative = sum(1 for x in line for y in line for z in line if x + y + z < 6.1)
    return [negative, 0, SIDE**3 - negative]


def run(library, processes):
    environment = dict(os.environ, PETSC_OPTIONS=f"-dll_append {library.resolve()}", OMPI_ALLOW_RUN_AS_ROOT="1",
                       OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1", OMPI_MCA_btl_vader_single_copy_mechanism="none")
    done = subprocess.run(["mpiexec", "--oversubscribe", "-n", str(processes), sys.executable, __file__, "--child"], env=environment,
                          capture_output=True, text=True, timeout=300, check=False)
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode != 0 or not lines:
        raise RuntimeError((done.stdout + done.stderr)[-3000:])
    return json.loads(lines[0])


def complaints(results, before):
    for name, r in results.items():
        if isinstance(r, dict):
            if r["reason"] <= 0 or r["error"] > BOUND:
                yield f"{name}: reason {r['reason']}, error {r['error']:.1e}"
            # PETSc's own products and sums depend on who has which rows.
            if before and name not in ("GMRES", "CG") and r["bits"] != before[name]["bits"]:
                yield f"{name}: other bits"
    if results["inertia"] != expected_inertia():
        yield f"inertia {results['inertia']}, not {expected_inertia()}"
    if results["reason of a singular one"] >= 0:
        yield "a singular matrix was solved"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", type=pathlib.Path)
    parser.add_argument("--processes", default="2,3,4")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        child()
        return 0
    for what, there in (("petsc4py", importlib.util.find_spec("petsc4py")), ("mpi4py", importlib.util.find_spec("mpi4py")),
                        ("mpiexec", shutil.which("mpiexec"))):
        if not there:
            print(f"skipped: {what} is not installed")
            return 77
    wrong, before = 0, None
    for processes in map(int, arguments.processes.split(",")):
        results = run(arguments.library, processes)
        found = list(complaints(results, before))
        wrong += len(found)
        for line in found:
            print(f"{processes} processes: {line}")
        worst = max(r["error"] for r in results.values() if isinstance(r, dict))
        print(f"{processes} processes: {sum(isinstance(r, dict) for r in results.values())} systems, largest error {worst:.1e}, inertia {results['inertia']}", flush=True)
        before = results
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
