"""Derivatives through solves in PyTorch and JAX. Truth: differences (gradcheck, check_grads) and dense solves."""

import numpy as np
import pytest
import scipy.sparse as sp

from test_solver import matrix


def parts(kind, n=12):
    a = matrix(n, kind).tocsr()
    a.sort_indices()
    return a, a.indptr.astype("i8"), a.indices.astype("i8"), a.data.copy()


class TestTorch:
    torch = property(lambda self: pytest.importorskip("torch"))

    @pytest.mark.parametrize("kind", ["llt", "ldlt", "lu"])
    @pytest.mark.parametrize("transpose", [False, True])
    @pytest.mark.parametrize("columns", [None, 1, 3])
    def test_gradients(self, kind, transpose, columns):
        torch = self.torch
        import espalier.torch as et
        a, crow, col, data = parts(kind)
        crow, col = torch.from_numpy(crow), torch.from_numpy(col)
        values = torch.from_numpy(data).requires_grad_()
        b = torch.randn(12, *([] if columns is None else [columns]), dtype=torch.float64).requires_grad_()
        dense = a.T if transpose else a
        x = et.solve((crow, col, values), b, transpose=transpose)
        assert x.detach().numpy() == pytest.approx(np.linalg.solve(dense.toarray(), b.detach().numpy()))
        if kind == "lu":  # differences of one entry leave the symmetric matrices
            run = lambda v, r: et.solve((crow, col, v), r, transpose=transpose)  # noqa: E731
            assert torch.autograd.gradcheck(run, (values, b))
            assert torch.autograd.gradgradcheck(run, (values, b))

    def test_sparse_tensors_single_precision_and_half_the_gradients(self):
        torch = self.torch
        import espalier.torch as et
        a, crow, col, data = parts("lu")
        b = torch.ones(12, dtype=torch.float32)
        values = torch.tensor(data, dtype=torch.float32, requires_grad=True)
        csr = torch.sparse_csr_tensor(torch.from_numpy(crow), torch.from_numpy(col), values, (12, 12))
        x = et.solve(csr, b)
        assert x.dtype == torch.float32
        x.sum().backward()
        adjoint = np.linalg.solve(a.toarray().T, np.ones(12))
        row = np.repeat(np.arange(12), np.diff(crow))
        truth = -adjoint[row] * np.linalg.solve(a.toarray(), np.ones(12))[col]
        assert values.grad.numpy() == pytest.approx(truth, rel=1e-4, abs=1e-6)
        coo = csr.detach().to_sparse_coo()
        assert et.solve(coo, b).numpy() == pytest.approx(x.detach().numpy())
        right = b.double().requires_grad_()
        et.solve((torch.from_numpy(crow), torch.from_numpy(col), torch.from_numpy(data)), right).sum().backward()
        assert right.grad.numpy() == pytest.approx(adjoint)

    def test_operator_checks_and_errors(self):
        torch = self.torch
        import espalier.torch as et
        a, crow, col, data = parts("lu")
        crow, col, values = torch.from_numpy(crow), torch.from_numpy(col), torch.from_numpy(data)
        torch.library.opcheck(et._solve, (crow, col, values.requires_grad_(), torch.ones(12, dtype=torch.float64), False))
        for wrong, error in ((torch.ones(5), ValueError), (torch.ones(12, dtype=torch.int64), TypeError),
                             (torch.ones(12, device="meta"), TypeError)):
            with pytest.raises(error):
                et.solve((crow, col, values), wrong)
        with pytest.raises(ArithmeticError):
            et.solve((crow, col, torch.zeros_like(values)), torch.ones(12))

    def test_the_factor_is_used_again_but_never_an_old_one(self):
        torch = self.torch
        import espalier.torch as et
        a, crow, col, data = parts("lu")
        crow, col, values = torch.from_numpy(crow), torch.from_numpy(col), torch.from_numpy(data)
        b = torch.ones(12, dtype=torch.float64)
        x = et.solve((crow, col, values), b)
        values *= 2  # in place
        assert et.solve((crow, col, values), b).numpy() == pytest.approx(x.numpy() / 2)
        et.clear()
        assert et.solve((crow, col, values), b).numpy() == pytest.approx(x.numpy() / 2)


class TestJax:
    @pytest.fixture(autouse=True)
    def x64(self):
        jax = pytest.importorskip("jax")
        jax.config.update("jax_enable_x64", True)
        with jax.default_device(jax.devices("cpu")[0]):  # test_gpu.py has those of a GPU
            yield
        jax.config.update("jax_enable_x64", False)

    @pytest.mark.parametrize("columns", [None, 1, 3])
    def test_derivatives_in_both_modes_to_second_order(self, columns):
        import jax.numpy as jnp
        from jax.test_util import check_grads

        import espalier.jax as ej
        a, indptr, indices, data = parts("lu")
        b = jnp.asarray(np.random.default_rng(0).normal(size=(12,) if columns is None else (12, columns)))
        run = lambda d, r: ej.solve(indptr, indices, d, r)  # noqa: E731
        assert np.asarray(run(data, b)) == pytest.approx(np.linalg.solve(a.toarray(), np.asarray(b)))
        check_grads(run, (jnp.asarray(data), b), order=2, modes=["fwd", "rev"], rtol=1e-4)

    def test_jit_vmap_and_symmetric(self):
        import jax
        import jax.numpy as jnp

        import espalier.jax as ej
        a, indptr, indices, data = parts("llt")
        many = jnp.asarray(np.random.default_rng(1).normal(size=(4, 12)))
        scales = jnp.asarray([1.0, 2, 3, 4])
        run = jax.jit(jax.vmap(lambda s, r: ej.solve(indptr, indices, s * data, r, symmetric=True)))
        truth = np.linalg.solve(a.toarray(), np.asarray(many).T).T / np.asarray(scales)[:, None]
        assert np.asarray(run(scales, many)) == pytest.approx(truth)
        slope = jax.vmap(jax.grad(lambda s, r: ej.solve(indptr, indices, s * data, r, symmetric=True).sum()))
        assert np.asarray(slope(scales, many)) == pytest.approx(-truth.sum(1) / np.asarray(scales))

    def test_xla_calls_the_solver_with_its_own_buffers(self, monkeypatch):
        import jax
        import jax.numpy as jnp

        import espalier.jax as ej
        from espalier._linear import cache as _cache
        a, indptr, indices, data = parts("lu")
        monkeypatch.setattr(ej, "_on_host", lambda *_: 1 / 0)  # what a callback would call
        seen = []
        real = _cache.solve
        monkeypatch.setattr(_cache, "solve", lambda *args, **keys: seen.append((args, keys)) or real(*args, **keys))
        b = np.random.default_rng(5).normal(size=(12, 3))
        run = jax.jit(lambda i, j, d, r: ej.solve(i, j, d, r))
        compiled = run.lower(indptr, indices, data, b).compile()
        assert "espalier_solve" in compiled.as_text() and "callback" not in compiled.as_text()
        truth = np.linalg.solve(a.toarray(), b)
        assert np.asarray(run(indptr, indices, data, b)) == pytest.approx(truth)
        args, keys = seen[-1]
        assert keys["key"] == "" and keys["out"].shape == (12, 3)  # a pattern that was an argument
        assert not any(array.flags.owndata for array in (*args[:4], keys["out"]))
        for integers in (np.int32, np.int64):
            got = ej.solve(indptr.astype(integers), indices.astype(integers), data, b[:, 0])
            assert np.asarray(got) == pytest.approx(truth[:, 0]) and len(seen[-1][1]["key"]) == 48
        single = ej.solve(indptr, indices, data.astype("f4"), b.astype("f4"))
        assert single.dtype == jnp.float32 and np.asarray(single) == pytest.approx(truth, rel=1e-4, abs=1e-5)

    def test_without_the_interface_a_callback_does_it_and_says_so(self, monkeypatch):
        import jax
        import jax.numpy as jnp
        from jax.test_util import check_grads

        import espalier.jax as ej
        a, indptr, indices, data = parts("lu")
        monkeypatch.setattr(ej, "_PLATFORMS", set())
        monkeypatch.setattr(ej, "_told", False)
        b = jnp.asarray(np.random.default_rng(6).normal(size=(12, 2)))
        with pytest.warns(UserWarning, match="jax.ffi"):
            x = ej.solve(indptr, indices, data, b)
        assert np.asarray(x) == pytest.approx(np.linalg.solve(a.toarray(), np.asarray(b)))
        check_grads(jax.jit(lambda d, r: ej.solve(indptr, indices, d, r)), (jnp.asarray(data), b), order=1, modes=["rev"],
                    rtol=1e-4)

    def test_values_that_lose_their_symmetry(self):
        import espalier.jax as ej
        a, indptr, indices, data = parts("llt")
        b = np.arange(12.0)
        assert np.asarray(ej.solve(indptr, indices, data, b)) == pytest.approx(np.linalg.solve(a.toarray(), b))
        a.data[1] += 0.25
        assert np.asarray(ej.solve(indptr, indices, a.data, b)) == pytest.approx(np.linalg.solve(a.toarray(), b))

    def test_many_programs_in_threads(self):
        import jax
        from concurrent.futures import ThreadPoolExecutor

        import espalier.jax as ej

        def one(seed):
            a, indptr, indices, data = parts("lu", 20 + seed)
            b = np.random.default_rng(seed).normal(size=20 + seed)
            run = jax.jit(lambda d, r: ej.solve(indptr, indices, d, r))
            return max(np.abs(a @ np.asarray(run(k * data, b)) * k - b).max() for k in (1.0, 2.0, 3.0))

        with ThreadPoolExecutor(6) as pool:
            assert max(pool.map(one, range(12))) < 1e-9

    def test_errors(self):
        import espalier.jax as ej
        a, indptr, indices, data = parts("lu")
        with pytest.raises(ValueError, match="data of shape"):
            ej.solve(indptr, indices, data[1:], np.ones(12))
        with pytest.raises(ValueError, match="shape"):
            ej.solve(indptr, indices, data, np.ones(5))
        with pytest.raises(TypeError, match="floating"):
            ej.solve(indptr, indices, data.astype("i4"), np.ones(12, "i4"))
        with pytest.raises(Exception, match="SingularMatrixError: .*(singular|depends)"):
            np.asarray(ej.solve(indptr, indices, 0 * data, np.ones(12)))
        with pytest.raises(Exception, match="is nan"):
            np.asarray(ej.solve(indptr, indices, np.nan * data, np.ones(12)))


def test_kept_solvers_are_few():
    from espalier._linear import cache as _cache

    for n in range(5, 25):
        a = sp.eye(n, format="csr") * 2
        assert _cache.solve(a.indptr, a.indices, a.data, np.ones(n), False) == pytest.approx(np.full(n, 0.5))
    assert len(_cache._known) <= _cache._MOST
    _cache.clear()
    assert not _cache._known
