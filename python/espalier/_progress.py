"""How far a long call is: a line in a terminal or a notebook, or calls of a function."""

import sys
import time
from dataclasses import dataclass
from typing import Any, Callable, Union

from . import _core
from ._checks import flag


@dataclass(frozen=True)
class Progress:
    """What a `progress` function is told of a long call. `state`: "running", at last "ended". `phase`:
    "factorization", "modes", "motion" ...; `done` of `total` in `unit` ("flops", "modes", "time"; total 0: nobody knows);
    `seconds` since the phase began and `seconds_left` (NaN: nobody knows); `inside`: what the phase is at, likewise."""

    state: str
    phase: str
    done: float
    total: float
    unit: str
    seconds: float
    seconds_left: float
    inside: str
    inside_done: float
    inside_total: float
    inside_unit: str


Asked = Union[bool, str, Callable[[Progress], Any]]


def wanted(progress: Any = "auto") -> bool:
    """Whether a line is asked for: by True or False, or ("auto") where somebody can see it."""
    if callable(progress):
        return False
    if isinstance(progress, str) and progress == "auto":
        return _notebook() or sys.stderr.isatty()
    return flag(progress, "progress")


def watching(progress: Any, what: str, expected: "float | None" = None) -> Any:
    """For `with`: what looks at a call of the main thread, as `progress` of the call's options asks for it."""
    if callable(progress):
        return Told(progress)
    return Watch(what, expected) if wanted(progress) else UNWATCHED


def _notebook() -> bool:
    shell = sys.modules.get("IPython")
    return shell is not None and hasattr(shell.get_ipython(), "kernel")


class Bar:
    """Nothing for a second, then an update at most twice a second."""

    def __init__(self) -> None:
        self._begin = time.monotonic()
        self._next = self._begin + 1
        self._handle: Any = None
        self._width = 0

    def due(self) -> bool:
        return time.monotonic() >= self._next

    def seconds(self) -> float:
        return time.monotonic() - self._begin

    def show(self, share: "float | None", text: str) -> None:
        """share: 0 to 1 of the work, or None where nobody knows."""
        self._next = time.monotonic() + 0.5
        if _notebook():
            from html import escape

            from IPython.display import HTML, display  # type: ignore[import-not-found]

            value = "" if share is None else f" value='{share:.3f}'"
            page = HTML(f"<progress{value}></progress> {escape(text)}")
            if self._handle is None:
                self._handle = display(page, display_id=True)
            else:
                self._handle.update(page)
        else:
            line = text if share is None else f"[{'#' * int(30 * share):<30}] {text}"
            print(f"\r{line:<{self._width}}", end="", file=sys.stderr, flush=True)
            self._width = len(line)

    def end(self) -> None:
        if self._width > 0:
            print(file=sys.stderr)


class Watch:
    """`with Watch("factorizing", seconds):` shows how far a call of the solver is: the C++ code ticks ten times a second
    in Python's main thread. expected: seconds that it will take, or None."""

    def __init__(self, what: str, expected: "float | None" = None) -> None:
        self._what, self._expected = what, expected

    def __enter__(self) -> None:
        self._bar = Bar()
        _core.set_tick(self._tick)

    def _tick(self) -> None:
        if not self._bar.due():
            return
        seconds, expected = self._bar.seconds(), self._expected
        now = Progress("running", *_core.progress())
        if now.total > 0 and now.done > 0:
            left = f", about {now.seconds_left:.0f} s to go" if now.seconds_left >= 0 else ""
            self._bar.show(now.done / now.total, f"{self._what}: {now.phase}, {seconds:.0f} s{left}")
        elif expected and expected > seconds:
            self._bar.show(seconds / expected, f"{self._what}: {seconds:.0f} of about {expected:.0f} s")
        else:
            self._bar.show(None, f"{self._what}: {seconds:.0f} s")

    def __exit__(self, *_: Any) -> None:
        _core.set_tick(None)
        self._bar.end()


class Told:
    """Calls a function with a Progress, at most five times a second and once at the end, unless an
    exception ended the call. What it raises ends the call."""

    def __init__(self, function: "Callable[[Progress], Any]") -> None:
        self._function = function
        self._next = 0.0

    def __enter__(self) -> None:
        _core.set_tick(self._tick)

    def _tick(self) -> None:
        now = Progress("running", *_core.progress())
        if now.phase and time.monotonic() >= self._next:
            self._next = time.monotonic() + 0.2
            self._function(now)

    def __exit__(self, kind: Any, *_: Any) -> None:
        last = Progress("ended", *_core.progress())
        _core.set_tick(None)
        if kind is None:
            self._function(last)


class Unwatched:
    """In place of a Watch where nobody looks."""

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: Any) -> None:
        pass


UNWATCHED = Unwatched()
