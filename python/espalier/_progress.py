"""A line that tells how far a long call is: in a terminal, or in a notebook."""

import sys
import time
from typing import Any

from ._checks import flag


def wanted(progress: Any = "auto") -> bool:
    """Whether it is asked for: by True or False, or ("auto") where somebody can see it."""
    if isinstance(progress, str) and progress == "auto":
        return _notebook() or sys.stderr.isatty()
    return flag(progress, "progress")


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
        from . import _core

        self._bar = Bar()
        _core.set_tick(self._tick)

    def _tick(self) -> None:
        if not self._bar.due():
            return
        seconds, expected = self._bar.seconds(), self._expected
        if expected and expected > seconds:
            self._bar.show(seconds / expected, f"{self._what}: {seconds:.0f} of about {expected:.0f} s")
        else:
            self._bar.show(None, f"{self._what}: {seconds:.0f} s")

    def __exit__(self, *_: Any) -> None:
        from . import _core

        _core.set_tick(None)
        self._bar.end()


class Unwatched:
    """In place of a Watch where nobody looks."""

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: Any) -> None:
        pass


UNWATCHED = Unwatched()
