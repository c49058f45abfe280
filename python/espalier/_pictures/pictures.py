"""Bodies as meshes of PyVista, which is imported by the first call that needs it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from .scene import Scene, SurfaceFrame

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Frame(NamedTuple):
    """The bodies at one time. points, displacement (from the start), velocity: (points, 3); von_mises: (cells,), stress in
    the middle of solid elements, 0 elsewhere. In the units of the model."""

    t: float
    points: "NDArray[np.float64]"
    displacement: "NDArray[np.float64]"
    velocity: "NDArray[np.float64]"
    von_mises: "NDArray[np.float64]"

    def __repr__(self) -> str:
        return f"<espalier.Frame at t = {self.t:g}: {len(self.points)} points>"


@dataclass(frozen=True, repr=False)
class Cells:
    """What the bodies are made of: flexible ones of their meshes, rigid ones are boxes; of a page, triangles of their surfaces. types: VTK's numbers of the shapes,
    (cells,) uint8; cell k has the points connectivity[offsets[k]:offsets[k + 1]], int64; body: (cells,) int32, which of
    `bodies` it belongs to."""

    types: "NDArray[np.uint8]"
    offsets: "NDArray[np.int64]"
    connectivity: "NDArray[np.int64]"
    body: "NDArray[np.int32]"
    bodies: "list[str]"

    def __repr__(self) -> str:
        return f"<espalier.Cells: {len(self.types)} of {', '.join(self.bodies)}>"


def _pyvista() -> Any:
    try:
        import pyvista
    except ImportError as error:
        raise ImportError("meshes need PyVista: pip install pyvista") from error
    return pyvista


def surface_cells(scene: Scene) -> Cells:
    """The triangles of a page, its lines and points that belong to none."""
    import numpy as np

    faced = np.zeros(scene.points, bool)
    faced[scene.triangles] = True
    lines = scene.edges[~faced[scene.edges].all(axis=1)]
    alone = ~faced
    alone[lines] = False
    points = np.flatnonzero(alone)
    counts = np.repeat([3, 2, 1], [len(scene.triangles), len(lines), len(points)])
    connectivity = np.concatenate([scene.triangles.ravel(), lines.ravel(), points]).astype(np.int64)
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    types = np.repeat(np.array([5, 3, 1], np.uint8), [len(scene.triangles), len(lines), len(points)])
    return Cells(types, offsets, connectivity, scene.body_of[connectivity[offsets[:-1]]].astype(np.int32), [b.name for b in scene.bodies])


def grid(cells: Cells, frame: "Frame | SurfaceFrame") -> Any:
    """A pyvista.UnstructuredGrid with its own copy of everything: point data displacement, velocity (of a page speed,
    von_mises, principal); cell data body (and von_mises); field data t."""
    import numpy as np

    counts = np.diff(cells.offsets)
    lead = np.empty(len(cells.connectivity) + len(counts), np.int64)  # VTK's list: count, points, count, points, ...
    heads = cells.offsets[:-1] + np.arange(len(counts))
    lead[heads] = counts
    rest = np.ones(len(lead), bool)
    rest[heads] = False
    lead[rest] = cells.connectivity
    mesh = _pyvista().UnstructuredGrid(lead, cells.types, np.array(frame.points))
    for name, values in frame._asdict().items():
        if name not in ("t", "points"):
            (mesh.cell_data if isinstance(frame, Frame) and name == "von_mises" else mesh.point_data)[name] = np.array(values)
    mesh.cell_data["body"] = np.array(cells.body)
    mesh.set_active_scalars("von_mises")
    mesh.field_data["t"] = [frame.t]
    return mesh
