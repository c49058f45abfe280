"""Solutions with the factor of a Solver."""

import warnings
from typing import TYPE_CHECKING, Any, overload

from .. import _checks, _device
from . import rows as _rows
from .._errors import AccuracyWarning, make_error
from .matrices import _floats, _numbers
from .._progress import UNWATCHED
from .results import Solve

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MANY = 32  # right-hand sides that go together


class Solutions:
    """What a Solver solves."""

    _core: Any
    _n: int
    _by_rows: bool
    _complex: bool
    _storage: int
    last_solve: "Solve | None"

    @overload
    def solve(self, b: "NDArray[Any]", *, out: Any = ..., transpose: "bool | str" = ..., stream: Any = ...,
              rows: Any = ...) -> "NDArray[Any]": ...
    @overload
    def solve(self, b: Any, *, out: Any = ..., transpose: "bool | str" = ..., stream: Any = ..., rows: Any = ...) -> Any: ...

    def solve(self, b: Any, *, out: Any = None, transpose: "bool | str" = False, stream: Any = None, rows: Any = None) -> Any:
        """x with A x = b, A^T x = b (transpose=True) or A^H x = b (transpose="H"): float64 of the shape of b, (n,) or (n, k);
        complex128 where A or b is complex.

        out: a writable array of that dtype and shape, which is filled and returned; it may be b, or overlap it. Contiguous vectors and
        Fortran-ordered columns are read and written in place; others are copied. Warns AccuracyWarning.

        b may lie on the GPU that holds the factor; so does x then, an array of the same library (CuPy, torch, JAX, numba;
        of others, `out` must be given). Columns in C order are rearranged by their library. stream: as for factorize();
        x is there when the call returns.

        rows: indices of unknowns that are wanted; x has these alone, (len(rows),) or (len(rows), k). b may be a matrix or array
        of scipy.sparse then, (n, k). Only the part of the factor is read that leads from the entries of b to these unknowns;
        `last_solve` is a SolveRows then. Not refined: where the factor is not good enough for that, or lies on a GPU, whole
        solutions are made (`last_solve.share` is 1)."""
        import numpy as np

        if self._n == 0:
            raise RuntimeError("there is no matrix yet: call factorize(A) first")
        self._factored()  # type: ignore[attr-defined]
        if rows is not None:
            if out is not None or stream is not None:
                raise ValueError("rows: out and stream are for whole solutions")
            return _rows.solve_rows(self, b, rows, _checks.transposition(transpose))  # type: ignore[arg-type]
        if type(b) is not np.ndarray and _device.on_gpu(b):
            return self._solve_on_gpu(b, out, transpose, stream)
        b = _numbers(b, "b", True)
        self._check_rows(b)
        transpose = _checks.transposition(transpose)
        dtype = np.dtype(np.complex128 if self._complex else b.dtype)
        if out is not None and not (isinstance(out, np.ndarray) and out.dtype == dtype and out.shape == b.shape
                                    and out.dtype.isnative and out.flags.writeable):
            raise ValueError(f"out must be a writable {dtype} array of shape {b.shape}")
        if dtype.kind == "c":
            x = self._solve_complex(b.astype(dtype, copy=False), transpose)
            if out is None:
                return x
            out[...] = x
            return out
        columns = 1 if b.ndim == 1 else b.shape[1]
        right = np.asfortranarray(b)
        direct = out is not None and out.flags.f_contiguous and out.flags.aligned
        x: Any = out if direct else np.empty(b.shape, order="F")
        if columns > 0:
            with self._watch(f"solving for {columns} columns") if columns > _MANY else UNWATCHED:  # type: ignore[attr-defined]
                solved = self._core.solve(right.T, x.T, columns, bool(transpose))
            self._solved(solved)
        if out is not None and not direct:
            out[...] = x
        return x if out is None else out

    def _solve_complex(self, b: Any, transpose: "bool | str") -> Any:
        import numpy as np

        columns = b.reshape(len(b), -1)
        if not self._complex:  # of a real matrix both parts are right-hand sides
            parts = np.asfortranarray(np.hstack([columns.real, columns.imag]))
            x = np.empty_like(parts)
            if columns.shape[1] > 0:
                self._solved(self._core.solve(parts.T, x.T, parts.shape[1], int(bool(transpose))))
            return (x[:, :columns.shape[1]] + 1j * x[:, columns.shape[1]:]).reshape(b.shape)
        how, turned = self._complex_way(transpose)
        right = np.asfortranarray(columns.conj() if turned else columns)
        x = np.empty_like(right)
        if columns.shape[1] > 0:
            self._solved(self._core.solve(_floats(right.T), _floats(x.T), columns.shape[1], how))
        return (x.conj() if turned else x).reshape(b.shape)

    def _complex_way(self, transpose: "bool | str") -> "tuple[int, bool]":
        """Which system of what the solver holds is solved, and whether for the conjugates of b and x."""
        how = 2 if transpose == "H" else int(transpose)
        turned = self._by_rows and self._storage == 0 and how == 2  # the solver holds A^T: A^H is its conjugate
        if self._by_rows and self._storage == 0:
            how = int(how == 0)
        elif self._by_rows and self._storage >= 4:  # ... which of a Hermitian matrix is A's conjugate
            how = int(how != 1)
        return how, turned

    def _check_rows(self, b: Any) -> None:
        if b.ndim not in (1, 2) or b.shape[0] != self._n:
            raise ValueError(f"b has shape {tuple(b.shape)}; the matrix has {self._n} rows")

    def _solved(self, answer: Any) -> None:
        status, found = answer
        self._judged(status, Solve(*found))

    def _judged(self, status: "tuple[int, str, int]", found: Solve) -> None:
        self.last_solve = found
        if status[0] == 7:
            warnings.warn(status[1], AccuracyWarning, stacklevel=4)
        elif status[0]:
            raise make_error(*status)

    def _solve_on_gpu(self, b: Any, out: Any, transpose: bool, stream: Any) -> Any:
        _device.expect_kernels(b)
        self._check_rows(b)
        shape = tuple(b.shape)
        right = _device.columns(b, "b", stream)
        x, answer = _device.answer_like(b, out, shape, stream)
        count = 1 if len(shape) == 1 else shape[1]
        if count > 0:
            stream = right.stream or x.stream
            self._solved(self._advised(
                self._core.solve_device(right.address, x.address, count, bool(transpose), stream), b))
        return answer()

    def _advised(self, answer: Any, array: Any) -> Any:
        """An answer to a call with an array on a GPU; where the factor is elsewhere, with what to do about it."""
        (code, message, row), found = answer
        if code == 6 and self._core.gpu() < 0:
            message += f"; give Solver(device='gpu:{_device.number_of(array)}')"
        return (code, message, row), found

    __call__ = solve
