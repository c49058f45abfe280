"""Beams and bars of mesh files, held against closed forms and a dense frame of our own."""

import math

import numpy as np
import pytest

import espalier

YOUNG, POISSON, DENSITY = 210e9, 0.3, 7850.0
SHEAR = YOUNG / 2 / (1 + POISSON)
MATERIAL = {"young": YOUNG, "poisson": POISSON, "density": DENSITY}


# The oracle: Timoshenko's beam, exact for forces at nodes (Przemieniecki 1968, chapter 5), masses consistent (without shear).


def element_matrices(a, b, y, section):
    area, iy, iz, j, ky, kz = section
    length = np.linalg.norm(b - a)
    x = (b - a) / length
    y = y - y @ x * x
    y = y / np.linalg.norm(y)
    turn = np.kron(np.eye(4), np.array([x, y, np.cross(x, y)]))
    k, m = np.zeros((12, 12)), np.zeros((12, 12))
    for (p, q), stiff, mass in (((0, 6), YOUNG * area, area), ((3, 9), SHEAR * j, iy + iz)):
        k[np.ix_([p, q], [p, q])] += stiff / length * np.array([[1, -1], [-1, 1]])
        m[np.ix_([p, q], [p, q])] += DENSITY * mass * length / 6 * np.array([[2, 1], [1, 2]])
    for own, bending, sheared, sign in (((1, 5, 7, 11), YOUNG * iz, ky, 1), ((2, 4, 8, 10), YOUNG * iy, kz, -1)):
        phi = 12 * bending / (sheared * SHEAR * area * length**2) if sheared > 0 else 0
        l, s = length, sign
        k[np.ix_(own, own)] += bending / (1 + phi) / l**3 * np.array(
            [[12, 6 * s * l, -12, 6 * s * l], [6 * s * l, (4 + phi) * l * l, -6 * s * l, (2 - phi) * l * l],
             [-12, -6 * s * l, 12, -6 * s * l], [6 * s * l, (2 - phi) * l * l, -6 * s * l, (4 + phi) * l * l]])
        m[np.ix_(own, own)] += DENSITY * area * l / 420 * np.array(
            [[156, 22 * s * l, 54, -13 * s * l], [22 * s * l, 4 * l * l, 13 * s * l, -3 * l * l],
             [54, 13 * s * l, 156, -22 * s * l], [-13 * s * l, -3 * l * l, -22 * s * l, 4 * l * l]])
    return turn.T @ k @ turn, turn.T @ m @ turn


def frame(nodes, elements, section, y, pieces=1):
    """K, M and the number of the first unknown of each node; elements are divided."""
    places, first, lines = [], {}, []
    for label, place in nodes.items():
        first[label] = 6 * len(places)
        places.append(np.array(place, float))
    for k, (a, b) in enumerate(elements):
        before = first[a] // 6
        for i in range(1, pieces + 1):
            if i == pieces:
                after = first[b] // 6
            else:
                places.append(places[first[a] // 6] * (1 - i / pieces) + places[first[b] // 6] * (i / pieces))
                after = len(places) - 1
            lines.append((before, after, k))
            before = after
    stiffness, mass = np.zeros((6 * len(places),) * 2), np.zeros((6 * len(places),) * 2)
    for a, b, k in lines:
        ke, me = element_matrices(places[a], places[b], np.array(y[k] if isinstance(y[0], (list, tuple)) else y, float), section)
        own = np.r_[6 * a:6 * a + 6, 6 * b:6 * b + 6]
        stiffness[np.ix_(own, own)] += ke
        mass[np.ix_(own, own)] += me
    return stiffness, mass, first


def solved(stiffness, first, held, loads):
    free = np.setdiff1d(np.arange(len(stiffness)), [first[n] + i for n in held for i in range(6)])
    f = np.zeros(len(stiffness))
    for n, force in loads.items():
        f[first[n]:first[n] + len(force)] += force
    u = np.zeros(len(f))
    u[free] = np.linalg.solve(stiffness[np.ix_(free, free)], f[free])
    return u


H, W = 0.03, 0.02  # along y, along z
COWPER = 10 * (1 + POISSON) / (12 + 11 * POISSON)


def rectangle_torsion(a, b):
    a, b = max(a, b), min(a, b)
    return a * b**3 * (1 / 3 - 64 / math.pi**5 * b / a * sum(math.tanh(n * math.pi * a / (2 * b)) / n**5 for n in range(1, 99, 2)))


RECTANGLE = (H * W, H * W**3 / 12, W * H**3 / 12, rectangle_torsion(H, W), COWPER, COWPER)


def inp(path, nodes, elements, section="*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION=RECT\n0.03,0.02\n0,1,0\n", kind="B31", sets=None, more=""):
    text = "*NODE\n" + "".join(f"{k},{x!r},{y!r},{z!r}\n" for k, (x, y, z) in nodes.items()) + f"*ELEMENT,TYPE={kind},ELSET=ALL\n"
    text += "".join(f"{e + 1}," + ",".join(map(str, own)) + "\n" for e, own in enumerate(elements))
    for name, members in (sets or {}).items():
        text += f"*NSET,NSET={name}\n" + ",".join(map(str, members)) + "\n"
    text += f"*MATERIAL,NAME=STEEL\n*ELASTIC\n{YOUNG},{POISSON}\n*DENSITY\n{DENSITY}\n{section}{more}"
    path.write_text(text)
    return str(path)


def model_of(path, held, loads, tips, kind="beam", statics=None, **keys):
    body = {"type": kind, "mesh": {"file": path}, **keys}
    supports = {f"s{n}": {"body": "f", "node": n, "hold": "all" if kind == "beam" else "xyz"} for n in held}
    forces = {f"f{n}": {"type": "load", "a": {"body": "f", "node": n}, "force": list(f[:3]), **({"moment": list(f[3:])} if len(f) > 3 else {})}
              for n, f in loads.items()}
    return {"bodies": {"f": body}, "supports": supports, "forces": forces, "markers": {f"m{n}": {"body": "f", "node": n} for n in tips},
            "statics": {"linear": True} if statics is None else statics, "output": {"quantities": [f"m{n}.position.{a}" for n in tips for a in "xyz"]}}


def displacements(model, nodes, tips):
    values = espalier.Model(model).run().summary["values"]
    return np.array([[values[f"m{n}.position.{a}"] - x for a, x in zip("xyz", nodes[n])] for n in tips])


def elbow(pieces=4):
    """Along x, then along y: labels 1 to pieces + 1 and on, with the tip last."""
    places = [(i / pieces, 0, 0) for i in range(pieces + 1)] + [(1, 0.6 * i / pieces, 0) for i in range(1, pieces + 1)]
    nodes = {10 * k + 10: p for k, p in enumerate(places)}
    labels = list(nodes)
    return nodes, list(zip(labels, labels[1:]))


PORTAL = ({1: (0, 0, 0), 2: (0, 0, 2), 3: (3, 0, 2), 4: (3, 0, 0), 5: (1.5, 0, 2), 6: (1.5, 1, 2)}, [(1, 2), (2, 5), (5, 3), (4, 3), (5, 6)])


def check(path, nodes, elements, section, towards, held, loads, rel=1e-6, **keys):
    stiffness, _, first = frame(nodes, elements, section, towards)
    u = solved(stiffness, first, held, loads)
    tips = [n for n in nodes if n not in held]
    found = displacements(model_of(path, held, loads, tips, **keys), nodes, tips)
    truth = np.array([u[first[n]:first[n] + 3] for n in tips])
    assert found == pytest.approx(truth, rel=rel, abs=rel * np.abs(truth).max())


# Held at one end, loaded at the other in all directions: the dense frame has the same beams.
def test_an_elbow_of_a_deck(tmp_path):
    nodes, elements = elbow()
    y = [[0, 0, 1]] * 8
    path = inp(tmp_path / "f.inp", nodes, elements, "*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION=RECT\n0.03,0.02\n0,0,1\n")
    check(path, nodes, elements, RECTANGLE, y, [10], {90: [100, -70, 40, 3, -2, 5]})


def test_a_portal_with_a_branch(tmp_path):
    """Three elements at one node, elements that point to each other, and out of the plane."""
    nodes, elements = PORTAL
    y = [[0, 1, 0]] * 4 + [[0, 0, 1]]
    text = "*ELSET,ELSET=REST\n5,\n*ELSET,ELSET=PLANE\n1,2,3,4\n" + "".join(
        f"*BEAM SECTION,ELSET={s},MATERIAL=STEEL,SECTION=RECT\n0.03,0.02\n{d}\n" for s, d in (("PLANE", "0,1,0"), ("REST", "0,0,1")))
    path = inp(tmp_path / "f.inp", nodes, elements, text)
    check(path, nodes, elements, RECTANGLE, y, [1, 4], {2: [100, 0, 0], 6: [0, 20, -30, 1, 2, 3]})


def test_the_portal_of_the_books(tmp_path):
    """Kleinlogel: clamped columns h, I and a beam l, I_b under a force F at its height: M at the foot = F h / 2 (3 k + 1) / (6 k + 1), k = I_b h / (I l)."""
    h, l = 2.0, 3.0
    nodes = {1: (0, 0, 0), 2: (0, 0, h), 3: (l, 0, h), 4: (l, 0, 0)}
    stiff = "*BEAM GENERAL SECTION,ELSET=ALL,SECTION=GENERAL,DENSITY=7850\n1.,1e-6,0.,1e-6,1e-6\n0,1,0\n210e9,81e9\n"  # area: no stretch
    path = inp(tmp_path / "f.inp", nodes, [(1, 2), (2, 3), (3, 4)], stiff)
    model = model_of(path, [1, 4], {2: [1000, 0, 0]}, [2])
    model["output"]["quantities"] += ["s1.moment.y", "s4.moment.y", "s1.force.x"]
    values = espalier.Model(model).run().summary["values"]
    k = h / l
    foot = 1000 * h / 2 * (3 * k + 1) / (6 * k + 1)
    assert abs(values["s1.moment.y"]) == pytest.approx(foot, rel=1e-3) and abs(values["s4.moment.y"]) == pytest.approx(foot, rel=1e-3)
    assert values["s1.force.x"] == pytest.approx(-500, rel=1e-3)


def test_modes_of_an_elbow(tmp_path):
    """Slender, since the masses of the dense frame have no rotary inertia."""
    nodes, elements = elbow(8)
    h, w = H / 10, W / 10
    thin = (h * w, h * w**3 / 12, w * h**3 / 12, rectangle_torsion(h, w), COWPER, COWPER)
    stiffness, mass, first = frame(nodes, elements, thin, [0, 0, 1], 2)
    free = np.arange(6, len(stiffness))
    values = np.linalg.eigvals(np.linalg.solve(mass[np.ix_(free, free)], stiffness[np.ix_(free, free)])).real
    truth = np.sort(np.sqrt(np.sort(values)[:6])) / (2 * math.pi)
    path = inp(tmp_path / "f.inp", nodes, elements, "*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION=RECT\n0.003,0.002\n0,0,1\n")
    model = model_of(path, [10], {}, [])
    del model["statics"]
    assert espalier.Model(model).modes(6)["frequency"] == pytest.approx(truth, rel=5e-3)


def shapes():
    a, b, t = 0.06, 0.04, 0.002  # Abaqus: along the first direction (y of ours), along the second
    inner_a, inner_b = a - 2 * t, b - 2 * t
    box = (a * b - inner_a * inner_b, (a * b**3 - inner_a * inner_b**3) / 12, (b * a**3 - inner_b * inner_a**3) / 12,
           4 * ((a - t) * (b - t)) ** 2 / (2 * (a - t) / t + 2 * (b - t) / t))
    yield "BOX", "0.06,0.04,0.002,0.002,0.002,0.002", box
    r, w = 0.02, 0.003
    area, i = math.pi * (r * r - (r - w) ** 2), math.pi / 4 * (r**4 - (r - w) ** 4)
    yield "PIPE", "0.02,0.003", (area, i, i, 2 * i)
    area, i = math.pi * 0.01**2, math.pi / 4 * 0.01**4
    yield "CIRC", "0.01", (area, i, i, 2 * i)
    yield "CIRC", "0.02,0.02", (area, i, i, 2 * i)
    yield "RECT", "0.03,0.02", RECTANGLE[:4]
    h, f, tf, tw = 0.1, 0.05, 0.006, 0.004  # height along the second direction
    strong = (f * h**3 - (f - tw) * (h - 2 * tf) ** 3) / 12
    weak = (2 * tf * f**3 + (h - 2 * tf) * tw**3) / 12
    yield "I", "0.05,0.1,0.05,0.05,0.006,0.006,0.004", (2 * f * tf + (h - 2 * tf) * tw, strong, weak, (2 * f * tf**3 + (h - tf) * tw**3) / 3)


@pytest.mark.parametrize("shape, data, section", list(shapes()))
def test_sections_of_a_deck(tmp_path, shape, data, section):
    """A long cantilever along x, first direction y: w = F L^3 / (3 E I) both ways (shear: below a thousandth), turn M L / (G J), stretch."""
    area, about_first, about_second, j = section
    nodes = {k + 1: (10.0 * k / 4, 0, 0) for k in range(5)}
    path = inp(tmp_path / "f.inp", nodes, [(k, k + 1) for k in range(1, 5)], f"*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION={shape}\n{data}\n0,1,0\n")
    model = model_of(path, [1], {5: [1000, 1, 1, 1, 0, 0]}, [5])
    x, y, z = displacements(model, nodes, [5])[0]
    assert x == pytest.approx(1000 * 10 / (YOUNG * area), rel=1e-6)
    assert y == pytest.approx(1000 / (3 * YOUNG * about_second), rel=2e-3)
    assert z == pytest.approx(1000 / (3 * YOUNG * about_first), rel=2e-3)
    model["forces"] = {"t": {"type": "load", "a": {"body": "f", "node": 5}, "moment": [1, 0, 0]}}
    model["output"]["quantities"] = ["f.strain_energy"]
    assert espalier.Model(model).run().summary["values"]["f.strain_energy"] == pytest.approx(0.5 * 10 / (SHEAR * j), rel=1e-6)


def test_elements_of_three_nodes_and_instances_and_includes(tmp_path):
    nodes = {1: (0, 0, 0), 2: (0.25, 0, 0), 3: (0.5, 0, 0), 4: (0.75, 0, 0), 5: (1, 0, 0)}
    (tmp_path / "section.inp").write_text("*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION=RECT\n0.03,0.02\n0,1,0\n")
    path = inp(tmp_path / "f.inp", nodes, [(1, 2, 3), (3, 4, 5)], "*INCLUDE,INPUT=section.inp\n", "B32")
    lines = [(k, k + 1) for k in range(1, 5)]
    check(path, nodes, lines, RECTANGLE, [0, 1, 0], [1], {5: [10, 20, 30]})


def bdf(path, nodes, elements, properties, kind="CBAR", y=(0, 1, 0), more=""):
    text = "BEGIN BULK\n" + "".join(f"GRID,{k},,{float(x)!r},{float(a)!r},{float(b)!r}\n" for k, (x, a, b) in nodes.items())
    towards = "" if kind == "CROD" else "," + ",".join(f"{float(v)!r}" for v in y)
    text += "".join(f"{kind},{e + 1},7,{a},{b}{towards}\n" for e, (a, b) in enumerate(elements))
    path.write_text(text + properties + f"MAT1,3,{YOUNG},,{POISSON},{DENSITY}\n{more}ENDDATA\n")
    return str(path)


@pytest.mark.parametrize("kind, card", [("CBAR", "PBARL,7,3,,BAR\n,0.02,0.03\n"), ("CBEAM", "PBEAML,7,3,,BAR\n,0.02,0.03\n")])
def test_beams_of_nastran(tmp_path, kind, card):
    """DIM1 of a BAR is its width along z, DIM2 its height along y."""
    nodes, elements = elbow()
    check(bdf(tmp_path / "f.bdf", nodes, elements, card, kind, (0, 0, 1)), nodes, elements, RECTANGLE, [0, 0, 1], [10], {90: [100, -70, 40, 3, -2, 5]})


def test_constants_of_nastran(tmp_path):
    """I1 is that of bending in the plane of y; without K1 and K2 there is no shear. Directions by a grid point."""
    nodes, elements = elbow()
    area, iy, iz, j = RECTANGLE[:4]
    for card, kind in ((f"PBAR,7,3,{area:.8g},{iz:.8e},{iy:.8e},{j:.8e}\n", "CBAR"), (f"PBEAM,7,3,{area:.8g},{iz:.8e},{iy:.8e},,{j:.8e}\n", "CBEAM")):
        path = bdf(tmp_path / "f.bdf", nodes, elements, card, kind, (0, 0, 1))
        check(path, nodes, elements, (area, iy, iz, j, 0, 0), [0, 0, 1], [10], {90: [100, -70, 40, 3, -2, 5]}, rel=1e-5)
    text = open(path).read().replace(",0.0,0.0,1.0\n", ",77,,\n").replace("ENDDATA", "GRID,77,,0.3,0.1,50.\nENDDATA")
    open(path, "w").write(text)
    above = [(0.3 - nodes[a][0], 0.1 - nodes[a][1], 50.0) for a, _ in elements]
    check(path, nodes, elements, (area, iy, iz, j, 0, 0), [list(v) for v in above], [10], {90: [100, -70, 40]}, rel=1e-5)


def test_lines_of_other_files(tmp_path):
    """Gmsh, VTK, MEDIT: lines with the section of the text."""
    nodes, elements = elbow()
    number = {label: k for k, label in enumerate(nodes)}
    (tmp_path / "f.msh").write_text(
        f'$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n0 1 "root"\n1 2 "line"\n$EndPhysicalNames\n$Nodes\n{len(nodes)}\n'
        + "".join(f"{k} {x} {y} {z}\n" for k, (x, y, z) in nodes.items()) + f"$EndNodes\n$Elements\n{len(elements) + 1}\n"
        + "".join(f"{e + 1} 1 2 2 2 {a} {b}\n" for e, (a, b) in enumerate(elements)) + "99 15 2 1 1 10\n$EndElements\n")
    (tmp_path / "f.mesh").write_text(
        f"MeshVersionFormatted 1\nDimension 3\nVertices\n{len(nodes)}\n" + "".join(f"{x} {y} {z} 0\n" for x, y, z in nodes.values())
        + f"Edges\n{len(elements)}\n" + "".join(f"{number[a] + 1} {number[b] + 1} 4\n" for a, b in elements) + "End\n")
    (tmp_path / "f.vtk").write_text(
        f"# vtk DataFile Version 2.0\nf\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {len(nodes)} double\n" + "".join(f"{x} {y} {z}\n" for x, y, z in nodes.values())
        + f"CELLS {len(elements)} {3 * len(elements)}\n" + "".join(f"2 {number[a]} {number[b]}\n" for a, b in elements)
        + f"CELL_TYPES {len(elements)}\n" + "3\n" * len(elements))
    section = {"height": H, "width": W, "y": [0, 0, 1], "material": MATERIAL}
    check(str(tmp_path / "f.msh"), nodes, elements, RECTANGLE, [0, 0, 1], [10], {90: [100, -70, 40]}, **section)
    counted = {number[k] + 1: p for k, p in nodes.items()}
    lines = [(number[a] + 1, number[b] + 1) for a, b in elements]
    for name in ("f.mesh", "f.vtk"):
        check(str(tmp_path / name), counted, lines, RECTANGLE, [0, 0, 1], [1], {9: [100, -70, 40]}, **section)


def tower():
    nodes = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0.5, 0.9, 0), 4: (0.4, 0.3, 1.2), 5: (1.3, 0.5, 1.1)}
    return nodes, [(1, 4), (2, 4), (3, 4), (2, 5), (3, 5), (4, 5)]


@pytest.mark.parametrize("format", ["inp", "bdf", "text"])
def test_a_truss(tmp_path, format):
    nodes, bars = tower()
    area, k, index = 2e-4, np.zeros((15, 15)), {n: 3 * i for i, n in enumerate(nodes)}
    for a, b in bars:
        d = np.array(nodes[b]) - np.array(nodes[a])
        length = np.linalg.norm(d)
        own = np.r_[index[a]:index[a] + 3, index[b]:index[b] + 3]
        k[np.ix_(own, own)] += YOUNG * area / length**3 * np.kron([[1, -1], [-1, 1]], np.outer(d, d))
    f = np.zeros(15)
    f[9:15] = [100, -50, -300, 20, 70, -40]
    truth = np.linalg.solve(k[9:, 9:], f[9:]).reshape(2, 3)
    keys = {}
    if format == "bdf":
        path = bdf(tmp_path / "t.bdf", nodes, bars, f"PROD,7,3,{area}\n", "CROD")
    else:
        path = inp(tmp_path / "t.inp", nodes, bars, f"*SOLID SECTION,ELSET=ALL,MATERIAL=STEEL\n{area}\n" if format == "inp" else "", "T3D2")
        if format == "text":
            keys = {"radius": math.sqrt(area / math.pi), "material": MATERIAL}
    model = model_of(path, [1, 2, 3], {4: [100, -50, -300], 5: [20, 70, -40]}, [4, 5], kind="cable", **keys)
    assert displacements(model, nodes, [4, 5]) == pytest.approx(truth, rel=1e-6, abs=1e-6 * np.abs(truth).max())


def test_a_mass_and_sets_and_page(tmp_path):
    """Sets of nodes hold and are loaded, sets of elements have energies and section forces; the page and the pictures are written."""
    nodes, elements = elbow()
    path = inp(tmp_path / "f.inp", nodes, elements, sets={"ROOT": [10], "ARM": [50, 60, 70, 80, 90], "TIP": [90]},
               section="*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION=RECT\n0.03,0.02\n0,0,1\n", more="*ELSET,ELSET=OUTER\n5,6,7,8\n")
    model = {"gravity": [0, 0, -10], "bodies": {"f": {"type": "beam", "mesh": {"file": path}}}, "supports": {"wall": {"body": "f", "nodes": "ROOT", "hold": "all"}},
             "forces": {"wind": {"type": "line-load", "body": "f", "nodes": "ARM", "force": [0, 0, -5]}}, "statics": {"linear": True},
             "output": {"vtu_interval": 0, "quantities": ["wall.force.z", "f[OUTER].strain_energy", "f.strain_energy", "f[OUTER].section.Mz.maxabs",
                                                          "f[ROOT].stress.max"]}}
    values = espalier.Model(model).run(out=str(tmp_path / "out")).summary["values"]
    weight = DENSITY * H * W * 1.6 * 10
    assert values["wall.force.z"] == pytest.approx(weight + 5 * 0.6, rel=1e-9)
    assert 0 < values["f[OUTER].strain_energy"] < values["f.strain_energy"]
    arm = 0.6**2 / 2 * (5 + DENSITY * H * W * 10)
    assert values["f[OUTER].section.Mz.maxabs"] == pytest.approx(arm, rel=0.02)
    assert (tmp_path / "out" / "index.html").stat().st_size > 10000
    assert (tmp_path / "out" / "results.vtkhdf").exists() or list((tmp_path / "out").glob("*.vtu"))


def test_a_frame_turns_far(tmp_path):
    """A straight line of two chains (their sections have other axes) under an end moment: an arc, exact."""
    nodes = {k: (0.1 * (k - 1), 0, 0) for k in range(1, 12)}
    text = "".join(f"*ELSET,ELSET={s},GENERATE\n{a},{b}\n*BEAM SECTION,ELSET={s},MATERIAL=STEEL,SECTION=RECT\n0.02,0.02\n{d}\n"
                   for s, a, b, d in (("A", 1, 4, "0,1,0"), ("B", 5, 10, "0,0,1")))
    path = inp(tmp_path / "f.inp", nodes, [(k, k + 1) for k in range(1, 11)], text)
    moment = YOUNG * 0.02**4 / 12 * math.pi / 2
    u = displacements(model_of(path, [1], {11: [0, 0, 0, 0, 0, moment]}, [11], statics={}), nodes, [11])[0]
    assert u == pytest.approx([2 / math.pi - 1, 2 / math.pi, 0], abs=1e-6)


def test_the_scale_counts_for_sections(tmp_path):
    nodes = {1: (0, 0, 0), 2: (1000, 0, 0)}
    path = inp(tmp_path / "f.inp", nodes, [(1, 2)], "*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION=RECT\n30,20\n0,1,0\n")
    model = model_of(path, [1], {2: [0, 0, -1]}, [2])
    model["bodies"]["f"]["mesh"]["scale"] = 1e-3
    z = displacements(model, {2: (1, 0, 0)}, [2])[0][2]
    assert z == pytest.approx(-1 / (3 * YOUNG * H * W**3 / 12) - 1 / (COWPER * SHEAR * H * W), rel=1e-6)


@pytest.mark.parametrize("section, message", [
    ("", "needs a section"), ("*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION=L\n1,1,1,1\n", "f.inp:.*SECTION=L is not read"),
    ("*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION=CIRC\n0.02,0.03\n", "ellipse"), ("*BEAM SECTION,ELSET=ALL,MATERIAL=NO,SECTION=CIRC\n0.02\n0,1,0\n", "needs 'material'"),
    ("*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION=RECT\n0.02,0.03\n1,0,0\n", "lies along it"),
    ("*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION=RECT,OFFSET1=0.5\n0.02,0.03\n0,1,0\n", "OFFSET1 is not read"),
    ("*SOLID SECTION,ELSET=ALL,MATERIAL=STEEL\n1e-4\n", "bars of a truss"),
    ("*BEAM SECTION,ELSET=ALL,MATERIAL=STEEL,SECTION=BOX\n0.02,0.03,1e-3,1e-3,2e-3,1e-3\n0,1,0\n", "opposite walls differ")])
def test_what_is_not_read_is_said(tmp_path, section, message):
    nodes, elements = elbow()
    path = inp(tmp_path / "f.inp", {k: (x, 0, y) for k, (x, y, _) in nodes.items()}, elements, section)
    with pytest.raises(espalier.Error, match=message):
        espalier.Model(model_of(path, [10], {90: [1, 0, 0]}, [90])).run()


@pytest.mark.parametrize("fields, message", [(",,12", "PA, PB"), (",,,,,0.1", "offset"), (",OGG", "OFFT")])
def test_what_nastran_says_beside_is_not_dropped(tmp_path, fields, message):
    nodes = {1: (0, 0, 0), 2: (1, 0, 0)}
    path = tmp_path / "f.bdf"
    bdf(path, nodes, [(1, 2)], "PBARL,7,3,,ROD\n,0.01\n")
    path.write_text(path.read_text().replace("0.0,1.0,0.0\n", "0.0,1.0,0.0" + (fields if fields.startswith(",O") else ",\n" + fields[1:]) + "\n"))
    with pytest.raises(espalier.Error, match=message):
        espalier.Model(model_of(str(path), [1], {2: [1, 0, 0]}, [2])).run()


def test_places_along_a_beam_of_our_own():
    """A beam between two walls, F in the middle: F L^3 / (192 E I); My at quarter is zero, F L / 8 in the middle."""
    b = {"type": "beam", "start": [0, 0, 0], "end": [2, 0, 0], "y": [0, 1, 0], "elements": 8, "height": 0.02, "width": 0.02, "material": {**MATERIAL, "poisson": 0}}
    model = {"bodies": {"b": b}, "supports": {f"s{k}": {"body": "b", "along": k, "hold": "all"} for k in (0, 1)},
             "forces": {"f": {"type": "load", "a": {"name": "mid", "body": "b", "along": 0.5}, "force": [0, 0, -100]}}, "statics": {"linear": True},
             "output": {"quantities": ["mid.position.z", "b[node 5].section.My", "b[node 3].section.My", "s0.moment.y"]}}
    values = espalier.Model(model).run().summary["values"]
    inertia = 0.02**4 / 12
    assert values["mid.position.z"] == pytest.approx(-100 * 8 / (192 * YOUNG * inertia), rel=1e-3)
    assert abs(values["s0.moment.y"]) == pytest.approx(100 * 2 / 8, rel=1e-3)
    assert abs(values["b[node 3].section.My"]) < 0.5
    for wrong, message in ((1.5, "share of the length"), ([0.9, 0.1], "share of the length")):
        with pytest.raises(espalier.Error, match=message):
            espalier.Model({**model, "supports": {"s": {"body": "b", "along": wrong, "hold": "all"}}}).check()
