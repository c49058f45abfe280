"""Espalier: a sparse direct solver and a simulator for mechanics."""

from . import _load  # first: it chooses the extension module
from ._version import __version__
from ._changed import ChangeCost, ChangedSystem
from ._changes import Batch, BatchSolve, SchurComplement, solve_systems
from ._dae import Dae
from ._errors import (AccuracyWarning, DeviceError, Error, InvalidInputError, NotPositiveDefiniteError,
                      OutOfMemoryError, SingularMatrixError)
from ._harmonic import Harmonic, ModelHarmonic, harmonic
from ._meshio import from_meshio
from ._model import Model
from ._modes import Modes, QuadraticModes, buckling_modes, modes, quadratic_modes
from ._pictures import Cells, Frame
from ._progress import Progress
from ._reduced import Interface, ReducedBody
from ._result import Result, Summary
from ._results import Analysis, Change, Factor, Inertia, InverseEntries, Solve, SolveRows
from ._saved import load_factor
from ._scene import SurfaceFrame
from ._sensitivities import Derivatives, derivatives, objective_gradient
from ._simulation import Simulation, Step, sweep
from ._solver import Solver, solve
from . import examples as examples

__all__ = ["AccuracyWarning", "Analysis", "Batch", "BatchSolve", "Cells", "Change", "ChangeCost", "ChangedSystem", "Dae", "Derivatives", "DeviceError", "Error", "Factor", "Frame", "Harmonic", "Inertia", "Interface", "InvalidInputError", "InverseEntries", "Model", "ModelHarmonic",
           "Modes", "QuadraticModes", "NotPositiveDefiniteError", "OutOfMemoryError", "Progress", "ReducedBody", "Result", "SchurComplement", "Simulation", "SingularMatrixError", "Solve", "SolveRows", "Solver",
           "Step", "Summary", "SurfaceFrame", "__version__", "buckling_modes", "derivatives", "from_meshio", "harmonic", "load_factor", "modes", "objective_gradient", "quadratic_modes", "solve", "solve_systems",
           "sweep"]
