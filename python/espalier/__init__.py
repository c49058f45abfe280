"""Espalier: a sparse direct solver and a simulator for mechanics."""

from . import _load  # first: it chooses the extension module
from ._version import __version__
from ._changed import ChangeCost, ChangedSystem
from ._linear.changes import Batch, BatchSolve, SchurComplement, solve_systems
from ._models.dae import Dae
from ._errors import (AccuracyWarning, DeviceError, Error, InvalidInputError, NotPositiveDefiniteError,
                      OutOfMemoryError, SingularMatrixError)
from ._pencils.harmonic import Harmonic, ModelHarmonic, harmonic
from ._models.meshio import from_meshio
from ._models.model import Model
from ._pencils.modes import Modes, QuadraticModes, buckling_modes, modes, quadratic_modes
from ._pictures.pictures import Cells, Frame
from ._progress import Progress
from ._models.reduced import Interface, ReducedBody
from ._models.result import Result, Summary
from ._linear.results import Analysis, Change, Factor, Inertia, InverseEntries, Solve, SolveRows
from ._linear.saved import load_factor
from ._pictures.scene import SurfaceFrame
from ._models.sensitivities import Derivatives, derivatives, objective_gradient
from ._models.simulation import Simulation, Step, sweep
from ._linear.solver import Solver, solve
from . import examples as examples

__all__ = ["AccuracyWarning", "Analysis", "Batch", "BatchSolve", "Cells", "Change", "ChangeCost", "ChangedSystem", "Dae", "Derivatives", "DeviceError", "Error", "Factor", "Frame", "Harmonic", "Inertia", "Interface", "InvalidInputError", "InverseEntries", "Model", "ModelHarmonic",
           "Modes", "QuadraticModes", "NotPositiveDefiniteError", "OutOfMemoryError", "Progress", "ReducedBody", "Result", "SchurComplement", "Simulation", "SingularMatrixError", "Solve", "SolveRows", "Solver",
           "Step", "Summary", "SurfaceFrame", "__version__", "buckling_modes", "derivatives", "from_meshio", "harmonic", "load_factor", "modes", "objective_gradient", "quadratic_modes", "solve", "solve_systems",
           "sweep"]
