#!/usr/bin/env python3
"""Masses, volumes and centres of mesh files beside a second reader: meshio and pyNastran (PyPI).

  pip install meshio pyNastran
  bench/dynamics/meshes_beside_readers.py FOLDER [--program build/release/espalier]

For every mesh of the folder that one of the two reads: the volume and the centre of its solids, by integration of their own shape functions
(125 points, exact for what is read), beside `espalier mesh FILE --json`; and density times volume of each section with a density: of .inp
files by meshio's element sets, of Nastran's by pyNastran's properties and materials. What neither reads is listed.
"""
import argparse
import gzip
import itertools
import json
import math
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
GAUSS = ((-math.sqrt(0.6), 5 / 9), (0.0, 8 / 9), (math.sqrt(0.6), 5 / 9))
HEX = np.array([(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], float)
EDGES = {"hex": ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
         "tet": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
         "wedge": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))}



def polynomial(kind):
    """Exponents of the monomials that a kind's shape functions are made of, and its nodes."""
    tet = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
    wedge = np.array([(0, 0, -1), (1, 0, -1), (0, 1, -1), (0, 0, 1), (1, 0, 1), (0, 1, 1)], float)
    corners = {"tetra": tet, "hexahedron": HEX, "wedge": wedge}[kind.rstrip("0123456789")]
    family = {"tetra": "tet", "hexahedron": "hex", "wedge": "wedge"}[kind.rstrip("0123456789")]
    middle = np.array([(corners[a] + corners[b]) / 2 for a, b in EDGES[family]])
    second = kind[-1].isdigit()
    nodes = np.vstack([corners, middle]) if second else corners
    powers = list(itertools.product(range(3), repeat=3))
    if family == "tet":
        powers = [p for p in powers if sum(p) <= (2 if second else 1)]
    elif family == "hex":  # serendipity: superlinear degree 2
        powers = [p for p in powers if sum(k for k in p if k > 1) <= 2] if second else [p for p in powers if max(p) <= 1]
    else:
        powers = [p for p in powers if (p[0] + p[1] <= 2 and p[2] <= 2 and (p[0] + p[1] < 2 or p[2] < 2)) and
                  (p[2] < 2 or p[0] + p[1] <= 1)] if second else [p for p in powers if p[0] + p[1] <= 1 and p[2] <= 1]
    return powers, nodes


def rule(kind):
    """Points and weights: Gauss of degree 5 in each direction, drawn together for simplices."""
    out = []
    for (a, wa), (b, wb), (c, wc) in itertools.product(gauss(5), repeat=3):
        if kind.startswith("hexa"):
            out.append(((a, b, c), wa * wb * wc))
        elif kind.startswith("wedge"):
            x, y = (1 + a) / 2 * (1 - b) / 2, (1 + b) / 2
            out.append(((x, y, c), wa * wb * wc * (1 - b) / 8))
        else:
            z = (1 + c) / 2
            y = (1 + b) / 2 * (1 - z)
            x = (1 + a) / 2 * (1 - y - z)
            out.append(((x, y, z), wa * wb * wc / 8 * (1 - z) * (1 - y - z)))
    return out


def gauss(n):
    return list(zip(*np.polynomial.legendre.leggauss(n)))


_tables = {}


def table(kind):
    """Values and gradients of the shape functions at the points of the rule, and the weights."""
    if kind not in _tables:
        powers, nodes = polynomial(kind)
        vandermonde = np.array([[np.prod(node ** np.array(p)) for p in powers] for node in nodes])
        assert vandermonde.shape[0] == vandermonde.shape[1], (kind, vandermonde.shape)
        factors = np.linalg.inv(vandermonde)
        values, gradients, weights = [], [], []
        for at, weight in rule(kind):
            at = np.array(at)
            values.append([np.prod(at ** np.array(p)) for p in powers] @ factors)
            rows = []
            for d in range(3):
                row = []
                for p in powers:
                    q = list(p)
                    q[d] = max(0, q[d] - 1)
                    row.append(p[d] * np.prod(at ** np.array(q)))
                rows.append(np.array(row) @ factors)
            gradients.append(rows)
            weights.append(weight)
        _tables[kind] = np.array(values), np.array(gradients), np.array(weights)
    return _tables[kind]


def measures(points, cells):
    """Volume and first moment of solids: [(kind, connectivity)]."""
    volume, moment = 0.0, np.zeros(3)
    for kind, connectivity in cells:
        values, gradients, weights = table(kind)
        for block in np.array_split(connectivity, max(1, len(connectivity) // 5000)):
            x = points[block]  # e a d
            origin = x[:, :1, :].copy()
            jacobian = np.einsum("gka,ead->egkd", gradients, x - origin)
            det = np.linalg.det(jacobian)
            det = det * np.sign(np.sum(det * weights, axis=1))[:, None]  # left-handed elements are legal in some programs
            places = np.einsum("ga,ead->egd", values, x - origin)
            one = det @ weights
            volume += math.fsum(one)
            moment += np.array([math.fsum(m) for m in (np.einsum("eg,g,egd->ed", det, weights, places) + one[:, None] * origin[:, 0, :]).T])
    return volume, moment


def of_meshio(path):
    import meshio
    mesh = meshio.read(path)
    names = ("tetra", "tetra10", "hexahedron", "hexahedron20", "wedge", "wedge15")
    return np.asarray(mesh.points, float), [(c.type, c.data) for c in mesh.cells if c.type in names], [
        c.type for c in mesh.cells if c.type in ("pyramid", "hexahedron27", "wedge18", "pyramid13")]


def of_pynastran(path, number=None):
    """@param number  of the property; None: all"""
    from pyNastran.bdf.bdf import BDF
    model = BDF(debug=False)
    model.read_bdf(str(path), xref=False, punch=False, validate=False)
    model.cross_reference(xref_elements=False, xref_properties=False, xref_masses=False, xref_materials=False, xref_loads=False,
                          xref_constraints=False, xref_aero=False, xref_sets=False, xref_optimization=False)
    index = {label: k for k, label in enumerate(model.nodes)}
    points = np.array([node.get_position() for node in model.nodes.values()])
    kinds = {"CTETRA": ("tetra", 4), "CHEXA": ("hexahedron", 8), "CPENTA": ("wedge", 6)}
    cells, others = {}, []
    for e in model.elements.values():
        if e.type not in kinds or number not in (None, e.pid):
            others += [e.type] if e.type == "CPYRAM" else []
            continue
        name, corners = kinds[e.type]
        nodes = [n for n in e.node_ids if n is not None]
        if len(nodes) > corners:
            name += {4: "10", 8: "20", 6: "15"}[corners]
            if e.type == "CHEXA":  # upright edges before those of the top
                nodes = nodes[:12] + nodes[16:20] + nodes[12:16]
            if e.type == "CPENTA":
                nodes = nodes[:9] + nodes[12:15] + nodes[9:12]
        cells.setdefault(name, []).append([index[n] for n in nodes])
    return points, [(k, np.array(v)) for k, v in cells.items()], others


def blocks_of(path):
    """Keyword lines of an .inp file without blanks, in upper case, with the data lines behind them."""
    out = []
    for line in path.read_text(errors="replace").splitlines():
        line = line.replace(" ", "").replace("\t", "")
        if line.startswith("**") or not line:
            continue
        if line.startswith("*"):
            out.append((line.upper(), []))
        elif out:
            out[-1][1].append(line)
    return out


def parameter(keyword, name):
    return next((w.split("=", 1)[1] for w in keyword.split(",") if w.startswith(name + "=")), "")


def densities_of_inp(path):
    """Element set -> density, as *SOLID SECTION and *DENSITY say."""
    density, sections, material = {}, {}, ""
    for keyword, data in blocks_of(path):
        if keyword.startswith("*MATERIAL"):
            material = parameter(keyword, "NAME")
        elif keyword.startswith("*DENSITY"):
            density[material] = float(data[0].split(",")[0])
        elif keyword.startswith("*SOLIDSECTION"):
            sections[parameter(keyword, "ELSET")] = parameter(keyword, "MATERIAL")
    return {name: density.get(m, 0.0) for name, m in sections.items()}


def masses_by_meshio(path):
    """Element set -> mass of its solids: the sets as meshio has them."""
    import meshio
    mesh = meshio.read(path)
    sets = {name.upper(): members for name, members in mesh.cell_sets.items()}
    masses = {}
    for name, density in densities_of_inp(path).items():
        if density == 0 or name not in sets:
            continue
        cells = [(c.type, c.data[np.asarray(which, int)]) for c, which in zip(mesh.cells, sets[name])
                 if c.type.startswith(("tetra", "hexa", "wedge")) and len(which)]
        masses[name] = density * measures(np.asarray(mesh.points, float), cells)[0]
    return masses


def masses_by_pynastran(path):
    """property-N -> mass, by pyNastran's own densities."""
    from pyNastran.bdf.bdf import BDF
    model = BDF(debug=False)
    model.read_bdf(str(path), xref=False, punch=False, validate=False)
    masses = {}
    for number, solid in model.properties.items():
        material = model.materials.get(solid.mid) if solid.type == "PSOLID" else None
        if material is None or material.type != "MAT1" or not material.rho:
            continue
        points, cells, _ = of_pynastran(path, number)
        masses[f"PROPERTY-{number}"] = material.rho * measures(points, cells)[0]
    return masses


def compare_masses(ours, plain):
    """@return how far the masses of the sections are off, and how many were compared"""
    theirs = masses_by_pynastran(plain) if plain.suffix in (".bdf", ".dat", ".nas") else masses_by_meshio(plain) if plain.suffix == ".inp" else {}
    found = {name.upper(): mass for name, mass in ours.get("masses", {}).items() if mass}
    compared = {name: abs(found[name] / mass - 1) for name, mass in theirs.items() if mass and name in found}
    for name in set(found) ^ {name for name, mass in theirs.items() if mass}:
        print(f"    mass of {name}: {found.get(name)} here, {theirs.get(name)} there")
    return max(compared.values(), default=0.0), len(compared)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--program", default=str(ROOT / "build/release/espalier"))
    args = parser.parse_args()
    worst = 0.0
    sections = 0
    for path in sorted(args.folder.iterdir()):
        run = subprocess.run([args.program, "mesh", str(path), "--json"], capture_output=True, text=True)
        if run.returncode != 0:
            print(f"{path.name:40} not read by espalier: {run.stderr.strip()[:120]}")
            continue
        ours = json.loads(run.stdout)
        with tempfile.TemporaryDirectory() as scratch:
            plain = pathlib.Path(scratch) / path.name.removesuffix(".gz")
            plain.write_bytes(gzip.open(path).read() if path.name.endswith(".gz") else path.read_bytes())
            try:
                points, cells, others = of_pynastran(plain) if plain.suffix in (".bdf", ".dat", ".nas") else of_meshio(plain)
            except BaseException as error:  # whatever the other reader does not like, SystemExit too
                print(f"{path.name:40} not read by the other: {type(error).__name__}: {str(error).strip()[:90]!r}")
                continue
            mass_off, count = compare_masses(ours, plain)
            sections += count
            worst = max(worst, mass_off)
        if others:
            print(f"{path.name:40} has kinds that the other's integration leaves out: {sorted(set(others))}")
            continue
        volume, moment = measures(points, cells)
        if volume == 0:
            print(f"{path.name:40} no solids ({ours['solids']['count']} by espalier)")
            continue
        size = max(abs(a - b) for a, b in zip(ours["extents"]["most"], ours["extents"]["least"]))
        off = max(abs(ours["solids"]["volume"] / volume - 1), max(abs(a - b) for a, b in zip(ours["solids"]["centre"], moment / volume)) / size)
        single = off > 1e-12 and np.array_equal(points, points.astype(np.float32))
        worst = max(worst, 0 if single else off)
        weighed = f", masses of {count} sections by {mass_off:.1e}" if count else ""
        print(f"{path.name:40} volume {volume:.15g}, off by {off:.1e}{weighed}{' (meshio keeps its points in single precision)' if single else ''}", flush=True)
    print(f"worst {worst:.1e}; masses of {sections} sections were compared")


if __name__ == "__main__":
    sys.exit(main())
