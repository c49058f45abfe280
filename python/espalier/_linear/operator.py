"""A factored matrix as an operator: its inverse, as scipy.sparse.linalg.aslinearoperator takes it."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np


class Inverse:
    """What a Solver is for iterative methods of SciPy: the operator x -> A^-1 x."""

    _n: int
    _complex: bool

    @property
    def shape(self) -> "tuple[int, int]":
        """Of the matrix, (n, n); (0, 0) where there is none yet."""
        return self._n, self._n

    @property
    def dtype(self) -> "np.dtype[np.float64 | np.complex128]":
        """Of solutions for real right-hand sides: float64, or complex128 of a complex matrix."""
        import numpy as np

        return np.dtype(np.complex128 if self._complex else np.float64)

    def solve(self, b: Any, *, transpose: "bool | str" = False) -> Any:
        """See Solver.solve()."""
        raise NotImplementedError

    def matvec(self, x: Any) -> Any:
        """solve(x): aslinearoperator(solver) and preconditioners (M=solver) ask for it by this name."""
        return self.solve(x)

    def rmatvec(self, x: Any) -> Any:
        """solve(x, transpose="H"), with the conjugate transpose."""
        return self.solve(x, transpose="H")

    matmat, rmatmat = matvec, rmatvec
