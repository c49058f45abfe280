"""Espalier: a sparse direct solver and a simulator for mechanics."""

from . import _load  # first: it chooses the extension module
from ._version import __version__
from ._dae import Dae
from ._errors import (AccuracyWarning, DeviceError, Error, InvalidInputError, NotPositiveDefiniteError,
                      OutOfMemoryError, SingularMatrixError)
from ._modes import Modes, buckling_modes, modes
from ._results import Analysis, Factor, Inertia, Solve
from ._simulation import Model, Result, Simulation, Step, sweep
from ._solver import Solver, solve

__all__ = ["AccuracyWarning", "Analysis", "Dae", "DeviceError", "Error", "Factor", "Inertia", "InvalidInputError", "Model",
           "Modes", "NotPositiveDefiniteError", "OutOfMemoryError", "Result", "Simulation", "SingularMatrixError", "Solve", "Solver",
           "Step", "__version__", "buckling_modes", "modes", "solve", "sweep"]
