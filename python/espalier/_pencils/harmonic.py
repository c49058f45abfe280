"""Frequency responses: amplitudes and phases over a range of frequencies, of matrices and of models."""

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Iterable, Mapping

from .. import _checks, _core
from .._errors import AccuracyWarning, make_error
from .._progress import Asked, watching
from .._linear.results import _Table, table
from .._linear.matrices import _STORAGE, _arrays, _numbers, not_sparse

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from typing_extensions import Unpack

    from .._options import SolverOptions

_SINGULAR, _INACCURATE = 3, 7


@dataclass(frozen=True, repr=False)
class Harmonic(_Table):
    """The answer to loads Re(f e^{i w t}), w = 2 pi frequency. P frequencies, O observed numbers, L loads (no such axis
    where one load was given as a vector): `frequencies` (P,) rising, those asked for and, with a tolerance, those solved
    or placed in peaks; `response` (P, O) or (P, O, L), complex, NaN on a resonance without damping; `solved` (P,), False:
    interpolated; `backward_errors` (P,), NaN where interpolated; `error_estimates` (P,) of interpolated ones;
    `shape_frequencies` (S,) and `shapes` (S, n) or (S, n, L): all unknowns.

    With a tolerance: `resonances`, rows of frequency, half width and 1 where a load excites it, `complete`: proven to be
    all, `completeness` says how, or why not; `checked_error`: the largest error of the interpolation at the last solves
    that were held back. `factorizations`: frequencies that were solved."""

    frequencies: "NDArray[np.float64]"
    response: "NDArray[np.complex128]"
    solved: "NDArray[np.bool_]"
    backward_errors: "NDArray[np.float64]"
    error_estimates: "NDArray[np.float64]"
    shape_frequencies: "NDArray[np.float64]"
    shapes: "NDArray[np.complex128]"
    resonances: "NDArray[np.float64]"
    complete: bool
    completeness: str
    checked_error: float
    factorizations: int
    seconds: "dict[str, float]"

    @property
    def amplitudes(self) -> "NDArray[np.float64]":
        """|response|."""
        import numpy as np

        return np.abs(self.response)

    @property
    def phases(self) -> "NDArray[np.float64]":
        """Of the response in degrees, from -180 to 180."""
        import numpy as np

        return np.angle(self.response, deg=True)

    def __len__(self) -> int:
        return len(self.frequencies)

    def _outputs(self) -> "list[tuple[str, ...]]":
        """A name for each number of a response, those of the loads last."""
        outputs, *loads = self.response.shape[1:]
        names: "list[tuple[str, ...]]" = [(str(k),) for k in range(outputs)]
        return [(*n, str(load)) for n in names for load in range(loads[0])] if loads else names

    def __repr__(self) -> str:
        import numpy as np

        names = self._outputs()
        amplitudes = self.amplitudes.reshape(len(self), len(names))
        at = [int(np.nanargmax(a)) if np.isfinite(a).any() else 0 for a in amplitudes.T[:20]]
        rows = [(*name, float(amplitudes[k, i]), float(self.frequencies[k])) for i, (name, k) in enumerate(zip(names, at))]
        rows += [names[0]] * (len(names) - len(rows))  # counted, not shown
        heads = ("response", "load")[:len(names[0])] if names else ()
        lowest, highest = (self.frequencies[0], self.frequencies[-1]) if len(self) else (0.0, 0.0)
        return table(f"{type(self).__name__}: {len(self)} frequencies from {lowest:.6g} to {highest:.6g}, {int(self.solved.sum())} solved",
                     (*heads, "largest amplitude", "at frequency"), rows)


@dataclass(frozen=True, repr=False)
class ModelHarmonic(Harmonic):
    """Of a model: O `quantities` and L `loads` by name; `response` is (P, O, L). `shapes`: increments of the velocity
    coordinates, then multipliers. `notices`: what is worth knowing."""

    quantities: "list[str]"
    loads: "list[str]"
    notices: "list[str]"

    def _outputs(self) -> "list[tuple[str, ...]]":
        return [(q, load) for q in self.quantities for load in self.loads]

    def __repr__(self) -> str:
        return "\n  ".join([super().__repr__()[:-1], *(f"notice: {text}" for text in self.notices)]) + ">"

    def __getitem__(self, name: "str | tuple[str, str]") -> "NDArray[np.complex128]":
        """One quantity, or (quantity, load): complex, (P,) for one load, else (P, L)."""
        quantity, load = name if isinstance(name, tuple) else (name, None)
        for wanted, known in ((quantity, self.quantities), (load, self.loads)):
            if wanted is not None and wanted not in known:
                raise KeyError(f"{wanted!r} is none of {', '.join(known)}")
        column = self.response[:, self.quantities.index(quantity)]
        if load is not None:
            return column[:, self.loads.index(load)]
        return column[:, 0] if len(self.loads) == 1 else column


def _fail(status: "tuple[int, str, int]") -> None:
    raise make_error(*status)


def _told(status: "tuple[int, str, int]", raw: "tuple[Any, ...]", stacklevel: int, fail: "Callable[..., None]" = _fail) -> None:
    """Raises, or warns where there are some numbers."""
    import warnings

    import numpy as np

    if status[0] in (_INACCURATE, _SINGULAR) and np.isfinite(raw[1]).any():
        warnings.warn(AccuracyWarning(status[1]), stacklevel=stacklevel)
    elif status[0] != 0:
        fail(status)


def _fields(raw: "tuple[Any, ...]", one: bool) -> "list[Any]":
    """Of Harmonic, from those of _core, whose complex numbers are pairs and whose loads stand before the outputs."""
    import numpy as np

    fields = list(raw)
    for k in (1, 6):
        numbers = fields[k][..., 0] + 1j * fields[k][..., 1]
        fields[k] = numbers[:, 0] if one else np.swapaxes(numbers, 1, 2)
    fields[2] = fields[2].astype(bool)
    return fields


def harmonic(K: Any, M: Any, loads: Any, *, C: Any = None, frequencies: Any = None,
             between: "tuple[float, float] | None" = None, points: int = 101, logarithmic: bool = False,
             tolerance: float = 0.0, max_solves: int = 1000, seek_resonances: bool = True, loss_factor: float = 0.0,
             observed: "Iterable[int] | None" = None, shapes_at: Any = None, symmetry: str = "auto",
             log: "logging.Logger | None" = None, progress: Asked = "auto", **solver: "Unpack[SolverOptions]") -> Harmonic:
    """Solves (K (1 + i loss_factor) + i w C - w^2 M) x = f for frequencies w / (2 pi), in cycles per unit of time.

    K, C, M: real, of one shape, of scipy.sparse, symmetric or not; C None: no viscous damping. Rows of constraints,
    [K G'; G 0], have no entries in C and M. symmetry: "auto" (all entries are stored), "lower", "upper" (only that
    triangle). loads: f, real or complex, (n,) or (n, L). frequencies: rising, not negative; or between, (lowest, highest),
    with `points` equal steps or (logarithmic) ratios. observed: unknowns from 0 whose responses are returned (None: all);
    shapes_at: frequencies at which all are.

    tolerance 0 solves at each frequency. Above it (1e-10 to 0.1), chosen frequencies are solved, at most max_solves, and a
    rational function (AAA) gives what lies between, with about that relative error; seek_resonances finds the modes first
    and solves next to each that answers. solver: threads, host_memory and the like, as for Solver; the host solves.

    Raises InvalidInputError for matrices and numbers that cannot be, SingularMatrixError where the system is singular at
    every frequency, OutOfMemoryError. Warns with AccuracyWarning where some frequencies lie on a resonance without damping
    (NaN) or the tolerance was not reached. Ctrl-C ends it with KeyboardInterrupt."""
    import numpy as np

    _checks.choice(symmetry, "symmetry", ("auto", "lower", "upper"))
    for key in ("kind", "precision", "singular", "permutation"):
        if key in solver:
            raise ValueError(f"{key} has no meaning here: the sweep chooses it")
    if (frequencies is None) == (between is None):
        raise ValueError("give either frequencies, or between=(lowest, highest)")
    listed = _checks.reals(frequencies, "frequencies")
    if frequencies is not None and not listed:
        raise ValueError("frequencies is empty")
    arrays = []
    for name, a in (("K", K), ("C", M if C is None else C), ("M", M)):
        if not hasattr(a, "tocsc"):
            raise not_sparse(a, name)
        pointers, indices, values, _ = _arrays(a.tocsc())
        if values is None:
            raise ValueError(f"{name} has no values, only a pattern")
        arrays += [pointers, indices, values]
    f = _numbers(loads, "loads", True)
    n = len(arrays[0]) - 1
    if f.ndim not in (1, 2) or f.shape[0] != n or f.size == 0:
        raise ValueError(f"loads of shape {f.shape}: give ({n},), or ({n}, number of loads)")
    columns = np.asfortranarray(f, dtype=np.complex128).reshape(-1, order="F").view(np.float64)
    low, high = (0.0, 0.0) if between is None else _checks.interval(between, "between")
    seen = [] if observed is None else _checks.items(observed, "observed")
    options = {"from": low, "to": high, "points": _checks.whole(points, "points", 2),
               "logarithmic": _checks.flag(logarithmic, "logarithmic"), "frequencies": listed,
               "tolerance": _checks.real(tolerance, "tolerance"), "max_solves": _checks.whole(max_solves, "max_solves", 1),
               "seek_resonances": _checks.flag(seek_resonances, "seek_resonances"),
               "loss_factor": _checks.real(loss_factor, "loss_factor"),
               "observed": [_checks.whole(v, f"observed[{k}]", 0, n - 1) for k, v in enumerate(seen)],
               "shapes_at": _checks.reals(shapes_at, "shapes_at")}
    if observed is not None and not seen:
        raise ValueError("observed is empty: name unknowns, or None for all")
    with watching(progress, "frequency response"):
        status, raw = _core.harmonic(*arrays, _STORAGE[symmetry], C is not None, columns, 1 if f.ndim == 1 else f.shape[1],
                                     options, _checks.options(solver), _checks.lines_of(log))
    _told(status, raw, 3)
    return Harmonic(*_fields(raw, f.ndim == 1))


def _amplitudes(loads: Any) -> Any:
    """Complex amplitudes as the model text has them."""
    import cmath
    import math

    if isinstance(loads, Mapping):
        return {name: _amplitudes(value) for name, value in loads.items()}
    if hasattr(loads, "dtype") and getattr(loads, "ndim", 1) == 0:
        loads = loads.item()
    if isinstance(loads, complex):
        return {"amplitude": abs(loads), "phase": math.degrees(cmath.phase(loads))}
    return [loads] if isinstance(loads, str) else loads


def model_harmonic(model: Any, keys: "Mapping[str, Any]", set: "Mapping[str, Any]", out: str,
                   progress: Asked, solver: "Mapping[str, Any]") -> ModelHarmonic:
    """See Model.harmonic()."""
    from .._models.toml import _value

    keys = {k: _amplitudes(v) if k == "loads" else v for k, v in keys.items()}
    given = {**set, **{f"harmonic.{k}": v for k, v in keys.items()}}
    options = _checks.options(solver)
    with watching(progress, "frequency response"):
        status, raw, quantities, loads, notices = _core.model_harmonic(
            model.text, model._name, [f"{k}={_value(v, k)}" for k, v in given.items()], out, options)
    _told(status, raw, 4, model._raise)
    return ModelHarmonic(*_fields(raw, False), quantities, loads, notices)
