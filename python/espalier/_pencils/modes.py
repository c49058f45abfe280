"""Modes: the lowest eigenvalues of symmetric pencils, proven complete."""

import logging
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Mapping

from .. import _checks, _core
from .._errors import AccuracyWarning, make_error
from .._progress import Asked, watching
from .._linear.results import _Table, table
from .._linear.matrices import _STORAGE, _arrays, not_sparse

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from typing_extensions import Unpack

    from .._options import SolverOptions


@dataclass(frozen=True, repr=False)
class Modes(_Table):
    """Of a pencil. Vectors are the columns of `vectors`, (n, count), orthonormal in the inner product of M (buckling: of K).

    `residuals`: ||K x - l M x||_2 / ((||K||_inf + |l| ||M||_inf) ||x||_2). `error_bounds`: an eigenvalue lies no farther from
    the given one, but for rounding. `orthogonality`: the largest |x_i' M x_j - delta_ij|. `complete`: proven that none is
    missing; `completeness` says how, or why not. `counts`: pairs of a number and how many eigenvalues lie below it.
    """

    eigenvalues: "NDArray[np.float64]"
    vectors: "NDArray[np.float64]"
    residuals: "NDArray[np.float64]"
    error_bounds: "NDArray[np.float64]"
    orthogonality: float
    complete: bool
    completeness: str
    finite: int
    massless: int
    counts: "tuple[tuple[float, int], ...]"
    factorizations: int
    solved_columns: int
    restarts: int
    peak_bytes: int
    seconds: "dict[str, float]"

    @property
    def frequencies(self) -> "NDArray[np.float64]":
        """sqrt(l) / (2 pi) of each mode of vibration; NaN where l is negative."""
        import numpy as np

        with np.errstate(invalid="ignore"):
            return np.sqrt(self.eigenvalues) / (2 * math.pi)

    def __len__(self) -> int:
        return len(self.eigenvalues)

    def __repr__(self) -> str:
        rows = ((k + 1, *map(float, row)) for k, row in
                enumerate(zip(self.eigenvalues, self.frequencies, self.residuals, self.error_bounds)))
        return table(f"Modes: {len(self)} of {len(self.vectors)} unknowns, {'complete' if self.complete else 'not proven to be complete'}",
                     ("mode", "eigenvalue", "frequency", "residual", "error bound"), rows)


def _search(K: Any, M: Any, symmetry: str, buckling: bool, log: "logging.Logger | None", progress: Asked,
            given: "dict[str, Any]", solver: "Mapping[str, Any]") -> Modes:
    import warnings

    _checks.choice(symmetry, "symmetry", ("auto", "symmetric", "lower", "upper"))
    for key in ("kind", "precision", "singular", "permutation"):
        if key in solver:
            raise ValueError(f"{key} has no meaning here: modes choose it")
    arrays = []
    for name, a in (("K", K), ("M", M)):
        pointers, indices, values, by_rows = _arrays(a)
        if values is None:
            raise ValueError(f"{name} has no values, only a pattern")
        arrays.append((pointers, indices, values, by_rows))
    # Rows of a symmetric matrix are its columns; those of a triangle are the columns of the other one.
    storage = {_STORAGE[symmetry] if not by_rows or symmetry not in ("lower", "upper") else 3 - _STORAGE[symmetry]
               for *_, by_rows in arrays}
    if len(storage) > 1:
        raise ValueError("K and M are triangles, one by rows and one by columns: convert one of them")
    with watching(progress, "seeking modes"):
        status, fields = _core.find_modes(*arrays[0][:3], *arrays[1][:3], storage.pop(), buckling, given,
                                          _checks.options(solver), _checks.lines_of(log))
    eigenvalues, vectors, *rest = fields
    found = Modes(eigenvalues, vectors.T, *rest)
    if status[0] == 7:
        warnings.warn(AccuracyWarning(status[1]), stacklevel=3)
    elif status[0] != 0:
        raise make_error(*status)
    return found


def _options(count: "int | None", below: "float | None", shift: "float | None", tolerance: float, prove: bool,
             check_mass: bool, block_size: int, basis_size: int, seed: int) -> "dict[str, Any]":
    if count is None and below is None:
        raise ValueError("nothing is asked for: give count, or below")
    return {"count": 0 if count is None else _checks.whole(count, "count", 1),
            "below": math.inf if below is None else _checks.real(below, "below"),
            "shift": math.nan if shift is None else _checks.real(shift, "shift"),
            "tolerance": _checks.real(tolerance, "tolerance"), "prove": _checks.flag(prove, "prove"),
            "check_mass": _checks.flag(check_mass, "check_mass"), "block_size": _checks.whole(block_size, "block_size"),
            "basis_size": _checks.whole(basis_size, "basis_size"), "seed": _checks.whole(seed, "seed", 0, 2**64 - 1)}


def modes(K: Any, M: Any, count: "int | None" = None, *, below: "float | None" = None, shift: "float | None" = None,
          tolerance: float = 1e-10, prove: bool = True, check_mass: bool = True, block_size: int = 0, basis_size: int = 0,
          seed: int = 1, symmetry: str = "auto", log: "logging.Logger | None" = None, progress: Asked = "auto",
          **solver: "Unpack[SolverOptions]") -> Modes:
    """The lowest eigenvalues of K x = l M x with their vectors: `count` of them, or all below `below`, or the fewer of both.

    K: symmetric, of scipy.sparse or (indptr, indices, data), also singular (free bodies) or with rows of constraints
    [A G'; G 0]. M: symmetric positive semi-definite, of the same shape; rows of zeros are no hindrance. symmetry: "auto" and
    "symmetric" (both triangles are stored), "lower", "upper" (only that one). shift: where the search begins, by default a
    little below zero. prove: count by inertia at the end that none is missing. check_mass: factorize M to see that it is
    semi-definite. progress: as for Solver. solver: device, threads, host_memory and the like, as for Solver.

    Raises InvalidInputError for matrices and numbers that cannot be, SingularMatrixError where det(K - s M) = 0 for every s or
    for `shift`, OutOfMemoryError. Warns with AccuracyWarning where some were not found. Ctrl-C ends it with KeyboardInterrupt.
    """
    return _search(K, M, symmetry, False, log, progress,
                   _options(count, below, shift, tolerance, prove, check_mass, block_size, basis_size, seed), solver)


def buckling_modes(K: Any, Kg: Any, count: int, *, tolerance: float = 1e-10, prove: bool = True, block_size: int = 0,
                   basis_size: int = 0, seed: int = 1, symmetry: str = "auto", log: "logging.Logger | None" = None,
                   progress: Asked = "auto", **solver: "Unpack[SolverOptions]") -> Modes:
    """The smallest positive l of K x = l Kg x (where a program has K + l Kgeo: Kg = -Kgeo). K: symmetric positive definite, but
    for rows of constraints; Kg: symmetric. Arguments and exceptions as for modes(); vectors have x' K x = 1."""
    return _search(K, Kg, symmetry, True, log, progress,
                   _options(count, None, None, tolerance, prove, True, block_size, basis_size, seed), solver)


@dataclass(frozen=True, repr=False)
class QuadraticModes(_Table):
    """Of (l^2 M + l C + K) x = 0: complex eigenvalues by distance from the shift, one of each conjugate pair; vectors are the
    columns of `vectors`, (n, count), of norm 1. `residuals`: ||Q(l) x||_2 / ((|l|^2 ||M|| + |l| ||C|| + ||K||) ||x||_2)."""

    eigenvalues: "NDArray[np.complex128]"
    vectors: "NDArray[np.complex128]"
    residuals: "NDArray[np.float64]"
    shift: float
    solved_columns: int

    @property
    def frequencies(self) -> "NDArray[np.float64]":
        """|Im l| / (2 pi)."""
        return abs(self.eigenvalues.imag) / (2 * math.pi)

    @property
    def damping_ratios(self) -> "NDArray[np.float64]":
        """-Re l / |l|."""
        return -self.eigenvalues.real / abs(self.eigenvalues)

    def __len__(self) -> int:
        return len(self.eigenvalues)

    def __repr__(self) -> str:
        rows = ((k + 1, f"{v:.6g}", float(f), float(d), float(r)) for k, (v, f, d, r) in
                enumerate(zip(self.eigenvalues, self.frequencies, self.damping_ratios, self.residuals)))
        return table(f"QuadraticModes: {len(self)} of {len(self.vectors)} unknowns",
                     ("mode", "eigenvalue", "frequency", "damping ratio", "residual"), rows)


def quadratic_modes(K: Any, C: Any, M: Any, count: int = 6, *, shift: "float | None" = None, tolerance: float = 1e-10,
                    basis_size: int = 0, progress: Asked = "auto", **solver: "Unpack[SolverOptions]") -> QuadraticModes:
    """The few eigenvalues of (l^2 M + l C + K) x = 0 nearest to a real shift (None: a little below zero, for the slowest
    motions): damping, gyroscopic and circulatory terms, rows of constraints [K G'; G 0]. K, C, M: real, of one shape, all
    entries stored, of scipy.sparse. Nothing proves that none was missed; up to 150 rows all are computed, and fewer than
    `count` come where there are no more. Raises as modes() does; warns with AccuracyWarning
    where some were not found."""
    import warnings

    arrays = []
    for name, a in (("K", K), ("C", C), ("M", M)):
        if not hasattr(a, "tocsc"):
            raise not_sparse(a, name)
        pointers, indices, values, _ = _arrays(a.tocsc())
        if values is None:
            raise ValueError(f"{name} has no values, only a pattern")
        arrays += [pointers, indices, values]
    with watching(progress, "seeking modes"):
        status, eigenvalues, vectors, residuals, taken, columns = _core.find_quadratic_modes(
            *arrays, 0, _checks.whole(count, "count", 1), math.nan if shift is None else _checks.real(shift, "shift"),
            _checks.real(tolerance, "tolerance"), _checks.whole(basis_size, "basis_size"), _checks.options(solver))
    found = QuadraticModes(eigenvalues[..., 0] + 1j * eigenvalues[..., 1],
                           (vectors[..., 0] + 1j * vectors[..., 1]).T, residuals, taken, columns)
    if status[0] == 7:
        warnings.warn(AccuracyWarning(status[1]), stacklevel=2)
    elif status[0] != 0:
        raise make_error(*status)
    return found
