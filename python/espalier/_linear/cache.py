"""Solvers by pattern, for adapters whose hosts hand over plain arrays at every call."""

import threading
from collections import OrderedDict
from contextlib import contextmanager
from typing import Any, Callable, Iterator

import numpy as np

from .solver import Solver

_MOST = 8  # patterns kept
_lock = threading.Lock()
_known: "OrderedDict[str, _Entry]" = OrderedDict()


class _Entry:
    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.solver: "Solver | None" = None
        self.values: Any = None  # of its factor


def key_of(indptr: Any, indices: Any) -> str:
    """Of a pattern on the host."""
    from hashlib import blake2b

    digest = blake2b(digest_size=24)
    for array in (indptr, indices):
        digest.update(np.ascontiguousarray(array, np.int64).data)
    return digest.hexdigest()


def _entry(key: str) -> _Entry:
    with _lock:
        entry = _known.setdefault(key, _Entry())
        _known.move_to_end(key)
        while len(_known) > _MOST:
            _known.popitem(last=False)
    return entry


def solve(indptr: Any, indices: Any, data: Any, b: Any, transpose: bool, *, key: str = "", out: Any = None) -> Any:
    """x with A x = b or A^T x = b, float64 of b's shape; A by compressed rows, on the host. The analysis of the last eight
    patterns is kept, with the last factor of each: the same values once more, as in the backward pass, cost a comparison.
    key: of the pattern, where it is known; out: as for Solver.solve()."""
    with _factorized(indptr, indices, data, key) as solver:
        return solver.solve(b, out=out, transpose=transpose)


@contextmanager
def _factorized(indptr: Any, indices: Any, data: Any, key: str = "") -> "Iterator[Solver]":
    """The kept solver of the pattern with a factor of these values, for the time of a call."""
    entry = _entry(key or key_of(indptr, indices))
    with entry.lock:
        if entry.solver is None:
            entry.solver = Solver()
        if entry.values is None or not np.array_equal(entry.values, data):
            entry.values = None
            kept = np.array(data, np.float64)
            entry.solver.factorize((indptr, indices, kept))
            entry.values = kept
        yield entry.solver


def slogdet(indptr: Any, indices: Any, data: Any) -> "tuple[float, float]":
    """Sign and logarithm of |det A|; the factor is kept as that of solve()."""
    with _factorized(indptr, indices, data) as solver:
        sign, logarithm = solver.slogdet
        return float(sign.real), logarithm


def slogdet_gradient(indptr: Any, indices: Any, data: Any) -> Any:
    """That of log|det A| by data: (A^-1)_ji for the entries a_ij."""
    with _factorized(indptr, indices, data) as solver:
        return solver.selected_inverse().data


def solve_on_gpu(key: str, pattern: "Callable[[], tuple[Any, Any]]", values: Any, host_values: "Callable[[], Any]",
                 same: "Callable[[Any], bool]", copy: "Callable[[], Any]", b: Any, transpose: bool, *, device: str,
                 symmetric: bool, **to_solve: Any) -> Any:
    """The same with values and b on a GPU. pattern(), host_values(): on the host, asked for by analyses; same(v): whether
    the kept values v are these; copy(): of these, to be kept. symmetric: nobody looks whether they are."""
    entry = _entry(f"{key} {device} {symmetric}")
    with entry.lock:
        if entry.solver is None:
            solver = Solver(device=device, symmetry="symmetric") if symmetric else Solver(device=device, kind="lu")
            solver.analyze((*pattern(), host_values()))
            entry.solver = solver
        if entry.values is None or not same(entry.values):
            entry.values = None
            entry.solver.factorize(values, stream=to_solve.get("stream"))
            entry.values = copy()
        return entry.solver.solve(b, transpose=transpose, **to_solve)


def clear() -> None:
    """Gives back the memory of all kept solvers."""
    with _lock:
        _known.clear()
