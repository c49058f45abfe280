#!/usr/bin/env python3
"""petsc4py, SLEPc and dolfinx on our package for PETSc and on their own solvers: PETSC_OPTIONS alone changes.

    apt-get install petsc-dev python3-petsc4py python3-slepc4py python3-dolfinx
    /usr/bin/python3 tests/hosts/petsc.py --library build/release/hosts/libespalier_petsc.so [--quick]

First random sequences of calls: petsc_sequences.c, which by itself runs as many as one likes. Then each system is solved with
PETSc's own default, with MUMPS, and with ours, and by two processes with ours; what is not installed is said to be skipped. Fails where errors are above 1e-10 (solutions and eigenvalues are known), eigenvalues are missing, or displacements differ.
"""
import argparse
import importlib.util
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time


def laplacian(PETSc, side, wind, kind):
    n = side**3
    a = PETSc.Mat().create()
    a.setSizes([n, n])
    a.setType(kind)
    a.setPreallocationNNZ(7 if kind.endswith("aij") and "sb" not in kind else 4)
    a.setOption(PETSc.Mat.Option.IGNORE_LOWER_TRIANGULAR, True) if "sbaij" in kind else None
    first, last = a.getOwnershipRange()
    for row in range(first, last):
        x, y, z = row % side, row // side % side, row // side**2
        a.setValue(row, row, 6.0)
        for inside, column, value in ((x > 0, row - 1, -1 - wind), (x + 1 < side, row + 1, -1 + wind), (y > 0, row - side, -1.0),
                                      (y + 1 < side, row + side, -1.0), (z > 0, row - side**2, -1.0), (z + 1 < side, row + side**2, -1.0)):
            if inside and ("sbaij" not in kind or column >= row):
                a.setValue(row, column, value)
    a.assemble()
    return a


def systems(side):
    """LU of AIJ, Cholesky of SBAIJ and of AIJ; refactorized once."""
    from petsc4py import PETSc

    results = {}
    for name, kind, wind, factor in (("wind, AIJ", "aij", 0.5, "lu"), ("Laplacian, SBAIJ", "sbaij", 0.0, "cholesky"), ("Laplacian, AIJ", "aij", 0.0, "cholesky")):
        a = laplacian(PETSc, side, wind, kind)
        if factor == "cholesky" and kind == "aij":
            a.setOption(PETSc.Mat.Option.SPD, True)
        solver = PETSc.KSP().create(a.comm)
        solver.setOperators(a)
        solver.setType("preonly")
        solver.getPC().setType(factor)
        solver.setFromOptions()
        x, b = a.createVecs()
        truth = x.duplicate()
        first, last = truth.getOwnershipRange()
        truth.setValues(range(first, last), [1.0 + k % 5 for k in range(first, last)])
        truth.assemble()
        a.mult(truth, b)
        begin, used = time.perf_counter(), time.process_time()
        solver.setUp()
        solver.solve(b, x)
        seconds, work = time.perf_counter() - begin, time.process_time() - used
        a.scale(2.0)
        solver.setOperators(a)
        solver.solve(b, x)
        x.scale(2.0)
        x.axpy(-1.0, truth)
        error = x.norm(PETSc.NormType.NORM_INFINITY)
        inertia = list(map(int, solver.getPC().getFactorMatrix().getInertia())) if factor == "cholesky" and name.endswith("SBAIJ") else None
        results[name] = {"unknowns": side**3, "seconds": seconds, "cpu_seconds": work, "error": error, "inertia": inertia,
                         "package": solver.getPC().getFactorSolverType()}
    return results


def eigenvalues(side):
    """Shift and invert around 1, and all eigenvalues of an interval by inertia (spectrum slicing)."""
    import numpy as np
    from petsc4py import PETSc
    from slepc4py import SLEPc

    line = 2 - 2 * np.cos(np.pi * np.arange(1, side + 1) / (side + 1))
    spectrum = (line[:, None, None] + line[:, None] + line).ravel()
    a = laplacian(PETSc, side, 0.0, "aij")
    results = {}
    for name in ("shift and invert", "slicing"):
        solver = SLEPc.EPS().create(a.comm)
        solver.setOperators(a)
        solver.setProblemType(SLEPc.EPS.ProblemType.HEP)
        spectral = solver.getST()
        spectral.setType("sinvert")
        spectral.getKSP().setType("preonly")
        PETSc.Options()["st_pc_type"] = "cholesky" if name == "slicing" else "lu"
        if name == "slicing":
            solver.setWhichEigenpairs(SLEPc.EPS.Which.ALL)
            solver.setInterval(0.5, 0.9)
        else:
            solver.setTarget(1.0)
            solver.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
            solver.setDimensions(8)
        solver.setFromOptions()
        begin, used = time.perf_counter(), time.process_time()
        solver.solve()
        seconds, work = time.perf_counter() - begin, time.process_time() - used
        values = [solver.getEigenvalue(k).real for k in range(solver.getConverged())]
        expected = int(((spectrum > 0.5) & (spectrum < 0.9)).sum()) if name == "slicing" else 8
        results[name] = {"unknowns": side**3, "seconds": seconds, "cpu_seconds": work,
                         "error": max((float(np.abs(spectrum / v - 1).min()) for v in values), default=1.0),
                         "found": len(values) if name == "slicing" else min(len(values), 8), "expected": expected,
                         "package": spectral.getKSP().getPC().getFactorSolverType()}
    return results


def elasticity(side):
    import numpy as np
    import ufl
    from dolfinx import fem, mesh
    from dolfinx.fem.petsc import LinearProblem
    from mpi4py import MPI
    from petsc4py import PETSc

    block = mesh.create_unit_cube(MPI.COMM_WORLD, side, side, side, mesh.CellType.hexahedron)
    space = fem.VectorFunctionSpace(block, ("Lagrange", 1))
    facets = mesh.locate_entities_boundary(block, 2, lambda x: np.isclose(x[0], 0))
    clamp = fem.dirichletbc(np.zeros(3), fem.locate_dofs_topological(space, 2, facets), space)
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    strain = lambda w: ufl.sym(ufl.grad(w))  # noqa: E731
    form = ufl.inner(2 * strain(u) + ufl.tr(strain(u)) * ufl.Identity(3), strain(v)) * ufl.dx
    load = ufl.inner(fem.Constant(block, PETSc.ScalarType((0, 0, -0.01))), v) * ufl.dx
    problem = LinearProblem(form, load, bcs=[clamp], petsc_options={"ksp_type": "preonly", "pc_type": "lu"})
    begin, used = time.perf_counter(), time.process_time()
    solution = problem.solve()
    return {"dolfinx": {"unknowns": int(space.dofmap.index_map.size_global * 3), "seconds": time.perf_counter() - begin,
                        "cpu_seconds": time.process_time() - used, "values": [solution.vector.norm()],
                        "package": problem.solver.getPC().getFactorSolverType()}}


TASKS = {"systems": (systems, "petsc4py"), "eigenvalues": (eigenvalues, "slepc4py"), "elasticity": (elasticity, "dolfinx")}


def in_child(task, side, options, processes):
    environment = dict(os.environ, PETSC_OPTIONS=options, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    launch = ["mpiexec", "--oversubscribe", "-n", str(processes)] if processes > 1 else []
    done = subprocess.run([*launch, sys.executable, __file__, "--child", task, "--side", str(side)], env=environment, capture_output=True, text=True)
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode != 0 or not lines:
        return None, (done.stderr or done.stdout)[-1500:]
    return json.loads(lines[0]), ""


def differences(ours, own):
    if ours["package"] != "espalier":
        return f"{ours['package']} has worked"
    if ours.get("error", 0) > 1e-10:
        return f"error {ours['error']:.1e}"
    if ours.get("inertia") != own.get("inertia") and own.get("inertia"):
        return f"inertia {ours['inertia']}"
    if ours.get("found") != ours.get("expected"):
        return f"{ours['found']} eigenvalues instead of {ours['expected']}"
    if any(abs(x - y) > 1e-7 * abs(y) for x, y in zip(ours.get("values", []), own.get("values", []))):
        return "other values"
    return ""


def sequences(library, count):
    """petsc_sequences.c: random calls, in which no factor may be that of old values. Returns whether something was wrong."""
    if shutil.which("mpicc") is None or shutil.which("pkg-config") is None:
        print("skipped: mpicc or pkg-config is not installed")
        return 0
    source = pathlib.Path(__file__).with_name("petsc_sequences.c")
    with tempfile.TemporaryDirectory() as folder:
        flags = subprocess.run(["pkg-config", "--cflags", "--libs", "petsc"], check=True, capture_output=True, text=True).stdout.split()
        program = pathlib.Path(folder) / "petsc_sequences"
        subprocess.run(["mpicc", "-O1", source, *flags, "-lm", "-o", program], check=True)
        environment = dict(os.environ, PETSC_OPTIONS=f"-dll_append {library} -pc_factor_mat_solver_type espalier", ESPALIER_OPTIONS="threads=1",
                           OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
        return 1 if subprocess.run([program, str(count)], env=environment, check=False).returncode else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", type=pathlib.Path)
    parser.add_argument("--quick", action="store_true", help="small systems alone")
    parser.add_argument("--side", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--child", choices=TASKS, help=argparse.SUPPRESS)
    parser.add_argument("--out", help="all results as JSON")
    arguments = parser.parse_args()
    if arguments.child:
        result = TASKS[arguments.child][0](arguments.side)
        from petsc4py import PETSc

        if PETSc.COMM_WORLD.rank == 0:
            print(json.dumps(result), flush=True)
        return 0
    ours = (f"-dll_append {arguments.library.resolve()} -pc_factor_mat_solver_type espalier -st_pc_factor_mat_solver_type espalier")
    mumps = ("-pc_factor_mat_solver_type mumps -st_pc_factor_mat_solver_type mumps -mat_mumps_icntl_13 1 -st_mat_mumps_icntl_13 1 "
             "-mat_mumps_icntl_24 1 -st_mat_mumps_icntl_24 1")
    results, wrong = [], sequences(arguments.library.resolve(), 200 if arguments.quick else 2000)
    for task, (_, module) in TASKS.items():
        if importlib.util.find_spec(module) is None:
            print(f"skipped: {module} is not installed for this Python")
            continue
        for side in [8] if arguments.quick else [8, 20]:
            own, why = in_child(task, side, mumps, 1)
            for processes in (1, 2):
                if processes > 1 and (shutil.which("mpiexec") is None or side > 8):
                    continue
                mine, failure = in_child(task, side, ours, processes)
                if own is None or mine is None:
                    print(f"{task} {side}: {why or failure}")
                    wrong += 1
                    continue
                for name, o in own.items():
                    m = mine[name]
                    m["wrong"] = differences(m, o)
                    wrong += bool(m["wrong"])
                    results.append({"system": name, "processes": processes, "own": o, "ours": m})
                    print(f"{name:18} {o['unknowns']:7} {processes} process(es)  MUMPS {o['seconds']:8.3f} s   ours {m['seconds']:8.3f} s  "
                          f"{m['wrong'] or 'same'}", flush=True)
    if arguments.out:
        pathlib.Path(arguments.out).write_text(json.dumps(results))
    print(f"{len(results)} systems, {wrong} differences")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
