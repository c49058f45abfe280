"""Decks alone whose elements are shells, beams and bars, held against closed forms and the same models in our own words."""

import math

import pytest

import espalier

E, NU, RHO = 210000.0, 0.3, 7.85e-9  # mm, t, s
STATIC = "*STEP\n*STATIC\n"


def steel(nu=NU, young=E, name="STEEL"):
    return f"*MATERIAL, NAME={name}\n*ELASTIC\n{young}, {nu}\n*DENSITY\n{RHO}\n"


def block(keyword, lines):
    return keyword + "\n" + "".join(",".join(f"{x!r}" if isinstance(x, float) else str(x) for x in line) + "\n" for line in lines)


def nodes_of(places):
    return block("*NODE", [(k, *map(float, p)) for k, p in places.items()])


def grid(nx, ny, place, first=1):
    """Node labels by (i, j), places, and quadrilaterals."""
    label = {(i, j): first + j * (nx + 1) + i for j in range(ny + 1) for i in range(nx + 1)}
    quads = [(label[i, j], label[i + 1, j], label[i + 1, j + 1], label[i, j + 1]) for j in range(ny) for i in range(nx)]
    return label, {label[k]: place(k[0] / nx, k[1] / ny) for k in label}, quads


def shells(quads, first=1, kind="S4", name="PLATE"):
    return block(f"*ELEMENT, TYPE={kind}, ELSET={name}", [(first + k, *q) for k, q in enumerate(quads)])


def nset(name, labels):
    return block(f"*NSET, NSET={name}", [(n,) for n in labels])


def model(path, text, probes, **more):
    """The deck with places of nodes as outputs. @param probes  (body, node)"""
    path.write_text(text)
    markers = {f"m{n}": {"body": body, "node": n} for body, n in probes}
    quantities = [f"m{n}.position.{a}" for _, n in probes for a in "xyz"]
    return espalier.Model({"bodies": {"part": {"mesh": {"file": str(path), "take": "all"}}}, "markers": markers, "output": {"quantities": quantities}, **more})


def moved(path, text, places, *probes):
    """Displacements of nodes of `part`, or of (body, node)."""
    named = [p if isinstance(p, tuple) else ("part", p) for p in probes]
    values = model(path, text, named).run().summary["values"]
    return [[values[f"m{n}.position.{a}"] - x for a, x in zip("xyz", places[n])] for _, n in named]


def strip(nx=20, nu=0.0, length=200.0, width=20.0, kind="S4", place=None):
    label, places, quads = grid(nx, 2, place or (lambda s, t: (length * s, width * t, 0)))
    deck = nodes_of(places) + shells(quads, kind=kind) + steel(nu)
    deck += nset("LEFT", [label[0, j] for j in range(3)]) + nset("RIGHT", [label[nx, j] for j in range(3)])
    return label, places, deck


THICK = "*SHELL SECTION, ELSET=PLATE, MATERIAL=STEEL\n4.\n"
CLAMP = "*BOUNDARY\nLEFT, 1, 6\n"


# Truth: P l^3 / 3 E I and what shear adds, of a strip without Poisson's ratio.
def test_a_cantilever_of_shells(tmp_path):
    label, places, deck = strip()
    end = [label[20, j] for j in range(3)]
    text = deck + THICK + CLAMP + STATIC + block("*CLOAD", [(end[0], 3, 2.5), (end[1], 3, 5.0), (end[2], 3, 2.5)])
    inertia, area = 20 * 4**3 / 12, 80
    truth = 10 * 200**3 / 3 / E / inertia + 1.2 * 10 * 200 / (E / 2) / area
    assert moved(tmp_path / "a.inp", text, places, end[1])[0][2] == pytest.approx(truth, rel=1e-3)


# Truth: M l^2 / 2 E I; a moment at each node of the end.
def test_moments_at_nodes_of_shells(tmp_path):
    label, places, deck = strip()
    end = [label[20, j] for j in range(3)]
    text = deck + THICK + CLAMP + STATIC + block("*CLOAD", [(end[0], 5, -250.0), (end[1], 5, -500.0), (end[2], 5, -250.0)])
    assert moved(tmp_path / "a.inp", text, places, end[1])[0][2] == pytest.approx(1000 * 200**2 / 2 / E / (20 * 4**3 / 12), rel=2e-3)


# Truth: a guided end has P l^3 / 12 E I: its rotation is held, its displacement is not.
def test_rotations_of_shells_are_held(tmp_path):
    label, places, deck = strip()
    end = [label[20, j] for j in range(3)]
    text = deck + THICK + CLAMP + "*BOUNDARY\nRIGHT, 5\n" + STATIC + block("*CLOAD", [(end[0], 3, 2.5), (end[1], 3, 5.0), (end[2], 3, 2.5)])
    inertia = 20 * 4**3 / 12
    truth = 10 * 200**3 / 12 / E / inertia + 1.2 * 10 * 200 / (E / 2) / 80
    assert moved(tmp_path / "a.inp", text, places, end[1])[0][2] == pytest.approx(truth, rel=3e-3)


# Truth: Navier's plate, 0.00406235 p a^4 / D; the pressure acts along the normal of each element, whichever way it goes round.
@pytest.mark.parametrize("flipped", [(), range(0, 256, 3), range(256)])
def test_a_plate_under_pressure_with_reversed_normals(tmp_path, flipped):
    label, places, quads = grid(16, 16, lambda s, t: (100 * s, 100 * t, 0))
    quads = [q[::-1] if k in set(flipped) else q for k, q in enumerate(quads)]
    edge = [n for (i, j), n in label.items() if i in (0, 16) or j in (0, 16)]
    text = nodes_of(places) + shells(quads) + steel() + "*SHELL SECTION, ELSET=PLATE, MATERIAL=STEEL\n1.\n" + nset("EDGE", edge)
    text += f"*BOUNDARY\nEDGE, 3\nEDGE, 6\n{label[8, 8]}, 1, 2\n{label[8, 0]}, 1\n" + STATIC
    text += block("*DLOAD", [(k + 1, "P", -0.01 if k in set(flipped) else 0.01) for k in range(256)])
    truth = 0.00406235 * 0.01 * 100**4 / (E / 12 / (1 - NU**2))
    assert moved(tmp_path / "a.inp", text, places, label[8, 8])[0][2] == pytest.approx(truth, rel=1e-2)


# Truth: the same by a surface, SPOS is pressed and SNEG pushed; ccx 2.20 has the same signs.
def test_surfaces_of_shells_are_pressed(tmp_path):
    label, places, deck = strip()
    tail = THICK + CLAMP + "*SURFACE, NAME=TOP\nPLATE, SPOS\n*SURFACE, NAME=UNDER\nPLATE, SNEG\n" + STATIC
    loads = ("*DLOAD\nPLATE, P, 0.01\n", "*DSLOAD\nUNDER, P, 0.01\n", "*DSLOAD\nTOP, P, -0.01\n")
    found = [moved(tmp_path / "a.inp", deck + tail + load, places, label[20, 1])[0][2] for load in loads]
    assert found == pytest.approx([0.01 * 20 * 200**4 / 8 / E / (20 * 4**3 / 12)] * 3, rel=3e-3)


# Truth: F l / E A; EDNOR is towards the element, as in ccx 2.20.
def test_an_edge_is_loaded_across(tmp_path):
    label, places, deck = strip()
    text = deck + THICK + CLAMP + STATIC + "*DLOAD\n20, EDNOR2, 8.\n40, EDNOR2, 8.\n"
    assert moved(tmp_path / "a.inp", text, places, label[20, 1])[0][0] == pytest.approx(-160 * 200 / E / 80, rel=1e-9)


# Truth: rho w^2 l^3 / 3 E of a rod that turns about its end, and g rho l^2 / 2 E of one that hangs.
@pytest.mark.parametrize("load, truth", [("CENTRIF, 1e6, 0,0,0, 0,0,1", RHO * 1e6 * 200**3 / 3 / E), ("GRAV, 9810., 1,0,0", 9810 * RHO * 200**2 / 2 / E)])
@pytest.mark.parametrize("thin", ["shells", "beams"])
def test_weight_and_centrifugal_forces(tmp_path, load, truth, thin):
    if thin == "shells":
        label, places, deck = strip()
        text, tip = deck + THICK + "*BOUNDARY\nLEFT, 1\nLEFT, 3, 5\n2, 3\n" + f"{label[0, 1]}, 1, 6\n", label[20, 1]
        load = load.replace("0,0,0, 0,0,1", "0,10,0, 0,0,1")
    else:
        places = {k: (10.0 * (k - 1), 0, 0) for k in range(1, 22)}
        text = nodes_of(places) + block("*ELEMENT, TYPE=B31, ELSET=PLATE", [(k, k, k + 1) for k in range(1, 21)]) + steel()
        text, tip = text + "*BEAM SECTION, ELSET=PLATE, MATERIAL=STEEL, SECTION=RECT\n4., 20.\n0,0,1\n*BOUNDARY\n1, 1, 6\n", 21
    found = moved(tmp_path / "a.inp", text + STATIC + f"*DLOAD\nPLATE, {load}\n", places, tip)[0][0]
    assert found == pytest.approx(truth, rel=2e-3)


# Truth: the same in our own words, to rounding.
def test_a_deck_of_shells_is_our_own_model(tmp_path):
    label, places, deck = strip(6, 0.3)
    end = [label[6, j] for j in range(3)]
    mesh = tmp_path / "mesh.inp"
    mesh.write_text(deck + THICK)
    own = espalier.Model({
        "bodies": {"s": {"type": "shell", "mesh": {"file": str(mesh)}}}, "supports": {"c": {"body": "s", "nodes": "LEFT", "hold": "all"}, "r": {"body": "s", "nodes": "RIGHT", "hold": "y", "rotations": "x"}},
        "forces": {"f": {"type": "load", "a": {"body": "s", "node": end[0]}, "force": [3, 0, 5], "moment": [0, 7, 0]},
                   "p": {"type": "pressure", "body": "s", "face": "middle", "pressure": -0.02}},
        "markers": {"m": {"body": "s", "node": end[0]}}, "statics": {"linear": True}, "output": {"quantities": ["m.position.x", "m.position.z"]}}).run().summary["values"]
    text = deck + THICK + CLAMP + "*BOUNDARY\nRIGHT, 2\nRIGHT, 4\n" + STATIC + block("*CLOAD", [(end[0], 1, 3.0), (end[0], 3, 5.0), (end[0], 5, 7.0)]) + "*DLOAD\nPLATE, P, 0.02\n"
    found = moved(tmp_path / "a.inp", text, places, end[0])[0]
    assert [found[0] + places[end[0]][0], found[2]] == pytest.approx([own["m.position.x"], own["m.position.z"]], rel=1e-9)


# Truth: Belytschko's value of the pinched cylinder with end diaphragms, 1.8248e-5, with rotations held in three planes of symmetry.
def test_a_pinched_cylinder(tmp_path):
    label, places, quads = grid(32, 32, lambda s, t: (300 * math.sin(math.pi / 2 * s), 300 * t, 300 * math.cos(math.pi / 2 * s)))
    deck = nodes_of(places) + shells(quads) + "*MATERIAL, NAME=STEEL\n*ELASTIC\n3e6, 0.3\n*SHELL SECTION, ELSET=PLATE, MATERIAL=STEEL\n3.\n"
    deck += nset("X", [label[0, j] for j in range(33)]) + nset("Z", [label[32, j] for j in range(33)])
    deck += nset("MIDDLE", [label[i, 0] for i in range(33)]) + nset("END", [label[i, 32] for i in range(33)])
    text = deck + "*BOUNDARY\nX, XSYMM\nZ, ZSYMM\nMIDDLE, YSYMM\nEND, 1\nEND, 3\n" + STATIC + f"*CLOAD\n{label[0, 0]}, 3, -0.25\n"
    assert moved(tmp_path / "a.inp", text, places, label[0, 0])[0][2] == pytest.approx(-1.8248e-5, rel=0.03)


# Truth: 1.8751^2 / (2 pi l^2) sqrt(E I / rho A), of shells and of beams.
@pytest.mark.parametrize("thin", ["shells", "beams"])
def test_frequencies(tmp_path, thin):
    if thin == "shells":
        _, _, deck = strip()
        text = deck + THICK + CLAMP
    else:
        places = {k: (10.0 * (k - 1), 0, 0) for k in range(1, 22)}
        text = nodes_of(places) + block("*ELEMENT, TYPE=B31, ELSET=PLATE", [(k, k, k + 1) for k in range(1, 21)]) + steel(0.0)
        text += "*BEAM SECTION, ELSET=PLATE, MATERIAL=STEEL, SECTION=RECT\n20., 4.\n0,1,0\n*BOUNDARY\n1, ENCASTRE\n"
    path = tmp_path / "a.inp"
    path.write_text(text + "*STEP\n*FREQUENCY\n2\n")
    found = espalier.Model({"bodies": {"part": {"mesh": {"file": str(path), "take": "all"}}}}).modes(2)["frequency"]
    assert found[0] == pytest.approx(1.8751**2 / 2 / math.pi / 200**2 * math.sqrt(E * 4**2 / 12 / RHO), rel=2e-3)


L_FRAME = {1: (0, 0, 0), 2: (50, 0, 0), 3: (100, 0, 0), 4: (100, 40, 0), 5: (100, 80, 0), 6: (50, 0, 60)}


def frame(kind="B31", direction="0.1,0.2,1", more=""):
    return (nodes_of(L_FRAME) + block(f"*ELEMENT, TYPE={kind}, ELSET=F", [(1, 1, 2), (2, 2, 3), (3, 3, 4), (4, 4, 5), (5, 2, 6)]) + steel()
            + f"*BEAM SECTION, ELSET=F, MATERIAL=STEEL, SECTION=RECT\n4., 3.\n{direction}\n" + more)


# Truth: the same in our own words: an elbow with a branch, forces, moments and even loads, several supports.
def test_a_frame_of_beams_is_our_own_model(tmp_path):
    mesh = tmp_path / "mesh.inp"
    mesh.write_text(frame(direction="0.3,0.5,0.7"))
    own = espalier.Model({
        "bodies": {"f": {"type": "beam", "mesh": {"file": str(mesh)}}}, "supports": {"c": {"body": "f", "node": 1, "hold": "all"}, "r": {"body": "f", "node": 5, "hold": "z", "rotations": "xz"}},
        "forces": {"a": {"type": "load", "a": {"body": "f", "node": 6}, "force": [3, 0, 5], "moment": [0, 70, 9]},
                   "p": {"type": "line-load", "body": "f", "force": [0, 0, 0.02]}},
        "markers": {"m": {"body": "f", "node": 6}}, "statics": {"linear": True}, "output": {"quantities": [f"m.position.{a}" for a in "xyz"]}}).run().summary["values"]
    text = frame(direction="0.3,0.5,0.7") + "*BOUNDARY\n1, 1, 6\n5, 3, 4\n5, 6\n" + STATIC + block("*CLOAD", [(6, 1, 3.0), (6, 3, 5.0), (6, 5, 70.0), (6, 6, 9.0)]) + "*DLOAD\nF, PZ, 0.02\n"
    found = moved(tmp_path / "a.inp", text, L_FRAME, 6)[0]
    assert [f + x for f, x in zip(found, L_FRAME[6])] == pytest.approx([own[f"m.position.{a}"] for a in "xyz"], rel=1e-9)


# Truth: P l^3 / 3 E I, and / 12 where the rotation about one oblique axis is held at the end as well.
@pytest.mark.parametrize("held, share", [("", 3), ("END, 5\n", 12), ("END, 4, 6\n", 12)])
def test_rotations_of_beams(tmp_path, held, share):
    places = {k: (10.0 * (k - 1), 0, 0) for k in range(1, 12)}
    text = nodes_of(places) + block("*ELEMENT, TYPE=B31, ELSET=F", [(k, k, k + 1) for k in range(1, 11)]) + steel() + nset("END", [11])
    text += "*BEAM SECTION, ELSET=F, MATERIAL=STEEL, SECTION=RECT\n1., 2.\n0,0,1\n*BOUNDARY\n1, 1, 6\n" + held + STATIC + "*CLOAD\nEND, 3, 0.1\n"
    truth = 0.1 * 100**3 / share / E / (2 * 1 / 12)
    assert moved(tmp_path / "a.inp", text, places, 11)[0][2] == pytest.approx(truth, rel=1e-3)


# Truth: two bars at 45 degrees: F l / (E A) in each direction.
def test_a_truss(tmp_path):
    places = {1: (0, 0, 0), 2: (100, 0, 0), 3: (100, 100, 0)}
    text = nodes_of(places) + block("*ELEMENT, TYPE=T3D2, ELSET=T", [(1, 1, 2), (2, 2, 3)]) + steel() + "*SOLID SECTION, ELSET=T, MATERIAL=STEEL\n5.\n"
    text += "*BOUNDARY\n1, 1, 3\n3, 1, 3\n2, 3\n" + STATIC + "*CLOAD\n2, 1, 70.\n2, 2, -30.\n"
    found = moved(tmp_path / "a.inp", text, places, 2)[0]
    assert found[:2] == pytest.approx([70 * 100 / E / 5, -30 * 100 / E / 5], rel=1e-6)


# A cube with a bar, a beam and a shell. Truth: each in series with a cube that is a thousand times as stiff.
def test_a_solid_with_a_bar_and_a_beam(tmp_path):
    places = {1: (0, 0, 0), 2: (10, 0, 0), 3: (10, 10, 0), 4: (0, 10, 0), 5: (0, 0, 10), 6: (10, 0, 10), 7: (10, 10, 10), 8: (0, 10, 10),
              20: (10, 0, 60), 30: (5, 5, 10), 31: (5, 5, 60), 32: (5, 5, 110)}
    text = nodes_of(places) + "*ELEMENT, TYPE=C3D8, ELSET=CUBE\n1, 1,2,3,4,5,6,7,8\n*ELEMENT, TYPE=T3D2, ELSET=BAR\n2, 6, 20\n*ELEMENT, TYPE=B31, ELSET=POST\n3, 30, 31\n4, 31, 32\n"
    text += steel() + steel(0.3, 1000 * E, "HARD") + "*SOLID SECTION, ELSET=CUBE, MATERIAL=HARD\n*SOLID SECTION, ELSET=BAR, MATERIAL=STEEL\n0.2\n"
    text += "*BEAM SECTION, ELSET=POST, MATERIAL=STEEL, SECTION=CIRC\n1.\n1,0,0\n*NSET, NSET=TOP\n5,6,7,8\n*NSET, NSET=FLOOR\n1,2,3,4\n"
    text += "*SURFACE, NAME=LID\nCUBE, S2\n*COUPLING, CONSTRAINT NAME=C, REF NODE=30, SURFACE=LID\n*KINEMATIC\n1, 6\n"
    text += "*BOUNDARY\nFLOOR, 1, 3\n20, 1, 2\n" + STATIC + "*CLOAD\n20, 3, 2.\n32, 1, 0.1\n32, 6, 5.\n"
    bar, post = moved(tmp_path / "a.inp", text, places, ("part_bars", 20), ("part_beams", 32))
    assert bar[2] == pytest.approx(2 * 50 / E / 0.2, rel=1e-3)
    assert post[0] == pytest.approx(0.1 * 100**3 / 3 / E / (math.pi / 4), rel=2e-3)


# A post in the middle of a clamped plate, turned about its axis: the plate holds it. Truth: T l / G J and the same post on a clamp.
def test_a_post_on_a_plate_does_not_spin(tmp_path):
    label, places, quads = grid(8, 8, lambda s, t: (80 * s, 80 * t, 0))
    base = label[4, 4]
    places |= {200: (40, 40, 30), 201: (40, 40, 60), 202: (45, 40, 60)}
    edge = [n for (i, j), n in label.items() if i in (0, 8) or j in (0, 8)]
    text = nodes_of(places) + shells(quads) + block("*ELEMENT, TYPE=B31, ELSET=POST", [(900, base, 200), (901, 200, 201), (902, 201, 202)]) + steel()
    text += THICK + "*BEAM SECTION, ELSET=POST, MATERIAL=STEEL, SECTION=CIRC\n1.\n0,1,0\n" + nset("LEFT", edge) + CLAMP + STATIC + "*CLOAD\n202, 2, 1.\n"
    found = moved(tmp_path / "a.inp", text, places, ("part_beams", 202))[0][1]
    shear, inertia = E / 2 / (1 + NU), math.pi / 4
    truth = 60**3 / 3 / E / inertia + 5**2 * 60 / shear / (2 * inertia) + 5**3 / 3 / E / inertia
    assert found == pytest.approx(truth, rel=2e-2)


# A stiffener on a strip, and a T of two plates. Truth: bending of the sum, E (I_1 + I_2), and of the T.
def test_a_stiffened_strip(tmp_path):
    label, places, deck = strip()
    row = [label[i, 1] for i in range(21)]
    text = deck + THICK + block("*ELEMENT, TYPE=B31, ELSET=RIB", [(900 + k, a, b) for k, (a, b) in enumerate(zip(row, row[1:]))])
    text += "*BEAM SECTION, ELSET=RIB, MATERIAL=STEEL, SECTION=RECT\n2., 6.\n0,1,0\n" + CLAMP + STATIC + f"*CLOAD\n{row[-1]}, 3, 10.\n"
    inertia = 20 * 4**3 / 12 + 2 * 6**3 / 12
    found = moved(tmp_path / "a.inp", text, places, ("part_beams", row[-1]))[0][2]
    assert found == pytest.approx(10 * 200**3 / 3 / E / inertia, rel=1e-2)


def test_plates_that_branch(tmp_path):
    label, places, deck = strip()
    web, more, quads = grid(20, 2, lambda s, t: (200 * s, 10, -20 * t), first=200)
    same = {web[i, 0]: label[i, 1] for i in range(21)}
    places |= {n: p for n, p in more.items() if n not in same}
    text = nodes_of({n: p for n, p in more.items() if n not in same}) + deck
    text += shells([tuple(same.get(n, n) for n in q) for q in quads], 500, name="WEB") + "*SHELL SECTION, ELSET=WEB, MATERIAL=STEEL\n2.\n" + THICK
    text += nset("LEFT", [web[0, 1], web[0, 2]]) + CLAMP + STATIC + f"*CLOAD\n{label[20, 1]}, 3, 10.\n"
    flange, rib = 80.0, 40.0  # areas; centres at 0 and -10
    centre = -10 * rib / (flange + rib)
    inertia = 20 * 4**3 / 12 + flange * centre**2 + 2 * 20**3 / 12 + rib * (-10 - centre) ** 2
    truth = 10 * 200**3 / 3 / E / inertia + 10 * 200 / (E / 2) / rib
    found = moved(tmp_path / "a.inp", text, places, label[20, 1])[0][2]
    assert found == pytest.approx(truth, rel=3e-2)


# Triangles and quadrilaterals side by side, of two thicknesses. Truth: M-diagram of a stepped strip.
def test_mixed_elements_and_sections(tmp_path):
    label, places, quads = grid(20, 2, lambda s, t: (200 * s, 20 * t, 0))
    thin = [q for q in quads if places[q[0]][0] >= 99]
    thick = [q for q in quads if places[q[0]][0] < 99]
    triangles = [t for a, b, c, d in thin for t in ((a, b, c), (a, c, d))]
    text = nodes_of(places) + shells(thick, 1) + shells(triangles, 500, "S3", "THIN") + steel(0.0) + THICK + "*SHELL SECTION, ELSET=THIN, MATERIAL=STEEL\n2.\n"
    end = [label[20, j] for j in range(3)]
    text += nset("LEFT", [label[0, j] for j in range(3)]) + CLAMP + STATIC + block("*CLOAD", [(end[0], 3, 0.25), (end[1], 3, 0.5), (end[2], 3, 0.25)])
    i1, i2 = 20 * 4**3 / 12, 20 * 2**3 / 12
    truth = (200**3 - 100**3) / 3 / E / i1 + 100**3 / 3 / E / i2
    assert moved(tmp_path / "a.inp", text, places, ("part_shells_2", end[1]))[0][2] == pytest.approx(truth, rel=1e-2)


# Truth: layers of one material are one plate, to rounding; of two, bending stiffness adds up.
def test_layers(tmp_path):
    label, places, deck = strip()
    end = [label[20, j] for j in range(3)]
    tail = CLAMP + STATIC + block("*CLOAD", [(end[0], 3, 0.25), (end[1], 3, 0.5), (end[2], 3, 0.25)])
    deck += steel(0.0, E / 100, "FOAM")
    layers = "*SHELL SECTION, ELSET=PLATE, COMPOSITE\n"
    one = moved(tmp_path / "a.inp", deck + THICK + tail, places, end[1])[0][2]
    three = moved(tmp_path / "a.inp", deck + layers + "1., 3, STEEL, 45.\n2., 3, STEEL\n1., 3, STEEL\n" + tail, places, end[1])[0][2]
    sandwich = moved(tmp_path / "a.inp", deck + layers + "1., 3, STEEL\n2., 3, FOAM\n1., 3, STEEL\n" + tail, places, end[1])[0][2]
    assert three == pytest.approx(one, rel=1e-12)
    bending = 20 / 12 * (E * (4**3 - 2**3) + E / 100 * 2**3)
    assert sandwich == pytest.approx(200**3 / 3 / bending, rel=5e-3)


# Truth: our own plate whose thickness goes from corner to corner, to rounding.
def test_nodal_thickness(tmp_path):
    label, places, deck = strip(8, 0.3)
    deck += "*SHELL SECTION, ELSET=PLATE, MATERIAL=STEEL, NODAL THICKNESS\n1.\n" + block("*NODAL THICKNESS", [(n, 5.0 - 3 * places[n][0] / 200) for n in places])
    text = deck + CLAMP + STATIC + f"*CLOAD\n{label[8, 1]}, 3, 1.\n"
    own = espalier.Model({
        "bodies": {"s": {"type": "shell", "x": [200, 0, 0], "y": [0, 20, 0], "nx": 8, "ny": 2, "thickness": [5, 2, 2, 5], "material": {"young": E, "poisson": 0.3, "density": RHO}}},
        "supports": {"c": {"body": "s", "edge": "x0", "hold": "all"}}, "forces": {"f": {"type": "load", "a": {"body": "s", "node": label[8, 1]}, "force": [0, 0, 1]}},
        "markers": {"m": {"body": "s", "node": label[8, 1]}}, "statics": {"linear": True}, "output": {"quantities": ["m.position.z"]}}).run().summary["values"]
    assert moved(tmp_path / "a.inp", text, places, label[8, 1])[0][2] == pytest.approx(own["m.position.z"], rel=1e-9)


def nastran(nx=20):
    label, places, quads = grid(nx, 2, lambda s, t: (200 * s, 20 * t, 0))
    text = "SOL 101\nCEND\nSPC=1\nLOAD=2\nBEGIN BULK\n" + "".join(f"GRID,{n},,{x!r},{y!r},{z!r}\n" for n, (x, y, z) in places.items())
    text += "".join(f"CQUAD4,{k + 1},7,{','.join(map(str, q))}\n" for k, q in enumerate(quads))
    return label, places, text + f"MAT1,3,{E},,0.,{RHO}\nSPC1,1,123456,{label[0, 0]},{label[0, 1]},{label[0, 2]}\n"


# Truth: as above; PLOAD4, PLOAD2 along the normal, FORCE, MOMENT, GRAV, T1 to T4.
@pytest.mark.parametrize("cards, truth", [
    ("PLOAD4,2,1,0.01,,,,THRU,40\n", 0.01 * 20 * 200**4 / 8), ("PLOAD2,2,0.01,1,THRU,40\n", 0.01 * 20 * 200**4 / 8),
    ("FORCE,2,{0},,1.,0.,0.,0.25\nFORCE,2,{1},,1.,0.,0.,0.5\nFORCE,2,{2},,1.,0.,0.,0.25\n", 200**3 / 3),
    ("MOMENT,2,{0},,-25.,0.,1.,0.\nMOMENT,2,{1},,-50.,0.,1.,0.\nMOMENT,2,{2},,-25.,0.,1.,0.\n", 100 * 200**2 / 2),
    ("GRAV,2,,9810.,0.,0.,1.\n", 9810 * RHO * 80 * 200**4 / 8)])
def test_shells_of_nastran(tmp_path, cards, truth):
    label, places, text = nastran()
    end = [label[20, j] for j in range(3)]
    text += "PSHELL,7,3,4.,3\n" + cards.format(*end) + "ENDDATA\n"
    assert moved(tmp_path / "a.bdf", text, places, end[1])[0][2] == pytest.approx(truth / E / (20 * 4**3 / 12), rel=3e-3)


# Truth: P l^3 / 3 E I, p l^4 / 8 E I.
@pytest.mark.parametrize("cards, truth", [("FORCE,2,11,,1.,0.,0.,1.\n", 100**3 / 3), ("".join(f"PLOAD1,2,{k},FZ,FR,0.,0.1,1.,0.1\n" for k in range(1, 11)), 0.1 * 100**4 / 8)])
def test_beams_of_nastran(tmp_path, cards, truth):
    places = {k: (10.0 * (k - 1), 0, 0) for k in range(1, 12)}
    text = "SOL 101\nCEND\nSPC=1\nLOAD=2\nBEGIN BULK\n" + "".join(f"GRID,{n},,{x!r},{y!r},{z!r}\n" for n, (x, y, z) in ((n, map(float, p)) for n, p in places.items()))
    text += "".join(f"CBAR,{k},7,{k},{k + 1},0.,0.,1.\n" for k in range(1, 11)) + f"PBARL,7,3,,BAR\n,2.,1.\nMAT1,3,{E},,0.3,{RHO}\nSPC1,1,123456,1\n" + cards + "ENDDATA\n"
    assert moved(tmp_path / "a.bdf", text, places, 11)[0][2] == pytest.approx(truth / E / (2 / 12), rel=2e-3)


# A cantilever of ten beams with what stands at its end. Truths: Euler's beam with a spring, a mass, half a circle under a moment, an equation.
BEAM = {k: (10.0 * (k - 1), 0, 0) for k in range(1, 12)}
BENDING = E * 2 / 12


def cantilever(more=""):
    return (nodes_of(BEAM) + block("*ELEMENT, TYPE=B31, ELSET=F", [(k, k, k + 1) for k in range(1, 11)]) + steel()
            + "*BEAM SECTION, ELSET=F, MATERIAL=STEEL, SECTION=RECT\n1., 2.\n0,0,1\n" + more)


def test_a_spring_that_turns(tmp_path):
    text = cantilever("*ELEMENT, TYPE=SPRING1, ELSET=S\n500, 11\n*SPRING, ELSET=S\n5\n1000.\n*BOUNDARY\n1, 1, 6\n")
    turn = 0.1 * 100**2 / 2 / BENDING / (1 + 1000 * 100 / BENDING)
    truth = 0.1 * 100**3 / 3 / BENDING - 1000 * turn * 100**2 / 2 / BENDING
    assert moved(tmp_path / "a.inp", text + STATIC + "*CLOAD\n11, 3, 0.1\n", BEAM, 11)[0][2] == pytest.approx(truth, rel=1e-3)


def test_a_mass_at_a_beam(tmp_path):
    (tmp_path / "a.inp").write_text(cantilever("*ELEMENT, TYPE=MASS, ELSET=M\n500, 11\n*MASS, ELSET=M\n1e-3\n*BOUNDARY\n1, 1, 6\n*STEP\n*FREQUENCY\n2\n"))
    found = espalier.Model({"bodies": {"part": {"mesh": {"file": str(tmp_path / "a.inp"), "take": "all"}}}}).modes(2)["frequency"]
    assert found[0] == pytest.approx(math.sqrt(3 * BENDING / 100**3 / (1e-3 + 0.243 * RHO * 200)) / 2 / math.pi, rel=1e-3)


def test_half_a_circle(tmp_path):
    text = cantilever("*BOUNDARY\n1, 1, 6\n*STEP, NLGEOM\n*STATIC\n") + f"*CLOAD\n11, 5, {-math.pi * BENDING / 100}\n"
    assert moved(tmp_path / "a.inp", text, BEAM, 11)[0] == pytest.approx([-100, 0, 200 / math.pi], abs=1e-6)


def test_equations_of_beams(tmp_path):
    text = cantilever("*BOUNDARY\n1, 1, 6\n*EQUATION\n2\n11, 3, 1., 6, 3, -2.\n") + STATIC + "*CLOAD\n11, 3, 0.1\n"
    end, middle = moved(tmp_path / "a.inp", text, BEAM, 11, 6)
    assert end[2] == pytest.approx(2 * middle[2], rel=1e-12) and middle[2] > 0.1


# Truths: the strip goes on as a rigid lever; as a beam of the same section; it ends at the face of a hard block.
def test_an_edge_in_a_coupling(tmp_path):
    label, places, deck = strip()
    edge = "*SURFACE, NAME=E, TYPE=NODE\nRIGHT\n*COUPLING, CONSTRAINT NAME=C, REF NODE=900, SURFACE=E\n*KINEMATIC\n1, 6\n"
    inertia = 20 * 4**3 / 12
    (tmp_path / "a.inp").write_text(deck + "*NODE\n900, 250., 10., 0.\n" + THICK + CLAMP + edge + STATIC + "*CLOAD\n900, 3, 10.\n")
    lever = espalier.Model({"bodies": {"part": {"mesh": {"file": str(tmp_path / "a.inp"), "take": "all"}}}, "output": {"quantities": ["part_coupling_1.position.z"]}}).run()
    assert lever.summary["values"]["part_coupling_1.position.z"] == pytest.approx(10 / E / inertia * (200**3 / 3 + 50 * 200**2 + 50**2 * 200), rel=1e-3)
    places |= {900: (200, 10, 0), 901: (300, 10, 0)}
    text = deck + "*NODE\n900, 200., 10., 0.\n901, 300., 10., 0.\n*ELEMENT, TYPE=B31, ELSET=F\n800, 900, 901\n*BEAM SECTION, ELSET=F, MATERIAL=STEEL, SECTION=RECT\n20., 4.\n0,1,0\n"
    found = moved(tmp_path / "a.inp", text + THICK + CLAMP + edge + STATIC + "*CLOAD\n901, 3, 10.\n", places, ("part_beams", 901))[0][2]
    assert found == pytest.approx(10 * 300**3 / 3 / E / inertia, rel=1e-3)


def test_an_edge_tied_to_a_block(tmp_path):
    label, places, deck = strip(10)
    corners = [(x, y, z) for z in (-20.0, 20.0) for x, y in ((-40.0, -10.0), (0.0, -10.0), (0.0, 30.0), (-40.0, 30.0))]
    text = deck + nodes_of({1000 + k: p for k, p in enumerate(corners)}) + "*ELEMENT, TYPE=C3D8I, ELSET=CUBE\n900, " + ",".join(str(1000 + k) for k in range(8)) + "\n"
    text += steel(0.0, 1000 * E, "HARD") + "*SOLID SECTION, ELSET=CUBE, MATERIAL=HARD\n" + THICK + "*SURFACE, NAME=FACE\nCUBE, S4\n*SURFACE, NAME=EDGE, TYPE=NODE\nLEFT\n*TIE, NAME=T\nEDGE, FACE\n"
    text += nset("FLOOR", [1000, 1003, 1004, 1007]) + "*BOUNDARY\nFLOOR, 1, 3\n" + STATIC + f"*CLOAD\n{label[10, 1]}, 3, 10.\n"
    assert moved(tmp_path / "a.inp", text, places, ("part_shells", label[10, 1]))[0][2] == pytest.approx(10 * 200**3 / 3 / E / (20 * 4**3 / 12), rel=5e-3)


# Pulled in the plane of its nodes, which lie on its underside: F e l^2 / 2 E I clamped, / 8 E I between hinges.
@pytest.mark.parametrize("held, place, share", [("LEFT, 1, 6\n", 20, 2), ("LEFT, 1, 3\nRIGHT, 2, 3\n", 10, -8)])
def test_offsets(tmp_path, held, place, share):
    label, places, deck = strip()
    text = deck + THICK.replace("STEEL\n", "STEEL, OFFSET=SNEG\n") + "*BOUNDARY\n" + held + STATIC + block("*CLOAD", [(label[20, 0], 1, 25.0), (label[20, 1], 1, 50.0), (label[20, 2], 1, 25.0)])
    assert moved(tmp_path / "a.inp", text, places, label[place, 1])[0][2] == pytest.approx(100 * 2 * 200**2 / share / E / (20 * 4**3 / 12), rel=1e-6)


# A stiffener of Nastran. Truth: E (I_1 + I_2).
def test_shells_with_beams_of_nastran(tmp_path):
    label, places, text = nastran()
    row = [label[i, 1] for i in range(21)]
    text += "PSHELL,7,3,4.,3\n" + "".join(f"CBAR,{500 + k},8,{a},{b},0.,0.,1.\n" for k, (a, b) in enumerate(zip(row, row[1:]))) + f"PBARL,8,3,,BAR\n,2.,6.\nFORCE,2,{row[-1]},,10.,0.,0.,1.\nENDDATA\n"
    truth = 10 * 200**3 / 3 / E / (20 * 4**3 / 12 + 2 * 6**3 / 12)
    assert moved(tmp_path / "a.bdf", text, places, ("part_beams", row[-1]))[0][2] == pytest.approx(truth, rel=2e-3)


# A bar on a cube of Nastran. Truth: F l / E A; without its section it is an error, not left out.
def test_bars_beside_solids_of_nastran(tmp_path):
    places = {1: (0, 0, 0), 2: (10, 0, 0), 3: (10, 10, 0), 4: (0, 10, 0), 5: (0, 0, 10), 6: (10, 0, 10), 7: (10, 10, 10), 8: (0, 10, 10), 20: (10, 0, 60)}
    text = "SOL 101\nCEND\nSPC=1\nLOAD=2\nBEGIN BULK\n" + "".join(f"GRID,{n},,{x}.,{y}.,{z}.\n" for n, (x, y, z) in places.items())
    text += f"CHEXA,1,5,1,2,3,4,5,6\n,7,8\nCROD,2,6,6,20\nPSOLID,5,4\nMAT1,3,{E},,0.,{RHO}\nMAT1,4,{1000 * E},,0.,{RHO}\nSPC1,1,123,1,2,3,4\nSPC1,1,12,20\nFORCE,2,20,,2.,0.,0.,1.\n"
    assert moved(tmp_path / "a.bdf", text + "PROD,6,3,0.2\nENDDATA\n", places, ("part_bars", 20))[0][2] == pytest.approx(2 * 50 / E / 0.2, rel=1e-3)
    (tmp_path / "a.bdf").write_text(text + "ENDDATA\n")
    with pytest.raises(espalier.Error, match=r"a\.bdf: element 2 \(a line2\) has no section"):
        espalier.Model({"bodies": {"part": {"mesh": {"file": str(tmp_path / "a.bdf"), "take": "all"}}}}).run()


ELEMENT_ALONE = "*ELEMENT, TYPE=S4, ELSET=ALONE\n999, 1,2,5,4\n"


@pytest.mark.parametrize("change, message", [
    (lambda d: d + ELEMENT_ALONE, r"a\.inp: element 999 \(a quad4\) has no section"),
    (lambda d: d + "*SHELL SECTION, ELSET=PLATE, MATERIAL=STEEL\n3.\n", r"a\.inp:\d+: element 1 has this section, and that of .*a\.inp:\d+"),
    (lambda d: d.replace("4.\n", "0.\n"), r"a\.inp:\d+: \*SHELL SECTION needs a thickness above 0"),
    (lambda d: d.replace("TYPE=S4", "TYPE=M3D4"), r"a\.inp:\d+: .*elements M3D4"),
    (lambda d: d.replace("RIGHT, 3, 1.", "RIGHT, 7, 1."), r"a\.inp:\d+: \*CLOAD: degree of freedom 7"),
    (lambda d: d.replace("LEFT, 1, 6\n", "LEFT, 1, 6\nRIGHT, 5, 5, 0.1\n"), r"a\.inp:\d+: node \d+ is turned by 0.1"),
    (lambda d: d.replace("*STATIC\n", "*STATIC\n*DLOAD\nPLATE, BX, 1.\n"), r"a\.inp:\d+: \*DLOAD BX acts on part"),
    (lambda d: d.replace("*STATIC\n", "*STATIC\n*DLOAD\nPLATE, PX, 1.\n"), r"a\.inp:\d+: .*\*DLOAD PX of quad4"),
    (lambda d: d.replace("0.0\n*DENSITY", "0.0\n*PLASTIC\n200.,0.\n*DENSITY"), r"a\.inp:\d+: .*\*PLASTIC of material STEEL")])
def test_what_cannot_be_taken_is_named(tmp_path, change, message):
    _, places, deck = strip(2)
    text = change(deck + THICK) + CLAMP + STATIC + "*CLOAD\nRIGHT, 3, 1.\n"
    if "RIGHT, 7" in message or "degree" in message or "turned" in message or "DLOAD" in message:
        text = change(deck + THICK + CLAMP + STATIC + "*CLOAD\nRIGHT, 3, 1.\n")
    path = tmp_path / "a.inp"
    path.write_text(text)
    with pytest.raises(espalier.Error, match=message):
        espalier.Model({"bodies": {"part": {"mesh": {"file": str(path), "take": "all"}}}}).run()


@pytest.mark.parametrize("change, message", [
    (lambda d: d.replace("0.1,0.2,1", "1,0,0"), r"the y axis of the section of element 1 lies along it"),
    (lambda d: d.replace("*STEP", "*STEP\n*DLOAD\nF, P1, 1.\n", 1).replace("*STATIC\n", "", 1) + "*STATIC\n", r"a\.inp:\d+: \*DLOAD P1: on beams this is a force per length in Abaqus"),
    (lambda d: d.replace("\n5,2,6\n", "\n5,2,6\n6,3,3\n"), r"a\.inp': element 6 has no length"),
    (lambda d: d.replace("*STEP", "*EQUATION\n2\n6, 5, 1., 5, 5, -2.\n*STEP"), r"a\.inp:\d+: the equation has a rotation of node 6"),
    (lambda d: d.replace("TYPE=B31", "TYPE=T3D3"), r"a\.inp:\d+: ")])
def test_beams_that_cannot_be_taken_are_named(tmp_path, change, message):
    path = tmp_path / "a.inp"
    path.write_text(change(frame(more="*BOUNDARY\n1, 1, 6\n*STEP\n*STATIC\n*CLOAD\n6, 1, 1.\n")))
    with pytest.raises(espalier.Error, match=message):
        espalier.Model({"bodies": {"part": {"mesh": {"file": str(path), "take": "all"}}}}).run()


# Two cubes in a row. Truth: F l / E A of each.
def test_materials_of_sets(tmp_path):
    path = tmp_path / "two.inp"
    path.write_text(nodes_of({1 + x + 10 * y + 20 * z: (x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1, 2)})
                    + "*ELEMENT, TYPE=C3D8, ELSET=SOFT\n1, 1,2,12,11, 21,22,32,31\n*ELEMENT, TYPE=C3D8, ELSET=STIFF\n2, 2,3,13,12, 22,23,33,32\n*ELSET, ELSET=NONE\n")
    own = {"bodies": {"b": {"type": "solid", "mesh": {"file": str(path)}, "materials": {"soft": {"young": 100, "poisson": 0}, "STIFF": "hard"}}},
           "materials": {"hard": {"young": 1000, "poisson": 0}}, "supports": {"s": {"body": "b", "nodes": [1, 11, 21, 31], "hold": "all"}},
           "forces": {"f": {"type": "load", "a": {"body": "b", "nodes": [3, 13, 23, 33]}, "force": [1, 0, 0]}},
           "markers": {"m": {"body": "b", "node": 3}}, "statics": {"linear": True}, "output": {"quantities": ["m.position.x"]}}
    assert espalier.Model(own).run().summary["values"]["m.position.x"] - 2 == pytest.approx(1 / 100 + 1 / 1000, rel=1e-12)
    for wrong, message in (({"OTHER": "hard"}, "no element set 'OTHER'"), ({"SOFT": "hard"}, "element 2 lies in none|mesh file states none|needs 'material'")):
        own["bodies"]["b"]["materials"] = wrong
        with pytest.raises(espalier.Error, match=message):
            espalier.Model(own).run()


# A bar of wedges. Truth: F l / E A, and P l^3 / 3 E I of those of second order.
@pytest.mark.parametrize("kind", ["C3D6", "C3D15"])
def test_wedges(tmp_path, kind):
    pieces, second = 10, kind == "C3D15"
    places, number, wedges = {}, {}, []

    def node(x, y, z):
        key = (round(x, 6), round(y, 6), round(z, 6))
        number.setdefault(key, len(number) + 1)
        places[number[key]] = key
        return number[key]

    for i in range(pieces):
        corners = [(10.0 * (i + a), b, c) for a in (0, 1) for b, c in ((0.0, 0.0), (4.0, 0.0), (4.0, 6.0), (0.0, 6.0))]
        for tri in ((0, 1, 2), (0, 2, 3)):
            own = [corners[k] for k in tri] + [corners[4 + k] for k in tri]
            if second:
                edges = [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]
                own += [tuple((p + q) / 2 for p, q in zip(own[a], own[b])) for a, b in edges]
            wedges.append([node(*p) for p in own])
    left, right = ([n for n, p in places.items() if p[0] == x] for x in (0.0, 100.0))
    text = nodes_of(places) + "".join(f"{'*ELEMENT, TYPE=' + kind + ', ELSET=W' if k == 0 else ''}\n{k + 1}, {', '.join(map(str, w))}" for k, w in enumerate(wedges))
    text += "\n" + steel(0.0) + "*SOLID SECTION, ELSET=W, MATERIAL=STEEL\n" + nset("LEFT", left) + "*BOUNDARY\nLEFT, 1, 3\n" + STATIC
    pull = block("*DLOAD", [(len(wedges) - 1, "P2", -10.0), (len(wedges), "P2", -10.0)])
    tip = node(100.0, 4.0, 6.0)
    assert moved(tmp_path / "a.inp", text + pull, places, tip)[0][0] == pytest.approx(10 * 100 / E, rel=1e-9)
    if second:
        found = moved(tmp_path / "a.inp", text + block("*CLOAD", [(n, 3, 1.0 / len(right)) for n in right]), places, tip)[0][2]
        assert found == pytest.approx(100**3 / 3 / E / (4 * 6**3 / 12) + 1.2 * 100 / (E / 2) / 24, rel=2e-2)
