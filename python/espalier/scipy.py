"""scipy.sparse.linalg with this solver: the same names, arguments and answers, and patch() for programs that cannot be
changed.

What belongs to SuperLU alone (permc_spec, diag_pivot_thresh, relax, panel_size, options, use_umfpack) is accepted and
has no effect; answers have the dtype that SciPy gives them, and are computed in float64 or complex128. eigsh and eigs of
complex matrices are left to SciPy inside patch().
"""

import contextlib
import sys
import warnings
from typing import Any, Callable, Iterator

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from ._errors import SingularMatrixError
from ._linear.solver import Solver

_eigsh, _eigs = spla.eigsh, spla.eigs  # not those of patch()


def _dtype(*arrays: Any) -> Any:
    return np.result_type(np.float32, *(a.dtype for a in arrays))


class _SuperLU:
    """What scipy.sparse.linalg.splu returns, without its factors: shape, nnz (of the factor), solve()."""

    def __init__(self, A: Any) -> None:
        self._solver = Solver(A)
        self._dtype = _dtype(A)
        self.shape = A.shape
        assert self._solver.analysis is not None
        self.nnz = self._solver.analysis.nonzeros_factor

    def solve(self, rhs: Any, trans: str = "N") -> Any:
        """x with A x = rhs ("N"), A^T x = rhs ("T") or A^H x = rhs ("H"); rhs: (n,) or (n, k)."""
        if trans not in ("N", "T", "H"):
            raise ValueError(f"trans is {trans!r}; it must be N, T or H")
        rhs = np.asarray(rhs)
        x = self._solver.solve(rhs, transpose="H" if trans == "H" else trans == "T")
        return x.astype(_dtype(self, rhs), copy=False)

    @property
    def dtype(self) -> Any:
        return self._dtype


def splu(A: Any, *_: Any, **__: Any) -> _SuperLU:
    """As scipy.sparse.linalg.splu. Raises SingularMatrixError, which is a RuntimeError, for a singular matrix."""
    return _SuperLU(A)


def factorized(A: Any) -> Callable[[Any], Any]:
    """As scipy.sparse.linalg.factorized: a function that solves A x = b for a vector or columns b."""
    return _SuperLU(A).solve


def spsolve(A: Any, b: Any, permc_spec: Any = None, use_umfpack: bool = True) -> Any:
    """As scipy.sparse.linalg.spsolve: b is a vector, an (n, 1) array, for which a vector comes back, an (n, k) array, or a
    sparse matrix, for which one in the format of A comes back. For a singular matrix it warns MatrixRankWarning and returns NaN, as SciPy does; espalier.solve()
    raises."""
    sparse = sp.issparse(b)
    rhs = b.toarray() if sparse else np.asarray(b)
    if rhs.ndim == 2 and rhs.shape[1] == 1:
        rhs = rhs.ravel()
    dtype = _dtype(A, rhs)
    try:
        with Solver(A) as solver:
            x = solver.solve(rhs).astype(dtype, copy=False)
    except SingularMatrixError as error:
        warnings.warn(str(error), spla.MatrixRankWarning, stacklevel=2)
        x = np.full(rhs.shape, np.nan, dtype)
    if not sparse or x.ndim == 1:
        return x
    return (type(A) if A.format in ("csc", "csr") else sp.csc_array)(x)


def _operator(A: Any) -> Any:
    lu = _SuperLU(A)
    return spla.LinearOperator(A.shape, matvec=lu.solve, matmat=lu.solve, dtype=lu.dtype)


def _shifted(A: Any, M: Any, sigma: float) -> Any:
    if M is None:
        M = sp.eye_array(A.shape[0], format="csc", dtype=A.dtype)
    return (A - sigma * M).tocsc() if sigma != 0 else A


def _with_inverses(A: Any, M: Any, sigma: Any, options: "dict[str, Any]") -> None:
    """Adds OPinv, or Minv, as SciPy needs them, where the matrices are there and the caller gave none."""
    sparse = sp.issparse(A) and (M is None or sp.issparse(M))
    if sigma is not None and sparse and options.get("OPinv") is None and np.imag(sigma) == 0:
        options["OPinv"] = _operator(_shifted(A, M, float(np.real(sigma))))
    elif sigma is None and M is not None and sp.issparse(M) and options.get("Minv") is None:
        options["Minv"] = _operator(M)


def eigsh(A: Any, k: int = 6, M: Any = None, sigma: Any = None, **options: Any) -> Any:
    """As scipy.sparse.linalg.eigsh, with this solver's inverse of A - sigma M (or of M, where sigma is None)."""
    _with_inverses(A, M, sigma, options)
    return _eigsh(A, k=k, M=M, sigma=sigma, **options)


def eigs(A: Any, k: int = 6, M: Any = None, sigma: Any = None, **options: Any) -> Any:
    """As scipy.sparse.linalg.eigs; sigma must be real for this solver's inverse, else SciPy's own is taken."""
    _with_inverses(A, M, sigma, options)
    return _eigs(A, k=k, M=M, sigma=sigma, **options)


def _is_complex(A: Any) -> bool:
    return getattr(getattr(A, "dtype", None), "kind", "") == "c"


def _unless_complex(ours: Callable[..., Any], theirs: Callable[..., Any]) -> Callable[..., Any]:
    def chosen(A: Any, *args: Any, **kwargs: Any) -> Any:
        complex_values = _is_complex(A) or _is_complex(kwargs.get("M"))
        return (theirs if complex_values else ours)(A, *args, **kwargs)

    chosen.__name__, chosen.__doc__ = theirs.__name__, ours.__doc__
    return chosen


@contextlib.contextmanager
def patch() -> Iterator[None]:
    """Inside `with patch():` spsolve, factorized, splu, eigsh and eigs are this module's, in SciPy and in every loaded
    module that has taken them from there (`from scipy.sparse.linalg import spsolve`). Holds for the whole process and
    all of its threads."""
    changed = []
    try:
        for ours in (spsolve, factorized, splu, eigsh, eigs):
            theirs = getattr(spla, ours.__name__)
            chosen = _unless_complex(ours, theirs) if ours in (eigsh, eigs) else ours
            for name, module in list(sys.modules.items()):
                if name == __name__ or module is None:
                    continue
                for key, value in list(vars(module).items()) if hasattr(module, "__dict__") else ():
                    if value is theirs:
                        setattr(module, key, chosen)
                        changed.append((module, key, theirs))
        yield
    finally:
        for module, key, theirs in reversed(changed):
            setattr(module, key, theirs)
