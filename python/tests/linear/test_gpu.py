"""Arrays on a GPU, of every library that is there. Truth: the residual, with the arrays on the host."""

import os

import numpy as np
import pytest
import scipy.sparse as sp

import espalier as esp
from espalier import _core, _device
from test_solver import check

if not _core.has_gpu:
    pytest.skip("this espalier has no GPU kernels", allow_module_level=True)
if not os.path.exists("/dev/nvidiactl"):
    pytest.skip("there is no NVIDIA GPU", allow_module_level=True)


def torch_arrays():
    torch = pytest.importorskip("torch")
    if not torch.cuda.is_available():
        pytest.skip("torch sees no GPU")
    return (lambda a: torch.as_tensor(a, device="cuda")), lambda a: a.cpu().numpy()


def cupy_arrays():
    cupy = pytest.importorskip("cupy")
    return (lambda a: cupy.asarray(a, order="F")), cupy.asnumpy


def jax_arrays():
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    if jax.default_backend() != "gpu":
        pytest.skip("JAX sees no GPU")
    return jax.numpy.asarray, np.asarray


def numba_arrays():
    cuda = pytest.importorskip("numba.cuda")
    if not cuda.is_available():
        pytest.skip("numba sees no GPU")
    return (lambda a: cuda.to_device(np.asfortranarray(a))), lambda a: a.copy_to_host()


@pytest.fixture(params=[torch_arrays, cupy_arrays, jax_arrays, numba_arrays], ids=lambda f: f.__name__)
def library(request):
    return request.param()


def system(kind, n=40):
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
    a = (sp.kron(line, sp.eye_array(n)) + sp.kron(sp.eye_array(n), line)).tocsr()
    if kind == "lu":
        a.data[a.indices > np.repeat(np.arange(n * n), np.diff(a.indptr))] *= 0.5
    if kind == "ldlt":
        a = (a - 3 * sp.eye_array(n * n)).tocsr()
    return a


@pytest.mark.parametrize("kind", ["llt", "ldlt", "lu"])
def test_values_vectors_and_columns(library, kind):
    to_gpu, to_host = library
    a = system(kind)
    n = a.shape[0]
    b = np.random.default_rng(0).normal(size=(n, 3))
    solver = esp.Solver(device="gpu:0")
    solver.analyze(a)
    values, right = to_gpu(2 * a.data), to_gpu(b[:, 0].copy())
    _device.copies = 0
    solver.factorize(values)
    x = solver.solve(right)
    assert type(x) is type(right) and _device.copies == 0
    check(2 * a, to_host(x), b[:, 0])
    check(2 * a.T, to_host(solver.solve(right, transpose=True)), b[:, 0])
    many = to_gpu(b)
    y = solver.solve(many)
    assert type(y) is type(many) and y.shape == (n, 3)
    check(2 * a, to_host(y), b)
    check(2 * a, solver.solve(b), b)  # the host's arrays, with the same factor
    solver.factorize(to_gpu(a.data))
    check(a, to_host(solver.solve(right)), b[:, 0])


def test_a_matrix_on_the_gpu_chooses_it(library):
    to_gpu, to_host = library
    a = system("lu")
    solver = esp.Solver((a.indptr, a.indices, to_gpu(a.data)))
    assert solver._core.gpu() == 0
    b = np.ones(a.shape[0])
    check(a, to_host(solver.solve(to_gpu(b))), b)


def test_matrices_of_cupy_and_torch():
    a, b = system("lu"), np.ones(1600)
    done = []
    try:
        import cupyx.scipy.sparse as cusp

        m = cusp.csr_matrix(sp.csr_matrix(a))
        check(a, esp.solve(m, m.data[:1].repeat(1600) * 0 + 1).get(), b)
        done.append("cupy")
    except ImportError:
        pass
    try:
        import torch

        if torch.cuda.is_available():
            m = torch.sparse_csr_tensor(torch.as_tensor(a.indptr), torch.as_tensor(a.indices), torch.as_tensor(a.data)).cuda()
            check(a, esp.solve(m, torch.ones(1600, dtype=torch.float64, device="cuda")).cpu().numpy(), b)
            done.append("torch")
    except ImportError:
        pass
    if not done:
        pytest.skip("neither CuPy nor torch with a GPU is here")


def test_a_factor_on_the_host_is_told(library):
    to_gpu, _ = library
    solver = esp.Solver(system("lu"), device="cpu")
    with pytest.raises(esp.DeviceError, match="not in the memory of a GPU"):
        solver.solve(to_gpu(np.ones(1600)))


def test_gradients_of_torch_on_the_gpu():
    torch = pytest.importorskip("torch")
    if not torch.cuda.is_available():
        pytest.skip("torch sees no GPU")
    import espalier.torch as et

    a = system("lu", 4)
    crow, col = torch.as_tensor(a.indptr).long(), torch.as_tensor(a.indices).long()
    values = torch.as_tensor(a.data, device="cuda").requires_grad_()
    for shape in ((16,), (16, 3)):
        b = torch.randn(*shape, dtype=torch.float64, device="cuda").requires_grad_()
        for pattern in ((crow, col), (crow.cuda(), col.cuda())):
            x = et.solve((*pattern, values), b)
            assert x.is_cuda
            check(a, x.detach().cpu().numpy(), b.detach().cpu().numpy())
            assert torch.autograd.gradcheck(lambda v, r: et.solve((*pattern, v), r), (values, b))
    changed = (2 * values).detach()
    check(2 * a, et.solve((crow, col, changed), b.detach()).cpu().numpy(), b.detach().cpu().numpy())
    with pytest.raises(ArithmeticError):
        et.solve((crow, col, torch.zeros_like(changed)), b.detach())
    et.clear()


@pytest.fixture
def jax_on_gpu():
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    if jax.default_backend() != "gpu":
        pytest.skip("JAX sees no GPU")
    return jax


@pytest.mark.parametrize("symmetric", [False, True])
def test_xla_on_the_gpu(jax_on_gpu, monkeypatch, symmetric):
    jax = jax_on_gpu
    from jax.test_util import check_grads

    import espalier.jax as ej

    monkeypatch.setattr(ej, "_on_host", lambda *_: 1 / 0)  # what a callback would call
    a = system("ldlt" if symmetric else "lu", 6)
    run = jax.jit(lambda d, r: ej.solve(a.indptr, a.indices, d, r, symmetric=symmetric))
    for shape in ((36,), (36, 3)):
        b = jax.numpy.asarray(np.random.default_rng(1).normal(size=shape))
        x = run(a.data, b)
        assert next(iter(x.devices())).platform == "gpu"
        check(a, np.asarray(x), np.asarray(b))
        check(2 * a, np.asarray(run(2 * a.data, b)), np.asarray(b))
        if not symmetric:
            check_grads(run, (jax.numpy.asarray(a.data), b), order=2, modes=["fwd", "rev"], rtol=1e-4)
    # The pattern as an argument, and one system after another.
    traced = jax.jit(lambda i, j, d, r: ej.solve(i, j, d, r, symmetric=symmetric))
    check(a, np.asarray(traced(a.indptr, a.indices, a.data, b)), np.asarray(b))
    many = jax.vmap(lambda s, r: ej.solve(a.indptr, a.indices, s * a.data, r, symmetric=symmetric))
    scales = np.array([1.0, 2, 4])
    right = np.random.default_rng(2).normal(size=(3, 36))
    for scale, x, r in zip(scales, np.asarray(many(scales, right)), right):
        check(scale * a, x, r)
    with pytest.raises(Exception, match="SingularMatrixError"):
        np.asarray(run(0 * a.data, b))
    ej.clear()
