"""The models of the gallery, which come with the package: a chain, an engine, gears, a tyre and others.

    import espalier as esp

    print(esp.examples.names())
    result = esp.examples.load("engine").run(until=0.01, quantities=["piston.position.x"])

Each is a file that says in its first lines what it is and what may be set; `espalier examples` lists them in a terminal.
Those of the gallery that need meshes of other programs are not among them."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._simulation import Model

__all__ = ["load", "names", "path"]

_FOLDER = Path(__file__).parent / "models"


def names() -> "list[str]":
    """The names of all examples, sorted."""
    return sorted(file.stem for file in _FOLDER.glob("*.toml"))


def path(name: str) -> Path:
    """The file of an example, for `espalier simulate` or to be copied and changed.

    Raises:
        ValueError: there is no example of this name.
    """
    known = names()
    if name not in known:
        import difflib
        near = difflib.get_close_matches(str(name), known, 1)
        raise ValueError(f"there is no example {name!r}; " + (f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"))
    return _FOLDER / f"{name}.toml"


def load(name: str) -> "Model":
    """The model of an example, to be run or changed.

    Raises:
        ValueError: there is no example of this name.
    """
    from ._simulation import Model
    return Model.load(path(name))
