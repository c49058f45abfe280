"""Derivatives of simulations by parameters of their models."""

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Iterable, Literal, Mapping

from .. import _checks, _core
from .._errors import make_error
from .._linear.results import table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from typing_extensions import Unpack

    from .._options import SolverOptions

Parameters = "Iterable[str] | Mapping[str, float]"


@dataclass(frozen=True, repr=False)
class Derivatives:
    """Quantities of a run and their derivatives. parameters: P paths of the model text, with their present values (P,);
    names: Q quantities; t: (T,) start and ends of steps, of statics the last load factor alone, of the adjoint method the
    end alone; values (T, Q);
    derivatives (T, Q, P); frequencies (K,) and frequency_derivatives (K, P): natural frequencies of the model at its
    start, where it has [initial] modes = K; defect: how well the linear equations of the derivatives are solved;
    adjoint: by the adjoint method, where defect says how exact the tangent is; notices: what the run and the check of the
    derivatives had to say, for people."""

    parameters: "list[str]"
    parameter_values: "NDArray[np.float64]"
    names: "list[str]"
    t: "NDArray[np.float64]"
    values: "NDArray[np.float64]"
    derivatives: "NDArray[np.float64]"
    frequencies: "NDArray[np.float64]"
    frequency_derivatives: "NDArray[np.float64]"
    defect: float
    adjoint: bool = False
    notices: "tuple[str, ...]" = ()

    def __getitem__(self, name: str) -> "NDArray[np.float64]":
        """Derivatives of one quantity over time, (T, P)."""
        return self.derivatives[:, self.names.index(name), :]

    def value(self, name: str) -> float:
        """Of a quantity at the end."""
        return float(self.values[-1, self.names.index(name)])

    def __repr__(self) -> str:
        rows = [(name, float(self.values[-1, k]), *map(float, self.derivatives[-1, k, :6])) for k, name in enumerate(self.names)]
        more = f", of {len(self.parameters)} parameters the first six" if len(self.parameters) > 6 else ""
        text = table(f"Derivatives{' (adjoint)' if self.adjoint else ''} at t = {self.t[-1]:.6g}, defect {self.defect:.2g}{more}",
                     ("quantity", "value", *(f"by {p}" for p in self.parameters[:6])), rows)
        return "\n  ".join([text[:-1], *(f"notice: {n}" for n in self.notices)]) + ">"

    def gradient(self, name: str) -> "NDArray[np.float64]":
        """Of a quantity at the end, (P,)."""
        return self.derivatives[-1, self.names.index(name), :].copy()


def derivatives(model: Any, parameters: "Iterable[str] | Mapping[str, float]", *,
                set: "Mapping[str, Any] | None" = None, until: "float | None" = None, quantities: Iterable[str] = (),
                method: 'Literal["auto", "forward", "adjoint"]' = "auto", **solver: "Unpack[SolverOptions]") -> Derivatives:
    """Runs a model (as for Simulation) and differentiates its quantities, those of `quantities` and of its [output], by
    parameters: paths of numbers in its text ("parameters.length", "forces.spring.stiffness"), with a mapping also the
    step to both sides at which the equations are looked at (0: 5e-6 of the value). set: values to be replaced first.
    Motions forward through the steps of the run, statics at the equilibrium: method "forward", or "adjoint", one
    transposed solve for each quantity however many parameters there are, which "auto" takes for statics where there are
    more of these. Of a motion "adjoint" goes back through its steps once, for the quantities at its end; see
    docs/use/sensitivities.md. Raises ValueError for other methods,
    InvalidInputError for paths that name no number, models with events, and what a Simulation raises."""
    return _run(model, parameters, set, until, quantities, method, None, solver)


def objective_gradient(model: Any, objective: "Callable[[Any, Any], tuple[float, Any]]",
                       parameters: "Iterable[str] | Mapping[str, float]", *, set: "Mapping[str, Any] | None" = None,
                       until: "float | None" = None, quantities: Iterable[str] = (),
                       **solver: "Unpack[SolverOptions]") -> "tuple[float, NDArray[np.float64]]":
    """A number that a whole run comes to, and its gradient by parameters, (P,), by the adjoint method: at the cost of one
    quantity, however many parameters and times there are. objective(t, values) is called after the run (and, where the model
    switches, after each run that checks the gradient) with t (T,), start and ends of steps, and values (T, Q); it returns
    the number and its derivatives by the values, (T, Q).
    Everything else as for derivatives(). Raises what objective raises, and ValueError for derivatives of another shape."""

    import numpy as np

    from .._linear.matrices import _numbers

    _checks.function(objective, "objective")

    def told(t: Any, values: Any) -> "tuple[float, Any]":
        answer = _checks.items(objective(t, values), "what objective returned")
        if len(answer) != 2:
            raise ValueError("objective must return a number and its derivatives by the values")
        value, slopes = _checks.real(answer[0], "objective's number"), _numbers(answer[1], "objective's derivatives")
        if slopes.shape != values.shape:
            raise ValueError(f"objective: derivatives by the values have the shape {slopes.shape}, the values {values.shape}")
        return value, np.ascontiguousarray(slopes).ravel()

    found = _run(model, parameters, set, until, quantities, "adjoint", told, solver)
    return found.value("objective"), found.gradient("objective")


def _run(model: Any, parameters: "Iterable[str] | Mapping[str, float]", set: "Mapping[str, Any] | None",
         until: "float | None", quantities: Iterable[str], method: str, objective: Any,
         solver: "Mapping[str, Any]") -> Derivatives:
    from .model import model_of
    from .toml import _value

    if isinstance(parameters, Mapping):
        steps = {p: _checks.real(s, f"parameters[{p!r}]") for p, s in _checks.mapping(parameters, "parameters").items()}
    else:
        steps = {p: 0.0 for p in _checks.texts(parameters, "parameters")}
    model = model_of(model)
    options = _checks.options(solver)
    status, found = _core.sensitivities(
        model.text, model._name, list(steps.items()),
        [f"{k}={_value(v, k)}" for k, v in _checks.mapping(set, "set").items()],
        None if until is None else _checks.real(until, "until"), _checks.texts(quantities, "quantities"),
        options, _checks.choice(method, "method", ("auto", "forward", "adjoint")), objective)
    model._raise(status)
    *fields, notices = found
    for notice in notices:
        if notice.startswith("derivatives:"):
            warnings.warn(notice, stacklevel=3)
    return Derivatives(*fields, notices=tuple(notices))
