"""Rows and columns around a factor."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from . import _checks, _core
from ._linear.changes import _checked, _columns
from ._linear.matrices import _floats, _indices, _numbers
from ._linear.results import Inertia, Solve, _Table
from ._linear.solver import Solver

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, repr=False)
class ChangeCost(_Table):
    """Of changes around a factor. `changes`: operations of their columns, and of products with them, since the last factorization of the
    changed matrix; `factorization`: those that one takes, 120 for each entry of a factor that a solve reads, and 10 more a column; `columns`:
    that went through the factor since then; `factorizations`: since the last reset(); seconds as measured."""

    changes: float
    factorization: float
    columns: int
    factorizations: int
    column_seconds: float
    factorization_seconds: float


class ChangedSystem:
    """Rows and columns around the factor of a Solver: constraints and bounds that come and go, unknowns that are removed or replaced, A + U C V^T.

    Unknowns keep their numbers: 0 to n - 1 are those of A, added ones follow. Changes are noted; the next solve() lets the columns of what is
    new go through the factor together. With folding=True, which set it so at first, the changed matrix is factorized, beside the solver's factor, where that takes
    fewer operations than the columns that are missing and what solves have done with columns since the last time (`cost`).
    The solver keeps its factor meanwhile; once it is factorized again, calls raise RuntimeError until reset(). Solves with
    the transpose of an unsymmetric matrix take two solves with the factor, of compressed rows (CSR) those without.

    Around a complex factor all numbers are complex, and real ones are taken as such. Rows that are left out are the columns, and V is U;
    where the solver has taken the matrix as a Hermitian one (`hermitian`), they are the conjugates of these. V.T is no conjugate anywhere.
    """

    def __init__(self, solver: Solver, *, folding: bool = True) -> None:
        if not isinstance(solver, Solver):
            raise TypeError(f"solver is {_checks.shown(solver)}; it must be an espalier.Solver")
        if solver.factor is None:
            raise RuntimeError("there is no factorization: call solver.factorize(A) first")
        self._folding = _checks.flag(folding, "folding")
        self._solver, self._n = solver, solver._n
        self._dtype = "complex128" if solver._complex else "float64"
        self._core = _core.ChangedSystem(solver._core)
        self._core.set_folding(self._folding)
        self.last_solve: "Solve | None" = None

    def __repr__(self) -> str:
        return f"<espalier.ChangedSystem: {len(self)} unknowns, of {self._n} in the factor>"

    def reset(self) -> None:
        """Forgets all changes, and takes the factor that the solver has now."""
        self.__init__(self._solver, folding=self._folding)  # type: ignore[misc]

    @property
    def hermitian(self) -> bool:
        """Whether what is left out is the conjugate: the solver has a complex matrix and has taken it as a Hermitian one."""
        return bool(self._core.hermitian)

    def __len__(self) -> int:
        """Unknowns, added and removed ones among them."""
        return int(self._core.size)

    def _sparse(self, a: Any, rows: int, what: str) -> "tuple[Any, Any, Any]":
        """(begin, rows, values) of a with some columns; `rows` of them unless it is sparse: then at most."""
        import numpy as np

        if not hasattr(a, "tocsc"):
            flat, count, _ = _columns(a, rows, what, self._dtype)
            return np.arange(count + 1, dtype=np.int64) * rows, np.tile(np.arange(rows, dtype=np.int32), count), _floats(flat)
        if len(a.shape) != 2 or a.shape[0] > rows:
            raise ValueError(f"{what} of shape {a.shape}: give at most {rows} rows")
        a = a.tocsc()
        return (np.ascontiguousarray(a.indptr, dtype=np.int64), np.ascontiguousarray(a.indices, dtype=np.int32),
                _floats(np.ascontiguousarray(self._as_numbers(a.data, what))))

    def _pair(self, columns: Any, rows: Any, size: int, names: "tuple[str, str]") -> "tuple[Any, Any]":
        import numpy as np

        u = self._sparse(columns, size, names[0])
        if rows is None:
            return u, (np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int32), np.empty(0))
        w = self._sparse(rows, size, names[1])
        if len(w[0]) != len(u[0]):
            raise ValueError(f"{len(u[0]) - 1} {names[0]}, but {len(w[0]) - 1} {names[1]}")
        return u, w

    def _size_of(self, a: Any) -> int:
        """Rows of columns over the unknowns of A, or over all that are there."""
        import numpy as np

        if hasattr(a, "tocsc"):
            return len(self)
        return len(self) if np.ndim(a) in (1, 2) and np.shape(a)[0] == len(self) else self._n

    def _as_numbers(self, a: Any, what: str) -> Any:
        return _numbers(a, what, self._dtype == "complex128").astype(self._dtype, copy=False)

    def _square(self, a: Any, size: int, what: str) -> Any:
        import numpy as np

        if a is None:
            return np.empty(0)
        a = np.atleast_2d(self._as_numbers(a, what))
        if a.shape != (size, size):
            raise ValueError(f"{what} of shape {a.shape}: give ({size}, {size})")
        return _floats(np.ascontiguousarray(a.T).reshape(-1))

    @staticmethod
    def _turned(rows: Any) -> Any:
        import numpy as np

        return rows if rows is None else rows.T if hasattr(rows, "tocsc") else np.transpose(rows)

    def add(self, columns: Any, rows: Any = None, corner: Any = None) -> None:
        """Adds k unknowns and equations. columns: (n,), (n, k) or (len(self), k), how the equations depend on them; sparse: at most len(self) rows.
        rows: (k, n) likewise, how theirs depend on the unknowns; None: columns.T (`hermitian`: its conjugate). corner: (k, k), zeros by default."""
        u, w = self._pair(columns, self._turned(rows), self._size_of(columns), ("columns", "rows"))
        _checked(self._core.add(*u, *w, self._square(corner, len(u[0]) - 1, "corner")))

    def replace(self, unknowns: Any, columns: Any, rows: Any = None) -> None:
        """Gives each of k unknowns another column and row. columns: (len(self), k), sparse: at most as many rows; rows: (k, len(self)), None:
        as for add(). Diagonal entries are those of the columns; of what stands between two of the list the later one decides."""
        listed = _indices(unknowns, "unknowns", 2**31 - 1, "int32")
        u, w = self._pair(columns, self._turned(rows), len(self), ("columns", "rows"))
        if len(u[0]) - 1 != len(listed):
            raise ValueError(f"{len(listed)} unknowns, but {len(u[0]) - 1} columns")
        _checked(self._core.replace(listed, *u, *w))

    def add_low_rank(self, U: Any, C: Any = None, V: Any = None) -> None:
        """A + U C V^T. U, V: (n,) or (n, k), sparse or not; V: U by default (`hermitian`: its conjugate). C: (k, k), the identity by default."""
        u, v = self._pair(U, V, self._n, ("U", "V"))
        _checked(self._core.add_low_rank(*u, self._square(C, len(u[0]) - 1, "C"), *v))

    def remove(self, unknowns: Any) -> None:
        """Removes unknowns with the equations of the same numbers: x is 0 there."""
        _checked(self._core.remove(_indices(unknowns, "unknowns", 2**31 - 1, "int32")))

    def restore(self, unknowns: Any) -> None:
        """Takes back what remove() did."""
        _checked(self._core.restore(_indices(unknowns, "unknowns", 2**31 - 1, "int32")))

    def flip(self, unknowns: Any) -> None:
        """Removes those that are there, restores those that are removed."""
        _checked(self._core.flip(_indices(unknowns, "unknowns", 2**31 - 1, "int32")))

    def prepare(self) -> None:
        """Makes the columns of what is new now; solve() does so, too. Raises SingularMatrixError."""
        _checked(self._core.prepare())

    def fold(self) -> None:
        """Factorizes the changed matrix now, beside the solver's factor. Raises SingularMatrixError; everything is as it was then."""
        _checked(self._core.fold())

    @property
    def cost(self) -> ChangeCost:
        """What the changes have cost, and what a factorization would."""
        return ChangeCost(*self._core.cost())

    def solve(self, b: Any, *, transpose: "bool | str" = False) -> "NDArray[Any]":
        """x of the shape of b, (len(self),) or (len(self), k); transpose: with the transposed matrix, "H": with the conjugate of that.
        Raises SingularMatrixError where the changed matrix is singular; warns AccuracyWarning."""
        flat, columns, one = _columns(b, len(self), "b", self._dtype)
        how = _checks.transposition(transpose)
        status, x, figures = self._core.solve(_floats(flat), columns, 2 if how == "H" else int(how))
        self.last_solve = Solve(*figures)
        _checked(status)
        x = x.view(self._dtype)
        return x[0] if one else x.T

    @property
    def inertia(self) -> Inertia:
        """Of the changed matrix without its removed rows and columns; -1 each where a part is not symmetric (complex: not Hermitian)."""
        return Inertia(*self._core.inertia())
