"""Reduced matrices of flexible bodies, for other programs."""

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Iterable, Mapping

from .. import _checks, _core
from .._errors import make_error

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from .model import Model

_FORMATS = ("op4", "op4-text", "dmig", "mtx", "npz")


@dataclass(frozen=True)
class Interface:
    """Where other programs hold on to a reduced body: rows `first_row` up to, not with, first_row + components of its matrices."""

    name: str
    node: int
    position: "tuple[float, float, float]"
    components: int
    first_row: int


class ReducedBody:
    """A flexible body by Craig and Bampton's method: x = shapes q. q: displacements and rotations of the interfaces, in the
    axes of the mesh, then amplitudes of modes with the interfaces at rest, of modal mass 1.

    `stiffness`, `mass`, `damping` (None where there is none): symmetric. `unknowns`: node and component of each row, as in
    files; component 0 is an amplitude. `frequencies` of the modes, Hz. `shapes`: 3 vectors_per_node rows for each of `nodes`.
    `position` and `rotation` are where the model puts the mesh: global = rotation mesh + position.
    """

    def __init__(self, core: Any) -> None:
        import numpy as np

        self._core = core
        self.body: str = core.body
        self.units: str = core.units
        self.interfaces = tuple(Interface(name, node, tuple(place), components, first) for name, node, place, components, first in core.interfaces)
        numbers = core.numbers()
        self.stiffness: "NDArray[np.float64]" = numbers["stiffness"]
        self.mass: "NDArray[np.float64]" = numbers["mass"]
        self.damping: "NDArray[np.float64] | None" = numbers.get("damping")
        self.shapes: "NDArray[np.float64]" = numbers["shapes"].T
        self.frequencies: "NDArray[np.float64]" = numbers["frequencies"]
        self.nodes: "NDArray[np.int64]" = numbers["nodes"]
        self.node_positions: "NDArray[np.float64]" = numbers["node_positions"]
        self.vectors_per_node: int = core.vectors_per_node
        self.unknowns = np.array([(i.node, c + 1) for i in self.interfaces for c in range(i.components)]
                                 + [(core.first_scalar + k, 0) for k in range(len(self.frequencies))], dtype=np.int64).reshape(-1, 2)
        self.total_mass: float = core.total_mass
        self.centre = tuple(core.centre)
        self.position = tuple(core.position)
        self.rotation: "NDArray[np.float64]" = np.array(core.rotation).reshape(3, 3)
        self.notices = tuple(core.notices)

    def __repr__(self) -> str:
        return (f"ReducedBody({self.body!r}: {len(self.mass)} unknowns, interfaces {', '.join(i.name for i in self.interfaces)}, "
                f"{len(self.frequencies)} modes)")

    def write(self, stem: "str | os.PathLike[str]", formats: "str | Iterable[str]" = ("op4", "dmig", "npz")) -> "list[str]":
        """Writes stem.op4, stem_text.op4, stem.bdf, stem_k.mtx ..., stem.npz, as formats says ("op4", "op4-text", "dmig",
        "mtx", "npz"), and stem.json, which says what each row is. Returns the names of the files."""
        wanted = [formats] if isinstance(formats, str) else _checks.texts(formats, "formats")
        for name in wanted:
            _checks.choice(name, "formats", _FORMATS)
        status, files = _core.write_reduced_matrices(self._core, os.fspath(stem), wanted)
        if status[0] != 0:
            raise make_error(*status)
        return list(files)




def reduce_body(model: "Model", body: str, interfaces: "Iterable[str]", modes: "int | None", frequency: "float | None",
                first_node: int, settings: "list[str]") -> ReducedBody:
    core = _core.reduced_matrices(model.text, model._name, _checks.text(body, "body"), _checks.texts(interfaces, "interfaces"),
                                  -1 if modes is None else _checks.whole(modes, "modes"),
                                  0.0 if frequency is None else _checks.real(frequency, "frequency"),
                                  _checks.whole(first_node, "first_node", 1), settings)
    model._raise(core.status)
    return ReducedBody(core)
