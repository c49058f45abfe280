"""Arguments of public calls: what cannot be is said in words, with the argument's name, before the extension module sees
it. All raise TypeError for what is of no such kind, ValueError for what is out of range."""

import math
import operator
import os
import sys
from typing import Any, Callable, Iterable, Mapping

from . import _core

INDEX = 2**31 - 1  # the most that the solver counts rows, columns and their numbers with


def shown(value: Any) -> str:
    """For a message, in one short line."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python writes
        return f"a number of {value.bit_length()} bits"
    return text if len(text) <= 60 and "\n" not in text and "object at" not in text else f"a value of type {type(value).__name__}"


def whole(value: Any, name: str, least: int = 0, most: int = INDEX) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        if not isinstance(value, float) or not value.is_integer():
            raise TypeError(f"{name} is {shown(value)}; it must be a whole number") from None
        number = int(value)
    if not least <= number <= most:
        raise ValueError(f"{name} is {shown(number)}; it must be a whole number from {least} to {most}")
    return number


def real(value: Any, name: str) -> float:
    """Infinity is one, NaN is none."""
    if isinstance(value, (str, bytes, complex)) or not hasattr(value, "__float__") or getattr(value, "ndim", 0) != 0:
        raise TypeError(f"{name} is {shown(value)}; it must be a real number")
    try:
        number = float(value)
    except OverflowError:
        raise ValueError(f"{name} is larger than any number of 64 bits") from None
    except (TypeError, ValueError):
        raise TypeError(f"{name} is {shown(value)}; it must be a real number") from None
    if math.isnan(number):
        raise ValueError(f"{name} is nan; it must be a number")
    return number


def reals(values: Any, name: str) -> "list[float]":
    """One, or some in a list or vector; None: an empty list."""
    import numpy as np

    if values is None:
        return []
    if np.ndim(values) == 0:
        return [real(values, name)]
    if np.ndim(values) > 1:
        raise ValueError(f"{name} has the shape {np.shape(values)}; it must be a list of numbers")
    return [real(v, f"{name}[{k}]") for k, v in enumerate(values)]


def interval(value: Any, name: str) -> "tuple[float, float]":
    pair = items(value, name)
    if len(pair) != 2:
        raise ValueError(f"{name} is {shown(value)}; it must be a pair of numbers, (lowest, highest)")
    return real(pair[0], f"{name}[0]"), real(pair[1], f"{name}[1]")


def flag(value: Any, name: str) -> bool:
    if isinstance(value, int) and value in (0, 1) or type(value).__name__ in ("bool", "bool_"):
        return bool(value)
    raise TypeError(f"{name} is {shown(value)}; it must be True or False")


def transposition(value: Any) -> "bool | str":
    try:
        return "H" if isinstance(value, str) and value == "H" else flag(value, "transpose")
    except TypeError:
        raise ValueError(f"transpose is {shown(value)}; it must be False, True or 'H'") from None


def choice(value: Any, name: str, among: "Iterable[str]") -> str:
    if not isinstance(value, str) or value not in among:
        raise ValueError(f"{name} {shown(value)} is none of {', '.join(among)}")
    return value


def text(value: Any, name: str) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{name} is {shown(value)}; it must be a text")
    try:
        value.encode()
    except UnicodeEncodeError:
        raise ValueError(f"{name} is {shown(value)}, which is no text in UTF-8") from None
    return value


def items(values: Any, name: str) -> "list[Any]":
    try:
        return list(values)
    except TypeError:
        raise TypeError(f"{name} is {shown(values)}; it must be a list") from None


def texts(values: Any, name: str) -> "list[str]":
    """One, or a list of some."""
    if isinstance(values, str):
        return [text(values, name)]
    return [text(v, f"{name}[{k}]") for k, v in enumerate(items(values, name))]


def path(value: Any, name: str) -> str:
    try:
        found = os.fsdecode(value)
    except TypeError:
        raise TypeError(f"{name} is {shown(value)}; it must be a path") from None
    if "\0" in found:
        raise ValueError(f"{name} is {shown(value)}; a path has no NUL in it")
    return text(found, name)


def mapping(value: Any, name: str) -> "Mapping[str, Any]":
    """None: an empty one. Keys are texts."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise TypeError(f"{name} is {shown(value)}; it must be a dictionary")
    for key in value:
        text(key, f"a key of {name}")
    return value


def function(value: Any, name: str) -> "Callable[..., Any]":
    if not callable(value):
        raise TypeError(f"{name} is {shown(value)}; it must be a function")
    return value


def places(values: Any, name: str, rows: int, columns: int) -> "list[tuple[int, int]]":
    """(row, column) of entries."""
    found = []
    for k, pair in enumerate(items(values, name)):
        pair = items(pair, f"{name}[{k}]")
        if len(pair) != 2:
            raise ValueError(f"{name}[{k}] is {shown(pair)}; it must be a pair, (row, column)")
        found.append((whole(pair[0], f"{name}[{k}][0]", 0, rows - 1), whole(pair[1], f"{name}[{k}][1]", 0, columns - 1)))
    return found


def lines_of(log: Any) -> "Callable[[str], Any]":
    """Where lines of the log go: to a logging.Logger, None: to that named espalier."""
    import logging

    if log is None:
        log = logging.getLogger("espalier")
    if not callable(getattr(log, "debug", None)):
        raise TypeError(f"log is {shown(log)}; it must be a logging.Logger")
    return log.debug  # type: ignore[no-any-return]


def near(wrong: str, names: "Iterable[str]") -> str:
    """For a message: "; did you mean 'x'?", or which there are."""
    from difflib import get_close_matches

    names = list(dict.fromkeys(names))
    found = get_close_matches(wrong, names, 1)
    return f"; did you mean {found[0]!r}?" if found else f"; there are {', '.join(names)}"


def unknown_argument(wrong: str, names: "Iterable[str]") -> TypeError:
    """What Python says of a keyword that a call does not have, with the nearest one, of `names` or of the public calls
    that are under way: those arguments are real ones."""
    call, known, frame = "", list(names), sys._getframe(1)
    while frame is not None and str(frame.f_globals.get("__name__")).startswith("espalier."):
        code = frame.f_code
        if code.co_name == "__init__" or not code.co_name.startswith(("_", "<")) and frame.f_globals["__name__"] != __name__:
            call = str(getattr(code, "co_qualname", code.co_name)).removesuffix(".__init__")
            known += code.co_varnames[:code.co_argcount + code.co_kwonlyargcount]
        frame = frame.f_back  # type: ignore[assignment]
    known = [k for k in known if k != "self" and not k.startswith("_")]
    return TypeError(f"{call}(): there is no argument {wrong!r}{near(wrong, known)}")


def options(given: "Mapping[str, Any]") -> "list[tuple[str, str]]":
    """Options of the solver as the command line has them."""
    known = _core.option_names()
    for key in mapping(given, "solver"):
        if key.replace("-", "_") not in known:
            raise unknown_argument(key, known)
    return [(text(key, "the name of an option"), text(option(value, key), key)) for key, value in mapping(given, "solver").items()]


def option(value: Any, name: str) -> str:
    if hasattr(value, "tolist") and getattr(value, "ndim", 1) == 0:  # a number of NumPy
        value = value.tolist()
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, (list, tuple)):
        return ",".join(option(v, f"{name}[{k}]") for k, v in enumerate(value))
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, int):
        return str(value) if abs(value) < 2**64 else shown(value)
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    raise TypeError(f"{name} is {shown(value)}; an option is a text, a number, True or False, or a list of these")
