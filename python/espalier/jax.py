"""Sparse solves in JAX, with derivatives in both modes, inside jit, grad, vmap and scan:
x = espalier.jax.solve(indptr, indices, data, b).

The solve is a callback to the host (jax.pure_callback), not a handler of XLA's foreign function interface: a handler
would have to be compiled against the headers of one version of jaxlib, and this package is built without JAX. A call
costs some 100 microseconds more. jax.lax.custom_linear_solve makes derivatives of it: of data and b, to any order.
Enable jax_enable_x64: without it the answer is a float32 of a solve in float64.
"""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from . import _cache

clear = _cache.clear


def _on_host(transpose: bool, indptr: Any, indices: Any, data: Any, b: Any) -> Any:
    b = np.asarray(b)
    x = _cache.solve(np.asarray(indptr), np.asarray(indices), np.asarray(data), b, transpose=transpose)
    return np.ascontiguousarray(x, b.dtype)


def solve(indptr: Any, indices: Any, data: Any, b: Any, *, symmetric: bool = False) -> Any:
    """x with A x = b, A by compressed rows; b: (n,) or (n, k), floating. Derivatives go to data and b.

    symmetric: A is, and data is seen as such by derivatives in reverse mode (the transposed system is not asked for)."""
    indptr, indices = jnp.asarray(indptr), jnp.asarray(indices)
    data, b = jnp.asarray(data), jnp.asarray(b)
    dtype = jnp.promote_types(data.dtype, b.dtype)
    if not jnp.issubdtype(dtype, jnp.floating):
        raise TypeError(f"data has dtype {data.dtype} and b {b.dtype}; they must be real, at least one of them floating")
    n = len(indptr) - 1
    if b.ndim not in (1, 2) or b.shape[0] != n:
        raise ValueError(f"b has shape {b.shape}; the matrix has {n} rows")
    data, b = data.astype(dtype), b.astype(dtype)
    rows = jnp.repeat(jnp.arange(n), jnp.diff(indptr), total_repeat_length=len(indices))
    shape = jax.ShapeDtypeStruct(b.shape, dtype)

    def matvec(x: Any) -> Any:
        products = data.reshape(-1, *[1] * (x.ndim - 1)) * x[indices]
        return jnp.zeros_like(x).at[rows].add(products)

    def inverse(transpose: bool, _: Any, rhs: Any) -> Any:
        fixed = jax.lax.stop_gradient(data)
        return jax.pure_callback(partial(_on_host, transpose), shape, indptr, indices, fixed, rhs,
                                 vmap_method="sequential")

    return jax.lax.custom_linear_solve(matvec, b, partial(inverse, False), partial(inverse, True), symmetric=symmetric)
