"""Matrices and right-hand sides as the extension module takes them."""

from typing import Any

_STORAGE = {"auto": 0, "general": 0, "lower": 1, "upper": 2, "symmetric": 3, "hermitian_lower": 4, "hermitian_upper": 5,
            "hermitian": 6}
SYMMETRIES = tuple(_STORAGE)  # "auto" and "general" are both stored as 0


def _numbers(a: Any, what: str, complex_too: bool = False) -> Any:
    """`a` as float64, or complex128 where it is complex, without a copy where it is that already."""
    import numpy as np

    if type(a) is not np.ndarray:
        a = _plain(a, what)
    if not a.flags.aligned:
        a = a.copy()
    if complex_too and a.dtype.kind == "c" and a.dtype.itemsize <= 16:
        return a.astype(np.complex128, copy=False)
    if a.dtype.kind not in "fiub" or a.dtype.itemsize > 8:
        raise TypeError(f"{what}: numbers of dtype {a.dtype}; espalier computes in float64 and takes real numbers of 64 bits"
                        " or fewer" + ("; no complex ones here" if a.dtype.kind == "c" else ", and complex ones of 128"))
    return a.astype(np.float64, copy=False)


def _floats(a: Any) -> Any:
    """Complex numbers as pairs of float64, for _core; None and others as they are."""
    return a.view("float64") if a is not None and a.dtype.kind == "c" else a


def _plain(a: Any, what: str) -> Any:
    """As an array of NumPy's own class."""
    import numpy as np

    if isinstance(a, np.ma.MaskedArray):
        raise TypeError(f"{what}: a masked array, and nobody knows what stands behind the mask: give its .filled(...)")
    if hasattr(a, "toarray"):
        raise TypeError(f"{what}: a sparse array; it must be dense: give its .toarray()")
    given, a = a, np.asarray(a)
    if a.dtype.kind == "O":
        raise TypeError(f"{what}: {type(given).__name__} is no array of numbers")
    return a


def _indices(a: Any, what: str, most: int, dtype: str) -> Any:
    import numpy as np

    a = np.asarray(a)
    if a.ndim != 1 or (a.dtype.kind not in "iu" and a.size > 0):
        raise TypeError(f"{what} must be a vector of integers, not {a.ndim}-D {a.dtype}")
    if a.size > 0 and (int(a.min()) < 0 or int(a.max()) > most):
        raise ValueError(f"{what} run from {a.min()} to {a.max()}; they must lie from 0 to {most}")
    return np.require(a, dtype, "CA")


def not_sparse(a: Any, name: str) -> TypeError:
    """What is said of something else in the place of a matrix."""
    if getattr(a, "ndim", 0) == 2:
        return TypeError(f"{name} is a dense array of shape {tuple(a.shape)}: give a sparse matrix, scipy.sparse.csc_array(A)")
    return TypeError(f"{name} is a {type(a).__name__}, no sparse matrix: give one of scipy.sparse or (indptr, indices, data)")


def _arrays(a: Any, complex_too: bool = False) -> "tuple[Any, Any, Any, bool]":
    """(indptr int64, indices int32, values float64 (complex128) or None, whether they are compressed rows)."""
    import numpy as np

    if isinstance(a, tuple):
        if len(a) != 3:
            raise TypeError("a matrix as a tuple is (indptr, indices, data) of compressed rows; data may be None")
        indptr, indices, data, by_rows = np.asarray(a[0]), a[1], a[2], True
        if indptr.ndim != 1:
            raise TypeError(f"indptr must be a vector of integers, not {indptr.ndim}-D {indptr.dtype}")
        n = indptr.size - 1
    else:
        if not hasattr(a, "tocsc"):
            raise not_sparse(a, "the matrix")
        if len(a.shape) != 2 or a.shape[0] != a.shape[1]:
            raise ValueError(f"a matrix of shape {a.shape} is not square")
        if a.format not in ("csc", "csr"):
            a = a.tocsc()
        indptr, indices, data, by_rows = a.indptr, a.indices, a.data, a.format == "csr"
        nonzeros, n = int(indptr[-1]), a.shape[0]
        indices, data = indices[:nonzeros], data[:nonzeros]
    if not 0 < n < 2**31:
        raise ValueError(f"a matrix of {n} rows; there must be from 1 to 2^31 - 1")
    if data is not None:
        data = np.ascontiguousarray(_numbers(data, "the matrix", complex_too))
        if data.shape != (len(indices),):
            raise ValueError(f"data of shape {data.shape} for {len(indices)} indices")
    return (_indices(indptr, "indptr", 2**62, "int64"), _indices(indices, "indices", n - 1, "int32"), data, by_rows)
