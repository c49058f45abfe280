"""Schur complements, rows and columns around a factor, batches."""

import logging
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Iterable

from .. import _checks, _core
from .._errors import AccuracyWarning, make_error
from .results import Inertia, Solve, _Table
from .matrices import _STORAGE, _arrays, _indices, _numbers
from .solver import Solver, _finite

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from typing_extensions import Unpack

    from .._options import SolverOptions


def _by_columns(A: Any, symmetry: str) -> "tuple[Any, Any, Any, int, Any]":
    """(indptr, indices, data, storage, order) of compressed columns; order: of the caller's data, or None where it is that."""
    import numpy as np

    storage = _STORAGE[_checks.choice(symmetry, "symmetry", _STORAGE)]
    pointers, indices, values, by_rows = _arrays(A)
    if values is None:
        raise ValueError("the matrix has no values, only a pattern")
    if not by_rows:
        return pointers, indices, values, storage, None
    if storage in (1, 2, 3):  # rows of a symmetric matrix are its columns; those of a triangle are those of the other one
        return pointers, indices, values, 3 - storage if storage < 3 else storage, None
    n = len(pointers) - 1
    rows = np.repeat(np.arange(n, dtype=np.int32), np.diff(pointers))
    order = np.argsort(indices, kind="stable")
    columns = np.zeros(n + 1, dtype=np.int64)
    np.cumsum(np.bincount(indices, minlength=n), out=columns[1:])
    return columns, rows[order], np.ascontiguousarray(values[order]), storage, order


def _columns(b: Any, rows: int, what: str, dtype: str = "float64") -> "tuple[Any, int, bool]":
    """`b` of shape (rows,) or (rows, k) as one vector, column by column; k; whether it is a vector already."""
    import numpy as np

    b = _numbers(b, what, dtype == "complex128").astype(dtype, copy=False)
    if b.ndim not in (1, 2) or b.shape[0] != rows or b.size == 0:
        raise ValueError(f"{what} of shape {b.shape}: give ({rows},) or ({rows}, k)")
    return np.ascontiguousarray(b.T).reshape(-1), 1 if b.ndim == 1 else b.shape[1], b.ndim == 1


def _checked(status: "tuple[int, str, int]") -> None:
    if status[0] == 7:
        warnings.warn(AccuracyWarning(status[1]), stacklevel=4)
    elif status[0] != 0:
        raise make_error(*status)


class SchurComplement:
    """A condensed onto listed unknowns: S = A_ss - A_sr A_rr^-1 A_rs, dense, with a factor of the rest, A_rr.

    A: as for Solver, on the host. unknowns: indices from 0, each once, in the order that the rows of S shall have. symmetry,
    log, options: as for Solver; factors are FP64. A_rr must be regular, S need not.

    Raises SingularMatrixError where A_rr is singular (its row is one of A's), InvalidInputError for an empty list, duplicates
    and indices out of range.
    """

    def __init__(self, A: Any, unknowns: Any, *, symmetry: str = "auto", log: "logging.Logger | None" = None,
                 **options: "Unpack[SolverOptions]") -> None:
        self._symmetry = symmetry
        self.unknowns = _indices(unknowns, "unknowns", 2**31 - 1, "int32")
        self._core = _core.SchurComplement(_checks.options(options), _checks.lines_of(log))
        self._n, self._pattern = 0, None  # type: ignore[var-annotated]
        self.last_solve: "Solve | None" = None
        self.factorize(A)

    def factorize(self, A: Any) -> None:
        """New values of the same pattern; a matrix with another one, or that is symmetric no more, is analyzed first."""
        import numpy as np

        pointers, indices, values, storage, _ = _by_columns(A, self._symmetry)
        known = (self._pattern is not None and np.array_equal(self._pattern[0], pointers)
                 and np.array_equal(self._pattern[1], indices))
        given = (pointers, indices, values, storage, self.unknowns)
        self._pattern, self._n = None, len(pointers) - 1
        answer = self._core.factorize(*given, not known)
        if known and answer[0][0] == 2 and _finite(values):  # no longer symmetric
            answer = self._core.factorize(*given, True)
        self._pattern = pointers.copy(), indices.copy()
        status, self.seconds, self.complement_seconds, self.by_elimination, rest, self.rank, self.dependent_rows = answer
        self.rest_inertia = Inertia(*rest)
        if status[0]:
            raise make_error(*status)

    def __repr__(self) -> str:
        return f"<espalier.SchurComplement: {len(self.unknowns)} of {self._n} unknowns>"

    @property
    def complement(self) -> "NDArray[np.float64]":
        """S, (size, size) float64."""
        return self._core.complement().T

    @property
    def inertia(self) -> "tuple[Inertia, Inertia]":
        """Of A_rr and of S; their sum is that of A."""
        status, rest, complement = self._core.inertia()
        _checked(status)
        return Inertia(*rest), Inertia(*complement)

    def _take(self, answer: Any, one: bool) -> Any:
        status, x, figures = answer
        self.last_solve = Solve(*figures)
        _checked(status)
        return x[0] if one else x.T

    def condense(self, b: Any, *, transpose: bool = False) -> "NDArray[np.float64]":
        """g = b_s - A_sr A_rr^-1 b_r, of shape (size,) or (size, k)."""
        flat, columns, one = _columns(b, self._n, "b")
        return self._take(self._core.condense(flat, columns, bool(_checks.transposition(transpose))), one)

    def expand(self, b: Any, xs: Any, *, transpose: bool = False) -> "NDArray[np.float64]":
        """x with x_r = A_rr^-1 (b_r - A_rs x_s), of the shape of b."""
        flat, columns, one = _columns(b, self._n, "b")
        of_list, same, _ = _columns(xs, len(self.unknowns), "xs")
        if columns != same:
            raise ValueError(f"b has {columns} columns, xs has {same}")
        return self._take(self._core.expand(flat, of_list, columns, bool(_checks.transposition(transpose))), one)

    def solve(self, b: Any, *, transpose: bool = False) -> "NDArray[np.float64]":
        """x with A x = b, by way of S. Raises SingularMatrixError where S is singular."""
        flat, columns, one = _columns(b, self._n, "b")
        return self._take(self._core.solve(flat, columns, bool(_checks.transposition(transpose))), one)


@dataclass(frozen=True, repr=False)
class BatchSolve(_Table):
    """Of a batch. `x`: of the shape of b (of solve_systems: a list), NaN in systems that failed. `errors`: by number of the system, an exception each.
    `backward_errors`, `negative` (eigenvalues; -1 for lu): by system. `workers`: systems that were worked on at a time."""

    x: Any
    errors: "dict[int, Exception]"
    backward_errors: "NDArray[np.float64]"
    negative: "NDArray[np.int64]"
    seconds: float
    workers: int


def _errors_of(status: Any, statuses: Any, check: bool) -> "dict[int, Exception]":
    if not statuses and status[0]:
        raise make_error(*status)
    errors = {k: make_error(*s) for k, s in enumerate(statuses) if s[0]}
    if errors and check:
        raise make_error(*status)
    return errors


def _pair(given: Any) -> "tuple[Any, Any]":
    pair = _checks.items(given, "a system")
    if len(pair) != 2:
        raise TypeError(f"{len(pair)} things in the place of a pair (A, b)")
    return pair[0], pair[1]


def solve_systems(systems: "Iterable[tuple[Any, Any]]", *, symmetry: str = "auto", transpose: bool = False, check: bool = True,
                  log: "logging.Logger | None" = None, **options: "Unpack[SolverOptions]") -> BatchSolve:
    """Many small systems of patterns of their own: pairs (A, b), A as for Solver on the host, b of shape (n,) or (n, k).
    One on each thread; with device="gpu:0" (and "auto", where that is predicted to be faster) as many together as fill
    the GPU, each with an order, a scaling and a verdict of its own, and what fails there on the cores. Nothing is kept. symmetry, log, options: as for Solver, the same for all; check as for
    Batch.solve(). `x` of the result is a list, each of the shape of its b."""
    import numpy as np

    matrices, flat, columns, shapes = [], [], [], []
    for k, pair in enumerate(_checks.items(systems, "systems")):
        try:
            A, b = _pair(pair)
            matrix = _by_columns(A, symmetry)[:4]
            vector, count, _ = _columns(b, len(matrix[0]) - 1, "b")
        except (TypeError, ValueError) as error:
            raise ValueError(f"system {k}: {error}") from None
        matrices.append(matrix)
        flat.append(vector)
        columns.append(count)
        shapes.append(np.shape(b))
    status, x, statuses, *rest = _core.solve_systems(matrices, np.concatenate([np.empty(0), *flat]), columns,
                                                     bool(_checks.transposition(transpose)), _checks.options(options),
                                                     _checks.lines_of(log))
    errors = _errors_of(status, statuses, _checks.flag(check, "check"))
    parts = np.split(x, np.cumsum([len(v) for v in flat])[:-1])
    shaped = [p if len(s) == 1 else p.reshape(s[1], s[0]).T for p, s in zip(parts, shapes)]
    return BatchSolve(shaped, errors, *rest)


class Batch:
    """Many systems of the pattern of A, one on each thread.

    A: as for Solver, on the host; its values are typical of the batch. symmetry, log, options: as for Solver; threads:
    systems at a time. Solutions have the bits of single systems, whatever the number of threads.
    """

    def __init__(self, A: Any, *, symmetry: str = "auto", log: "logging.Logger | None" = None, **options: "Unpack[SolverOptions]") -> None:
        self._core = _core.Batch(_checks.options(options), _checks.lines_of(log))
        pointers, indices, values, storage, self._order = _by_columns(A, symmetry)
        self._n, self._nonzeros = len(pointers) - 1, len(indices)
        status = self._core.analyze(pointers, indices, values, storage)
        if status[0]:
            raise make_error(*status)

    def __repr__(self) -> str:
        return f"<espalier.Batch: {self._n} unknowns, {self._nonzeros} entries>"

    def solve(self, values: Any, b: Any, *, transpose: bool = False, check: bool = True) -> BatchSolve:
        """values: (systems, nonzeros), each in the order of the matrix's data. b: (systems, n) or (systems, n, k).
        check: raises the error of the first system that fails; False: all are in `errors`."""
        import numpy as np

        values, b = _numbers(values, "values"), _numbers(b, "b")
        if values.ndim != 2 or values.shape[1] != self._nonzeros:
            raise ValueError(f"values of shape {values.shape}: give (systems, {self._nonzeros})")
        if b.ndim not in (2, 3) or b.shape[:2] != (len(values), self._n):
            raise ValueError(f"b of shape {b.shape}: give ({len(values)}, {self._n}) or ({len(values)}, {self._n}, k)")
        if self._order is not None:
            values = values[:, self._order]
        columns = 1 if b.ndim == 2 else b.shape[2]
        if columns == 0:
            raise ValueError("b has no right-hand sides")
        flat = np.ascontiguousarray(b if b.ndim == 2 else b.transpose(0, 2, 1)).reshape(-1)
        status, x, statuses, *rest = self._core.solve(np.ascontiguousarray(values).reshape(-1), flat, len(values), columns,
                                                      bool(_checks.transposition(transpose)))
        errors = _errors_of(status, statuses, _checks.flag(check, "check"))
        shaped = x.reshape(b.shape) if b.ndim == 2 else x.reshape(len(values), columns, self._n).transpose(0, 2, 1)
        return BatchSolve(shaped, errors, *rest)
