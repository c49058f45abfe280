"""Meshes of meshio (VTK, MED, XDMF, Exodus and others) as meshes of bodies."""

import os
import tempfile
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

# Kinds of cells: types of the file that is written, and how many nodes are kept (those in the middle of faces and of the
# volume stand last in VTK's order, which is meshio's).
_KINDS = {"tetra": ("C3D4", 4), "tetra10": ("C3D10", 10), "hexahedron": ("C3D8", 8), "hexahedron20": ("C3D20", 20),
          "hexahedron24": ("C3D20", 20), "hexahedron27": ("C3D20", 20), "wedge": ("C3D6", 6), "wedge15": ("C3D15", 15),
          "wedge18": ("C3D15", 15), "pyramid": ("C3D5", 5), "triangle": ("S3", 3), "triangle6": ("S6", 6), "triangle7": ("S6", 6),
          "quad": ("S4", 4), "quad8": ("S8", 8), "quad9": ("S8", 8), "line": ("T3D2", 2), "line3": ("T3D3", 3)}
_MOST_GROUPS = 256

_folder: "tempfile.TemporaryDirectory[str] | None" = None


def _new_file() -> str:
    """A file in a folder that goes with the process."""
    global _folder
    if _folder is None:
        _folder = tempfile.TemporaryDirectory(prefix="espalier-meshio-")
    handle, path = tempfile.mkstemp(".inp", dir=_folder.name)
    os.close(handle)
    return path


def _rows(values: Any) -> str:
    """Whole numbers, twelve in a line."""
    numbers = [str(int(v)) for v in values]
    return "".join(",".join(numbers[k:k + 12]) + "\n" for k in range(0, len(numbers), 12))


class _Sets:
    """Sets by name: of the file, whose names have no capitals, and names that a file can state."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.sets: "dict[str, list[Any]]" = {}

    def add(self, name: str, members: Any) -> None:
        import numpy as np

        name = str(name)
        if not name or name != name.strip() or any(c in name for c in ',="*\n\r'):
            raise ValueError(f"the {self.kind} set {name!r} cannot be named so in a mesh file: rename it, without , = \" * and blanks at its ends")
        for known in self.sets:
            if known != name and known.upper() == name.upper():
                raise ValueError(f"the {self.kind} sets {known!r} and {name!r} differ by capitals alone; rename one")
        self.sets.setdefault(name, []).append(np.asarray(members, dtype=np.int64).ravel())

    def text(self, keyword: str) -> str:
        import numpy as np

        out = []
        for name, lists in self.sets.items():
            members = np.unique(np.concatenate(lists))
            if len(members):
                out.append(f"*{keyword}, {keyword}={name}\n" + _rows(members + 1))
        return "".join(out)


def _groups(values: Any) -> "np.ndarray[Any, Any] | None":
    """Values of whole-number data of one component."""
    import numpy as np

    array = np.asarray(values)
    if array.ndim == 2 and array.shape[1] == 1:
        array = array[:, 0]
    return array if array.ndim == 1 and array.dtype.kind in "iu" else None


def _add_data(mesh: Any, starts: "list[int]", elements: _Sets, nodes: _Sets) -> None:
    """Sets NAME-VALUE of whole-number data; of Gmsh's physical groups their names."""
    import numpy as np

    named = {(int(tag), int(dim)): name for name, (tag, dim) in (getattr(mesh, "field_data", None) or {}).items()}
    for key, blocks in (getattr(mesh, "cell_data", None) or {}).items():
        arrays = [_groups(b) for b in blocks]
        whole = [a for a in arrays if a is not None]
        if len(whole) != len(arrays) or not whole or len(np.unique(np.concatenate(whole))) > _MOST_GROUPS:
            continue
        for start, block, array in zip(starts, mesh.cells, whole):
            if start < 0:
                continue
            for value in np.unique(array):
                dim = {"t": 3, "h": 3, "w": 3, "p": 3}.get(block.type[0], 2) if not block.type.startswith("tri") else 2
                dim = 1 if block.type.startswith("line") else dim
                name = named.get((int(value), dim)) if key == "gmsh:physical" else None
                elements.add(name or f"{key.replace(':', '-')}-{value}", start + np.nonzero(array == value)[0])
    for key, values in (getattr(mesh, "point_data", None) or {}).items():
        array = _groups(values)
        if array is None or len(np.unique(array)) > _MOST_GROUPS:
            continue
        for value in np.unique(array):
            nodes.add(f"{key.replace(':', '-')}-{value}", np.nonzero(array == value)[0])


def from_meshio(mesh: Any, *, file: "str | os.PathLike[str] | None" = None, scale: float = 1.0) -> "dict[str, Any]":
    """A mesh of meshio as the mesh of a body: model.bodies["part"] = {"type": "solid", "mesh": esp.from_meshio(mesh), ...}.

    meshio (pip install meshio) reads VTK, MED, XDMF, Exodus, CGNS and more: esp.from_meshio(meshio.read("part.med")).
    Point sets become node sets, cell sets element sets (of faces of solids face sets, too), by their names; whole-number
    data of cells and points become sets NAME-VALUE, Gmsh's physical groups by their names. Cells that are no lines, faces
    or solids of first or second order are an error; points in the middle of faces and volumes are left out.

    file: where the mesh is written, an Abaqus .inp; without one it lies in a temporary folder as long as the process lives.
    scale: of the coordinates. Returns {"file": ..., "scale": ...}.
    """
    import numpy as np

    for need in ("points", "cells"):
        if not hasattr(mesh, need):
            raise TypeError(f"from_meshio takes a mesh of meshio, which has points and cells; {type(mesh).__name__} has no {need}")
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or not np.isfinite(points).all():
        raise ValueError(f"points must be finite numbers in an array of two or three columns, not of shape {points.shape}")
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    elements, nodes = _Sets("cell"), _Sets("point")
    starts, count, text = [], 0, []
    for block in mesh.cells:
        if block.type == "vertex":
            starts.append(-1)
            continue
        if block.type not in _KINDS:
            raise ValueError(f"cells of type {block.type!r} are not read; known are vertex, {', '.join(_KINDS)}")
        kind, kept = _KINDS[block.type]
        data = np.asarray(block.data, dtype=np.int64)
        if data.size and (data.min() < 0 or data.max() >= len(points)):
            raise ValueError(f"cells of type {block.type!r} use points that are not there: 0 to {len(points) - 1} are")
        starts.append(count)
        text.append(f"*ELEMENT, TYPE={kind}\n")
        text += [_rows([count + k + 1, *(cell + 1)]).replace("\n", ",\n", 1 if kept > 11 else 0) for k, cell in enumerate(data[:, :kept])]
        count += len(data)
    if not count:
        raise ValueError("the mesh has no cells")
    for name, blocks in (getattr(mesh, "cell_sets", None) or {}).items():
        for start, members in zip(starts, blocks):
            if start >= 0 and members is not None:
                elements.add(name, start + np.asarray(members, dtype=np.int64))
    for name, members in (getattr(mesh, "point_sets", None) or {}).items():
        nodes.add(name, members)
    _add_data(mesh, starts, elements, nodes)
    path = os.path.abspath(os.fspath(file)) if file is not None else _new_file()
    if not path.lower().endswith(".inp"):
        raise ValueError(f"file: the mesh is written as Abaqus .inp; '{path}' does not end so")
    with open(path, "w", encoding="utf-8") as out:
        out.write("*NODE\n")
        out.writelines(f"{k + 1},{x!r},{y!r},{z!r}\n" for k, (x, y, z) in enumerate(points.tolist()))
        out.writelines(text)
        out.write(nodes.text("NSET") + elements.text("ELSET"))
    return {"file": path, "scale": float(scale)}
