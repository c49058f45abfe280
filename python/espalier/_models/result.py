"""What a run came to: series, frames, pictures, its page and its summary."""

import os
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Callable, Iterator

from .. import _checks
from .._pictures.page import Shown, write_page
from .._pictures.pictures import Cells, Frame, grid, surface_cells
from .._pictures.scene import Frames, Scene

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_FLAT = {"method": "integrator", "t_begin": "time", "t_end": "time", "stopped_by": "events", "critical": "statics", "modes": "initial",
         "statics_residual": "statics", "statics_backward_error": "statics"}
_FLAT.update({k: "system" for k in ("bodies", "joints", "forces", "velocities", "degrees_of_freedom", "redundant", "notices")})
_FLAT.update({k: "integrator" for k in ("steps", "newton_iterations", "error_failures", "newton_failures")})
_FLAT.update({k: "counts" for k in ("residuals", "tangents", "analyses", "factorizations", "solves", "turned")})


class Summary(dict):  # type: ignore[type-arg]
    """What is known of a run, nested with the keys of summary.json, which the command line writes; NaN stands where that
    has null. summary["steps"] is short for summary["integrator"]["steps"], and likewise for other names of the second
    level that are not in doubt."""

    def __missing__(self, key: str) -> Any:
        if key not in _FLAT:
            raise KeyError(f"{key!r}: the summary has {', '.join(self)}")
        group = self[_FLAT[key]]
        return group[key[2:] if key.startswith("t_") else key.removeprefix("statics_")]


def _vectors(names: "list[str]") -> "dict[str, list[int]]":
    """The columns of each quantity, by its name: one, or the three of a vector, in the order of the first."""
    at, out = {n: k for k, n in enumerate(names)}, {}
    for name in names:
        stem = name[:-2]
        parts = [f"{stem}.{c}" for c in "xyz"]
        if name[-2:] in (".x", ".y", ".z") and all(p in at for p in parts):
            out[stem] = [at[p] for p in parts]
        else:
            out[name] = [at[name]]
    return out


def _rising(limits: Any) -> "tuple[float, float] | None":
    if limits is None:
        return None
    low, high = _checks.interval(limits, "limits")
    if not float("-inf") < low < high < float("inf"):
        raise ValueError(f"limits={limits!r}: the lowest and the highest value of the colours")
    return low, high


@dataclass(frozen=True)
class Result:
    """What a run came to. t: (rows,) times, or load factors, of the start and the ends of steps; names and values (rows,
    len(names)): the chosen quantities, or a usual set; dimensions: of each name in words of the model's units
    ("length/time", "": not known); summary: everything that is known of the run, nested.

    A mapping of its names to their columns: result["bob.position.x"], `in`, len(), keys(), items(), dict(result); vectors
    are known by their names, too: result["bob.position"] is (rows, 3)."""

    t: "NDArray[np.float64]"
    names: "list[str]"
    values: "NDArray[np.float64]"
    summary: Summary
    dimensions: "dict[str, str]" = field(default_factory=dict)
    _kept: "tuple[Cells, tuple[Frame, ...]] | None" = field(default=None, repr=False, compare=False)
    _page: "Callable[[], str] | str | None" = field(default=None, repr=False, compare=False)

    def __getstate__(self) -> "dict[str, Any]":  # the simulation stays in its process, its page goes along
        kept = {k: v for k, v in self.__dict__.items() if k != "_scene"}
        return {**kept, "_page": self._page() if callable(self._page) else self._page}

    def to_html(self, path: "str | os.PathLike[str] | None" = None) -> str:
        """The page of the run (docs/guide/see.md): scene, plots and summary in one text of HTML that needs nothing else;
        with a path it is written there, too. Of a simulation that went on since, it shows that."""
        if self._page is None:
            raise ValueError("no page was kept: leave page=False out of run() or Simulation(); sweep() takes page=True")
        text = self._page() if callable(self._page) else self._page
        if path is not None:
            write_page(text, _checks.path(path, "path"))
        return text

    def show(self, *, height: int = 640) -> Shown:
        """The page: in a notebook in the cell (a picture where a notebook is read without scripts), else in a browser."""
        from .._pictures.drawing import png

        height = _checks.whole(height, "height", 100, 10_000)
        return Shown(self.to_html(), height, lambda: png(self._scene, (1000, min(height, 620))))

    @cached_property
    def _scene(self) -> Scene:
        return Scene(self.to_html())

    def __getitem__(self, name: str) -> "NDArray[np.float64]":
        """One quantity over time, (rows,), the three columns of a vector, (rows, 3), or its length ("pin.force.norm")."""
        import numpy as np

        _checks.text(name, "name")
        if name in self.names:
            return self.values[:, self.names.index(name)]
        vectors = _vectors(self.names)
        if name in vectors:
            return self.values[:, vectors[name]]
        stem, _, last = name.rpartition(".")
        if last == "norm" and len(vectors.get(stem, ())) == 3:
            return np.linalg.norm(self.values[:, vectors[stem]], axis=1)
        raise KeyError(f"{name!r} was not chosen; there are {', '.join(vectors) or 'none'}: give quantities=[...]")

    def __contains__(self, name: object) -> bool:
        return name in self.names or name in _vectors(self.names)

    def __iter__(self) -> "Iterator[str]":
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __bool__(self) -> bool:
        return True

    def keys(self) -> "list[str]":
        """The names of the quantities."""
        return list(self.names)

    def get(self, name: str, otherwise: Any = None) -> Any:
        """result[name], or something else where the name is not known."""
        try:
            return self[name]
        except KeyError:
            return otherwise

    def items(self) -> "list[tuple[str, NDArray[np.float64]]]":
        """Pairs of a name and its column, (rows,)."""
        return [(name, self.values[:, k]) for k, name in enumerate(self.names)]

    def to_pandas(self) -> Any:
        """A pandas.DataFrame with the times as index; attrs["units"]: the dimensions of its columns."""
        import pandas

        frame = pandas.DataFrame(self.values, index=pandas.Index(self.t, name="t"), columns=self.names)
        frame.attrs["units"] = dict(self.dimensions)
        return frame

    def to_xarray(self) -> Any:
        """An xarray.Dataset over the dimension t; vectors have a second one, axis, of x, y, z. attrs["units"] of each
        variable is its dimension in the units of the model."""
        import xarray

        made = {}
        for name, columns in _vectors(self.names).items():
            attrs = {"units": self.dimensions.get(self.names[columns[0]], "")}
            vector = len(columns) == 3
            made[name] = xarray.Variable(("t", "axis") if vector else "t", self.values[:, columns if vector else columns[0]], attrs)
        statics = self.summary["method"].endswith("statics")
        coordinates = {"t": ("t", self.t, {"long_name": "load factor"} if statics else {"long_name": "time", "units": "time"})}
        if any(v.ndim == 2 for v in made.values()):
            coordinates["axis"] = list("xyz")
        return xarray.Dataset(made, coordinates, {"title": self.summary["title"]})

    @property
    def frames(self) -> Any:
        """The bodies over the run: Frames with their meshes where frames=... asked for them, else SurfaceFrames of the
        page, each unpacked when it is asked for; none with page=False."""
        if self._kept is not None:
            return self._kept[1]
        return () if self._page is None else Frames(self._scene)

    @property
    def cells(self) -> "Cells | None":
        """What the points of the frames make up."""
        if self._kept is not None:
            return self._kept[0]
        return None if self._page is None else surface_cells(self._scene)

    def _frame(self, t: "float | None") -> "tuple[Cells, Any]":
        import numpy as np

        cells, frames = self.cells, self.frames
        if cells is None or not frames:
            raise ValueError("no frames were kept: leave page=False out, or give frames=0.01, an interval of time")
        times = self._scene.times if isinstance(frames, Frames) else [f.t for f in frames]
        at = len(times) - 1 if t is None else int(np.argmin(np.abs(np.array(times) - _checks.real(t, "t"))))
        return cells, frames[at]

    def mesh(self, t: "float | None" = None) -> Any:
        """The bodies as a pyvista.UnstructuredGrid, as they were in the frame nearest to t (None: the last): point data
        displacement, velocity, cell data von_mises of frames=..., else point data displacement, speed, von_mises,
        principal of their surfaces; cell data body (its place in cells.bodies); field data t."""
        return grid(*self._frame(t))

    def meshes(self) -> Any:
        """All frames as a pyvista.MultiBlock, a block for each, named by its time."""
        from .._pictures.pictures import _pyvista

        cells, _ = self._frame(None)
        blocks = _pyvista().MultiBlock()
        for frame in self.frames:
            blocks.append(grid(cells, frame), f"t = {frame.t:.9g}")
        return blocks

    def picture(self, t: "float | None" = None, path: "str | os.PathLike[str] | None" = None, *, scalars: "str | None" = "auto",
                size: "tuple[int, int]" = (800, 500), view: Any = None, limits: "tuple[float, float] | None" = None) -> Any:
        """The page's frame nearest to t (None: the last), drawn without a window and without PyVista: an image of Pillow,
        which notebooks show; with a path (.png, .jpg, ...) it is written there, too. scalars: what is coloured
        ("von_mises", "principal", "strain", "displacement", "deformation", "velocity"; "body" or None: each body has its colour;
        "auto": stress where there is one). view: "xy" (x to the right, y up), "xz", ..., "iso", or the direction of the eye.
        limits: of the colours; None: everything, nothing is clipped. The place of the largest value is named."""
        from .._pictures.drawing import still

        image = still(self._scene, None if t is None else _checks.real(t, "t"), scalars, size, view,
                      _rising(limits))
        if path is not None:
            image.save(os.fspath(path))
        return image

    def animate(self, path: "str | os.PathLike[str] | None" = None, *, seconds: float = 3.0,
                between: "tuple[float, float] | None" = None, scalars: "str | None" = "auto", size: "tuple[int, int]" = (640, 400),
                view: Any = None, limits: "tuple[float, float] | None" = None) -> Any:
        """The page's frames (between two times) as an animation (.gif, .webp, .png) of that duration, 15 pictures a second
        at most, with one scale of colours and one camera; without a path as an image that notebooks show. Options as for
        picture()."""
        from .._pictures.drawing import animation

        seconds = _checks.real(seconds, "seconds")
        if not 0 < seconds < 1000:
            raise ValueError(f"seconds={seconds!r}: the duration of the animation, more than 0")
        return animation(self._scene, None if path is None else os.fspath(path), seconds,
                         None if between is None else _checks.interval(between, "between"), scalars, size, view,
                         _rising(limits))

    def _facts(self) -> "list[tuple[str, str]]":
        """What was solved, how well, and what is to be known of it."""
        s = self.summary
        system, energy, worst, integrator = s["system"], s["energy"], s["constraints"], s["integrator"]
        statics = s["method"].endswith("statics")
        facts = [("solved", f"{system['bodies']} bodies, {system['joints']} joints, {system['forces']} forces; {system['velocities']} + "
                  f"{system['constraints']} unknowns, {system['degrees_of_freedom']} degrees of freedom"),
                 ("load" if statics else "time", f"{s['t_begin']:g} to {s['t_end']:g} in {s['steps']} steps ({s['method']}, "
                  f"{integrator['newton_iterations']} Newton iterations), {s['seconds']['total']:.3g} s")]
        if s["status"] != "ok":
            facts.append(("status", f"{s['status'].replace('_', ' ')}{': ' if s['message'] else ''}{s['message']}"))
        if statics:
            facts.append(("out of balance", f"{s['statics_residual']:.3g}"))
        else:
            change = max(abs(energy["end"]["total"] - energy["begin"]["total"]), abs(energy["work"]), energy["end"]["kinetic"])
            share = f" ({100 * abs(energy['gain']) / change:.2g} % of what changed)" if change > 0 else ""
            facts.append(("energy made by the steps", f"{energy['gain']:.3g}{share}"))
        facts.append(("constraints miss by", f"{worst['position']:.2g} in positions, {worst['velocity']:.2g} in velocities"))
        facts += [("event", f"{e['name']} at {e['t']:.6g}") for e in s["events"]["first"][:10]]
        facts += [("mode", f"{m['frequency']:.6g}, damping {100 * m['damping_ratio']:.2g} %") for m in s["modes"][:10]]
        facts += [("critical", f"{c['kind']} at load factor {c['load']:.6g}") for c in s["critical"]]
        facts += [("redundant", text) for text in system["redundant"]] + [("notice", text) for text in system["notices"]]
        return facts

    def _repr_html_(self) -> str:
        from base64 import b64encode
        from html import escape

        from .._pictures.drawing import png

        rows = "".join(f"<tr><th style='text-align:left'>{escape(k)}</th><td style='text-align:left'>{escape(v)}</td></tr>"
                       for k, v in [*self._facts(), ("quantities", ", ".join(list(_vectors(self.names))[:12]) or "none")])
        cheap = self._page is not None and self.summary["velocities"] < 20_000
        image = png(self._scene, (420, 280)) if cheap else None
        shown = "" if image is None else (f"<img alt='The bodies at the end' width='420' height='280' src='data:image/png;base64,"
                                          f"{b64encode(image).decode()}'>")
        return (f"<table><caption>{escape(str(self.summary['title'] or 'Result'))}: show() for a scene and plots</caption>{rows}"
                f"</table>{shown}")

    def __repr__(self) -> str:
        s = self.summary
        lines = [f"<espalier.Result: {s['title']!r}, {s['method']}, t = {s['t_begin']:g} to {s['t_end']:g} in {s['steps']} steps, "
                 f"{s['seconds']['total']:.3g} s, {len(self.names)} quantities"]
        told = [f"{k}: {v}" for k in ("redundant", "notices") for v in s[k]]
        return "\n  ".join([*lines, *told[:8], *([f"... and {len(told) - 8} more"] if len(told) > 8 else [])]) + ">"
