"""Solvers that are pickled: options, matrix, analysis, and values in order to factorize anew."""

import os
from typing import Any

from .matrices import SYMMETRIES


class Pickled:
    """What a Solver is for pickle."""

    _core: Any
    _options: "dict[str, Any]"
    _pattern: Any
    _by_rows: bool
    _storage: int
    _complex: bool
    analysis: Any
    factor: Any

    def save_analysis(self, path: "str | os.PathLike[str]") -> None:
        """See Solver.save_analysis()."""
        raise NotImplementedError

    def _storage_of(self, complex_values: bool) -> int:
        raise NotImplementedError

    def __reduce__(self) -> Any:
        state = self._core.state()
        if state == 0:
            return _revive, (type(self), self._options)
        if not self._core.has_pattern(self._pattern[0], self._pattern[1], self._by_rows, self._storage, self._complex):
            raise ValueError("the arrays of the matrix have been changed since its analysis: call factorize(A) again"
                             " before the solver is pickled")
        from tempfile import TemporaryDirectory

        with TemporaryDirectory() as folder:
            file = os.path.join(folder, "analysis")
            self.save_analysis(file)
            with open(file, "rb") as f:
                analysis = f.read()
        values = None if self.factor is None else self._core.values()
        if values is not None and self._complex:
            values = values.view("complex128")
        options = dict(self._options)
        if self._storage != self._storage_of(self._complex):  # of a file
            options["symmetry"] = SYMMETRIES[self._storage + 1]
        if self.analysis is not None and options.get("kind", "auto") != "auto":
            options["kind"] = self.analysis.kind
        return _revive, (type(self), options, self._pattern, self._by_rows, analysis, values, self._complex)


def _revive(kind: "type[Any]", options: "dict[str, Any]", pattern: Any = None, by_rows: bool = False,
            analysis: bytes = b"", values: Any = None, complex_values: bool = False) -> Any:
    solver = kind(**options)
    if pattern is None:
        return solver
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        file = os.path.join(folder, "analysis")
        with open(file, "wb") as f:
            f.write(analysis)
        solver._analyze((*pattern, values, by_rows), file, complex_values)
    if values is not None:
        solver.factorize(values)
    return solver
