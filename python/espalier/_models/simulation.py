"""The simulator: runs, and motions that a program steps through."""

import os
from typing import TYPE_CHECKING, Any, Callable, Iterable, Mapping, NamedTuple

from .. import _checks, _core
from .model import Model, _settings, model_of
from .._pictures.pictures import Cells, Frame, grid
from .._progress import UNWATCHED, Asked, Bar, wanted, watching
from .result import Result, Summary

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .._options import SolverOptions, SweepOptions


class Step(NamedTuple):
    """One accepted step, of time or (statics) of the load factor."""

    index: int  # type: ignore[assignment]
    t: float
    h: float
    order: int
    newton_iterations: int
    factorizations: int
    failures: int
    residual: float
    error: float


Observer = Callable[[Step], Any]


def _interval(frames: float) -> float:
    interval = _checks.real(frames, "frames")
    if not 0 <= interval < float("inf"):
        raise ValueError(f"frames={frames!r}: it must be an interval of time, or 0 for every step")
    return interval


def _told_of(observer: "Observer | None") -> "Callable[[Any], Any] | None":
    """What the extension module calls after a step."""
    if observer is None:
        return None
    call = _checks.function(observer, "observer")
    return lambda step: call(Step(*step))


class Simulation:
    """One motion of one model, made consistent and ready to go.

    model: a Model, a dictionary, or the path of a model file. set: values to be replaced, {"parameters.size": 2}. until:
    end instead of the model's. quantities: names ("rod.position.x", "rod.position", "energy.total") of what is kept at
    every step, besides those of the model's [output]; where neither names any, a usual set: positions and velocities of
    the first six bodies, forces of the first six joints, energies (of more than 20,000 steps every second, fourth ...
    one). out: folder for files. restart: a restart file to go on from.
    frames: the meshes of the bodies are kept at such intervals of time (or of the load factor; 0: at every step), for
    Result.frames and mesh(), which else have the surfaces of the page. analyses: a folder that keeps the orderings of Newton's matrices for other simulations of the same structure.
    page: what Result.show(), to_html(), picture() and animate() need is kept, and with `out` index.html is written.
    Further options are those of the solver (device, threads, ...).

    Calls let other Python threads run. Ctrl-C ends a run after a step, or in a long factorization, with
    KeyboardInterrupt; run() or step() then go on. Raises InvalidInputError for what is wrong in the model, with its line.
    """

    def __init__(self, model: "Model | Mapping[str, Any] | str | os.PathLike[str]", *,
                 set: "Mapping[str, Any] | None" = None, until: "float | None" = None, quantities: Iterable[str] = (),
                 out: "str | os.PathLike[str]" = "", restart: "str | os.PathLike[str]" = "",
                 accept_changes: bool = False, analyses: "str | os.PathLike[str]" = "",
                 frames: "float | None" = None, page: bool = True, **solver: "Unpack[SolverOptions]") -> None:
        given = model_of(model)
        self._core = _core.Simulation(
            _settings(set), _checks.path(out, "out"),
            None if until is None else _checks.real(until, "until"), _checks.path(restart, "restart"),
            _checks.flag(accept_changes, "accept_changes"), _checks.texts(quantities, "quantities"), _checks.options(solver),
            _checks.path(analyses, "analyses"), -1.0 if frames is None else _interval(frames),
            _checks.flag(page, "page"))
        self._frames = frames is not None
        self._page = page
        self._check: "Callable[[tuple[int, str, int]], None]" = given._raise  # raises what a status says
        self._check(self._core.load(given.text, given._name))

    @property
    def time(self) -> float:
        """The present time, or load factor."""
        return self._core.time()

    @property
    def end_time(self) -> float:
        """Where run() ends."""
        return self._core.end_time()

    def run(self, observer: "Observer | None" = None, *, progress: Asked = "auto") -> Result:
        """To the end. observer: called with a Step after every step; False (any false value but None) stops the run. progress: "auto" shows it in
        terminals and notebooks; a function is called with a Progress a few times a second."""
        bar, begin, span = Bar(), self.time, self.end_time - self.time
        told = _told_of(observer)

        def shown(s: Any) -> Any:
            if bar.due():
                step = Step(*s)
                share = (step.t - begin) / span if 0 < span < float("inf") else None
                bar.show(share, f"t = {step.t:.6g}, step {step.index}")
            return None if told is None else told(s)

        try:
            with watching(progress, "") if callable(progress) else UNWATCHED:
                status = self._core.run(shown if wanted(progress) else told)
            self._check(status)
        finally:
            bar.end()
        return self.result()

    def step_to(self, t: float, observer: "Observer | None" = None) -> None:
        """Steps until exactly t, an event that stops, or the observer's False."""
        self._check(self._core.step_to(_checks.real(t, "t"), _told_of(observer)))

    def step(self, dt: float) -> None:
        """step_to(time + dt)."""
        self.step_to(self.time + _checks.real(dt, "dt"))

    def value(self, quantity: str) -> float:
        """A quantity of the present state. Raises ValueError for unknown ones."""
        return self._core.value(_checks.text(quantity, "quantity"))

    def __getitem__(self, quantity: str) -> Any:
        """value(quantity), or of a vector ("bob.position") its three components, (3,); a Result takes the same names."""
        import numpy as np

        try:
            return self.value(quantity)
        except ValueError:
            try:
                return np.array([self._core.value(f"{quantity}.{c}") for c in "xyz"])
            except ValueError:
                pass
            raise

    def __contains__(self, quantity: object) -> bool:
        """Whether sim[quantity] is there."""
        try:
            self[quantity]  # type: ignore[index]
        except (TypeError, ValueError):
            return False
        return True

    __iter__: None = None  # there are too many; `quantities` names them

    @property
    def inputs(self) -> "dict[str, float]":
        """[inputs] of the model with their present values."""
        return self._core.inputs()

    def set_input(self, name: str, value: float) -> None:
        """For the steps to come; also from the observer of a run."""
        self._core.set_input(_checks.text(name, "name"), _checks.real(value, "value"))

    @property
    def quantities(self) -> "dict[str, str]":
        """Everything that value() knows, with its dimension in the units of the model ("length/time")."""
        return self._core.quantities()

    def save(self) -> bytes:
        """The present state, inputs and switches included; as in a restart file. Costs an analysis of the solver."""
        return self._core.save()

    def restore(self, state: bytes) -> None:
        """Goes to a state of save(), of this or another simulation of the same model; what was kept of later steps goes."""
        try:
            content = bytes(memoryview(state))
        except TypeError:
            raise TypeError(f"state is {_checks.shown(state)}; it must be the bytes of save()") from None
        self._check(self._core.restore(content))

    def result(self) -> Result:
        """What is known so far."""
        names, t, values = self._core.series()
        dimensions = self._core.units() or self.quantities
        kept = (Cells(*self._core.mesh()), tuple(Frame(*f) for f in self._core.frames())) if self._frames else None
        return Result(t, names, values, Summary(self._core.summary()), {n: dimensions.get(n, "") for n in names}, kept,
                      self._core.page if self._page else None)

    def mesh(self) -> Any:
        """The bodies as they are now, a pyvista.UnstructuredGrid as of Result.mesh()."""
        return grid(Cells(*self._core.mesh()), Frame(*self._core.frame()))

    def __repr__(self) -> str:
        return f"<espalier.Simulation at t = {self.time:g}>"


def _one(job: "tuple[Any, dict[str, Any], dict[str, Any]]") -> Result:
    model, point, options = job
    return Simulation(model, set=point, **options).run(progress=False)


def _told(point: "dict[str, Any]", call: "Callable[..., Result]", *args: Any) -> "Result":
    """call(*args); its error says for which point of a sweep."""
    try:
        return call(*args)
    except Exception as error:
        error.point = point  # type: ignore[attr-defined]
        if hasattr(error, "add_note"):  # Python 3.11
            error.add_note(f"in the sweep's run with {point}")
        raise


def sweep(model: Any, parameters: "Mapping[str, Iterable[Any]]", *, workers: "int | None" = None,
          **options: "Unpack[SweepOptions]") -> "list[tuple[dict[str, Any], Result]]":
    """Runs a model for all combinations of values, on several processes: [({"parameters.size": 1}, Result), ...] in the
    order of itertools.product. options: those of Simulation. The ordering of Newton's matrix is made once for each
    structure and shared. A run that fails raises its error, with what was set as its attribute `point`; it and Ctrl-C end
    the others. RuntimeError: a process was killed, by the system for want of memory for instance."""
    from concurrent.futures import FIRST_EXCEPTION, ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool
    from itertools import product
    from multiprocessing import get_context

    from tempfile import TemporaryDirectory

    own = [k for k in Simulation.__init__.__annotations__ if k not in ("model", "solver", "return")]
    for key in options:
        if key.replace("-", "_") not in (allowed := [*own, *_core.option_names()]):
            raise _checks.unknown_argument(key, allowed)
    fixed = dict(_checks.mapping(options.pop("set", None), "set"))
    model = model_of(model)
    lists = {k: _checks.items(v, f"parameters[{k!r}]") for k, v in _checks.mapping(parameters, "parameters").items()}
    points = [dict(zip(lists, values)) for values in product(*lists.values())]
    if workers is not None:
        workers = _checks.whole(workers, "workers", 1, 4096)
    with TemporaryDirectory(prefix="espalier-") as folder:
        jobs = [(model, {**fixed, **p}, {"threads": 1, "analyses": folder, "page": False, **options}) for p in points]
        if workers == 1 or len(jobs) < 2:
            return [(point, _told(point, _one, job)) for point, job in zip(points, jobs)]
        workers = workers or min(len(jobs), len(os.sched_getaffinity(0)))
        pool = ProcessPoolExecutor(workers, get_context("spawn"))
        try:
            futures = [pool.submit(_one, job) for job in jobs]
            wait(futures, return_when=FIRST_EXCEPTION)
            for point, future in zip(points, futures):  # the first in order that has failed, if one has
                if future.done() and not future.cancelled() and future.exception() is not None:
                    _told(point, future.result)
            return [(point, future.result()) for point, future in zip(points, futures)]
        except BrokenProcessPool as error:
            raise RuntimeError("a process of the sweep was killed (is there enough memory? take fewer workers), or could not"
                               ' start (a script that sweeps needs `if __name__ == "__main__":`)') from error
        except BaseException:
            for process in list((getattr(pool, "_processes", None) or {}).values()):  # they would finish their runs
                process.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)
