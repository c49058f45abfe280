"""Espalier: a sparse direct solver for mechanics."""

from ._core import version as __version__
from ._errors import (AccuracyWarning, DeviceError, Error, InvalidInputError, NotPositiveDefiniteError,
                      OutOfMemoryError, SingularMatrixError)
from ._results import Analysis, Factor, Inertia, Solve
from ._solver import Solver, solve

__all__ = ["AccuracyWarning", "Analysis", "DeviceError", "Error", "Factor", "Inertia", "InvalidInputError",
           "NotPositiveDefiniteError", "OutOfMemoryError", "SingularMatrixError", "Solve", "Solver", "__version__",
           "solve"]
