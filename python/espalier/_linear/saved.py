"""A solver with the factor of a file."""

import logging
import os
from typing import TYPE_CHECKING

from .. import _checks
from .._errors import make_error
from .matrices import SYMMETRIES
from .._progress import Asked
from .results import Analysis
from .solver import Solver

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .._options import SolverOptions


def load_factor(path: "str | os.PathLike[str]", *, symmetry: "str | None" = None, log: "logging.Logger | None" = None,
                progress: Asked = "auto", **options: "Unpack[SolverOptions]") -> Solver:
    """A factorized Solver by the file of Solver.save_factor(), also of C and C++.

    Kind and precision are those of the file, threads and device those of the options. On the host, in core, the numbers of
    the factor are taken from the file, and solutions have the bits of the solver that was saved, for any number of threads;
    else (a GPU, another width of blocks) the matrix is factorized again, without an analysis. `solver.restored` tells which.

    Everything is there that the saved solver could do. factorize(values) takes new values in the order of
    `solver.stored_matrix().data`, which has duplicates summed. symmetry: of matrices that are given later, as for Solver; None:
    that of the file, so that the triangle of a symmetric matrix is taken for one again.

    Raises InvalidInputError for a file that is cut off, damaged, none of ours or of a newer program."""
    file = _checks.path(path, "path")
    solver = Solver(None, symmetry=symmetry or "auto", log=log, progress=progress, **options)
    with solver._watch("loading a factor"):
        status, factor, analysis, matrix = solver._core.load_factor(file)
    if status[0]:
        raise make_error(*status)
    pointers, indices, solver._by_rows, solver._storage, solver._complex, solver.restored = matrix
    if symmetry is None:
        solver._asked, solver._options["symmetry"] = solver._storage, SYMMETRIES[solver._storage + 1]
    solver._n, solver._pattern = len(pointers) - 1, (pointers, indices)
    solver.analysis = Analysis(*analysis)
    solver._taken_factor(status, factor, None)
    return solver
