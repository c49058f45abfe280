"""What calls found out, one dataclass per call. Times in seconds, memory in bytes, indices from 0."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Iterable, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def brief(value: Any) -> str:
    """repr() of what is small, else kind and size."""
    if getattr(value, "size", 0) > 6:
        return f"<{value.dtype} {value.shape}>"
    if isinstance(value, (list, tuple, dict)) and len(value) > 8:
        return f"<{type(value).__name__} of {len(value)}>"
    return " ".join((str(value) if hasattr(value, "dtype") else repr(value)).split())


def table(head: str, names: "Iterable[str]", rows: "Iterable[Iterable[Any]]", most: int = 20) -> str:
    """A head and rows of numbers below their names; of many rows the first ones."""
    cells = [[v if isinstance(v, str) else str(v) if isinstance(v, int) else f"{v:.6g}" for v in row] for row in rows]
    shown = [list(names), *cells[:most]]
    widths = [max(len(row[k]) for row in shown) for k in range(len(shown[0]))]
    lines = ["  ".join(v.rjust(w) for v, w in zip(row, widths)) for row in shown]
    more = [f"... and {len(cells) - most} more"] if len(cells) > most else []
    return "\n  ".join([f"<espalier.{head}", *(lines if cells else []), *more]) + ">"


class _Table:
    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{f.name}={brief(getattr(self, f.name))}' for f in fields(self))})"  # type: ignore[arg-type]

    def _repr_html_(self) -> str:
        from html import escape

        rows = "".join(f"<tr><th>{f.name}</th><td>{escape(brief(getattr(self, f.name)))}</td></tr>"
                       for f in fields(self))  # type: ignore[arg-type]
        return f"<table><caption>{type(self).__name__}</caption>{rows}</table>"


class Inertia(NamedTuple):
    """Counts of eigenvalues by sign; -1 each for kind lu, and of complex symmetric matrices."""

    positive: int
    negative: int
    zero: int


@dataclass(frozen=True, repr=False)
class Analysis(_Table):
    """Of a pattern. `kind`: llt, ldlt or lu; `flops` and `nonzeros_factor` of one factorization."""

    kind: str
    seconds: float
    matching_seconds: float
    ordering_seconds: float
    plan_seconds: float
    nonzeros_factor: int
    flops: float
    fronts: int
    tiers: int
    largest_front: int
    predicted_bytes: int
    predicted_seconds: float
    device: str


@dataclass(frozen=True, repr=False)
class Change(_Table):
    """Of Solver.analyze_change(). `full`: all was ordered anew, `why` says for what reason; `reordered`: an order that was
    made beside the work since an earlier change has taken the place of the one before; `entries_of_order`: of the
    factor, by the last order. Entries that came or went are counted as they are stored."""

    analysis: Analysis
    full: bool
    why: str
    added_entries: int
    removed_entries: int
    moved_unknowns: int
    kept_fronts: int
    reordered: bool
    entries_of_order: int


@dataclass(frozen=True, repr=False)
class Factor(_Table):
    """Of a factorization. `null_vectors`: (n - rank, n) float64 (complex128), rows v with A v = 0, the largest number of each 1 in
    magnitude, or None for a regular matrix (and where they are many, unless `singular="null_vectors"` asks for them); `left_null_vectors`: likewise w with A^T w = 0, of a Hermitian matrix the conjugates;
    `work_share`: operations done over those for all fronts, below 1 with `partial_refactorization=True`;
    `determinant_sign` of a complex matrix is the phase of the determinant; nan where it is not known (on GPUs, but for
    Hermitian matrices)."""

    seconds: float
    flops_per_second: float
    inertia: Inertia
    determinant_sign: "float | complex"
    determinant_log: float
    rank: int
    two_by_two: int
    perturbed: int
    delayed: int
    peak_host_bytes: int
    device: str
    work_share: float
    dependent_rows: "list[int]"
    dependent_columns: "list[int]"
    null_vectors: "NDArray[np.float64] | NDArray[np.complex128] | None"
    left_null_vectors: "NDArray[np.float64] | NDArray[np.complex128] | None"


@dataclass(frozen=True, repr=False)
class Solve(_Table):
    """Of a solve: errors are the largest over all right-hand sides."""

    seconds: float
    solve_seconds: float
    refinement_steps: int
    backward_error: float
    componentwise_error: float


@dataclass(frozen=True, repr=False)
class SolveRows(Solve):
    """Of solve(b, rows=...). `share`: of the factor's entries that were read, of both sweeps; below 1 the errors are those of a
    whole solution by the same factor, without refinement, for a random right-hand side."""

    share: float


@dataclass(frozen=True, repr=False)
class InverseEntries(_Table):
    """Of entries of an inverse. `error`: estimated, the largest error of an entry over the largest entry of its column of
    A^-1 (of A^-T where A is of compressed rows); `entry_error`: over the entry itself. `checked` columns were solved for and
    compared; `solved` columns had entries outside the pattern of the factor and were solved for. `trace_error`: of
    trace_of_inverse(), absolute; else nan."""

    seconds: float
    error: float
    entry_error: float
    trace_error: float
    checked: int
    solved: int
