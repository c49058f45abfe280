"""Your own mechanical system as Python functions, integrated by the simulator's methods."""

from typing import TYPE_CHECKING, Any, Callable, Iterable

from .. import _checks, _core
from .._errors import make_error
from .._options import DaeOptions

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from typing_extensions import Unpack

    from .._options import SolverOptions

_VECTORS = {"force": "coordinates", "residual": "coordinates", "constraint": "constraints",
            "constraint_rate": "constraints", "constraint_gamma": "constraints"}
_MATRICES = {"mass": "coordinates", "tangent": "coordinates", "constraint_jacobian": "constraints"}


_WHOLE = ("max_order", "order", "max_newton")


def _real(x: Any, name: str) -> Any:
    """As an array, where it is one of real numbers. name: of the function that returned it, or of what it is."""
    import numpy as np

    x = np.asarray(x)
    if x.dtype.kind not in "fiub":
        what = f"numbers of dtype {x.dtype}" if x.dtype.kind == "c" else "None" if x.ndim == 0 and x[()] is None else "no numbers"
        raise TypeError(f"{name}: {what}; real numbers are wanted")
    return x


def _number(name: str, value: Any) -> Any:
    """An option."""
    return float(_checks.whole(value, f"option {name}") if name in _WHOLE else _checks.real(value, f"option {name}"))


def _vector(function: Callable[..., Any], name: str, size: int) -> Callable[..., Any]:
    import numpy as np

    def checked(*args: Any) -> Any:
        x = np.ascontiguousarray(_real(function(*args), name), np.float64)
        if x.shape != (size,):
            raise ValueError(f"{name} returned an array of shape {x.shape}; it must be ({size},)")
        return x
    return checked


def _matrix(function: Callable[..., Any], name: str, rows: int, columns: int) -> Callable[..., Any]:
    import numpy as np

    def checked(*args: Any) -> Any:
        x = function(*args)
        if not hasattr(x, "tocoo"):
            x = _real(x, name)
        elif x.dtype.kind not in "fiub":
            raise TypeError(f"{name} returned a matrix of dtype {x.dtype}; it must return real numbers")
        if x.shape != (rows, columns):
            raise ValueError(f"{name} returned a matrix of shape {x.shape}; it must be ({rows}, {columns})")
        if hasattr(x, "tocoo"):
            x = x.tocoo()
            row, column, values = x.row, x.col, x.data
        else:
            row, column = np.nonzero(x)
            values = x[row, column]
        return (np.ascontiguousarray(row, np.int32), np.ascontiguousarray(column, np.int32),
                np.ascontiguousarray(values, np.float64))
    return checked


def _pair(energy: Callable[..., Any]) -> Callable[..., "tuple[float, float]"]:
    def checked(*args: Any) -> "tuple[float, float]":
        both = _real(energy(*args), "energy")
        if both.shape != (2,):
            raise ValueError("energy must return two numbers, (kinetic, potential)")
        return float(both[0]), float(both[1])
    return checked


class Dae:
    """n coordinates q, v = dq/dt, a = dv/dt and m multipliers lambda, with Phi_q = dPhi/dq:

        F(t, q, v, a, lambda) + Phi_q^T lambda = 0,   F = M(q) a - f(t, q, v) in the usual case
        Phi(t, q) = 0, and its two derivatives in time

    Functions get float64 arrays of their own and return arrays, matrices dense or of scipy.sparse:

        mass(q) -> (n, n) and force(t, q, v) -> (n,), or residual(t, q, v, a, lam) -> (n,)
        tangent(t, q, v, a, lam, wa, wv, wq) -> (n, n): wa F_a + wv F_v + wq (F + Phi_q^T lam)_q
        constraint(t, q) -> (m,), constraint_jacobian(t, q) -> (m, n), constraint_rate(t, q) -> (m,): dPhi/dt at fixed q
        constraint_gamma(t, q, v) -> (m,): -(d/dt Phi_q) v - d/dt Phi_t
        energy(t, q, v, a, lam) -> (kinetic, potential)

    Derivatives that are not given are made by central differences; check_jacobians() compares those that are.
    tangent_pattern, constraint_pattern: (row, column) of all entries that may ever be other than zero; by default all.
    options: method ("bdf", "generalized-alpha"), relative, absolute, absolute_velocity, test_velocity, max_order, order,
    step, initial_step, min_step, max_step, spectral_radius, hht_alpha, constraint_tolerance, max_newton,
    newton_tolerance, allowed_position, allowed_velocity, as in espalier/dae.hpp; solver: a dictionary of options of
    Solver for Newton's matrices. What a function raises ends the call.
    """

    def __init__(self, coordinates: int, constraints: int = 0, *, mass: Any = None, force: Any = None, residual: Any = None,
                 tangent: Any = None, constraint: Any = None, constraint_jacobian: Any = None,
                 constraint_rate: Any = None, constraint_gamma: Any = None, energy: Any = None,
                 constraint_names: Iterable[str] = (), tangent_pattern: "Iterable[tuple[int, int]]" = (),
                 constraint_pattern: "Iterable[tuple[int, int]]" = (), method: str = "bdf",
                 solver: "SolverOptions | None" = None, **options: "Unpack[DaeOptions]") -> None:
        _checks.choice(method, "method", ("bdf", "generalized-alpha"))
        for key in options:
            if key not in DaeOptions.__annotations__:
                raise _checks.unknown_argument(key, DaeOptions.__annotations__)
        self._coordinates = coordinates = _checks.whole(coordinates, "coordinates", 1)
        constraints = _checks.whole(constraints, "constraints", 0, _checks.INDEX - coordinates)
        given = {"mass": mass, "force": force, "residual": residual, "tangent": tangent, "constraint": constraint,
                 "constraint_jacobian": constraint_jacobian, "constraint_rate": constraint_rate,
                 "constraint_gamma": constraint_gamma}
        sizes = {"coordinates": coordinates, "constraints": constraints}
        functions: "dict[str, Any]" = {}
        for name, function in given.items():
            if function is None:
                continue
            _checks.function(function, name)
            if name in _VECTORS:
                functions[name] = _vector(function, name, sizes[_VECTORS[name]])
            else:
                functions[name] = _matrix(function, name, sizes[_MATRICES[name]], coordinates)
        if energy is not None:
            functions["energy"] = _pair(_checks.function(energy, "energy"))
        self._core = _core.Dae(coordinates, constraints, functions,
                               {"generalized_alpha": method != "bdf", **{k: _number(k, v) for k, v in options.items()}},
                               _checks.options(solver or {}), _checks.texts(constraint_names, "constraint_names"),
                               _checks.places(tangent_pattern, "tangent_pattern", coordinates, coordinates),
                               _checks.places(constraint_pattern, "constraint_pattern", constraints, coordinates))

    def start(self, t: float, q: Any, v: Any) -> None:
        """Begins at time t with the nearest q and v, (n,) each, that satisfy the constraints."""
        import numpy as np

        given = []
        for x, name in ((q, "q"), (v, "v")):
            x = _real(x, name)
            if x.shape != (self._coordinates,):
                raise ValueError(f"{name} has shape {x.shape}; it must be ({self._coordinates},)")
            given.append(np.ascontiguousarray(x, np.float64))
        self._check(self._core.start(_checks.real(t, "t"), *given))

    def integrate(self, end: float, observer: "Callable[[float], Any] | None" = None) -> None:
        """Steps until exactly `end`; may be called again with a later one. observer: called with the time after every step;
        False ends the call."""
        call = None if observer is None else _checks.function(observer, "observer")
        self._check(self._core.integrate(_checks.real(end, "end"), None if call is None else lambda step: call(step[1])))

    @staticmethod
    def _check(status: "tuple[int, str, int]") -> None:
        if status[0]:
            raise make_error(*status)

    @property
    def t(self) -> float:
        """The present time."""
        return self._core.state()[0]

    @property
    def q(self) -> "NDArray[np.float64]":
        """Coordinates, (n,), a copy; so are the others."""
        return self._core.state()[1]

    @property
    def v(self) -> "NDArray[np.float64]":
        """Their rates, (n,)."""
        return self._core.state()[2]

    @property
    def a(self) -> "NDArray[np.float64]":
        """The rates of v, (n,)."""
        return self._core.state()[3]

    @property
    def lam(self) -> "NDArray[np.float64]":
        """Multipliers, (m,)."""
        return self._core.state()[4]

    def energy(self) -> "tuple[float, float]":
        """(kinetic, potential) at the present state."""
        return self._core.energy()

    def check_jacobians(self) -> "dict[str, Any]":
        """Largest relative differences between given derivatives and central differences, by name; `worst` in words."""
        return self._core.check_jacobians()

    @property
    def summary(self) -> "dict[str, Any]":
        """Counts of steps, iterations and factorizations so far, and how the start was made to fit."""
        return self._core.summary()

    def __repr__(self) -> str:
        return f"<espalier.Dae: {self._coordinates} coordinates at t = {self.t:g}>"
