#!/usr/bin/env python3
"""Each solid element and formulation against the truth: the table of docs/guide/elements.md.

    PYTHONPATH=build/release/python bench/dynamics/element_table.py [--only ELEMENT]

Meshes are grids, made here, the same for all elements (quadratic ones have as many elements, six tetrahedra stand for a
hexahedron). Numbers are displacements over the true ones: 1 is right, below it an element is too stiff. Truths: sigma L / E
(patch: tension of a bar whose inner nodes are displaced by a fifth of an element); Timoshenko's beam (bending, the same with
trapezoids, with a Poisson ratio of 0.4999, there times 0.975 for the clamp, by refinement); pi P R^3 / (4 E I) (thin: a quarter of a circle, R / t = 100); MacNeal and Harder's
twisted beam, 5.424e-3 and 1.754e-3 (Finite Elem. Anal. Des. 1, 1985). Compressed: the stretch at which a
block of Saint Venant's material, of elements that are four times as wide as long, under pressure on both ends, leaves the
homogeneous solution; it is looked at down to 0.7.
"""
import argparse
import itertools
import pathlib
import sys
import tempfile

import espalier as esp
import numpy as np

ELEMENTS = {
    "hex8 enhanced": ("hex8", {"hex8": "enhanced"}),
    "hex8 shell": ("hex8", {"hex8": "shell"}),
    "hex8 mean-dilatation": ("hex8", {"hex8": "mean-dilatation"}),
    "hex8 full": ("hex8", {"hex8": "full"}),
    "hex20 reduced": ("hex20", {"reduced_hex20": True}),
    "hex20 full": ("hex20", {}),
    "tet10": ("tet10", {}),
    "tet4": ("tet4", {}),
}
ABAQUS = {"hex8": "C3D8", "hex20": "C3D20", "tet4": "C3D4", "tet10": "C3D10"}
CORNERS = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
TET_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]


def shapes_of(kind):
    """Of one cell of a grid: its elements, each a list of places in half cells."""
    corners = [np.array(c) for c in CORNERS]
    if kind.startswith("hex"):
        middles = [(corners[a] + corners[b]) // 2 for a, b in EDGES] if kind == "hex20" else []
        return [corners + middles]
    tets = []
    for order in itertools.permutations(range(3)):  # Kuhn's six
        points = [np.zeros(3, int)]
        for axis in order:
            points.append(points[-1] + 2 * np.eye(3, dtype=int)[axis])
        if np.linalg.det(np.array(points[1:]) - points[0]) < 0:
            points[1], points[2] = points[2], points[1]
        tets.append(points + ([(points[a] + points[b]) // 2 for a, b in TET_EDGES] if kind == "tet10" else []))
    return tets


def write_mesh(path, kind, divisions, place):
    """place(u, v, w) of grid coordinates in [0, 1]; face sets x0 and x1."""
    labels, lines, elements = {}, [], []

    def label(point):
        key = tuple(int(x) for x in point)
        if key not in labels:
            labels[key] = len(labels) + 1
            x = place(*(k / (2 * n) for k, n in zip(key, divisions)))
            lines.append(f"{labels[key]}, " + ", ".join(f"{c:.15g}" for c in x))
        return labels[key]

    for cell in itertools.product(*(range(n) for n in divisions)):
        for shape in shapes_of(kind):
            elements.append([label(2 * np.array(cell) + p) for p in shape])
    text = ["*NODE", *lines, f"*ELEMENT, TYPE={ABAQUS[kind]}, ELSET=ALL"]
    text += [f"{k + 1}, " + ", ".join(map(str, e[:10])) + ("" if len(e) <= 10 else ",\n" + ", ".join(map(str, e[10:])))
             for k, e in enumerate(elements)]
    for name, at in (("x0", 0), ("x1", 2 * divisions[0])):
        text += [f"*NSET, NSET={name}", *(f"{n}" for key, n in labels.items() if key[0] == at)]
    path.write_text("\n".join(text) + "\n")
    return labels


def solid(kind, options, divisions, place, material, folder, attach="rigid"):
    path = pathlib.Path(folder) / "mesh.inp"
    write_mesh(path, kind, divisions, place)
    model = esp.Model(statics={})
    model.body("bar", "solid", mesh={"file": str(path)}, material=material, **options)
    centre = place(0, 0.5, 0.5)
    model.joint("hold", "fixed", a={"body": "ground", "point": list(map(float, centre))}, b={"body": "bar", "face": "x0"}, attach=attach)
    model.marker("tip", body="bar", face="x1", attach=attach)
    return model


def moved(model, force):
    model.force("load", "load", a="tip", force=list(force))
    return displacement(model)


def displacement(model):
    result = model.run(quantities=["tip.position"])
    x = result["tip.position"]
    return x[-1] - x[0]


def box(lx, ly, lz, distort=None):
    def place(u, v, w):
        if distort is not None:
            u = distort(u, v, w)
        return np.array([lx * u, ly * v, lz * w])
    return place


def patch(kind, options, folder):
    rng = np.random.default_rng(1)
    inner = {}

    def place(u, v, w):
        key = (round(4 * 2 * u), round(2 * 2 * v), round(2 * 2 * w))
        x = np.array([4 * u, 2 * v, 2 * w])
        corner = all(k % 2 == 0 for k in key)
        if corner and 0 < u < 1 and 0 < v < 1 and 0 < w < 1:
            inner.setdefault(key, 0.2 * (2 * rng.random(3) - 1))
            return x + inner[key]
        if corner:
            return x
        # Middles of straight edges: between the corners beside them.
        low = [(k - (k % 2)) for k in key]
        ends = [np.array(low), np.array([l + 2 * (k % 2) for l, k in zip(low, key)])]
        return 0.5 * sum(place(e[0] / 8, e[1] / 4, e[2] / 4) for e in ends)

    model = solid(kind, options, (4, 2, 2), place, {"young": 1.0, "poisson": 0.3, "density": 1}, folder, "mean")
    model.force("pull", "pressure", body="bar", face="x1", pressure=-1e-6)
    model.force("push", "pressure", body="bar", face="x0", pressure=-1e-6)
    return displacement(model)[0] / 4e-6


def bending(kind, options, folder, poisson=0.3, skew=0.0, divisions=(10, 1, 1)):
    def distort(u, v, w):
        cell = u * divisions[0]
        return u + (skew / divisions[0]) * (w - 0.5) * (-1) ** round(cell) * (0 < u < 1) * (abs(cell - round(cell)) < 1e-9)
    length, side, force = 10.0, 1.0, 1e-7
    model = solid(kind, options, divisions, box(length, side, side, distort if skew else None),
                  {"young": 1.0, "poisson": poisson, "density": 1}, folder)
    stiff = side ** 4 / 12
    k, shear = 10 * (1 + poisson) / (12 + 11 * poisson), 0.5 / (1 + poisson)
    return moved(model, (0, 0, force))[2] / (force * (length ** 3 / (3 * stiff) + length / (k * shear * side ** 2)))


def thin(kind, options, folder):
    radius, t, width, force = 1.0, 0.01, 0.05, 1e-12

    def place(u, v, w):
        r = radius + t * (w - 0.5)
        return np.array([r * np.cos(0.5 * np.pi * (1 - u)), width * v, r * np.sin(0.5 * np.pi * (1 - u))])
    model = solid(kind, options, (12, 1, 1), place, {"young": 1.0, "poisson": 0.0, "density": 1}, folder)
    inertia = width * t ** 3 / 12
    return moved(model, (force, 0, 0))[0] / (np.pi * force * radius ** 3 / (4 * inertia))


def twisted(kind, options, folder, axis):
    def place(u, v, w):
        angle = 0.5 * np.pi * u
        y, z = 1.1 * (v - 0.5), 0.32 * (w - 0.5)
        return np.array([12 * u, y * np.cos(angle) - z * np.sin(angle), y * np.sin(angle) + z * np.cos(angle)])
    model = solid(kind, options, (12, 2, 1), place, {"young": 29e6, "poisson": 0.22, "density": 1}, folder)
    force = np.zeros(3)
    force[axis] = 1e-3
    return moved(model, force)[axis] / (1e-3 * {2: 5.424e-3, 1: 1.754e-3}[axis])


def pressure_at(stretch, young=1.0, poisson=0.3):
    """On the deformed ends of a bar of Saint Venant's material: S = E (stretch^2 - 1) / 2 along it, 0 across."""
    strain = 0.5 * (stretch ** 2 - 1)
    return -young * strain * stretch / (1 - 2 * poisson * strain)


def compressed(kind, options, folder):
    """The stretch at which a block of flat elements, four times as wide as long, leaves the homogeneous solution; 0.7 is the end."""
    rng = np.random.default_rng(2)
    moved_by = {}

    def uneven(u, v, w):  # by a ten-thousandth of an element
        inner = all(0 < x < 1 for x in (u, v, w))
        return np.array([u, v, w]) + (moved_by.setdefault((u, v, w), 1e-5 * (rng.random(3) - 0.5)) if inner else 0)
    model = solid(kind, options, (8, 2, 2), uneven, {"young": 1.0, "poisson": 0.3, "density": 1}, folder, "mean")
    last, reached = pressure_at(0.7), None
    for face in ("x0", "x1"):
        model.force("push_" + face, "pressure", body="bar", face=face, pressure=last)
    loads = []
    try:
        result = model.run(set={"statics.largest_step": 0.05, "statics.path": "load-steps"}, observer=lambda step: loads.append(step.t))
        critical = result.summary["critical"]
        reached = critical[0]["load"] if critical else 1.0
    except esp.Error:
        reached = loads[-1] if loads else 0.0
    low, high = 0.7, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if pressure_at(middle) > reached * last else (low, middle)
    return low


COLUMNS = {
    "patch": patch,
    "bending": bending,
    "bending, trapezoids": lambda k, o, f: bending(k, o, f, skew=0.5),
    "incompressible": lambda k, o, f: bending(k, o, f, poisson=0.4999, divisions=(10, 2, 2)) / 0.975,
    "thin": thin,
    "twisted": lambda k, o, f: twisted(k, o, f, 2),
    "twisted, flat": lambda k, o, f: twisted(k, o, f, 1),
    "compressed to": compressed,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    print("| element | " + " | ".join(COLUMNS) + " |")
    print("|---" * (1 + len(COLUMNS)) + "|")
    for name, (kind, options) in ELEMENTS.items():
        if arguments.only not in name:
            continue
        cells = []
        for measure in COLUMNS.values():
            with tempfile.TemporaryDirectory() as folder:
                try:
                    cells.append(f"{measure(kind, options, folder):.2f}")
                except esp.Error as error:
                    cells.append(f"fails: {str(error)[:60]}")
        print(f"| `{name}` | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
