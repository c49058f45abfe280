"""Other programs with this solver inside. Truth: their own solvers."""

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


class TestNgsolve:
    @pytest.fixture(scope="class")
    def problem(self):
        ng = pytest.importorskip("ngsolve")
        from ngsolve import dx, grad

        import espalier.ngsolve  # noqa: F401
        mesh = ng.Mesh(ng.unit_square.GenerateMesh(maxh=0.1)) if hasattr(ng, "unit_square") else self._mesh(ng)
        return ng, mesh, dx, grad

    @staticmethod
    def _mesh(ng):
        from netgen.geom2d import unit_square

        return ng.Mesh(unit_square.GenerateMesh(maxh=0.1))

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
