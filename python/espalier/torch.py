"""Sparse solves in PyTorch, with gradients: x = espalier.torch.solve(A, b).

The adjoint takes one more solve with the factor that is there: with lambda = A^-T dL/dx, dL/db = lambda and
dL/dA[i, j] = -lambda[i] x[j] for the entries of the pattern. Backward is made of the same operator, so derivatives of
every order come out. slogdet(A) likewise gives sign and logarithm of |det A|, with the gradient A^-T on the pattern of A
(Solver.selected_inverse), once. Tensors of the CPU are float64 or float32; those of an NVIDIA GPU (with espalier-cuda) are float64
and are read and written where they lie. The arithmetic is float64.
"""

from typing import Any

import torch
from torch import Tensor

from . import _device
from ._linear import cache as _cache

clear = _cache.clear


@torch.library.custom_op("espalier::solve", mutates_args=())
def _solve(crow: Tensor, col: Tensor, values: Tensor, b: Tensor, transpose: bool) -> Tensor:
    if b.device.type == "cuda":
        return _on_gpu(crow, col, values.detach(), b.detach(), transpose)
    x = _cache.solve(crow.numpy(), col.numpy(), values.detach().numpy(), b.detach().numpy(), transpose)
    return torch.from_numpy(x).to(torch.promote_types(values.dtype, b.dtype)).contiguous()


def _on_gpu(crow: Tensor, col: Tensor, values: Tensor, b: Tensor, transpose: bool) -> Tensor:
    _device.expect_kernels(b)
    crow, col = crow.cpu(), col.cpu()  # no copy where the pattern lies on the host
    x = _cache.solve_on_gpu(_cache.key_of(crow.numpy(), col.numpy()), lambda: (crow.numpy(), col.numpy()), values,
                            lambda: values.cpu().numpy(), lambda v: torch.equal(v, values), values.clone, b, transpose,
                            device=f"gpu:{_device.number_of(b)}", symmetric=False)
    return x.contiguous()


@_solve.register_fake
def _(crow: Tensor, col: Tensor, values: Tensor, b: Tensor, transpose: bool) -> Tensor:
    return torch.empty(b.shape, dtype=torch.promote_types(values.dtype, b.dtype), device=b.device)


def _setup(ctx: Any, inputs: Any, output: Tensor) -> None:
    crow, col, values, b, ctx.transpose = inputs
    ctx.dtypes = values.dtype, b.dtype
    ctx.save_for_backward(crow, col, values, output)


def _backward(ctx: Any, grad: Tensor) -> Any:
    crow, col, values, x = ctx.saved_tensors
    adjoint = _solve(crow, col, values, grad.contiguous(), not ctx.transpose)
    to_values = None
    if ctx.needs_input_grad[2]:
        count = crow[1:] - crow[:-1]
        row = torch.repeat_interleave(torch.arange(len(count), device=crow.device), count).to(x.device)
        col = col.to(x.device)
        left, right = (x, adjoint) if ctx.transpose else (adjoint, x)
        product = left[row] * right[col]
        to_values = -(product if product.ndim == 1 else product.sum(1)).to(ctx.dtypes[0])
    return None, None, to_values, adjoint.to(ctx.dtypes[1]) if ctx.needs_input_grad[3] else None, None


_solve.register_autograd(_backward, setup_context=_setup)


def _rows_of(A: Any) -> "tuple[Tensor, Tensor, Tensor]":
    if isinstance(A, Tensor):
        if A.layout != torch.sparse_csr:
            A = A.to_sparse_csr()
        A = A.crow_indices(), A.col_indices(), A.values()
    crow, col, values = A
    return crow, col, values


@torch.library.custom_op("espalier::slogdet", mutates_args=())
def _slogdet(crow: Tensor, col: Tensor, values: Tensor) -> "tuple[Tensor, Tensor]":
    sign, logarithm = _cache.slogdet(crow.numpy(), col.numpy(), values.detach().numpy())
    return values.new_tensor(sign), values.new_tensor(logarithm)


@_slogdet.register_fake
def _(crow: Tensor, col: Tensor, values: Tensor) -> "tuple[Tensor, Tensor]":
    return values.new_empty(()), values.new_empty(())


@torch.library.custom_op("espalier::slogdet_gradient", mutates_args=())
def _slogdet_gradient(crow: Tensor, col: Tensor, values: Tensor) -> Tensor:
    gradient = _cache.slogdet_gradient(crow.numpy(), col.numpy(), values.detach().numpy())
    return torch.from_numpy(gradient).to(values.dtype)


@_slogdet_gradient.register_fake
def _(crow: Tensor, col: Tensor, values: Tensor) -> Tensor:
    return torch.empty_like(values)


def _setup_slogdet(ctx: Any, inputs: Any, output: Any) -> None:
    ctx.save_for_backward(*inputs)


def _slogdet_backward(ctx: Any, of_sign: Tensor, of_logarithm: Tensor) -> Any:
    return None, None, of_logarithm * _slogdet_gradient(*ctx.saved_tensors)


_slogdet.register_autograd(_slogdet_backward, setup_context=_setup_slogdet)


def slogdet(A: Any) -> "tuple[Tensor, Tensor]":
    """Sign and logarithm of |det A|, as torch.linalg.slogdet. A: as for solve(), real, on the CPU. The gradient of the logarithm goes
    to the values of A: (A^-1)_ji for each entry a_ij, by the factor that is there. It cannot be differentiated again. Raises
    espalier.SingularMatrixError for a singular A."""
    crow, col, values = _rows_of(A)
    if values.device.type != "cpu":
        raise TypeError(f"A lies on {values.device}; espalier.torch.slogdet takes tensors of the CPU: entries of the inverse"
                        " come from factors on the host")
    if values.dtype not in (torch.float64, torch.float32):
        raise TypeError(f"A has dtype {values.dtype}; it must be float64 or float32")
    return _slogdet(crow, col, values)


def solve(A: Any, b: Tensor, *, transpose: bool = False) -> Tensor:
    """x with A x = b, or A^T x = b, of the shape of b: (n,) or (n, k).

    A: a sparse tensor (CSR, or COO or CSC, which are converted), or (crow_indices, col_indices, values) of compressed
    rows; gradients go to its values and to b. On a GPU the pattern may stay on the host, which saves a copy of it per
    call, and the matrix is factorized as L U, whatever its values. Raises the errors of espalier.Solver; TypeError for
    other devices and dtypes."""
    crow, col, values = _rows_of(A)
    for name, tensor in (("A", values), ("b", b)):
        if tensor.device.type not in ("cpu", "cuda"):
            raise TypeError(f"{name} lies on {tensor.device}; espalier.torch takes tensors of the CPU and of NVIDIA's GPUs")
        if tensor.dtype != torch.float64 and (tensor.dtype != torch.float32 or tensor.device.type == "cuda"):
            raise TypeError(f"{name} has dtype {tensor.dtype}; it must be float64" +
                            (" or float32" if tensor.device.type == "cpu" else " on a GPU"))
    if values.device != b.device:
        raise TypeError(f"A lies on {values.device} and b on {b.device}; they must lie on the same device")
    if b.ndim not in (1, 2) or b.shape[0] != len(crow) - 1:
        raise ValueError(f"b has shape {tuple(b.shape)}; the matrix has {len(crow) - 1} rows")
    return _solve(crow, col, values, b, transpose)
