"""The solver files for Mosaic, without Mosaic. Truth: fields that finite elements hold exactly, scipy, differences."""

import importlib.util
import threading
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

FILE = Path(__file__).parents[3] / "hosts/mosaic/mosaic_shared/utils/hex8_simp.py"
spec = importlib.util.spec_from_file_location("hex8_simp", FILE)
hex8 = importlib.util.module_from_spec(spec)
spec.loader.exec_module(hex8)


def grid(nx, ny, nz, distorted=0.0, lengths=(2.0, 1.0, 1.0)):
    """Points and cells; inner points moved by `distorted` of an element."""
    z, y, x = np.meshgrid(*(np.linspace(0, s, n + 1) for s, n in zip(lengths[::-1], (nz, ny, nx))), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    number = np.arange(len(points)).reshape(nz + 1, ny + 1, nx + 1)
    low, high = slice(None, -1), slice(1, None)
    corners = [(low, low, low), (low, low, high), (low, high, high), (low, high, low)]
    corners += [(high, *c[1:]) for c in corners]
    cells = np.stack([number[c].ravel() for c in corners], axis=1)
    inner = ((points > 1e-9) & (points < np.array(lengths) - 1e-9)).all(axis=1)
    moved = np.random.default_rng(1).uniform(-1, 1, points.shape) * distorted / max(nx, ny, nz)
    points[inner] += moved[inner]
    return points, cells


def inputs(points, cells, fixed, values, loaded, load):
    return {
        "hex_mesh": {"points": points, "faces": cells, "n_points": len(points), "n_faces": len(cells)},
        "boundary_conditions": {
            "dirichlet": {"mask": fixed.astype(int), "values": values},
            "neumann": {"mask": loaded.astype(int), "values": load},
        },
    }


def dense_matrix(model, factors):
    rows = np.repeat(model.cells_of[:, :, None], model.cells_of.shape[1], axis=2)
    columns = rows.transpose(0, 2, 1)
    values = factors[:, None, None] * model.stiffness
    n = model.unknowns * len(model.points)
    return sp.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n))


def test_a_pulled_bar_is_strained_evenly_on_a_distorted_mesh():
    points, cells = grid(5, 3, 4, 0.3)
    nu, pull = 0.3, 7.0
    given = inputs(
        points, cells, points[:, 0] < 1e-9, np.zeros((1, 3)), points[:, 0] > 2 - 1e-9, np.array([[pull, 0, 0]])
    )
    # The module fixes whole nodes: those of one end are held where an even strain has them.
    exact = pull * np.stack([points[:, 0], -nu * points[:, 1], -nu * points[:, 2]], axis=1)
    problem = hex8.Hex8Inputs(given, lambda: hex8.isotropic(nu), ("elastic", nu))
    problem.model.factorize(np.ones(len(cells)))
    prescribed = np.where((points[:, 0] < 1e-9)[:, None], exact, 0).ravel()
    u = problem.model.solve(problem.load, prescribed)
    assert np.abs(u - exact.ravel()).max() < 1e-11 * np.abs(exact).max()
    assert abs(problem.load.sum() - pull) < 1e-12


def test_heat_flows_evenly_and_sources_add_up():
    points, cells = grid(4, 4, 4, 0.3)
    given = inputs(points, cells, points[:, 0] < 1e-9, np.array([[2.0]]), points[:, 0] > 2 - 1e-9, np.array([[3.0]]))
    problem = hex8.Hex8Inputs(given, lambda: None, "heat")
    problem.model.factorize(np.full(len(cells), 0.5))
    temperature = problem.model.solve(problem.load, problem.prescribed)
    assert np.abs(temperature - (2 + 6 * points[:, 0])).max() < 1e-11
    assert abs(problem.model.source_load(np.full(len(cells), 1.5)).sum() - 3.0) < 1e-12


@pytest.mark.parametrize("law", [None, "elastic"])
def test_answers_and_slopes(law):
    points, cells = grid(4, 2, 3, 0.2)
    dofs = 1 if law is None else 3
    rng = np.random.default_rng(2)
    values = rng.uniform(-1, 1, (1, dofs)) * 1e-2
    given = inputs(
        points, cells, points[:, 0] < 1e-9, values, points[:, 0] > 2 - 1e-9, rng.uniform(-1, 1, (1, dofs))
    )
    problem = hex8.Hex8Inputs(given, lambda: None if law is None else hex8.isotropic(0.3), law)
    model, factors = problem.model, rng.uniform(0.1, 2, len(cells))

    def goal(s):
        model.factorize(s)
        return problem.load @ model.solve(problem.load, problem.prescribed)

    matrix = dense_matrix(model, factors).tocsc()
    free = model.free
    rest = problem.load - matrix @ np.where(np.isin(np.arange(len(problem.load)), free), 0, problem.prescribed)
    exact = spla.spsolve(matrix[free][:, free], rest[free])
    model.factorize(factors)
    u = model.solve(problem.load, problem.prescribed)
    assert np.abs(u[free] - exact).max() < 1e-12 * np.abs(exact).max()
    slopes = -model.slopes(u, model.solve(problem.load))
    for e in rng.permutation(len(cells))[:6]:
        step = np.zeros(len(cells))
        step[e] = 1e-4
        difference = (goal(factors + step) - goal(factors - step)) / 2e-4
        assert abs(slopes[e] - difference) < 1e-6 * max(abs(slopes).max(), abs(difference))


def test_negative_factors_are_factorized_as_indefinite():
    points, cells = grid(3, 2, 2)
    fixed = points[:, 0] < 1e-9
    model = hex8.Hex8Model(points, cells, hex8.isotropic(0.3), fixed)
    load = np.random.default_rng(3).uniform(-1, 1, 3 * len(points))
    for sign in (1.0, -0.5, 1.0):
        factors = np.ones(len(cells))
        factors[::3] = sign
        model.factorize(factors)
        u = model.solve(load)
        residual = (dense_matrix(model, factors) @ u - load)[model.free]
        assert np.abs(residual).max() < 1e-11


def test_mistakes_are_named():
    points, cells = grid(2, 2, 2)
    with pytest.raises(ValueError, match="cell 3 is turned inside out"):
        hex8.Hex8Model(points, np.where(np.arange(8)[:, None] == 3, cells[:, [0, 3, 2, 1, 4, 7, 6, 5]], cells), None, points[:, 0] < 1e-9)
    given = inputs(points, cells, 2 * (points[:, 0] < 1e-9), np.zeros((1, 1)), points[:, 0] > 9, np.zeros((1, 1)))
    with pytest.raises(ValueError, match="dirichlet.mask names group 2; values has 1"):
        hex8.Hex8Inputs(given, lambda: None, "heat")


def test_faces_between_cells_take_no_load():
    points, cells = grid(2, 1, 1)
    everywhere = np.ones(len(points), dtype=int)
    model = hex8.Hex8Model(points, cells, None, points[:, 0] < 1e-9)
    assert abs(model.surface_load(everywhere, np.array([[1.0]])).sum() - 10.0) < 1e-12  # the surface of 2 x 1 x 1


def test_threads_do_not_solve_with_the_factors_of_others():
    points, cells = grid(3, 2, 2)
    given = inputs(points, cells, points[:, 0] < 1e-9, np.array([[0.0]]), points[:, 0] > 2 - 1e-9, np.array([[1.0]]))
    turns, one_by_one, found = threading.Barrier(2), threading.Lock(), {}

    def work(conductivity):
        with one_by_one:  # the second finds what the first has made
            problem = hex8.Hex8Inputs(given, lambda: None, "heat")
        turns.wait()
        for _ in range(20):
            problem.model.factorize(np.full(len(cells), conductivity))
            turns.wait()  # both have factorized before either solves
            found.setdefault(conductivity, []).append(problem.model.solve(problem.load).max())
            turns.wait()

    threads = [threading.Thread(target=work, args=(k,)) for k in (1.0, 4.0)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for conductivity, values in found.items():
        assert len(values) == 20 and np.allclose(values, 2 / conductivity, rtol=1e-12)
