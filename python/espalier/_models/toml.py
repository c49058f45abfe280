"""Model texts from dictionaries."""

import os
from typing import Any, Mapping

from .. import _checks


def _key(key: Any) -> str:
    if not isinstance(key, str):
        raise TypeError(f"{key!r} is no name of a key: names are text")
    return key if key and all(c.isascii() and (c.isalnum() or c in "-_") for c in key) else _text(key)


def _text(value: str, path: str = "a key") -> str:
    import json

    _checks.text(value, path)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any, path: str) -> str:
    if hasattr(value, "tolist"):  # numbers and arrays of NumPy
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, str):
        return _text(value, path)
    if isinstance(value, (list, tuple, range)):
        return "[" + ", ".join(_value(v, f"{path}[{k}]") for k, v in enumerate(value)) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(k)} = {_value(v, f'{path}.{k}')}" for k, v in value.items()) + "}"
    raise TypeError(f"{path}: {type(value).__name__} has no place in a model; give numbers, text, lists and dictionaries")


def toml_of(tree: "Mapping[str, Any]") -> str:
    """TOML with a table for every named part, so that messages give its line."""
    lines = [f"{_key(k)} = {_value(v, k)}" for k, v in tree.items() if not isinstance(v, Mapping)]
    for section, entries in tree.items():
        if not isinstance(entries, Mapping):
            continue
        lines.append(f"[{_key(section)}]")
        lines += [f"{_key(k)} = {_value(v, f'{section}.{k}')}" for k, v in entries.items() if not isinstance(v, Mapping)]
        for name, part in entries.items():
            if isinstance(part, Mapping):
                lines.append(f"[{_key(section)}.{_key(name)}]")
                lines += [f"{_key(k)} = {_value(v, f'{section}.{name}.{k}')}" for k, v in part.items()]
    return "\n".join(lines) + "\n"
