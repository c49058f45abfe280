"""Solvers by pattern, for adapters whose hosts hand over plain arrays at every call."""

import threading
from collections import OrderedDict
from typing import Any

import numpy as np

from ._solver import Solver

_MOST = 8  # patterns kept
_lock = threading.Lock()
_known: "OrderedDict[bytes, _Entry]" = OrderedDict()


class _Entry:
    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.solver: "Solver | None" = None
        self.values: Any = None


def _entry(indptr: Any, indices: Any, options: "dict[str, Any]") -> _Entry:
    from hashlib import blake2b

    digest = blake2b(repr(sorted(options.items())).encode())
    for array in (indptr, indices):
        digest.update(np.ascontiguousarray(array, np.int64).data)
    with _lock:
        entry = _known.setdefault(digest.digest(), _Entry())
        _known.move_to_end(digest.digest())
        while len(_known) > _MOST:
            _known.popitem(last=False)
    return entry


def solve(indptr: Any, indices: Any, data: Any, b: Any, transpose: bool, **options: Any) -> Any:
    """x with A x = b or A^T x = b, float64 of b's shape; A by compressed rows. The analysis of the last eight patterns is
    kept, with the last factor of each: the same values once more, as in the backward pass, cost a comparison."""
    entry = _entry(indptr, indices, options)
    values = np.array(data, np.float64)
    with entry.lock:
        if entry.solver is None:
            entry.solver = Solver(**options)
        if entry.values is None or not np.array_equal(entry.values, values):
            entry.values = None
            entry.solver.factorize((indptr, indices, values))
            entry.values = values
        return entry.solver.solve(b, transpose=transpose)


def clear() -> None:
    """Gives back the memory of all kept solvers."""
    with _lock:
        _known.clear()
