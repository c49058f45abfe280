"""Sparse solves in JAX, with derivatives in both modes, inside jit, grad, vmap and scan:
x = espalier.jax.solve(indptr, indices, data, b).

XLA calls the solver by its foreign function interface, with the buffers as they lie: on the CPU, and with espalier-cuda
on an NVIDIA GPU. Elsewhere, and with a JAX that has no jax.ffi (before 0.4.38), the solve is a callback to the host
(jax.pure_callback), which copies; a warning says so once. jax.lax.custom_linear_solve makes derivatives of it: of data
and b, to any order. Enable jax_enable_x64: without it the answer is a float32 of a solve in float64.
"""

import warnings
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from . import _core
from ._linear import cache as _cache

clear = _cache.clear


def _driver() -> Any:
    from ctypes import CDLL

    return CDLL("libcuda.so.1")


def _present_gpu() -> int:
    """The GPU of the thread's context, which is XLA's."""
    from ctypes import byref, c_int

    number = c_int(0)
    _driver().cuCtxGetDevice(byref(number))
    return number.value


class _OnGpu:
    """A buffer of XLA in the memory of a GPU, for the time of a call."""

    def __init__(self, address: int, shape: "tuple[int, ...]", kind: str, stream: int) -> None:
        self.shape, self.stream, self.kind, self.address = shape, stream, kind, address
        self.ndim = len(shape)
        self.__cuda_array_interface__ = {"version": 3, "data": (address, False), "shape": shape, "typestr": kind,
                                         "strides": None, "stream": stream or 1}

    @property
    def T(self) -> "_OnGpu":  # noqa: N802 (as arrays have it)
        turned = _OnGpu(self.address, self.shape[::-1], self.kind, self.stream)
        steps = [8]
        for n in turned.shape[:-1]:
            steps.append(steps[-1] * n)
        turned.__cuda_array_interface__["strides"] = tuple(steps)
        return turned

    def on_host(self) -> Any:
        """A copy of NumPy's, by NVIDIA's driver: it is there, and it knows the context that XLA works in."""
        from ctypes import c_size_t, c_uint64, c_void_p

        host = np.empty(self.shape, np.dtype(self.kind))
        driver = _driver()
        for code in (driver.cuMemcpyDtoHAsync_v2(c_void_p(host.ctypes.data), c_uint64(self.address),
                                                 c_size_t(host.nbytes), c_void_p(self.stream)),
                     driver.cuStreamSynchronize(c_void_p(self.stream))):
            if code:
                raise RuntimeError(f"a copy from the GPU failed: error {code} of the CUDA driver")
        return host


def _called(attributes: "dict[str, Any]", stream: "int | None", arguments: "list[Any]", results: "list[Any]") -> None:
    """What XLA calls: results[0] becomes the solution. Arrays of NumPy over XLA's buffers, or (address, shape, type) on a
    GPU; columns of right-hand sides are rows there."""
    transpose = bool(attributes["transpose"])
    if stream is None:
        indptr, indices, data, b = arguments
        x = results[0]
        if x.dtype == np.float64:
            _cache.solve(indptr, indices, data, b.T, transpose, key=attributes["pattern"], out=x.T)
        else:
            x.T[...] = _cache.solve(indptr, indices, data, b.T, transpose, key=attributes["pattern"])
        return
    indptr, indices, data, b = (_OnGpu(*a, stream) for a in arguments)
    values: Any = None

    def on_host() -> Any:
        nonlocal values
        values = data.on_host() if values is None else values
        return values

    key = attributes["pattern"] or _cache.key_of(indptr.on_host(), indices.on_host())
    _cache.solve_on_gpu(key, lambda: (indptr.on_host(), indices.on_host()), data, on_host,
                        lambda v: np.array_equal(v, on_host()), on_host, b.T, transpose, device=f"gpu:{_present_gpu()}",
                        symmetric=bool(attributes["symmetric"]), out=_OnGpu(*results[0], stream).T)


def _register() -> "set[str]":
    """Platforms, as jax.lax.platform_dependent calls them, whose programs call the solver without a callback."""
    if not hasattr(getattr(jax, "ffi", None), "register_ffi_target"):
        return set()
    handlers = _core.xla_handlers(_called)
    done = set()
    for platform, name in (("cpu", "cpu"), ("CUDA", "cuda")):
        if platform == "cpu" or _core.has_gpu:
            jax.ffi.register_ffi_target("espalier_solve", handlers[platform], platform=platform)
            done.add(name)
    return done


_PLATFORMS = _register()
_told = False


def _tell() -> None:
    global _told
    if not _told:
        _told = True
        warnings.warn(f"jax {jax.__version__} has no jax.ffi: espalier.jax solves in callbacks to the host, which copies; jax 0.4.38 or"
                      " later needs none", stacklevel=3)


def _on_host(transpose: bool, indptr: Any, indices: Any, data: Any, b: Any) -> Any:
    b = np.asarray(b)
    x = _cache.solve(np.asarray(indptr), np.asarray(indices), np.asarray(data), b, transpose)
    return np.ascontiguousarray(x, b.dtype)


def _by_callback(transpose: bool, indptr: Any, indices: Any, data: Any, b: Any) -> Any:
    return jax.pure_callback(partial(_on_host, transpose), jax.ShapeDtypeStruct(b.shape, b.dtype), indptr, indices, data, b,
                             vmap_method="sequential")


def _by_call(attributes: "dict[str, Any]", indptr: Any, indices: Any, data: Any, b: Any) -> Any:
    call = jax.ffi.ffi_call("espalier_solve", jax.ShapeDtypeStruct(b.T.shape, b.dtype), vmap_method="sequential")
    return call(indptr, indices, data, b.T, **attributes).T


def _key(indptr: Any, indices: Any) -> str:
    """Of a pattern that is known when the program is made, else nothing: then the handler reads it at every call."""
    if isinstance(indptr, jax.core.Tracer) or isinstance(indices, jax.core.Tracer):
        return ""
    return _cache.key_of(np.asarray(indptr), np.asarray(indices))


def solve(indptr: Any, indices: Any, data: Any, b: Any, *, symmetric: bool = False) -> Any:
    """x with A x = b, A by compressed rows; b: (n,) or (n, k), floating. Derivatives go to data and b.

    symmetric: A is, and data is seen as such by derivatives in reverse mode (the transposed system is not asked for); on
    a GPU its upper triangle is then not read, and L D L^T is computed instead of L U."""
    if not _PLATFORMS:
        _tell()
    key = _key(indptr, indices)
    indptr, indices = jnp.asarray(indptr), jnp.asarray(indices)
    data, b = jnp.asarray(data), jnp.asarray(b)
    dtype = jnp.promote_types(data.dtype, b.dtype)
    if not jnp.issubdtype(dtype, jnp.floating):
        raise TypeError(f"data has dtype {data.dtype} and b {b.dtype}; they must be real, at least one of them floating")
    n = len(indptr) - 1
    if b.ndim not in (1, 2) or b.shape[0] != n:
        raise ValueError(f"b has shape {b.shape}; the matrix has {n} rows")
    if data.shape != indices.shape:
        raise ValueError(f"data of shape {data.shape} for {indices.shape[0]} indices")
    data, b = data.astype(dtype), b.astype(dtype)
    rows = jnp.repeat(jnp.arange(n), jnp.diff(indptr), total_repeat_length=len(indices))

    def matvec(x: Any) -> Any:
        products = data.reshape(-1, *[1] * (x.ndim - 1)) * x[indices]
        return jnp.zeros_like(x).at[rows].add(products)

    def inverse(transpose: bool, _: Any, rhs: Any) -> Any:
        given = indptr, indices, jax.lax.stop_gradient(data), rhs
        callback = partial(_by_callback, transpose)
        calls = _PLATFORMS if dtype == jnp.float64 else _PLATFORMS - {"cuda"}
        if dtype not in (jnp.float64, jnp.float32) or not calls:
            return callback(*given)
        call = partial(_by_call, {"pattern": key, "transpose": np.int64(transpose), "symmetric": np.int64(symmetric)})
        return jax.lax.platform_dependent(*given, default=callback, **{platform: call for platform in sorted(calls)})

    return jax.lax.custom_linear_solve(matvec, b, partial(inverse, False), partial(inverse, True), symmetric=symmetric)


def _host_slogdet(indptr: Any, indices: Any, data: Any) -> Any:
    data = np.asarray(data)
    found = _cache.slogdet(np.asarray(indptr), np.asarray(indices), data)
    return tuple(np.asarray(v, data.dtype) for v in found)


def _host_slogdet_gradient(indptr: Any, indices: Any, data: Any) -> Any:
    data = np.asarray(data)
    return _cache.slogdet_gradient(np.asarray(indptr), np.asarray(indices), data).astype(data.dtype)


@jax.custom_jvp
def _slogdet(indptr: Any, indices: Any, data: Any) -> Any:
    number = jax.ShapeDtypeStruct((), data.dtype)
    return jax.pure_callback(_host_slogdet, (number, number), indptr, indices, data, vmap_method="sequential")


@_slogdet.defjvp
def _(primals: Any, tangents: Any) -> Any:
    indptr, indices, data = primals
    gradient = jax.pure_callback(_host_slogdet_gradient, jax.ShapeDtypeStruct(data.shape, data.dtype), indptr, indices,
                                 data, vmap_method="sequential")
    sign, logarithm = _slogdet(indptr, indices, data)
    return (sign, logarithm), (jnp.zeros_like(sign), jnp.vdot(gradient, tangents[2]))


def slogdet(indptr: Any, indices: Any, data: Any) -> "tuple[Any, Any]":
    """Sign and logarithm of |det A|, A by compressed rows, as jax.numpy.linalg.slogdet; a callback to the host. The derivative of the
    logarithm by data, in both modes, is A^-T on the pattern (Solver.selected_inverse), by the factor that is there. It cannot be
    differentiated again (JAX says so of the callback)."""
    indptr, indices, data = jnp.asarray(indptr), jnp.asarray(indices), jnp.asarray(data)
    if not jnp.issubdtype(data.dtype, jnp.floating):
        raise TypeError(f"data has dtype {data.dtype}; it must be real and floating")
    if data.shape != indices.shape:
        raise ValueError(f"data of shape {data.shape} for {indices.shape[0]} indices")
    return _slogdet(indptr, indices, data)
