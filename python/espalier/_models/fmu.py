"""FMUs of models, for other simulators."""

from typing import NamedTuple


class FmuVariable(NamedTuple):
    """A variable of an exported FMU."""

    name: str
    kind: str
    """"time", "input", "output", "parameter", "state" or "derivative"."""
    unit: str
    """Empty where it is not known."""
    start: float


class Fmu(NamedTuple):
    """What Model.export_fmu() has written."""

    path: str
    bytes: int
    variables: "tuple[FmuVariable, ...]"
    files: "tuple[str, ...]"
    """Files of the model, which the FMU holds."""
    model_exchange: bool
    """Beside co-simulation."""
    no_model_exchange: str
    """Why not."""
