"""Arrays in the memory of a GPU: what DLPack and __cuda_array_interface__ tell of them, and new ones of the same library.

Nothing here copies an array that lies column by column. `copies` counts the others: columns that their own library
rearranges, and what an analysis reads on the host."""

from typing import Any, NamedTuple

from . import _core
from ._errors import DeviceError
from ._version import __version__

copies = 0
_CUDA = (2, 13)  # DLPack's kDLCUDA and kDLCUDAManaged


def on_gpu(a: Any) -> bool:
    """Whether `a` is an array in the memory of an NVIDIA GPU."""
    if type(a).__module__ == "numpy":
        return False
    where = getattr(a, "__dlpack_device__", None)
    if where is not None:
        return int(where()[0]) in _CUDA
    return hasattr(a, "__cuda_array_interface__")


def number_of(a: Any) -> int:
    """The GPU that holds an array, as the CUDA runtime counts; 0 where its library does not tell."""
    where = getattr(a, "__dlpack_device__", None)
    return 0 if where is None else int(where()[1])


def expect_kernels(a: Any) -> None:
    if not _core.has_gpu:
        raise DeviceError(f"an array lies on GPU {number_of(a)}, and this espalier has no GPU kernels:"
                          f" pip install espalier-cuda=={__version__}")


def stream_number(stream: Any) -> int:
    """The cudaStream_t of a number or of a stream of CuPy, torch or numba; 0: the default stream."""
    if stream is None:
        return 0
    if isinstance(stream, int):
        return stream
    if hasattr(stream, "__cuda_stream__"):
        return int(stream.__cuda_stream__()[1])
    for name in ("cuda_stream", "ptr"):  # torch, CuPy
        if hasattr(stream, name):
            return int(getattr(stream, name))
    handle = getattr(stream, "handle", None)  # numba
    if handle is not None:
        return int(getattr(handle, "value", handle) or 0)
    raise TypeError(f"{type(stream).__name__} is no stream: give a number or a stream of CuPy, torch or numba")


class View(NamedTuple):
    """float64 numbers on a GPU. stream: what has to be waited for before they are read or written. kept: what keeps
    them there."""

    address: int
    shape: "tuple[int, ...]"
    strides: "tuple[int, ...]"  # in elements
    stream: int
    kept: Any

    def follows(self, steps: "tuple[int, ...]") -> bool:
        """Whether the elements lie as these strides say."""
        return 0 in self.shape or all(s == t for n, s, t in zip(self.shape, self.strides, steps) if n > 1)

    @property
    def by_columns(self) -> bool:
        return self.follows((1, self.shape[0])[:len(self.shape)])

    @property
    def by_rows(self) -> bool:
        return self.follows((self.shape[-1], 1)[-len(self.shape):])


def view(a: Any, what: str, stream: Any, writable: bool = False) -> View:
    """@raises TypeError for numbers other than float64, ValueError for other than one or two dimensions"""
    number = stream_number(stream)
    if hasattr(a, "__dlpack__"):
        # 1: the default stream. The library makes it wait for what it has begun itself.
        kept = _core.Exported(a.__dlpack__(stream=number or 1))
        address, dtype, shape, strides = kept.address, kept.dtype, kept.shape, kept.strides
    else:
        kept, told = a, a.__cuda_array_interface__
        address, fixed = told["data"]
        if writable and fixed:
            raise ValueError(f"{what} is read-only")
        own = told.get("stream")
        if own and number and own != number:
            raise ValueError(f"{what} was written on stream {own}, and stream={number} was given: give the same")
        number = own or number
        dtype, shape = told["typestr"].lstrip("<=|"), tuple(told["shape"])
        strides = told.get("strides")
        if strides is None:
            strides = tuple(_product(shape[k + 1:]) for k in range(len(shape)))
        else:
            strides = tuple(s // 8 for s in strides)
    if dtype != "f8":
        raise TypeError(f"{what} is of {dtype} and lies on a GPU; there it must be float64")
    if len(shape) not in (1, 2):
        raise ValueError(f"{what} has shape {tuple(shape)}")
    return View(address, tuple(shape), tuple(strides), number, kept)


def _product(numbers: "tuple[int, ...]") -> int:
    result = 1
    for n in numbers:
        result *= n
    return result


def _library(a: Any) -> str:
    root = type(a).__module__.partition(".")[0]
    return {"jaxlib": "jax", "numba_cuda": "numba"}.get(root, root)


def columns(a: Any, what: str, stream: Any) -> View:
    """Its memory, column by column: its own where it lies so, else that of a copy that its library makes."""
    global copies
    v = view(a, what, stream)
    if v.by_columns:
        return v
    library = _library(a)
    if library == "torch":
        a = a.contiguous() if a.ndim == 1 else a.T.contiguous().T
    elif library == "cupy":
        import cupy  # type: ignore[import-not-found]

        a = cupy.asfortranarray(a)
    elif library == "jax":
        a = a.T  # a copy: JAX has no strides
    else:
        raise ValueError(f"{what} has strides {v.strides} (elements) for shape {v.shape}; on a GPU columns must lie one after"
                         " the other (Fortran order)")
    copies += 1
    moved = view(a, what, stream)
    assert moved.by_rows if library == "jax" else moved.by_columns
    return moved


def answer_like(b: Any, out: Any, shape: "tuple[int, ...]", stream: Any) -> "tuple[View, Any]":
    """Memory for a solution, column by column, and a function without arguments that gives the caller's array over it."""
    library = _library(b if out is None else out)
    if out is not None:
        if library == "jax":
            raise TypeError("out is an array of JAX, which nobody may write to")
        v = view(out, "out", stream, writable=True)
        if v.shape != shape or not v.by_columns:
            raise ValueError(f"out has shape {v.shape} and strides {v.strides} (elements); it must have shape {shape}, column"
                             " by column")
        return v, lambda: out
    new: Any
    turned = shape[::-1]
    if library == "torch":
        import torch

        new = torch.empty(turned, dtype=torch.float64, device=b.device)
    elif library == "cupy":
        import cupy

        with b.device:
            new = cupy.empty(turned, dtype="float64")
    elif library == "jax":
        import jax.numpy as jnp

        new = jnp.empty(turned, dtype="float64", device=b.device)  # a buffer of its own, which nobody else has seen
    elif library == "numba":
        from numba import cuda  # type: ignore[import-not-found]

        new = cuda.device_array(shape, dtype="float64", order="F")
        return view(new, "x", stream), lambda: new
    else:
        raise TypeError(f"espalier cannot make arrays of {type(b).__module__}.{type(b).__qualname__}: give out=")
    return view(new, "x", stream), lambda: new if len(shape) == 1 else new.T


def to_host(a: Any) -> Any:
    """As an array of NumPy."""
    import numpy as np

    global copies
    if not on_gpu(a):
        return a
    copies += 1
    library = _library(a)
    if library == "torch":
        return a.detach().cpu().numpy()
    if library == "cupy":
        return a.get()
    if library == "numba":
        return a.copy_to_host()
    return np.asarray(a)


def is_sparse_tensor(a: Any) -> bool:
    """Whether `a` is a sparse tensor of torch."""
    return type(a).__module__ == "torch" and "sparse" in str(a.layout)


def parts(a: Any) -> "tuple[Any, Any]":
    """A matrix with the arrays of its pattern on the host, and its values on a GPU; None where they do not lie there."""
    library = _library(a)
    if is_sparse_tensor(a):
        import torch

        if a.layout != torch.sparse_csr:
            a = a.to_sparse_csr()
        a = a.crow_indices(), a.col_indices(), a.values()
    elif library == "cupyx":
        if a.format not in ("csr", "csc"):
            a = a.tocsr()
        expect_kernels(a.data)
        return a.get(), a.data
    if isinstance(a, tuple) and len(a) == 3 and a[2] is not None and on_gpu(a[2]):
        expect_kernels(a[2])
        return (to_host(a[0]), to_host(a[1]), to_host(a[2])), a[2]
    return a, None
