"""solve(b, rows=...): a few unknowns for right-hand sides with few entries. Truth: whole solutions, dense ones."""

import numpy as np
import pytest
import scipy.sparse as sp

import espalier


def matrix(n, kind, seed):
    rng = np.random.default_rng(seed)
    grid = sp.diags_array([-1, -1, 4.5, -1, -1], offsets=[-n, -1, 0, 1, n], shape=(n * n, n * n)).tocsc()
    if kind == "general":
        grid = grid + sp.diags_array([0.7, -0.3], offsets=[2, -3], shape=grid.shape)
    if kind == "hermitian":
        skew = sp.diags_array([1j, -1j], offsets=[2, -2], shape=grid.shape)
        grid = grid + 0.4 * skew
    if kind == "complex":
        grid = grid + sp.diags_array(1j * rng.random(n * n)) + sp.diags_array([0.2j], offsets=[3], shape=grid.shape)
    return grid


@pytest.mark.parametrize("kind", ["symmetric", "general", "hermitian", "complex"])
@pytest.mark.parametrize("layout", ["csc", "csr", "coo"])
@pytest.mark.parametrize("transpose", [False, True, "H"])
@pytest.mark.parametrize("numbers", [float, complex])
def test_rows_are_those_of_whole_solutions(kind, layout, transpose, numbers):
    a = matrix(11, kind, 1).asformat(layout)
    n = a.shape[0]
    rng = np.random.default_rng(2)
    b = sp.random_array((n, 5), density=0.01, rng=rng, format="csc").astype(numbers)
    if numbers is complex:
        b = b * (0.3 + 1j)
    dense = a.toarray()
    op = {False: dense, True: dense.T, "H": dense.conj().T}[transpose]
    truth = np.linalg.solve(op, b.toarray())
    rows = [7, n - 1, 7, 0]
    solver = espalier.Solver(a)
    x = solver.solve(b, rows=rows, transpose=transpose)
    assert x.shape == (4, 5) and x.dtype == truth.dtype
    np.testing.assert_allclose(x, truth[rows], rtol=0, atol=1e-13 * np.abs(truth).max())
    assert isinstance(solver.last_solve, espalier.SolveRows) and solver.last_solve.componentwise_error < 1e-10
    # Dense right-hand sides with few entries, of any layout; one of them alone.
    for some in (b.toarray(), np.asfortranarray(b.toarray()), b.tocsr(), b.tocoo()):
        np.testing.assert_array_equal(solver.solve(some, rows=rows, transpose=transpose), x)
    one = solver.solve(b.toarray()[:, 2], rows=np.array(rows, np.uint8), transpose=transpose)
    np.testing.assert_allclose(one, x[:, 2], rtol=0, atol=1e-15 * np.abs(truth).max())


def test_a_corner_reads_a_part_of_the_factor():
    solver = espalier.Solver(matrix(60, "symmetric", 1))
    b = sp.coo_array(([2.0, 3.0], ([5, 5], [0, 0])), shape=(3600, 1))  # entries of one place are summed
    x = solver.solve(b, rows=[5])
    whole = np.zeros(3600)
    whole[5] = 5
    np.testing.assert_allclose(x[0, 0], solver.solve(whole)[5], rtol=1e-13)
    solver.solve(b, rows=[5])
    assert solver.last_solve.share < 0.5


def test_bad_input():
    solver = espalier.Solver(matrix(4, "general", 1))
    for rows in ([-1], [16], [1.5], [[1]], "abc"):
        with pytest.raises((ValueError, TypeError), match="rows"):
            solver.solve(np.ones(16), rows=rows)
    with pytest.raises(ValueError, match="shape"):
        solver.solve(sp.csc_array((15, 1)), rows=[0])
    with pytest.raises(ValueError, match="out and stream"):
        solver.solve(np.ones(16), rows=[0], out=np.ones(1))
    with pytest.raises(espalier.InvalidInputError, match="not finite"):
        solver.solve(np.full(16, np.nan), rows=[0])
    assert solver.solve(np.ones(16), rows=[]).shape == (0,)
    assert solver.solve(np.ones((16, 0)), rows=[1]).shape == (1, 0)
    np.testing.assert_array_equal(solver.solve(np.zeros(16), rows=[3]), [0])
