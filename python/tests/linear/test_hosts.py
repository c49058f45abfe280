"""Other programs with this solver inside. Truth: their own solvers."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import espalier as esp


def test_scikit_fem():
    skfem = pytest.importorskip("skfem")
    from skfem.models.poisson import laplace, unit_load

    basis = skfem.Basis(skfem.MeshTri().refined(4), skfem.ElementTriP2())
    system = skfem.condense(laplace.assemble(basis), unit_load.assemble(basis), D=basis.get_dofs())
    assert skfem.solve(*system, solver=esp.solve) == pytest.approx(skfem.solve(*system), abs=1e-12)


def test_felupe():
    fem = pytest.importorskip("felupe")

    def stretched(**options):
        mesh = fem.Cube(n=4)
        field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(mesh), dim=3)])
        boundaries = fem.dof.uniaxial(field, clamped=True, move=0.3)
        if not isinstance(boundaries, tuple):
            boundaries = boundaries, dict(zip(("dof0", "dof1", "ext0"),
                                              (*fem.dof.partition(field, boundaries), fem.dof.apply(field, boundaries))))
        body = fem.SolidBody(fem.NeoHooke(mu=1, bulk=2), field)
        newton = getattr(fem, "newtonraphson", None) or fem.newtonrhapson
        return newton(items=[body], verbose=0, **boundaries[1], **options).x[0].values

    assert stretched(solver=esp.solve) == pytest.approx(stretched(), abs=1e-9)


def test_pyamg():
    pyamg = pytest.importorskip("pyamg")
    a = pyamg.gallery.poisson((60, 60), format="csr")
    b = np.random.default_rng(0).normal(size=a.shape[0])
    solver = None

    def coarse(a, b):
        nonlocal solver
        solver = solver or esp.Solver(a)
        return solver.solve(b)

    x = pyamg.smoothed_aggregation_solver(a, max_coarse=50, coarse_solver=coarse).solve(b, tol=1e-12)
    assert solver is not None and x == pytest.approx(spla.spsolve(a.tocsc(), b), rel=1e-8, abs=1e-8)


def test_sfepy():
    pytest.importorskip("sfepy")
    import espalier.sfepy  # noqa: F401
    from sfepy.base.base import Struct
    from sfepy.solvers import Solver

    a = sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(50, 50)).tocsr()
    solver = Solver.any_from_conf(Struct(name="ls", kind="ls.espalier", threads=1))
    assert a @ solver(np.ones(50), mtx=a) == pytest.approx(np.ones(50))
    assert 2 * a @ solver(np.ones(50), mtx=2 * a) == pytest.approx(np.ones(50))


CVXPY = """
import cvxpy as cp, numpy as np, sys
rng = np.random.default_rng(0)
a, b, x = rng.normal(size=(60, 40)), rng.normal(size=60), cp.Variable(40)
problem = cp.Problem(cp.Minimize(cp.sum_squares(a @ x - b)), [cp.abs(x) <= 0.1])
options = {"direct_solve_method": "mkl"} if sys.argv[1:] else {}
problem.solve(solver=cp.CLARABEL, **options)
print(repr(list(x.value)))
"""


def test_cvxpy(tmp_path):
    pytest.importorskip("cvxpy")
    library = Path(__file__).parents[3] / "build/release/hosts/libespalier_mkl_pardiso.so"
    if not library.exists():
        pytest.skip(f"{library} is not built (target espalier_hosts)")
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "libmkl_rt.so").symlink_to(library)

    def solution(*options, **environment):
        run = subprocess.run([sys.executable, "-c", CVXPY, *options], capture_output=True, text=True,
                             env={**os.environ, **environment})
        assert run.returncode == 0, run.stderr
        return run.stdout.splitlines()[-1], run.stderr

    ours, log = solution("mkl", MKLROOT=str(tmp_path), ESPALIER_OPTIONS="log=stderr")
    assert "espalier" in log  # it was us
    number = lambda text: np.array(eval(text, {"np": np}))  # noqa: E731
    assert number(ours) == pytest.approx(number(solution()[0]), abs=1e-6)


class TestNgsolve:
    @pytest.fixture
    def problem(self):
        ng = pytest.importorskip("ngsolve")
        from netgen.geom2d import unit_square
        from ngsolve import dx, grad

        import espalier.ngsolve  # noqa: F401
        return ng, ng.Mesh(unit_square.GenerateMesh(maxh=0.1)), dx, grad

    @pytest.mark.parametrize("symmetric, half", [(True, True), (True, False), (False, False)])
    def test_inverse(self, problem, symmetric, half):
        ng, mesh, dx, grad = problem
        fes = ng.H1(mesh, order=3, dirichlet=".*")
        u, v = fes.TnT()
        form = ng.BilinearForm(fes, symmetric=symmetric, symmetric_storage=half)
        form += (grad(u) * grad(v) + (0 if symmetric else 5 * grad(u)[0] * v)) * dx
        load = ng.LinearForm(1 * v * dx).Assemble()
        form.Assemble()
        inverse = form.mat.Inverse(fes.FreeDofs(), inverse="espalier")
        truth = form.mat.Inverse(fes.FreeDofs(), inverse="umfpack" if not half else "sparsecholesky")
        x, y = load.vec.CreateVector(), load.vec.CreateVector()
        for factor in (1, 2):
            x.data, y.data = inverse * load.vec, truth * load.vec
            assert x.FV().NumPy() == pytest.approx(y.FV().NumPy() / factor, abs=1e-12)
            form.mat.AsVector().data *= 2
            inverse.Update()
