#!/usr/bin/env python3
"""Draws a result of `espalier simulate`: the outer surface of the bodies in one or two of its frames, coloured
by von Mises stress or by the displacement from the initial state, and a curve of quantities.csv below.

    python3 scripts/draw_model.py RESULTS --out picture.png --look engine
    python3 scripts/draw_model.py RESULTS --out picture.png --view 20 -60 --times 0.01 0.02 --curve pin.force.norm

RESULTS is the folder given to --out of simulate. --look takes times, view and curve of one of the models in models/.
Reads results.vtkhdf or motion.pvd. Needs numpy, matplotlib, pillow, h5py (the group "pictures" of scripts/packages.txt).
"""
import argparse
import csv
import re
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from PIL import Image

# Faces of a cell by its VTK type: corners, then the nodes in the middle of the edges, in the order of the outline.
HEX = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
TET = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
HEX_EDGES = {frozenset(e): 8 + k for k, e in enumerate(
    ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)))}
TET_EDGES = {frozenset(e): 4 + k for k, e in enumerate(((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)))}


def outlines(faces, edges):
    """The faces with the middle nodes of their edges between the corners."""
    return tuple(tuple(n for a, b in zip(f, f[1:] + f[:1]) for n in (a, edges[frozenset((a, b))])) for f in faces)


FACES = {10: TET, 24: outlines(TET, TET_EDGES), 12: HEX, 25: outlines(HEX, HEX_EDGES), 9: ((0, 1, 2, 3),),
         5: ((0, 1, 2),)}
LINE = 3
LARGEST = 150_000  # bytes; larger pictures get a palette of 256 colours


@dataclass(frozen=True)
class Look:
    """How a result is drawn."""
    times: tuple = ()                 # of the frames; empty: the last one
    view: tuple = (25.0, -60.0)       # elevation and azimuth of the eye, degrees
    up: str = "z"                     # axis that points up in the picture
    colour: str = "von_mises"         # or displacement, velocity
    unit: tuple = ()                  # label of the bar and factor, where the model is not in SI units
    most: float = 0.0                 # end of the colour scale in the unit of the bar; 0: 99.5 % of the faces are below
    mesh: float = 0.25                # width of the mesh lines, points; 0: none
    across: bool = True               # two frames stand side by side, else one above the other
    curve: tuple = ()                 # columns of quantities.csv, NAME or NAME.norm
    against: str = "time"
    axes: tuple = ("", "")            # labels of the curve
    factors: tuple = (1.0, 1.0)       # from the model's units to those of the labels
    names: tuple = ()                 # legend of the curves
    size: tuple = (8.0, 5.6)          # inches
    share: float = 0.42               # height of the curve against that of the frames
    path: tuple = ()                  # points of a line that is drawn behind the bodies (a guide), global axes
    titles: str = "t = {:.3g} s"


def chain_guide(pitch=0.040, links=3):
    """The path of the pins of models/chain.toml, as far as the picture shows it."""
    radius = pitch / (2 * np.sin(np.pi / 4 / links))
    turn = np.linspace(0, np.pi / 2, 40)
    arc = np.stack([radius * np.sin(turn), radius * (np.cos(turn) - 1), 0 * turn], axis=1)
    return tuple(map(tuple, np.concatenate([[[-0.26, 0, 0]], arc, [[radius, -0.31, 0]]])))


LOOKS = {
    "engine": Look(times=(0.021, 0.025), view=(24, -68), up="y", curve=("crank_pin.force.norm",),
                   axes=("time, ms", "force on the\ncrank pin, kN"), factors=(1e3, 1e-3), size=(8.0, 4.6), share=0.55),
    "chain": Look(times=(0.02, 0.2), view=(14, -80), up="y", curve=("haul.force.y",), path=chain_guide(),
                  axes=("time, s", "pull at the head, N"), factors=(1, -1), size=(8.0, 5.2), share=0.45),
    "sprocket": Look(times=(0.0, 0.2), view=(14, -72), up="y", colour="velocity", curve=("hook.force.norm",), mesh=0.1,
                     axes=("time, s", "force in the\nhook, N"), size=(8.0, 5.6), share=0.35),
    "gears": Look(times=(0.0, 0.002), view=(65, -90), up="z", curve=("motor.moment.z",), mesh=0.12,
                  axes=("time, ms", "moment of the\nmotor, N m"), factors=(1e3, 1), size=(8.0, 4.8), share=0.4),
    "tyre": Look(times=(0.3, 0.52), view=(8, -72), up="z", curve=("rim.position.z",), mesh=0.12,
                 axes=("time, s", "height of the\naxle, mm"), factors=(1, 1e3), size=(8.0, 5.2), share=0.4),
    "rotor": Look(times=(0.06, 0.1028), view=(22, -42), up="y", curve=("centre.position.radius",),
                  against="unbalance.angular_velocity.z", axes=("speed, rad/s", "radius of the whirl, mm"),
                  factors=(1, 1e3), size=(8.0, 5.6), share=0.6),
    "real-engine": Look(times=(0.0185, 0.0225), view=(24, 50), curve=("crank_pin.force.norm",),
                        axes=("time, ms", "force on the crank pin, N"), factors=(1e3, 1), size=(8.0, 4.8), share=0.5),
    "real-rotor": Look(times=(0.002, 0.03), view=(22, -52), curve=("bearing_left.force.norm",),
                       axes=("time, ms", "force in the\nlower bearing, N"), factors=(1e3, 1), size=(8.0, 4.6), share=0.55),
    "real-wheelset": Look(times=(0.008, 0.012), view=(18, -62), curve=("suspension_left.force.z", "suspension_right.force.z"),
                          names=("left", "right"), axes=("time, ms", "force of the\nsuspension, kN"), factors=(1e3, 1e-3),
                          size=(8.0, 4.6), share=0.55, mesh=0.15),
    "real-slot": Look(times=(0.0018, 0.0034), view=(40, -65), curve=("clamp.force.x",), unit=("von Mises stress, psi", 1.0),
                      axes=("time, ms", "force in the\nclamp, lbf"), factors=(1e3, 1), size=(8.0, 4.8), share=0.45, mesh=0.1),
    "real-tyre": Look(times=(0.05, 0.2), view=(20, -35), curve=("motor.moment.x",), axes=("time, s", "moment of the\nmotor, N m"),
                      size=(8.0, 5.2), share=0.4, mesh=0.15),
    "real-tyre-road": Look(times=(0.4, 0.74), view=(8, 18), up="z", curve=("rim.position.z",), mesh=0.12,
                           axes=("time, s", "height of the\naxle, mm"), factors=(1, 1e3), size=(8.0, 5.2), share=0.4),
}

UNITS = {"von_mises": ("von Mises stress, MPa", 1e-6), "displacement": ("displacement, mm", 1e3),
         "velocity": ("speed, m/s", 1.0)}


def unit_of(look):
    """Label of the colour bar and the factor from the model's unit to it."""
    return look.unit or UNITS[look.colour]


def read_vtu(path):
    """The arrays of one .vtu file of ours (appended raw binary) by name."""
    data = path.read_bytes()
    start = data.index(b"<AppendedData")
    start = data.index(b"_", data.index(b">", start)) + 1
    types = {"Float64": np.float64, "Int64": np.int64, "UInt8": np.uint8}
    arrays = {}
    for tag in re.findall(r"<DataArray [^>]*>", data[:start].decode()):
        a = dict(re.findall(r'(\w+)="([^"]*)"', tag))
        at = start + int(a["offset"])
        size = int(np.frombuffer(data, np.uint64, 1, at)[0])
        values = np.frombuffer(data[at + 8:at + 8 + size], types[a["type"]])
        components = int(a["NumberOfComponents"])
        arrays[a["Name"]] = values.reshape(-1, components) if components > 1 else values
    return arrays


def read_vtkhdf(path, k):
    """The same of frame k of a results.vtkhdf."""
    import h5py

    with h5py.File(path) as file:
        root, steps = file["VTKHDF"], file["VTKHDF/Steps"]
        points, cells = int(root["NumberOfPoints"][0]), int(root["NumberOfCells"][0])
        arrays = {"connectivity": root["Connectivity"][:], "offsets": root["Offsets"][1:], "types": root["Types"][:]}
        first_of_points = int(steps["PointOffsets"][k])
        arrays["Points"] = root["Points"][first_of_points:first_of_points + points]
        for group, count in (("PointData", points), ("CellData", cells)):
            for name, array in root[group].items():
                first = int(steps[f"{group}Offsets"][name][k])
                arrays[name] = array[first:first + count]
    return arrays


def read_frame(frame):
    """The arrays of one of the frames of read_series()."""
    return read_vtkhdf(*frame) if isinstance(frame, tuple) else read_vtu(frame)


def read_series(folder):
    """Times and frames of results.vtkhdf or motion.pvd."""
    if (folder / "results.vtkhdf").exists():
        import h5py

        with h5py.File(folder / "results.vtkhdf") as file:
            times = file["VTKHDF/Steps/Values"][:]
        return times, [(folder / "results.vtkhdf", k) for k in range(len(times))]
    if not (folder / "motion.pvd").exists():
        sys.exit(f"{folder} has no results.vtkhdf or motion.pvd: give the model output.vtu_interval (index.html there needs none)")
    text = (folder / "motion.pvd").read_text()
    rows = re.findall(r'timestep="([^"]+)"[^>]*file="([^"]+)"', text)
    if not rows:
        sys.exit(f"{folder}/motion.pvd lists no files: give the model output.vtu_interval")
    return np.array([float(t) for t, _ in rows]), [folder / f for _, f in rows]


def surface(frame):
    """Outer faces as (list of arrays: faces x nodes of one outline length), the cells behind them, and lines."""
    ends, kinds = frame["offsets"], frame["types"]
    starts = np.concatenate([[0], ends[:-1]])
    found, behind, lines = [], [], []
    for kind in np.unique(kinds):
        cells = np.flatnonzero(kinds == kind)
        if kind == LINE:
            lines = frame["connectivity"][starts[cells][:, None] + np.arange(2)]
            continue
        if kind not in FACES:
            continue
        for face in FACES[kind]:
            found.append(frame["connectivity"][starts[cells][:, None] + np.array(face)])
            behind.append(cells)
    corners = [f[:, ::2] if f.shape[1] > 4 else f for f in found]
    keys = np.full((sum(len(c) for c in corners), 4), -1, np.int64)
    row = 0
    for c in corners:
        keys[row:row + len(c), :c.shape[1]] = np.sort(c, axis=1)
        row += len(c)
    _, which, times = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    once = times[which.ravel()] == 1
    kept, cells, row = [], [], 0
    for f, b in zip(found, behind):
        mask = once[row:row + len(f)]
        kept.append(f[mask])
        cells.append(b[mask])
        row += len(f)
    return kept, cells, lines


def axes_of_view(look):
    """Rows: right, up and towards the eye of the picture, in global axes."""
    e, a = np.radians(look.view)
    eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0])
    frame = np.array([right, np.cross(eye, right), eye])
    return frame if look.up == "z" else frame[:, [0, 2, 1]] * np.array([1, 1, -1])  # y up: (x, y, z) = (x, z', -y')


def face_values(frame, faces, cells, name, factor):
    """One number for every face. Stress: averaged over the cells at every node first; NaN for rigid bodies."""
    if name in ("displacement", "velocity"):
        at_point = np.linalg.norm(frame[name], axis=1)
        return [factor * at_point[f].mean(axis=1) for f in faces]
    owner = np.repeat(np.arange(len(frame["offsets"])), np.diff(frame["offsets"], prepend=0))
    count = np.bincount(frame["connectivity"], minlength=len(frame["Points"]))
    total = np.bincount(frame["connectivity"], frame[name][owner], minlength=len(frame["Points"]))
    at_point = total / np.maximum(count, 1)
    body = frame["body"].astype(int)
    alone = (np.bincount(body)[body] == 1) & (frame[name] == 0)  # one cell without stress: the box of a rigid body
    return [np.where(alone[c], np.nan, factor * at_point[f].mean(axis=1)) for f, c in zip(faces, cells)]


def cut(polygon, pieces=20):
    """A large quadrilateral as small ones, so that sorting by depth stays right."""
    s = np.linspace(0, 1, pieces + 1)
    u, v = np.meshgrid(s, s)
    grid = ((1 - u) * (1 - v))[..., None] * polygon[0] + (u * (1 - v))[..., None] * polygon[1] \
        + (u * v)[..., None] * polygon[2] + ((1 - u) * v)[..., None] * polygon[3]
    return [grid[[i, i, i + 1, i + 1], [j, j + 1, j + 1, j]] for i in range(pieces) for j in range(pieces)]


def polygons(frame, look):
    """Visible polygons (2-D, back to front), their values, their brightness, whether they carry mesh lines."""
    faces, cells, lines = surface(frame)
    view = axes_of_view(look)
    points = frame["Points"] @ view.T
    light = np.array([-0.35, 0.6, 0.72])
    light /= np.linalg.norm(light)
    flat, depth, value, bright, own = [], [], [], [], []
    for f, v in zip(faces, face_values(frame, faces, cells, look.colour, unit_of(look)[1])):
        p = points[f]
        following = np.roll(p, -1, axis=1)
        normal = np.cross(p, following).sum(axis=1)
        length = np.linalg.norm(normal, axis=1)
        normal /= np.where(length > 0, length, 1)[:, None]
        for k in np.flatnonzero(normal[:, 2] > 0):
            small = cut(p[k]) if np.isnan(v[k]) and len(p[k]) == 4 else [p[k]]
            for q in small:
                flat.append(q[:, :2])
                depth.append(q[:, 2].mean())
                value.append(v[k])
                bright.append(0.62 + 0.38 * max(0.0, float(normal[k] @ light)))
                own.append(len(small) == 1)
    order = np.argsort(depth)
    segments = points[np.asarray(lines, int).reshape(-1, 2)][:, :, :2]
    return [flat[i] for i in order], np.array(value)[order], np.array(bright)[order], np.array(own)[order], segments


def draw_frame(axes, shapes, look, norm, colours):
    flat, value, bright, own, segments = shapes
    if look.path:
        axes.plot(*(np.array(look.path) @ axes_of_view(look).T)[:, :2].T, color="#c4c8ce", lw=5, zorder=0,
                  solid_capstyle="round")
    rgb = colours(norm(np.nan_to_num(value)))[:, :3]
    rgb[np.isnan(value)] = (0.72, 0.74, 0.78)
    rgb = np.clip(rgb * bright[:, None], 0, 1)
    lines = np.where((own & (look.mesh > 0))[:, None], 0.72 * rgb, rgb)
    widths = np.where(own & (look.mesh > 0), look.mesh, 0.3)
    axes.add_collection(PolyCollection(flat, facecolors=rgb, edgecolors=lines, linewidths=widths, joinstyle="round"))
    if len(segments):
        axes.add_collection(LineCollection(segments, colors="#345", linewidths=1.2))
    axes.set_aspect("equal")
    axes.axis("off")


def read_columns(folder):
    with open(folder / "quantities.csv", newline="") as file:
        rows = list(csv.reader(file))
    names = [n.strip() for n in rows[0]]
    return dict(zip(names, np.array(rows[1:], float).T))


def column(columns, name, factor):
    """A column, NAME.norm of three columns, or NAME.radius: of x and y."""
    if name in columns:
        return factor * columns[name]
    stem, _, last = name.rpartition(".")
    parts = {"norm": "xyz", "radius": "xy"}.get(last)
    if parts is None or any(f"{stem}.{p}" not in columns for p in parts):
        sys.exit(f"quantities.csv has no {name}; it has: {', '.join(columns)}")
    return abs(factor) * np.sqrt(sum(columns[f"{stem}.{p}"]**2 for p in parts))


def draw_curve(axes, folder, look, times):
    columns = read_columns(folder)
    x = column(columns, look.against, look.factors[0])
    for k, name in enumerate(look.curve):
        axes.plot(x, column(columns, name, look.factors[1]), lw=1.2, color=("#20508a", "#b5482a", "#3c7d4f")[k % 3],
                  label=look.names[k] if k < len(look.names) else name)
    if len(look.curve) > 1:
        axes.legend(frameon=False, fontsize=8)
    for t in times if len(times) > 0 else ():
        axes.axvline(np.interp(t, columns["time"], x), color="#999", lw=0.8, ls=":")
    axes.set_xlabel(look.axes[0] or look.against)
    axes.set_ylabel(look.axes[1] or look.curve[0])
    axes.grid(color="#e4e4e4", lw=0.6)
    axes.margins(x=0)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def limits(all_shapes):
    """One window for all frames, so that they have one scale."""
    points = np.concatenate([np.concatenate(s[0]) for s in all_shapes if s[0]])
    low, high = points.min(axis=0), points.max(axis=0)
    pad = 0.03 * (high - low).max()
    return low - pad, high + pad


def draw(folder, out, look):
    times, files = read_series(folder)
    chosen = [int(np.argmin(abs(times - t))) for t in look.times] or [len(times) - 1]
    shapes = [polygons(read_frame(files[i]), look) for i in chosen]
    label, _ = unit_of(look)
    every = np.concatenate([s[1] for s in shapes])
    most = look.most or float(np.nanpercentile(every, 99.5)) or 1.0
    if label.endswith("MPa") and most < 0.5:
        label, most, every = label.replace("MPa", "kPa"), 1e3 * most, 1e3 * every
        shapes = [(s[0], 1e3 * s[1], *s[2:]) for s in shapes]
    norm, colours = Normalize(0, most, clip=True), plt.get_cmap("turbo")
    figure = plt.figure(figsize=look.size, dpi=110, facecolor="white", layout="constrained")
    rows, cols = (1, len(chosen)) if look.across else (len(chosen), 1)
    grid = figure.add_gridspec(rows + bool(look.curve), cols, height_ratios=[1] * rows + [look.share * rows] * bool(look.curve))
    low, high = limits(shapes)
    panels = []
    for k, (i, shape) in enumerate(zip(chosen, shapes)):
        axes = figure.add_subplot(grid[k // cols, k % cols])
        draw_frame(axes, shape, look, norm, colours)
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_title(look.titles.format(times[i]), fontsize=9, color="#444")
        panels.append(axes)
    bar = figure.colorbar(ScalarMappable(norm, colours), ax=panels, shrink=0.8, aspect=22, pad=0.01,
                          extend="max" if np.nanmax(every) > most else "neither")
    bar.set_label(label)
    bar.outline.set_visible(False)
    if look.curve:
        draw_curve(figure.add_subplot(grid[rows, :]), folder, look, times[chosen])
    figure.savefig(out)
    image = Image.open(out).convert("RGB")
    image.save(out, optimize=True)
    if Path(out).stat().st_size > LARGEST:
        image.quantize(256).save(out, optimize=True)
    print(f"{out}: {Path(out).stat().st_size / 1e3:.0f} kB, frames at {', '.join(f'{times[i]:g}' for i in chosen)} s")


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("results", type=Path, help="folder of results")
    p.add_argument("--out", required=True, help="the picture, .png")
    p.add_argument("--look", choices=sorted(LOOKS), help="as one of our models is drawn; other options change it")
    p.add_argument("--times", type=float, nargs="+", help="frames nearest to these times (default: the last)")
    p.add_argument("--view", type=float, nargs=2, metavar=("ELEVATION", "AZIMUTH"), help="degrees")
    p.add_argument("--up", choices=("y", "z"), help="axis that points up")
    p.add_argument("--colour", choices=sorted(UNITS), help="what the colours mean")
    p.add_argument("--most", type=float, help="end of the colour scale")
    p.add_argument("--mesh", type=float, help="width of mesh lines in points; 0: none")
    p.add_argument("--curve", nargs="+", help="columns of quantities.csv to draw, also NAME.norm")
    p.add_argument("--against", help="column to draw them against (default: time)")
    a = p.parse_args()
    given = {k: tuple(v) if isinstance(v, list) else v for k, v in vars(a).items()
             if v is not None and k not in ("results", "out", "look")}
    draw(a.results, a.out, replace(LOOKS.get(a.look, Look()), **given))


if __name__ == "__main__":
    main()
