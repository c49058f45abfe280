"""Entries of the inverse of a factored matrix."""

import warnings
from typing import TYPE_CHECKING, Any

from .. import _checks
from .._errors import AccuracyWarning, make_error
from .matrices import _arrays, _floats
from .._progress import UNWATCHED
from .results import InverseEntries

if TYPE_CHECKING:
    from numpy.typing import NDArray


class SelectedInverse:
    """What a Solver knows of A^-1 beside solves with it."""

    _core: Any
    _pattern: Any
    _n: int
    _by_rows: bool
    _complex: bool
    _storage: int
    last_inverse: "InverseEntries | None"

    def selected_inverse(self, pattern: Any = None) -> Any:
        """Entries of A^-1 as a sparse array: where `pattern`, a matrix of scipy.sparse or (indptr, indices, None), stores
        something. Its values are not read.

        None: (A^-1)_ji for all entries a_ij that A stores, which is where they are cheap. `data` of the answer is in the
        order of A.data: the gradient of log|det A| by it (of a matrix of which one triangle is given, each entry off the
        diagonal stands for two). The answer of a symmetric matrix has the arrays and the format of A; of others it is of
        compressed rows where A is of columns, and the other way round.

        It takes about twice the time of a factorization, by the factor that is there. Entries that are neither there nor on
        the pattern of the factor cost a solve for each of their columns (rows, where A is of compressed rows). The factor may
        lie on the host or on one GPU. `last_inverse` tells how accurate the entries are. Warns AccuracyWarning; raises
        SingularMatrixError where A is singular, DeviceError where several GPUs share its factor."""
        import scipy.sparse as sp

        self._expect_factor()
        if pattern is None:
            pointers, indices = self._pattern
            if not self._core.has_pattern(pointers, indices, self._by_rows, self._storage, self._complex):
                raise ValueError("the arrays of the matrix have been changed since its analysis: call factorize(A) again")
            by_rows = self._by_rows if self._storage in (1, 2, 3) else not self._by_rows
            turned = True
        else:
            pointers, indices, _, by_rows = _arrays(pattern, True)
            self._check_size(len(pointers) - 1, "the pattern")
            turned = by_rows != self._by_rows
        x = self._inverted(self._core.selected_inverse, pointers, indices, turned)
        kind = sp.csr_array if by_rows else sp.csc_array
        return kind((x, indices.copy(), pointers.copy()), shape=(self._n, self._n))

    def inverse_diagonal(self) -> "NDArray[Any]":
        """The diagonal of A^-1: marginal variances, where A is the precision matrix of a Gaussian field."""
        return self.inverse_blocks(1).reshape(-1)

    def inverse_blocks(self, size: int) -> "NDArray[Any]":
        """Blocks on the diagonal of A^-1 as (n / size, size, size): of nodes with `size` unknowns each."""
        self._expect_factor()
        size = _checks.whole(size, "size", 1, self._n)
        if self._n % size:
            raise ValueError(f"{self._n} unknowns cannot be parted into blocks of {size}")
        x = self._inverted(self._core.inverse_blocks, size, self._n).reshape(-1, size, size)  # each by columns of what the solver holds
        return x if self._by_rows else x.transpose(0, 2, 1).copy()

    def trace_of_inverse(self, B: Any) -> "float | complex":
        """trace(A^-1 B) for a sparse B, both triangles of which are given: the derivative of log det A in the direction B.
        `last_inverse.trace_error` estimates its error."""
        import numpy as np
        import scipy.sparse as sp

        self._expect_factor()
        if isinstance(B, tuple):
            pointers, indices, values, _ = _arrays(B, True)
            if values is None:
                raise ValueError("B has no values, only a pattern")
            B = sp.csr_array((values, indices, pointers), shape=(len(pointers) - 1,) * 2)
        elif not hasattr(B, "tocsc"):
            raise TypeError(f"B is a {type(B).__name__}, no sparse matrix: give one of scipy.sparse")
        pointers, indices, values, by_rows = _arrays(B.tocsr() if self._by_rows else B.tocsc(), True)
        self._check_size(len(pointers) - 1, "B")
        if values.dtype.kind == "c" and not self._complex:
            return complex(self._trace(pointers, indices, values.real.copy()),
                           self._trace(pointers, indices, values.imag.copy()))
        trace = self._trace(pointers, indices, values.astype(np.complex128) if self._complex else values)
        return trace if self._complex else trace.real

    def _trace(self, pointers: Any, indices: Any, values: Any) -> Any:
        return self._inverted(self._core.trace_of_inverse, pointers, indices, _floats(values))[0]

    def _inverted(self, call: Any, *arguments: Any) -> Any:
        import numpy as np

        with self._watch("inverting") if self._n > 10_000 else UNWATCHED:  # type: ignore[attr-defined]
            status, x, found = call(*arguments)
        self.last_inverse = InverseEntries(*found)
        if status[0] == 7:
            warnings.warn(status[1], AccuracyWarning, stacklevel=4)
        elif status[0]:
            raise make_error(*status)
        return x.view(np.complex128) if self._complex else x

    def _expect_factor(self) -> None:
        self._factored()  # type: ignore[attr-defined]

    def _check_size(self, n: int, what: str) -> None:
        if n != self._n:
            raise ValueError(f"{what} has {n} rows; the matrix has {self._n}")
