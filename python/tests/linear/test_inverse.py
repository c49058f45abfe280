"""Entries of inverses. Truth: dense inverses of NumPy, closed forms of Gauss-Markov fields, differences."""

import numpy as np
import pytest
import scipy.sparse as sp

import espalier as esp
from test_solver import matrix

KINDS = ["llt", "ldlt", "lu"]


def dense_at(truth, s):
    s = s.tocoo()
    return truth[s.row, s.col]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("form", ["csc", "csr", "coo", "tuple"])
def test_on_the_pattern_of_a(kind, form):
    a = matrix(30, kind).tocsr()
    a.sort_indices()
    truth = np.linalg.inv(a.toarray())
    solver = esp.Solver((a.indptr, a.indices, a.data) if form == "tuple" else a.asformat(form))
    s = solver.selected_inverse()
    assert s.shape == a.shape and s.nnz == a.nnz
    assert s.tocoo().data == pytest.approx(dense_at(truth, s), rel=1e-10, abs=1e-12)
    # In the order of A.data: the gradient of log|det A|.
    same = a.tocsc() if form in ("csc", "coo") else a
    rows, cols = (same.indices, np.repeat(np.arange(30), np.diff(same.indptr)))
    rows, cols = (rows, cols) if same.format == "csc" else (cols, rows)
    assert s.data == pytest.approx(truth.T[rows, cols], rel=1e-10, abs=1e-12)
    found = solver.last_inverse
    assert found.error < 1e-12 and 6 <= found.checked <= 8 and found.solved == 0
    assert np.isnan(found.trace_error)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("form", ["csc", "csr"])
def test_other_patterns_diagonals_blocks_and_traces(kind, form):
    a = matrix(30, kind).asformat(form)
    truth = np.linalg.inv(a.toarray())
    solver = esp.Solver(a)
    for pattern in (sp.random_array((30, 30), density=0.1, rng=np.random.default_rng(1), format="csr"),
                    sp.eye_array(30, format="csc"), sp.coo_array(([1.0], ([3], [29])), shape=(30, 30))):
        s = solver.selected_inverse(pattern)
        assert s.tocoo().data == pytest.approx(dense_at(truth, s), rel=1e-9, abs=1e-12)
        assert s.nnz == pattern.nnz
    assert solver.inverse_diagonal() == pytest.approx(np.diag(truth), rel=1e-10)
    blocks = solver.inverse_blocks(3)
    assert blocks.shape == (10, 3, 3)
    for k in range(10):
        assert blocks[k] == pytest.approx(truth[3 * k:3 * k + 3, 3 * k:3 * k + 3], rel=1e-9, abs=1e-12)
    b = matrix(30, "lu")
    for given in (b.tocsc(), b.tocsr(), (b.tocsr().indptr, b.tocsr().indices, b.tocsr().data)):
        trace = solver.trace_of_inverse(given)
        assert isinstance(trace, float)
        assert trace == pytest.approx(np.trace(truth @ b.toarray()), rel=1e-10)
        assert 0 < solver.last_inverse.trace_error < 1e-9
    assert solver.trace_of_inverse(1j * b) == pytest.approx(1j * np.trace(truth @ b.toarray()), rel=1e-10)


@pytest.mark.parametrize("symmetry", ["lower", "upper", "symmetric", "auto"])
@pytest.mark.parametrize("form", ["csc", "csr"])
def test_one_triangle(symmetry, form):
    a = matrix(30, "ldlt").tocsc()
    truth = np.linalg.inv(a.toarray())
    given = {"lower": sp.tril(a), "upper": sp.triu(a)}.get(symmetry, a).asformat(form)
    s = esp.Solver(given, symmetry=symmetry).selected_inverse()
    assert s.format == form or symmetry == "auto"
    assert s.tocoo().data == pytest.approx(dense_at(truth, s), rel=1e-9, abs=1e-12)
    assert s.nnz == given.nnz


@pytest.mark.parametrize("hermitian", [True, False])
@pytest.mark.parametrize("form", ["csc", "csr"])
def test_complex(hermitian, form):
    rng = np.random.default_rng(3)
    half = sp.random_array((24, 24), density=0.15, rng=rng) + 1j * sp.random_array((24, 24), density=0.15, rng=rng)
    a = (half + half.conj().T if hermitian else half) + 4 * sp.eye_array(24)
    a = sp.csc_array(a).asformat(form)
    truth = np.linalg.inv(a.toarray())
    solver = esp.Solver(a, symmetry="hermitian" if hermitian else "auto")
    for s in (solver.selected_inverse(), solver.selected_inverse(a), solver.selected_inverse(a.tocsr())):
        assert s.dtype == complex
        assert s.tocoo().data == pytest.approx(dense_at(truth, s), rel=1e-10, abs=1e-13)
    assert solver.inverse_diagonal() == pytest.approx(np.diag(truth), rel=1e-10)
    assert solver.inverse_blocks(2)[3] == pytest.approx(truth[6:8, 6:8], rel=1e-10)
    assert solver.trace_of_inverse(a) == pytest.approx(24, rel=1e-12)
    assert solver.trace_of_inverse(a.real) == pytest.approx(np.trace(truth @ a.real.toarray()), rel=1e-10)


def test_variances_of_a_random_walk():
    """x_0 ~ N(0, 1), x_(k + 1) = x_k + N(0, 1): the variance of x_k is k + 1, the covariance of two the smaller one."""
    n = 2000
    q = sp.diags_array([-np.ones(n - 1), np.append(2 * np.ones(n - 1), 1), -np.ones(n - 1)], offsets=[-1, 0, 1], format="csc")
    solver = esp.Solver(q)
    assert solver.inverse_diagonal() == pytest.approx(np.arange(1, n + 1), rel=1e-9)
    pairs = sp.csr_array((np.ones(2), ([5, 1700], [1999, 2])), shape=(n, n))
    s = solver.selected_inverse(pairs)
    assert [s[5, 1999], s[1700, 2]] == pytest.approx([6, 3], rel=1e-9)
    assert solver.last_inverse.solved == 2
    assert solver.slogdet[1] == pytest.approx(0, abs=1e-9)


def test_what_cannot_be():
    a = matrix(12, "llt")
    solver = esp.Solver()
    for call in (solver.selected_inverse, solver.inverse_diagonal, lambda: solver.trace_of_inverse(a),
                 lambda: solver.inverse_blocks(2)):
        with pytest.raises(RuntimeError, match="no factorization"):
            call()
    solver.factorize(a)
    with pytest.raises(ValueError, match="11 rows; the matrix has 12"):
        solver.selected_inverse(sp.eye_array(11, format="csc"))
    with pytest.raises(ValueError, match="B has 13 rows"):
        solver.trace_of_inverse(sp.eye_array(13))
    with pytest.raises(TypeError, match="no sparse matrix"):
        solver.trace_of_inverse(np.eye(12))
    with pytest.raises(ValueError, match="only a pattern"):
        solver.trace_of_inverse((*[a.tocsr().indptr, a.tocsr().indices], None))
    with pytest.raises(ValueError, match="blocks of 5"):
        solver.inverse_blocks(5)
    bad = a.tocsc().astype(float)
    bad.data[2] = np.nan
    with pytest.raises(esp.InvalidInputError):
        solver.trace_of_inverse(bad)
    singular = sp.csc_array(np.array([[1.0, 1, 0], [1, 1, 0], [0, 0, 1]]))
    reported = esp.Solver(singular, singular="report")
    with pytest.raises(esp.SingularMatrixError, match="rank is 2 of 3"):
        reported.inverse_diagonal()
    changed = sp.csc_array(np.array([[2.0, 0, 1], [0, 2, 0], [0, 0, 2]]))
    solver = esp.Solver(changed)
    changed.indices[2] = 1
    with pytest.raises(ValueError, match="have been changed"):
        solver.selected_inverse()
    solver.close()
    with pytest.raises(RuntimeError):
        solver.inverse_diagonal()


def test_follows_new_values_and_clones():
    a = matrix(20, "llt").tocsc()
    solver = esp.Solver(a)
    before = solver.inverse_diagonal()
    solver.factorize(4 * a.data)
    assert solver.inverse_diagonal() == pytest.approx(before / 4, rel=1e-12)
    clone = solver.clone()
    assert clone.last_inverse is None
    with pytest.raises(RuntimeError):
        clone.inverse_diagonal()
    clone.factorize(a.data)
    assert clone.inverse_diagonal() == pytest.approx(before, rel=1e-12)


def test_wide_indices():
    a = matrix(20, "lu").tocsc()
    wide = a.copy()
    wide.indptr, wide.indices = wide.indptr.astype(np.int64), wide.indices.astype(np.int64)
    s = esp.Solver(wide).selected_inverse()
    assert s.data == pytest.approx(esp.Solver(a).selected_inverse().data, rel=1e-12)


class TestTorch:
    torch = property(lambda self: pytest.importorskip("torch"))

    @pytest.mark.parametrize("kind", KINDS)
    def test_slogdet(self, kind):
        torch = self.torch
        import espalier.torch as et
        a = matrix(12, kind).tocsr()
        a.sort_indices()
        values = torch.tensor(a.data, dtype=torch.float64, requires_grad=True)
        pattern = torch.from_numpy(a.indptr.astype("i8")), torch.from_numpy(a.indices.astype("i8"))
        sign, logarithm = et.slogdet((*pattern, values))
        dense = torch.tensor(a.toarray(), requires_grad=True)
        truth = torch.linalg.slogdet(dense)
        assert (sign.item(), logarithm.item()) == pytest.approx((truth[0].item(), truth[1].item()))
        (3 * logarithm).backward()
        (3 * truth[1]).backward()
        rows = np.repeat(np.arange(12), np.diff(a.indptr))
        assert values.grad.numpy() == pytest.approx(dense.grad.numpy()[rows, a.indices], rel=1e-9)
        if kind == "lu":
            assert torch.autograd.gradcheck(lambda v: et.slogdet((*pattern, v))[1], (values,))

    def test_refuses(self):
        torch = self.torch
        import espalier.torch as et
        crow, col = torch.tensor([0, 1]), torch.tensor([0])
        with pytest.raises(TypeError, match="float64 or float32"):
            et.slogdet((crow, col, torch.ones(1, dtype=torch.complex128)))
        with pytest.raises(esp.SingularMatrixError):
            et.slogdet((crow, col, torch.zeros(1, dtype=torch.float64)))
        one = torch.ones(1, dtype=torch.float64, requires_grad=True)
        gradient, = torch.autograd.grad(et.slogdet((crow, col, one))[1], one, create_graph=True)
        with pytest.raises(RuntimeError):
            gradient.sum().backward()


class TestJax:
    @pytest.fixture
    def jax(self):
        jax = pytest.importorskip("jax")
        jax.config.update("jax_enable_x64", True)
        return jax

    @pytest.mark.parametrize("kind", KINDS)
    def test_slogdet(self, jax, kind):
        import espalier.jax as ej
        a = matrix(12, kind).tocsr()
        a.sort_indices()
        rows = np.repeat(np.arange(12), np.diff(a.indptr))
        run = jax.jit(lambda v: ej.slogdet(a.indptr, a.indices, v)[1])
        sign, logarithm = ej.slogdet(a.indptr, a.indices, a.data)
        assert (float(sign), float(logarithm)) == pytest.approx(np.linalg.slogdet(a.toarray()))
        gradient = jax.grad(run)(a.data)
        assert np.asarray(gradient) == pytest.approx(np.linalg.inv(a.toarray()).T[rows, a.indices], rel=1e-9)
        forward = jax.jvp(run, (a.data,), (np.ones_like(a.data),))[1]
        assert float(forward) == pytest.approx(float(gradient.sum()), rel=1e-9)
        with pytest.raises(Exception, match="(?i)jvp|differentiat"):
            jax.jacfwd(jax.grad(run))(a.data)
