"""A few unknowns of solutions, for right-hand sides with few entries."""

from typing import TYPE_CHECKING, Any

from .matrices import _floats, _indices, _numbers
from .results import SolveRows

if TYPE_CHECKING:
    from .solver import Solver


def _columns(b: Any, n: int) -> "tuple[Any, Any, Any, bool]":
    """Pointers, row indices and numbers of right-hand sides by columns; whether b is one vector."""
    import numpy as np

    if not hasattr(b, "tocsc"):
        b = _numbers(b, "b", True)
        if b.ndim not in (1, 2) or b.shape[0] != n:
            raise ValueError(f"b has shape {tuple(b.shape)}; the matrix has {n} rows")
        full = b.reshape(n, -1)
        columns, rows = np.nonzero(full.T)
        pointers = np.concatenate(([0], np.cumsum(np.bincount(columns, minlength=full.shape[1]))))
        return pointers, rows, full[rows, columns], b.ndim == 1
    if b.ndim != 2 or b.shape[0] != n:
        raise ValueError(f"b has shape {tuple(b.shape)}; sparse right-hand sides are (n, k), the matrix has {n} rows")
    b = b.tocsc()
    return b.indptr, b.indices, _numbers(b.data, "b", True), False


def solve_rows(solver: "Solver", b: Any, rows: Any, transpose: "bool | str") -> Any:
    """Solver.solve(b, rows=rows)."""
    import numpy as np

    pointers, places, values, alone = _columns(b, solver._n)
    last = solver._n - 1
    wanted, places = _indices(rows, "rows", last, "int32"), _indices(places, "the rows of b", last, "int32")
    pointers = np.require(pointers, "int64", "CA")
    count = len(pointers) - 1
    dtype = np.dtype(np.complex128 if solver._complex or values.dtype.kind == "c" else np.float64)

    def solved(numbers: Any, how: int) -> Any:
        status, x, found = solver._core.solve_rows(pointers, places, _floats(np.ascontiguousarray(numbers)), wanted, how)
        solver._judged(status, SolveRows(*found))
        return x

    shape = (len(wanted), count)
    if count == 0:
        x = np.empty(shape, dtype)
    elif solver._complex:
        how, turned = solver._complex_way(transpose)
        values = values.astype(np.complex128, copy=False)
        x = solved(values.conj() if turned else values, how).view(np.complex128).reshape(count, -1).T
        x = x.conj() if turned else x
    elif dtype.kind == "c":  # of a real matrix both parts are right-hand sides
        parts = [solved(part, int(bool(transpose))).reshape(count, -1).T for part in (values.real, values.imag)]
        x = parts[0] + 1j * parts[1]
    else:
        x = solved(values, int(bool(transpose))).reshape(count, -1).T
    return x[:, 0] if alone else x
