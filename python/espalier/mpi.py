"""Solvers that the processes of an MPI communicator share, with mpi4py."""

import logging
import os
from pathlib import Path
from typing import Any

from . import _checks, _core
from ._errors import make_error
from ._linear.results import Analysis, Factor, Inertia, Solve
from ._linear.matrices import _STORAGE, _floats, _indices, _numbers

__all__ = ["Solver", "adapter"]


def adapter() -> str:
    """The file of the adapter to the MPI that mpi4py has loaded: ESPALIER_MPI_ADAPTER, or an espalier_mpi_NAME.so beside
    this package, above it (a build), or where `espalier mpi-adapter` puts it. Raises FileNotFoundError."""
    from mpi4py import MPI

    if given := os.environ.get("ESPALIER_MPI_ADAPTER"):
        return given
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "espalier"
    here = Path(__file__).parent
    found = [str(f) for folder in (here, here.parent.parent, cache) for f in sorted(folder.glob("espalier_mpi_*.so"))]
    name = MPI.get_vendor()[0]
    open_mpi = "Open MPI" in name
    fitting = [f for f in found if ("openmpi" in Path(f).name) == open_mpi]
    if not fitting:
        raise FileNotFoundError(f"there is no adapter to {name}: make one by 'espalier mpi-adapter --cc mpicc', or name one"
                                " in ESPALIER_MPI_ADAPTER")
    return fitting[0]


class Solver:
    """A direct solver for one sparse system at a time, of which every process of `comm` has rows (docs/guide/mpi.md).

    comm: an mpi4py.MPI.Intracomm; a copy of it is used. symmetry: "general"; "symmetric" (both triangles are stored, the
    upper one is not read); "lower", "upper" (all processes together store that triangle alone); "hermitian",
    "hermitian_lower", "hermitian_upper" likewise. patience: seconds after which a process that sends nothing, while others
    wait for it, counts as lost. nodes: "host", or "process" where each process is to be a machine of its own (GPUs that do
    not reach each other). options: those of espalier.Solver (kind, precision, device, threads, singular, ...), the same on
    all processes but for threads, budgets and log.

    Values may be complex (complex64, complex128; computed in complex128): where those of one process are, the matrix is.

    All calls but `rows` are collective. What is wrong on one process is raised on all of them. MPI is called by the thread
    that calls the solver."""

    def __init__(self, comm: Any, *, symmetry: str = "general", patience: float = 300.0, nodes: str = "host",
                 log: "logging.Logger | None" = None, **options: Any) -> None:
        self._comm = comm
        self._pattern: Any = None
        self._n, self._complex = 0, False
        self.analysis: "Analysis | None" = None
        self.factor: "Factor | None" = None
        self.last_solve: "Solve | None" = None

        def checked() -> str:
            _checks.choice(symmetry, "symmetry", [k for k in _STORAGE if k != "auto"])
            _checks.choice(nodes, "nodes", ("host", "process"))
            _checks.real(patience, "patience")
            return adapter()

        self._core = _core.RankSolver(self._on_all(checked), comm.py2f(), _checks.real(patience, "patience"), nodes == "process")
        self._storage = _STORAGE[symmetry]
        self._hermitian = symmetry.startswith("hermitian")
        self._on_all(lambda: [self._core.set_option(key, value) for key, value in _checks.options(options)])
        self._core.set_log(self._on_all(lambda: _checks.lines_of(log)))

    def _on_all(self, body: Any) -> Any:
        """What body() returns; what it raises on one process is raised on all."""
        error: "Exception | None" = None
        value = None
        try:
            value = body()
        except Exception as e:  # whatever it is, the others must hear of it
            error = e
        said = self._comm.allgather(None if error is None else f"{type(error).__name__}: {error}")
        if error is not None:
            raise error
        for rank, text in enumerate(said):
            if text is not None:
                raise make_error(2, f"rank {rank}: {text}", -1)
        return value

    def _part(self, A: Any, first_row: "int | None", n: "int | None") -> "tuple[int, int | None, Any, Any, Any]":
        """(n, first row, indptr, indices, values or None) of this process."""
        import numpy as np

        if isinstance(A, tuple):
            if len(A) != 3 or n is None:
                raise TypeError("rows as a tuple are (indptr, indices, data), with n=... of the whole matrix")
            indptr, indices, data = A
            n = _checks.whole(n, "n", 1)
        else:
            if not hasattr(A, "tocsr") or len(A.shape) != 2:
                raise TypeError(f"{type(A).__name__} is no sparse matrix: give rows of scipy.sparse or (indptr, indices, data)")
            A = A.tocsr()
            if n is not None and n != A.shape[1]:
                raise ValueError(f"rows of {A.shape[1]} columns of a matrix of {n}")
            n, indptr, indices, data = A.shape[1], A.indptr, A.indices, A.data
        if not 0 < n < 2**31:
            raise ValueError(f"a matrix of {n} rows; there must be from 1 to 2^31 - 1")
        indptr = _indices(indptr, "indptr", 2**62, "int64")
        if indptr.size < 1 or indptr[0] != 0:
            raise ValueError("indptr must begin with 0")
        count = int(indptr[-1])
        indices = _indices(np.asarray(indices)[:count], "indices", n - 1, "int32")
        if data is not None:
            data = np.ascontiguousarray(_numbers(np.asarray(data)[:count], "the matrix", True))
            if data.shape != indices.shape:
                raise ValueError(f"data of shape {data.shape} for {len(indices)} indices")
        if first_row is not None and not 0 <= (first_row := _checks.whole(first_row, "first_row")) <= n - (indptr.size - 1):
            raise ValueError(f"{indptr.size - 1} rows from row {first_row} on, of a matrix of {n}")
        return n, first_row, indptr, indices, data

    def analyze(self, A: Any, *, first_row: "int | None" = None, n: "int | None" = None) -> Analysis:
        """Orders the pattern. A: this process's rows, of scipy.sparse and of shape (rows, n), or (indptr, indices, data) of
        compressed rows with n; data may be None on all processes. first_row: of A, from 0; None: the rows of the processes
        follow each other. Rows that several have are summed; a process may have none."""
        return self._analyze(self._on_all(lambda: self._part(A, first_row, n)))

    def save_analysis(self, path: "str | os.PathLike[str]") -> None:
        """Writes the analysis to a file, by process 0; load_analysis() of the same pattern then needs no ordering. It is that
        of espalier.Solver for the same matrix in compressed columns."""
        def checked() -> str:
            if self.analysis is None:
                raise RuntimeError("there is no analysis: call analyze(A) or factorize(A) first")
            return _checks.path(path, "path")

        status = self._core.save_analysis(self._on_all(checked))
        if status[0]:
            raise make_error(*status)

    def load_analysis(self, path: "str | os.PathLike[str]", A: Any, *, first_row: "int | None" = None,
                      n: "int | None" = None) -> Analysis:
        """Takes the analysis of A from the file of save_analysis(), which every process reads, in place of analyze(A, ...).
        Raises InvalidInputError where the file is damaged or belongs to another pattern."""
        part, file = self._on_all(lambda: (self._part(A, first_row, n), _checks.path(path, "path")))
        return self._analyze(part, file)

    def _analyze(self, part: Any, path: "str | None" = None) -> Analysis:
        n, first_row, indptr, indices, data = part
        counts = self._comm.allgather((len(indptr) - 1, first_row is None, n, data is None, _is_complex(data)))
        if any(c[1:4] != counts[0][1:4] for c in counts):
            raise make_error(2, "n, first_row=None and data=None must be the same on all processes", -1)
        if first_row is None:
            if sum(c[0] for c in counts) != n:
                raise make_error(2, f"the processes have {sum(c[0] for c in counts)} rows of {n}: give first_row", -1)
            first_row = sum(c[0] for c in counts[:self._comm.Get_rank()])
        self.analysis = self.factor = self._pattern = None
        self._complex = self._hermitian or any(c[4] for c in counts)
        status, found = self._core.analyze(n, first_row, indptr, indices, self._pairs(data), self._storage, self._complex, path)
        if status[0]:
            raise make_error(*status)
        self._n, self._pattern = n, (indptr.copy(), indices.copy(), first_row)  # the caller may sort his own in place
        self.analysis = Analysis(*found)
        return self.analysis

    def _pairs(self, values: Any) -> Any:
        """Values for _core: of complex matrices pairs of float64."""
        return _floats(values.astype("complex128", copy=False)) if self._complex and values is not None else values

    def factorize(self, A: Any, *, first_row: "int | None" = None, n: "int | None" = None) -> Factor:
        """Factorizes the matrix of which A are this process's rows, as for analyze(), or new values of the analyzed
        pattern: a vector in the order of this process's data. Another pattern, and complex values of a real one, are
        analyzed first."""
        import numpy as np

        def values_of() -> "tuple[Any, Any]":
            if isinstance(A, tuple) or hasattr(A, "tocsr"):
                part = self._part(A, first_row, n)
                if part[4] is None:
                    raise ValueError("a pattern without values cannot be factorized")
                return part, part[4]
            if self._pattern is None:
                raise RuntimeError("values of no matrix: call factorize(A) with rows of a sparse matrix first")
            values = np.ascontiguousarray(_numbers(A, "the values", True))
            if values.shape != self._pattern[1].shape:
                raise ValueError(f"values of shape {values.shape} for {len(self._pattern[1])} entries")
            return None, values

        part, values = self._on_all(values_of)
        known = part is None or (self._pattern is not None and part[0] == self._n and part[1] in (None, self._pattern[2])
                                 and np.array_equal(part[2], self._pattern[0]) and np.array_equal(part[3], self._pattern[1]))
        kinds = self._comm.allgather((part is None, known, _is_complex(values)))
        if any(k[0] != kinds[0][0] for k in kinds):
            raise make_error(2, "some processes give rows, others values alone", -1)
        complex_values = self._hermitian or any(k[2] for k in kinds)
        if part is None and complex_values and not self._complex:
            indptr, indices, first = self._pattern
            self._analyze((self._n, first, indptr, indices, values))
        elif part is not None and (complex_values != self._complex or not all(k[1] for k in kinds)):
            self._analyze(part)
        self.factor = None
        status, found = self._core.refactorize(self._pairs(values))
        if status[0]:
            raise make_error(*status)
        found = [*found[:-2], *(v.view("complex128") if v is not None and self._complex else v for v in found[-2:])]
        self.factor = Factor(found[0], found[1], Inertia(*found[2]), *found[3:])
        return self.factor

    def set_rows(self, first: int, count: int) -> None:
        """This process gives and gets rows first ... first + count - 1 of vectors, from the next solve() on until the next
        analysis. All processes together must give every row; rows that several give are summed."""
        def checked() -> "tuple[int, int]":
            if self._pattern is None:
                raise RuntimeError("there is no matrix yet: call factorize(A) first")
            begin = _checks.whole(first, "first", 0, self._n)
            return begin, _checks.whole(count, "count", 0, self._n - begin)

        self._core.set_rows(*self._on_all(checked))

    @property
    def rows(self) -> "tuple[int, int]":
        """(first, count): the rows of vectors that this process gives and gets."""
        return tuple(self._core.rows())

    def solve(self, b: Any, *, transpose: "bool | str" = False) -> Any:
        """This process's rows of x with A x = b, A^T x = b (transpose=True) or A^H x = b (transpose="H"), of the shape of b,
        its rows (count,) or (count, k): float64, or complex128 where A, or b on one of the processes, is complex."""
        import numpy as np

        def checked() -> Any:
            if self.factor is None:
                raise RuntimeError("there is no factorization: call factorize(A) first")
            _checks.transposition(transpose)
            right = _numbers(b, "b", True)
            if right.ndim not in (1, 2) or right.shape[0] != self.rows[1]:
                raise ValueError(f"b has shape {tuple(right.shape)}; this process has {self.rows[1]} rows")
            return right

        right = self._on_all(checked)
        columns = 1 if right.ndim == 1 else right.shape[1]
        transpose = _checks.transposition(transpose)
        given = self._comm.allgather((columns, transpose, _is_complex(right)))
        if any(g[:2] != given[0][:2] for g in given):
            raise make_error(2, "the processes give different numbers of right-hand sides, or another transpose", -1)
        how = 2 if transpose == "H" else int(transpose)
        if self._complex or not any(g[2] for g in given):
            return self._solved(right.astype("complex128" if self._complex else "float64", copy=False), columns, how)
        parts = right.reshape(len(right), columns)  # of a real matrix both parts are right-hand sides
        x = self._solved(np.hstack([parts.real, parts.imag]), 2 * columns, how)
        return (x[:, :columns] + 1j * x[:, columns:]).reshape(right.shape)

    def _solved(self, right: Any, columns: int, how: int) -> Any:
        """x of this process for numbers of the matrix's sort."""
        import numpy as np

        right = np.asfortranarray(right)
        x = np.empty_like(right)
        if columns > 0:
            status, found = self._core.solve(_floats(right.T), _floats(x.T), columns, how)
            self.last_solve = Solve(*found)
            if status[0]:
                raise make_error(*status)
        return x

    def close(self) -> None:
        """Gives all memory back. Call it before MPI ends."""
        self._core.close()
        self.factor = None

    def __enter__(self) -> "Solver":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()


def _is_complex(a: Any) -> bool:
    return a is not None and a.dtype.kind == "c"
