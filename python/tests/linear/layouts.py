"""Matrices in every layout, storage and dtype, and arrays that lie in memory in every way."""

import numpy as np
import scipy.sparse as sp

N = 24
EPS = np.finfo(float).eps
LAYOUTS = ["csc", "csr", "coo", "bsr", "dia", "lil", "triple"]
DTYPES = ["float32", "float64", "complex64", "complex128"]
SORTS = ["general", "symmetric", "definite"]  # complex: "hermitian" and "hermitian definite" too


def dense(sort, dtype, seed, deficiency=0):
    """A matrix of N rows whose last `deficiency` unknowns are combinations of others, as its equations are; in the numbers of
    `dtype`. Entries of the combinations are small integers, so that the zeros are zeros to the rounding of FP64 and, with
    entries of 12 bits, exactly in FP32."""
    rng = np.random.default_rng(seed)

    def numbers(shape):
        real = rng.integers(-2000, 2000, shape) / 512
        return real + 1j * rng.integers(-2000, 2000, shape) / 512 if np.dtype(dtype).kind == "c" else real

    m = N - deficiency
    a = numbers((m, m)) * (rng.random((m, m)) < 0.2)
    a += np.diag(numbers(m) + 6)
    adjoint = np.conj if "hermitian" in sort or sort == "definite" else (lambda v: v)
    if sort != "general":
        a = a + adjoint(a).T
    if sort == "definite":
        a = a + np.diag(np.ceil(abs(a).sum(1)))
    c = np.zeros((deficiency, m))
    for k in range(deficiency):
        c[k, rng.choice(m, 2, replace=False)] = rng.choice([-1, 1, 2], 2)
    c = c * (1j if np.dtype(dtype).kind == "c" else 1)
    full = np.vstack([np.eye(m), c])
    other = full if sort == "general" else adjoint(full)
    return (other @ a @ full.T).astype(dtype)


def symmetries(sort, dtype):
    """(symmetry, which part is stored)"""
    part = {"lower": np.tril, "upper": np.triu}
    if sort == "general":
        return [("auto", lambda a: a), ("general", lambda a: a)]
    prefix = "hermitian_" if np.dtype(dtype).kind == "c" and sort != "symmetric" else ""
    both = "hermitian" if prefix else "symmetric"
    return [("auto", lambda a: a), (both, lambda a: a), (prefix + "lower", part["lower"]), (prefix + "upper", part["upper"])]


def sorts(dtype):
    return [*SORTS, "hermitian"] if np.dtype(dtype).kind == "c" else SORTS


def laid_out(a, layout):
    s = sp.coo_array(a)
    if layout == "triple":
        r = s.tocsr()
        return r.indptr, r.indices, r.data
    if layout == "bsr":
        return sp.bsr_array(a, blocksize=(2, 2) if np.tril(a, -1).any() and np.triu(a, 1).any() else (1, 1))
    return s.asformat(layout)


CASES = [(dtype, sort) for dtype in DTYPES for sort in sorts(dtype)]


def places():
    """Ways in which the same numbers lie in memory: name -> function of an array."""
    def strided(a):
        return np.repeat(np.repeat(a, 2, 0), 3, -1)[::2, ..., ::3] if a.ndim > 1 else np.repeat(a, 2)[::2]

    def backwards(a):
        return np.ascontiguousarray(a[(slice(None, None, -1),) * a.ndim])[(slice(None, None, -1),) * a.ndim]

    def unaligned(a):
        raw = np.empty(a.nbytes + 1, np.uint8)[1:]
        out = raw.view(a.dtype).reshape(a.shape, order="F")
        out[...] = a
        return out

    def read_only(a):
        a = a.copy()
        a.flags.writeable = False
        return a

    return {"C": np.ascontiguousarray, "F": np.asfortranarray, "strided": strided, "backwards": backwards, "unaligned": unaligned,
            "read-only": read_only, "big endian": lambda a: a.astype(a.dtype.newbyteorder(">")),
            "one row of columns": lambda a: np.ascontiguousarray(a.T).T, "list": lambda a: a.tolist(),
            "part of more": lambda a: np.pad(a, [(1, 2)] * a.ndim)[(slice(1, -2),) * a.ndim]}


def close(x, truth, matrix):
    bound = 100 * N * EPS * np.linalg.cond(matrix)
    assert x.shape == np.shape(truth)
    assert abs(x - truth).max(initial=0) <= bound * abs(np.asarray(truth)).max(initial=0)
