"""Arrays on a GPU, played by libraries whose memory is the host's: what is read where, and on which stream. Truth: the
same solver with arrays of NumPy. test_gpu.py has the tests with a GPU."""

import ctypes
import sys
import types
import warnings

import numpy as np
import pytest

import espalier as esp
from espalier import _core, _device
from test_solver import check, matrix


class Cupy:
    """An array as CuPy has them: DLPack says that it lies on GPU 0."""

    def __init__(self, data):
        self.data, self.streams = data, []

    shape = property(lambda self: self.data.shape)
    ndim = property(lambda self: self.data.ndim)
    T = property(lambda self: Cupy(self.data.T))
    device = property(lambda self: warnings.catch_warnings())  # any context manager

    def __len__(self):
        return len(self.data)

    def __dlpack_device__(self):
        return 2, 0

    def __dlpack__(self, stream=None):
        self.streams.append(stream)
        return self.data.__dlpack__()

    def get(self):
        return self.data


Cupy.__module__ = "cupy"


class Numba:
    """An array as numba has them, with __cuda_array_interface__ alone."""

    def __init__(self, data, stream=None, read_only=False):
        self.data, self.stream, self.read_only = data, stream, read_only

    shape = property(lambda self: self.data.shape)
    ndim = property(lambda self: self.data.ndim)

    @property
    def __cuda_array_interface__(self):
        strides = None if self.data.flags.c_contiguous else self.data.strides
        return {"shape": self.data.shape, "typestr": self.data.dtype.str, "strides": strides, "version": 3,
                "data": (self.data.ctypes.data, self.read_only), "stream": self.stream}


class GpuCore:
    """The C++ solver, whose GPU is the host."""

    def __init__(self, core):
        self.core, self.calls = core, []

    def __getattr__(self, name):
        return getattr(self.core, name)

    @staticmethod
    def at(address, *shape):
        numbers = (ctypes.c_double * int(np.prod(shape))).from_address(address)
        return np.frombuffer(numbers).reshape(shape)

    def refactorize_device(self, values, count, stream, n):
        self.calls.append((values, stream))
        return self.core.refactorize(self.at(values, count), n)

    def solve_device(self, b, x, columns, transpose, stream):
        self.calls.append((b, x, stream))
        n = self.n
        return self.core.solve(self.at(b, columns, n), self.at(x, columns, n), columns, transpose)


@pytest.fixture
def cupy(monkeypatch):
    module = types.ModuleType("cupy")
    module.empty = lambda shape, dtype: Cupy(np.empty(shape, dtype))
    module.asfortranarray = lambda a: Cupy(np.asfortranarray(a.data))
    monkeypatch.setitem(sys.modules, "cupy", module)
    monkeypatch.setattr(_core, "has_gpu", True)
    monkeypatch.setattr(_device, "copies", 0)


def on_gpu(a):
    solver = esp.Solver(device="cpu")
    solver.analyze(a)
    solver._core = GpuCore(solver._core)
    solver._core.n = a.shape[0]
    return solver


@pytest.mark.skipif(_core.has_gpu, reason="this build has GPU kernels")
@pytest.mark.parametrize("make", [Cupy, Numba])
def test_a_build_without_kernels_says_what_to_install(make):
    a = matrix(20, "lu")
    solver = esp.Solver(a)
    for call in (lambda: solver.factorize(make(a.data)), lambda: solver.solve(make(np.ones(20))),
                 lambda: esp.Solver((a.indptr, a.indices, make(a.data))), lambda: esp.solve(a, make(np.ones(20)))):
        with pytest.raises(esp.DeviceError, match=f"GPU 0.*pip install espalier-cuda=={esp.__version__}"):
            call()
    check(a, solver.solve(np.ones(20)), np.ones(20))  # the factor is still there


@pytest.mark.parametrize("kind", ["llt", "ldlt", "lu"])
def test_values_and_vectors_are_read_where_they_lie(cupy, kind):
    a, b = matrix(50, kind), np.arange(50.0)
    solver = on_gpu(a)
    values, right = Cupy(2 * a.data), Cupy(b)
    assert solver.factorize(values).rank == 50
    x = solver.solve(right)
    assert type(x) is Cupy and x.shape == (50,) and _device.copies == 0
    check(2 * a, x.data, b)
    assert solver._core.calls == [(values.data.ctypes.data, 0), (b.ctypes.data, x.data.ctypes.data, 0)]
    assert values.streams == [1] and right.streams == [1]  # the default stream waits for CuPy's
    check(2 * a.T, solver.solve(right, transpose=True).data, b)
    out = Cupy(np.empty(50))
    assert solver.solve(right, out=out) is out
    assert (out.data == x.data).all()


def test_a_factor_that_lies_elsewhere_is_told(cupy):
    a = matrix(20, "lu")
    solver = esp.Solver(a, device="cpu")
    for call in (lambda: solver.solve(Cupy(np.ones(20))), lambda: solver.factorize(Cupy(a.data))):  # the C++ code itself
        with pytest.raises(esp.DeviceError, match=r"not in the memory of a GPU.*Solver\(device='gpu:0'\)"):
            call()


def test_columns_in_both_orders(cupy):
    a = matrix(40, "lu")
    solver = on_gpu(a)
    solver.factorize(Cupy(a.data))
    b = np.random.default_rng(0).normal(size=(40, 3))
    for array, copies in ((np.asfortranarray(b), 0), (b, 1), (b[:, :1], 1), (b[:, :0], 0), (b[::2].copy()[:, :0], None)):
        if copies is None:
            with pytest.raises(ValueError, match="40 rows"):
                solver.solve(Cupy(array))
            continue
        _device.copies = 0
        x = solver.solve(Cupy(array))
        assert x.shape == array.shape and _device.copies == copies
        if array.size:
            check(a, x.data, array)
    out = Cupy(np.empty((40, 3)))
    with pytest.raises(ValueError, match="column by column"):
        solver.solve(Cupy(b), out=out)
    every_second = Cupy(np.arange(80.0)[::2])
    check(a, solver.solve(every_second).data, every_second.data)


def test_arrays_of_the_cuda_interface(cupy):
    a = matrix(40, "lu")
    solver = on_gpu(a)
    solver.factorize(Numba(a.data, stream=7))
    b, out = np.ones((40, 2), order="F"), Numba(np.empty((40, 2), order="F"))
    assert solver.solve(Numba(b), out=out, stream=9) is out
    check(a, out.data, b)
    assert solver._core.calls == [(a.data.ctypes.data, 7), (b.ctypes.data, out.data.ctypes.data, 9)]
    with pytest.raises(TypeError, match="give out="):
        solver.solve(Numba(b))
    with pytest.raises(ValueError, match="read-only"):
        solver.solve(Numba(b), out=Numba(b, read_only=True))
    with pytest.raises(ValueError, match="stream 7"):
        solver.solve(Numba(b, stream=7), out=out, stream=9)
    with pytest.raises(ValueError, match="Fortran order"):
        solver.solve(Numba(np.ones((40, 2))), out=out)
    with pytest.raises(TypeError, match="float64"):
        solver.factorize(Numba(a.data.astype("f4")))


def test_streams_of_all_libraries(cupy):
    class Torch:
        cuda_stream = 11

    class CupyStream:
        ptr = 12

    class NumbaStream:
        handle = ctypes.c_void_p(13)

    class Protocol:
        def __cuda_stream__(self):
            return 0, 14

    a = matrix(20, "lu")
    solver = on_gpu(a)
    for stream, number in ((None, 0), (5, 5), (Torch, 11), (CupyStream, 12), (NumbaStream, 13), (Protocol(), 14)):
        values = Cupy(a.data)
        solver.factorize(values, stream=stream)
        assert solver._core.calls[-1][1] == number and values.streams == [number or 1]
    with pytest.raises(TypeError, match="no stream"):
        solver.factorize(Cupy(a.data), stream="default")


def test_wrong_arrays_leave_the_factor(cupy):
    a = matrix(20, "lu")
    solver = on_gpu(a)
    solver.factorize(Cupy(a.data))
    for wrong, error in ((Cupy(a.data.astype("f4")), TypeError), (Cupy(np.ones((3, 3))), ValueError),
                         (Cupy(np.ones(7)), ValueError)):
        with pytest.raises(error):
            solver.factorize(wrong)
        assert solver.factor is not None
    with pytest.raises(ValueError, match="matrix has 20 rows"):
        solver.solve(Cupy(np.ones(7)))
    with pytest.raises(esp.SingularMatrixError):
        solver.factorize(Cupy(0 * a.data))


def test_a_matrix_whose_values_lie_on_a_gpu(cupy):
    a = matrix(30, "lu")
    solver = on_gpu(a)
    triple = (Cupy(a.indptr), Cupy(a.indices), Cupy(a.data))
    solver.factorize(triple)
    assert len(solver._core.calls) == 1 and _device.copies == 3  # the analysis reads it on the host
    analysis = solver.analysis
    solver.factorize((a.indptr, a.indices, Cupy(2 * a.data)))
    assert solver.analysis is analysis
    check(2 * a, solver.solve(Cupy(np.ones(30))).data, np.ones(30))
    other = matrix(30, "lu", seed=5)
    solver.factorize((other.indptr, other.indices, Cupy(other.data)))
    assert solver.analysis is not analysis
    check(other, solver.solve(Cupy(np.ones(30))).data, np.ones(30))


class TestLibraries:
    """Arrays of the real libraries, on the host, that say they were on GPU 0."""

    @pytest.fixture
    def torch(self, monkeypatch, cupy):
        torch = pytest.importorskip("torch")
        export = torch.Tensor.__dlpack__
        monkeypatch.setattr(torch.Tensor, "__dlpack_device__", lambda self: (2, 0))
        monkeypatch.setattr(torch.Tensor, "__dlpack__", lambda self, stream=None: export(self))
        return torch

    @pytest.fixture
    def jax(self, monkeypatch, cupy):
        jax = pytest.importorskip("jax")
        jax.config.update("jax_enable_x64", True)
        kind = type(jax.numpy.ones(1))
        export = kind.__dlpack__
        monkeypatch.setattr(kind, "__dlpack_device__", lambda self: (2, 0))
        monkeypatch.setattr(kind, "__dlpack__", lambda self, stream=None, **_: export(self))
        with jax.default_device(jax.devices("cpu")[0]):  # also where JAX has a GPU: the false one reads the host's memory
            yield jax
        jax.config.update("jax_enable_x64", False)

    def test_torch(self, torch):
        a = matrix(40, "lu")
        b = np.random.default_rng(0).normal(size=(40, 3))
        solver = on_gpu(a)
        solver.factorize(torch.from_numpy(2 * a.data))
        x = solver.solve(torch.from_numpy(b[:, 0].copy()))
        assert type(x) is torch.Tensor and _device.copies == 0
        check(2 * a, x.numpy(), b[:, 0])
        columns = torch.from_numpy(np.asfortranarray(b))
        x = solver.solve(columns)
        assert x.shape == (40, 3) and _device.copies == 0
        check(2 * a, x.numpy(), b)
        out = torch.empty(3, 40, dtype=torch.float64).T
        assert solver.solve(columns, out=out) is out and (out == x).all()
        check(2 * a, solver.solve(torch.from_numpy(b)).numpy(), b)
        assert _device.copies == 1
        csr = torch.sparse_csr_tensor(torch.from_numpy(a.indptr), torch.from_numpy(a.indices), torch.from_numpy(a.data), a.shape)
        for tensor in (csr, csr.to_sparse_coo()):
            assert solver.factorize(tensor).rank == 40
            check(a, solver.solve(columns).numpy(), b)
        with pytest.raises(TypeError, match="float64"):
            solver.solve(columns.float())

    def test_sparse_tensors_of_the_host(self):
        torch = pytest.importorskip("torch")
        a = matrix(40, "lu")
        csr = torch.sparse_csr_tensor(torch.from_numpy(a.indptr), torch.from_numpy(a.indices), torch.from_numpy(a.data), a.shape)
        check(a, esp.solve(csr, np.ones(40)), np.ones(40))

    def test_jax(self, jax):
        a = matrix(40, "lu")
        b = np.random.default_rng(0).normal(size=(40, 3))
        solver = on_gpu(a)
        solver.factorize(jax.numpy.asarray(2 * a.data))
        for right in (b[:, 0], b, b[:, :1]):
            given = jax.numpy.asarray(right)
            x = solver.solve(given)
            assert isinstance(x, jax.Array) and x.shape == right.shape
            check(2 * a, np.asarray(x), right)
            assert (np.asarray(given) == right).all()
        with pytest.raises(TypeError, match="JAX"):
            solver.solve(given, out=given)
