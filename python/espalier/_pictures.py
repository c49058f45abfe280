"""Bodies as meshes of PyVista, pictures and animations. PyVista is imported by the first call that needs it."""

from dataclasses import dataclass
from typing import Any, NamedTuple


class Frame(NamedTuple):
    """The bodies at one time. points, displacement (from the start), velocity: (points, 3); von_mises: (cells,), stress in
    the middle of solid elements, 0 elsewhere. In the units of the model."""

    t: float
    points: Any
    displacement: Any
    velocity: Any
    von_mises: Any


@dataclass(frozen=True)
class Cells:
    """What the bodies are made of: flexible ones of their meshes, rigid ones are boxes. types: VTK's numbers of the shapes,
    (cells,) uint8; cell k has the points connectivity[offsets[k]:offsets[k + 1]], int64; body: (cells,) int32, which of
    `bodies` it belongs to."""

    types: Any
    offsets: Any
    connectivity: Any
    body: Any
    bodies: "list[str]"


def _pyvista() -> Any:
    from ctypes.util import find_library
    from os import environ
    from sys import modules

    # VTK would look for X first, and write that it found none.
    if "pyvista" not in modules and not environ.get("DISPLAY") and find_library("EGL"):
        environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    try:
        import pyvista
    except ImportError as error:
        raise ImportError("meshes and pictures need PyVista: pip install pyvista") from error
    return pyvista


def grid(cells: Cells, frame: Frame) -> Any:
    """A pyvista.UnstructuredGrid with its own copy of everything: point data displacement, velocity; cell data body,
    von_mises; field data t."""
    import numpy as np

    counts = np.diff(cells.offsets)
    lead = np.empty(len(cells.connectivity) + len(counts), np.int64)  # VTK's list: count, points, count, points, ...
    heads = cells.offsets[:-1] + np.arange(len(counts))
    lead[heads] = counts
    rest = np.ones(len(lead), bool)
    rest[heads] = False
    lead[rest] = cells.connectivity
    mesh = _pyvista().UnstructuredGrid(lead, cells.types, np.array(frame.points))
    mesh.point_data["displacement"] = np.array(frame.displacement)
    mesh.point_data["velocity"] = np.array(frame.velocity)
    mesh.cell_data["body"] = np.array(cells.body)
    mesh.cell_data["von_mises"] = np.array(frame.von_mises)
    mesh.set_active_scalars("von_mises")
    mesh.field_data["t"] = [frame.t]
    return mesh


def _limits(frames: "list[Frame]", scalars: "str | None") -> "tuple[float, float] | None":
    """One scale of colours for all pictures."""
    import numpy as np

    if scalars not in ("von_mises", "displacement", "velocity"):
        return None
    sizes = [np.asarray(getattr(f, scalars)) for f in frames]
    most = max((float(np.nanmax(np.linalg.norm(s, axis=1) if s.ndim == 2 else s, initial=0)) for s in sizes), default=0)
    return 0.0, most if most > 0 else 1.0


def _bounds(frames: "list[Frame]") -> "list[float]":
    """A box around everything: low x, high x, low y, ..."""
    import numpy as np

    low = np.min([f.points.min(axis=0) for f in frames], axis=0)
    high = np.max([f.points.max(axis=0) for f in frames], axis=0)
    return [float(v) for pair in zip(low, high) for v in pair]


def plotter(cells: Cells, frames: "list[Frame]", scalars: "str | None", size: "tuple[int, int]", view: Any, parallel: bool,
            mesh_options: "dict[str, Any]") -> "tuple[Any, Any]":
    """A pyvista.Plotter, offscreen, that looks at everything in all frames; and the mesh in it, of the first one."""
    mesh = grid(cells, frames[0])
    scene = _pyvista().Plotter(off_screen=True, window_size=list(size))
    options = {"cmap": "turbo", "clim": _limits(frames, scalars), "show_edges": len(cells.types) < 20_000,
               "edge_opacity": 0.25, "line_width": 2, "point_size": 10, "lighting": True,
               "scalar_bar_args": {"fmt": "%.3g", "n_labels": 2, "title_font_size": 14, "label_font_size": 13}, **mesh_options}
    scene.add_mesh(mesh, scalars=scalars, **{k: v for k, v in options.items() if v is not None})
    if parallel:
        scene.enable_parallel_projection()
    if view is None:  # flat models from the side that they lie in
        bounds = _bounds(frames)
        extents = [bounds[2 * k + 1] - bounds[2 * k] for k in range(3)]
        thin = min(range(3), key=lambda k: extents[k])
        view = ("yz", "xz", "xy")[thin] if extents[thin] < 0.2 * max(extents) else "iso"
    scene.camera_position = view
    scene.reset_camera(bounds=_bounds(frames))
    if parallel:
        scene.camera.parallel_scale = _scale(scene.camera, _bounds(frames), size)
    return scene, mesh


def _scale(camera: Any, bounds: "list[float]", size: "tuple[int, int]") -> float:
    """Half the height of the view in which the whole box is seen; reset_camera() looks at the sphere around it."""
    import numpy as np

    focal, up = np.array(camera.focal_point), np.array(camera.up)
    along = focal - np.array(camera.position)
    right = np.cross(along, up)
    top = np.cross(right, along)
    corners = np.array([[bounds[i], bounds[2 + j], bounds[4 + k]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) - focal
    wide = np.abs(corners @ right).max() / np.linalg.norm(right)
    high = np.abs(corners @ top).max() / np.linalg.norm(top)
    return float(1.1 * max(high, wide * size[1] / size[0])) or 1.0


def animation(cells: Cells, frames: "list[Frame]", path: Any, seconds: float, scalars: "str | None",
              size: "tuple[int, int]", view: Any, parallel: bool, mesh_options: "dict[str, Any]") -> Any:
    from os import fspath
    from tempfile import TemporaryDirectory

    from PIL import Image  # PyVista brings it along

    kind = "gif" if path is None else fspath(path).rpartition(".")[2].lower()
    if kind not in ("gif", "webp", "png"):
        raise ValueError(f"an animation is a file .gif, .webp or .png, not {fspath(path)!r}")
    scene, mesh = plotter(cells, frames, scalars, size, view, parallel, mesh_options)
    try:
        pictures = []
        for frame in frames:
            mesh.points[:] = frame.points
            mesh.point_data["displacement"][:] = frame.displacement
            mesh.point_data["velocity"][:] = frame.velocity
            mesh.cell_data["von_mises"][:] = frame.von_mises
            mesh.Modified()
            scene.render()
            pictures.append(Image.fromarray(scene.screenshot(return_img=True)))
    finally:
        scene.close()
    options: "dict[str, Any]" = {"save_all": True, "append_images": pictures[1:], "loop": 0,
                                 "duration": max(20, round(1000 * seconds / len(pictures)))}
    if path is not None:
        pictures[0].save(fspath(path), **options)
        return path
    from IPython.display import Image as Shown  # type: ignore[import-not-found]

    with TemporaryDirectory() as folder:
        file = f"{folder}/animation.gif"
        pictures[0].save(file, **options)
        with open(file, "rb") as f:
            return Shown(f.read(), format="gif")
