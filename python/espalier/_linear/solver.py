"""The direct solver: analyze a pattern, factorize values, solve."""

import logging
import os
from typing import TYPE_CHECKING, Any, overload

from .. import _checks, _core, _device
from .._errors import Error, make_error, transposed_error
from .inverse import SelectedInverse
from .matrices import _STORAGE, _arrays, _floats, _indices, _numbers
from .operator import Inverse
from .pickled import Pickled
from .._progress import Asked, wanted, watching
from .results import Analysis, Change, Factor, Inertia, Solve
from .solutions import Solutions

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from typing_extensions import Unpack

    from .._options import MatrixOptions, SolverOptions

_core.set_error_maker(make_error)


def _finite(values: Any) -> bool:
    import numpy as np

    return bool(np.isfinite(values).all())


def _matrix_error(status: "tuple[int, str, int]", by_rows: bool, kind: str) -> Error:
    """The solver reads compressed rows as columns. What a symmetric factor says of rows holds for columns, too."""
    swapped = by_rows and (status[0] == 2 or status[0] == 3 and kind not in ("llt", "ldlt"))
    return transposed_error(*status) if swapped else make_error(*status)


class Solver(Solutions, SelectedInverse, Inverse, Pickled):
    """A direct solver for one sparse system at a time.

    A: scipy.sparse matrix or array of any format, or (indptr, indices, data) of compressed rows with indices from 0;
    it is analyzed and factorized. None: analyze() or factorize() come later. Its arrays are read during calls only.
    symmetry: "auto" finds out from the values; "general"; "symmetric" (both triangles are stored, the upper one is not
    read); "lower", "upper" (only that triangle is stored); "hermitian", "hermitian_lower", "hermitian_upper" likewise. log: a logging.Logger, by default "espalier".
    progress: "auto" shows analyses, factorizations and solves that take longer than a second, in terminals and notebooks;
    True, False; or a function, which is called with a Progress a few times a second in such calls of the main thread. options: those of the command line (kind, precision, device, threads, singular, ...); threads=0, the default: OMP_NUM_THREADS, else all cores.

    The values of A (then a matrix of cupyx.scipy.sparse, a sparse tensor of torch, or a triple) may lie on an NVIDIA GPU,
    as float64; `device` is then that GPU unless it is given. The pattern is analyzed on the host.

    Values may be complex (complex64, complex128; computed in complex128): symmetric, Hermitian and general matrices. Complex
    matrices that "auto" finds both symmetric and Hermitian, since they are real, are taken as symmetric. Such systems are
    solved on the host.

    Calls let other Python threads run and wait for each other on one solver. Ctrl-C ends a call of the main thread within
    about a tenth of a second, with KeyboardInterrupt: an analysis, or a factor, in the making is lost; the solver is
    usable afterwards. Raises InvalidInputError for wrong options.

    A solver can be pickled and copied: options, pattern, analysis and values go along, and the copy factorizes again when
    it is loaded; save_factor() and load_factor() keep the factor. Arrays of the pattern are kept for that, without a copy
    where they need no conversion.
    """

    def __init__(self, A: Any = None, *, symmetry: str = "auto", log: "logging.Logger | None" = None,
                 permutation: Any = None, progress: Asked = "auto", **options: "Unpack[SolverOptions]") -> None:
        self._asked = _STORAGE[_checks.choice(symmetry, "symmetry", _STORAGE)]  # of matrices that are given
        self._storage = self._asked  # of the analyzed one, which may be that of a file
        self._core = _core.Solver()
        self._options = {"symmetry": symmetry, "log": log, "permutation": permutation,
                         "progress": "auto" if callable(progress) else progress, **options}
        self._pattern: Any = None
        for key, value in _checks.options(options):
            self._core.set_option(key, value)
        if permutation is not None:
            self._core.set_permutation(_indices(permutation, "permutation", 2**31 - 1, "int32"))
        self._core.set_log(_checks.lines_of(log))
        self._n, self._by_rows, self._complex = 0, False, False
        self._progress = progress if callable(progress) else wanted(progress)
        self.analysis: "Analysis | None" = None
        self.factor: "Factor | None" = None
        self.last_solve: "Solve | None" = None
        self.last_inverse = None
        self.restored: "bool | None" = None  # by load_factor(): whether the factor's numbers are those of the file
        if A is not None:
            self.factorize(A)

    def analyze(self, A: Any) -> Analysis:
        """Orders the pattern of A; values, where there are any, are used for matching, scaling and the kind."""
        return self._analyze(self._taken(A)[0])

    def _taken(self, A: Any) -> "tuple[tuple[Any, Any, Any, bool], Any]":
        """_arrays() of A, and its values where they lie on a GPU."""
        A, on_gpu = _device.parts(A)
        if (on_gpu is not None and self.analysis is None and "device" not in self._options
                and "device" not in os.environ.get("ESPALIER_OPTIONS", "")):
            self._options["device"] = f"gpu:{_device.number_of(on_gpu)}"
            self._core.set_option("device", self._options["device"])
        return _arrays(A, True), on_gpu

    def _watch(self, what: str, expected: "float | None" = None) -> Any:
        return watching(self._progress, what, expected)

    def save_analysis(self, path: "str | os.PathLike[str]") -> None:
        """Writes the analysis to a file; load_analysis() of the same pattern then needs no ordering."""
        status = self._core.save_analysis(_checks.path(path, "path"))
        if status[0]:
            raise make_error(*status)

    def load_analysis(self, path: "str | os.PathLike[str]", A: Any) -> Analysis:
        """Takes the analysis of A from the file of save_analysis(), in place of analyze(A). Raises InvalidInputError
        where the file is damaged or belongs to another pattern."""
        return self._analyze(self._taken(A)[0], _checks.path(path, "path"))

    def save_factor(self, path: "str | os.PathLike[str]") -> None:
        """Writes the factor, with matrix and analysis, to a file that appears under its name when all of it is on the medium;
        what stood there stays until then. espalier.load_factor() goes on with it, in another process or on another machine.
        Raises InvalidInputError with the system's reason where the file cannot be written."""
        self._factored()
        status = self._core.save_factor(_checks.path(path, "path"))
        if status[0]:
            raise make_error(*status)

    def stored_matrix(self) -> Any:
        """The matrix of the last factorization as a new sparse array, of compressed rows or columns as it was given: the order
        in which factorize() takes values. One triangle where one is stored."""
        import numpy as np
        import scipy.sparse as sp

        self._factored()
        pointers, indices = self._pattern
        if not self._core.has_pattern(pointers, indices, self._by_rows, self._storage, self._complex):
            raise ValueError("the arrays of the matrix have been changed since its analysis: call factorize(A) again")
        values = self._core.values()
        kind = sp.csr_array if self._by_rows else sp.csc_array
        return kind((values.view(np.complex128) if self._complex else values, indices.copy(), pointers.copy()), shape=(self._n, self._n))

    def clone(self, threads: int = 0) -> "Solver":
        """Another solver with the same options that shares the analysis and has no factor yet: for threads, load cases
        and batches. threads: host threads of its own; 0: as many as this solver has."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__, _core=self._core.clone(_checks.whole(threads, "threads", 0, 4096)))
        other.factor = other.last_solve = other.last_inverse = None
        return other

    def _analyze(self, arrays: "tuple[Any, Any, Any, bool]", path: "str | None" = None,
                 complex_values: "bool | None" = None, storage: "int | None" = None) -> Analysis:
        """complex_values: what a pattern without values is for; None: real ones. storage: None: as it was asked for."""
        self.analysis = self.factor = self._pattern = None
        self._complex = bool(complex_values) if arrays[2] is None else arrays[2].dtype.kind == "c"
        self._storage = self._storage_of(self._complex) if storage is None else storage
        given = (*arrays[:2], _floats(arrays[2]), arrays[3], self._storage, self._complex)
        with self._watch(f"analyzing {len(arrays[0]) - 1} unknowns"):
            if path is None:
                status, found = self._core.analyze(*given)
            else:
                status, found = self._core.load_analysis(path, *given)
        if status[0]:
            raise _matrix_error(status, arrays[3], "")
        self._n, self._by_rows, self._pattern = len(arrays[0]) - 1, arrays[3], arrays[:2]
        self.analysis = Analysis(*found)
        return self.analysis

    def _storage_of(self, complex_values: bool) -> int:
        """Of a matrix that is given: a Hermitian one with real values is symmetric."""
        return self._asked - 3 if self._asked >= 4 and not complex_values else self._asked

    def analyze_change(self, A: Any) -> Change:
        """Analyzes a pattern that differs here and there from the analyzed one, in a small part of analyze()'s time: what
        the change does not touch stays. Where too much has changed, all is ordered anew, and `why` says so. A matrix that is
        refused (not finite, indices out of range, a row without entries) leaves analysis and factor as they were."""
        arrays = self._taken(A)[0]
        if self.analysis is None:
            raise RuntimeError("there is no analysis: call analyze(A) or factorize(A) first")
        values, storage = arrays[2], self._storage_of(self._complex)
        if values is not None and self._complex:
            values = values.astype("complex128", copy=False)
        if values is not None and values.dtype.kind == "c" and not self._complex:
            raise TypeError("complex values for a system that was analyzed as a real one: call analyze(A)")
        with self._watch(f"analyzing {len(arrays[0]) - 1} unknowns"):
            status, found, change = self._core.analyze_change(*arrays[:2], _floats(values), arrays[3], storage, self._complex)
        if status[0]:
            raise _matrix_error(status, arrays[3], "")  # what was there still is
        self.factor, self._storage = None, storage
        self._n, self._by_rows, self._pattern = len(arrays[0]) - 1, arrays[3], arrays[:2]
        self.analysis = Analysis(*found)
        return Change(self.analysis, *change)

    def factorize(self, A: Any, *, stream: Any = None) -> Factor:
        """Factorizes a matrix, or new values of the analyzed one: a vector in the order of its `data` (of a format
        other than CSR and CSC: in that of `A.tocsc().data`). A matrix with another pattern is analyzed first.

        Values may lie on the GPU that holds the factor, and are read there. stream: a CUDA stream (a number, or an object
        of CuPy, torch or numba) whose work is waited for, besides that of the array's own library.

        Raises SingularMatrixError, NotPositiveDefiniteError, OutOfMemoryError, DeviceError, InvalidInputError (NaN, wrong
        sizes, values that are not symmetric any more: give the matrix again)."""
        partial = str(self._options.get("partial_refactorization", False)).lower() in ("true", "on", "yes", "1")
        before = self.factor if partial else None  # which outlives values that are refused
        if isinstance(A, tuple) or hasattr(A, "tocsc") or _device.is_sparse_tensor(A):
            status, found = self._factorize_matrix(A, stream)
        else:
            status, found = self._factorize_values(A, stream)
        return self._taken_factor(status, found, before)

    def factorize_entries(self, places: Any, values: Any) -> Factor:
        """The values of the last factorization but for some: values[k] at places[k], whole numbers from 0 in the order of the
        matrix's `data` (of a format other than CSR and CSC: in that of `A.tocsc().data`); the last of equal places counts.
        Of a symmetric matrix that is stored in both triangles both places are needed. With `partial_refactorization=True`
        only what these values reach is made again.

        Raises InvalidInputError for values that are not finite and for places that do not exist or are stored twice: the
        factor is as it was then. SingularMatrixError, NotPositiveDefiniteError as factorize(): the factor is made again of the
        values before."""
        import numpy as np

        before = self._factored()
        places, values = np.atleast_1d(np.asarray(places)), np.atleast_1d(_numbers(values, "the values", True))
        if places.dtype.kind not in "iu" and places.size:
            raise TypeError(f"places of dtype {places.dtype}; they are whole numbers from 0")
        if places.ndim != 1 or values.shape != places.shape:
            raise ValueError(f"places of shape {places.shape} and values of shape {values.shape}: give two vectors of one length")
        if values.dtype.kind == "c" and not self._complex:
            raise TypeError("complex values for a real matrix: give the matrix")
        values = np.ascontiguousarray(values, dtype="complex128" if self._complex else "float64")
        with self._watch(*self._factorizing(before)):
            status, found = self._core.refactorize_entries(np.ascontiguousarray(places, dtype="int64"), _floats(values), self._n)
        return self._taken_factor(status, found, before)

    def _taken_factor(self, status: Any, found: Any, before: "Factor | None") -> Factor:
        if status[0]:
            self.factor = before if self._core.state() == 2 else None
            raise _matrix_error(status, self._by_rows, self.analysis.kind if self.analysis else "")
        found = [*found[:-2], *(v.view("complex128") if v is not None and self._complex else v for v in found[-2:])]
        self.factor = Factor(found[0], found[1], Inertia(*found[2]), *found[3:])
        return self.factor

    def _factorize_matrix(self, A: Any, stream: Any) -> Any:
        arrays, on_gpu = self._taken(A)
        if arrays[2] is None:
            raise ValueError("a pattern without values cannot be factorized")
        known = (self.analysis is not None and self._n == len(arrays[0]) - 1 and self._by_rows == arrays[3]
                 and (arrays[2].dtype.kind == "c") == self._complex and self._storage == self._storage_of(self._complex))
        if known and on_gpu is not None:
            known = self._core.has_pattern(arrays[0], arrays[1], arrays[3], self._storage, self._complex)
        if not known:
            self._analyze(arrays)
        if on_gpu is not None:
            return self._factorize_values(on_gpu, stream)
        self.factor = None
        with self._watch(*self._factorizing()):
            status, found = self._core.factorize(*arrays[:2], _floats(arrays[2]), arrays[3], self._storage, self._complex)
        if known and status[0] == 2 and _finite(arrays[2]):  # another pattern, or no longer symmetric
            self._analyze(arrays)
            with self._watch(*self._factorizing()):
                status, found = self._core.factorize(*arrays[:2], _floats(arrays[2]), arrays[3], self._storage, self._complex)
        return status, found

    def _factorize_values(self, values: Any, stream: Any) -> Any:
        on_gpu = _device.on_gpu(values)
        if not on_gpu:
            values = _numbers(values, "the values", True)
        if values.ndim == 2:
            raise ValueError(f"a dense array of shape {values.shape}: give a sparse matrix, scipy.sparse.csc_array(A)")
        if values.ndim != 1:
            raise ValueError(f"values of shape {values.shape}: give a vector in the order of the matrix's data")
        if self.analysis is None:
            raise RuntimeError("values of no matrix: call factorize(A) with a sparse matrix first")
        if on_gpu:
            _device.expect_kernels(values)
            view = _device.columns(values, "the values", stream)
        if not on_gpu and (values.dtype.kind == "c") != self._complex:
            if self._complex:
                values = values.astype("complex128")
            else:
                real_of_hermitian = self._storage == self._storage_of(False) != self._asked
                self._analyze((*self._pattern, values.copy(), self._by_rows),
                              storage=self._asked if real_of_hermitian else self._storage)
        before, self.factor = self.factor, None
        try:
            with self._watch(*self._factorizing(before)):
                if on_gpu:
                    return self._advised(
                        self._core.refactorize_device(view.address, view.shape[0], view.stream, self._n), values)
                return self._core.refactorize(_floats(values if values.flags.c_contiguous else values.copy()), self._n)
        except ValueError:  # not even begun: the number of values is wrong
            self.factor = before
            raise

    def _factorizing(self, before: "Factor | None" = None) -> "tuple[str, float | None]":
        """For _watch()."""
        assert self.analysis is not None
        return "factorizing", self.analysis.predicted_seconds if before is None else before.seconds

    @property
    def inertia(self) -> Inertia:
        """Of the factored matrix."""
        return self._factored().inertia

    @property
    def slogdet(self) -> "tuple[float | complex, float]":
        """Sign (of a complex matrix: phase) and logarithm of |det A|, as numpy.linalg.slogdet."""
        return self._factored().determinant_sign, self._factored().determinant_log

    def _factored(self) -> Factor:
        if self.factor is None:
            self._core.state()  # a closed solver says so
            raise RuntimeError("there is no factorization: call factorize(A) first")
        return self.factor

    def condition(self) -> float:
        """Estimate of the condition number in the 1-norm (of a general matrix by rows: in the maximum norm)."""
        self._factored()
        status, estimate = self._core.condition()
        if status[0]:
            raise make_error(*status)
        return float(estimate)

    def close(self) -> None:
        """Gives all memory back; waits for a call of another thread."""
        self._core.close()
        self.factor = None

    def __repr__(self) -> str:
        return f"<espalier.Solver: {self._words()}>"

    def _words(self) -> str:
        if self.analysis is None:
            return "no matrix yet"
        done = "factorized" if self.factor is not None else "analyzed"
        return (f"{self._n} unknowns, {done} as {self.analysis.kind}, {self.analysis.nonzeros_factor:.3g} entries of the"
                f" factor")

    def _repr_html_(self) -> str:
        tables = [t for t in (self.analysis, self.factor, self.last_solve) if t is not None]
        return f"<p>espalier.Solver: {self._words()}</p>" + "".join(t._repr_html_() for t in tables)

    def __enter__(self) -> "Solver":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()


@overload
def solve(A: Any, b: "NDArray[Any]", **options: "Unpack[MatrixOptions]") -> "NDArray[Any]": ...
@overload
def solve(A: Any, b: Any, **options: "Unpack[MatrixOptions]") -> Any: ...


def solve(A: Any, b: Any, **options: "Unpack[MatrixOptions]") -> Any:
    """x with A x = b; A and options as for Solver, b and x as for Solver.solve()."""
    if A is None:
        raise TypeError("A is None; it must be a sparse matrix")
    if "device" not in options and _device.on_gpu(b):
        _device.expect_kernels(b)
        options["device"] = f"gpu:{_device.number_of(b)}"
    with Solver(A, **options) as solver:
        return solver.solve(b)
