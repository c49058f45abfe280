"""Shells of mesh files, and what joins shells to other bodies, held against closed forms and grids of our own."""

import math

import numpy as np
import pytest

import espalier

YOUNG, DENSITY = 210e9, 7850.0


def grid(nx, ny, lx=1.0, ly=0.2):
    """Nodes by label, and quadrilaterals by labels."""
    nodes = {j * (nx + 1) + i + 1: (lx * i / nx, ly * j / ny, 0.0) for j in range(ny + 1) for i in range(nx + 1)}
    quads = [(a, a + 1, a + nx + 2, a + nx + 1) for j in range(ny) for i in range(nx) for a in (j * (nx + 1) + i + 1,)]
    return nodes, quads


def deck(path, nodes, elements, section="0.01", parameters="", sets=None):
    """elements: {type: lists of labels}."""
    text, label = "*NODE\n" + "".join(f"{k},{x!r},{y!r},{z!r}\n" for k, (x, y, z) in nodes.items()), 1
    for kind, lists in elements.items():
        text += f"*ELEMENT,TYPE={kind},ELSET=ALL\n"
        for own in lists:
            text += f"{label}," + ",".join(map(str, own)) + "\n"
            label += 1
    for name, members in (sets or {}).items():
        text += f"*NSET,NSET={name}\n" + "".join(f"{m},\n" for m in members)
    text += f"*MATERIAL,NAME=STEEL\n*ELASTIC\n{YOUNG},0\n*DENSITY\n{DENSITY}\n*SHELL SECTION,ELSET=ALL,MATERIAL=STEEL{parameters}\n{section}\n"
    path.write_text(text)
    return str(path)


def ends(nodes):
    most = max(x for x, _, _ in nodes.values())
    return {"ROOT": [k for k, p in nodes.items() if p[0] == 0], "TIP": [k for k, p in nodes.items() if p[0] == most]}


def cantilever(body, root, tip, force=(0, 0, -1.0), quantities=("tip.position.z",)):
    model = espalier.Model({"bodies": {"s": body}, "markers": {"tip": {"body": "s", **tip}},
                            "supports": {"wall": {"body": "s", **root, "hold": "all"}},
                            "forces": {"load": {"type": "load", "a": "tip", "force": list(force)}},
                            "statics": {"linear": True}, "output": {"quantities": list(quantities)}})
    return model.run()


def moved(body, root, tip, force=(0, 0, -1.0), rest=(1, 0.1, 0)):
    """Displacement of the tip for a force of 1 along `force`."""
    result = cantilever(body, root, tip, [1e3 * f for f in force], [f"tip.position.{a}" for a in "xyz"])
    return [(result.summary["values"][f"tip.position.{a}"] - x) / 1e3 for a, x in zip("xyz", rest)]


def of_file(path, **keys):
    return {"type": "shell", "mesh": {"file": path}, **keys}


MATERIAL = {"young": YOUNG, "poisson": 0, "density": DENSITY}
STRIP = {"type": "shell", "x": [1, 0, 0], "y": [0, 0.2, 0], "nx": 10, "ny": 2, "thickness": 0.01, "material": MATERIAL}
INERTIA = 0.2 * 0.01**3 / 12
ROOT, TIP = {"nodes": "ROOT"}, {"nodes": "TIP", "attach": "mean"}


def test_a_deck_of_quadrilaterals_is_the_grid_of_our_own(tmp_path):
    nodes, quads = grid(10, 2)
    path = deck(tmp_path / "s.inp", nodes, {"S4R": quads}, sets=ends(nodes))
    own = moved(STRIP, {"edge": "x0"}, {"edge": "x1", "attach": "mean"})
    assert moved(of_file(path), ROOT, TIP) == pytest.approx(own, rel=1e-9, abs=1e-15)
    assert own[2] == pytest.approx(-1 / (3 * YOUNG * INERTIA), rel=5e-3)
    whole = espalier.Model({"bodies": {"s": of_file(path)}}).modes(9)["frequency"][6:]
    assert whole == pytest.approx(espalier.Model({"bodies": {"s": STRIP}}).modes(9)["frequency"][6:], rel=1e-8)


def triangles(quads):
    return [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]


def second_order(nodes, elements):
    """The same with nodes in the middles of edges."""
    nodes, known, out = dict(nodes), {}, []
    for own in elements:
        mids = []
        for a, b in zip(own, own[1:] + own[:1]):
            edge = (min(a, b), max(a, b))
            if edge not in known:
                known[edge] = len(nodes) + 1
                nodes[known[edge]] = tuple((p + q) / 2 for p, q in zip(nodes[a], nodes[b]))
            mids.append(known[edge])
        out.append(tuple(own) + tuple(mids))
    return nodes, out


@pytest.mark.parametrize("kind, make, tolerance", [
    ("S3", lambda n, q: (n, triangles(q)), 0.02), ("S6", lambda n, q: second_order(n, triangles(q)), 0.02),
    ("S8R", second_order, 0.005)])
def test_other_elements_become_quadrilaterals(tmp_path, kind, make, tolerance):
    nodes, elements = make(*grid(8, 2))
    path = deck(tmp_path / "s.inp", nodes, {kind: elements}, sets=ends(nodes))
    result = cantilever(of_file(path), ROOT, TIP, quantities=["tip.position.z", "s.strain_energy"])
    assert result.summary["values"]["tip.position.z"] == pytest.approx(-1 / (3 * YOUNG * INERTIA), rel=tolerance)
    body = espalier.Model({"bodies": {"s": of_file(path)}, "markers": {"all": {"body": "s", "nodes": "boundary", "attach": "mean"}}}).reduce(modes=1, interfaces=["all"])
    assert body.total_mass == pytest.approx(0.2 * 0.01 * DENSITY, rel=1e-12)
    assert len(body.nodes) == (85 if kind == "S8R" else 117)  # corners, edges, elements


def test_triangles_and_quadrilaterals_meet(tmp_path):
    nodes, quads = grid(6, 2)
    path = deck(tmp_path / "s.inp", nodes, {"S3": triangles(quads[::2]), "S4": quads[1::2]}, sets=ends(nodes))
    assert moved(of_file(path), ROOT, TIP)[2] == pytest.approx(-1 / (3 * YOUNG * INERTIA), rel=0.02)


# An axial force at the nodes, at a distance e from the middle, bends: w = F e L^2 / (2 E I) upwards or downwards.
@pytest.mark.parametrize("offset, parameters, distance", [(None, ",OFFSET=SNEG", 0.005), (None, ",OFFSET=1.5", -0.015),
                                                          (0.02, "", 0.02)])
def test_offset_couples_stretch_and_bending(tmp_path, offset, parameters, distance):
    nodes, quads = grid(10, 2)
    path = deck(tmp_path / "s.inp", nodes, {"S4": quads}, parameters=parameters, sets=ends(nodes))
    body = of_file(path) if offset is None else of_file(path, offset=offset)
    x, _, z = moved(body, ROOT, TIP, (1, 0, 0))
    assert z == pytest.approx(distance / (2 * YOUNG * INERTIA), rel=2e-3)
    assert x == pytest.approx(1 / (YOUNG * 0.002) + distance**2 / (YOUNG * INERTIA), rel=2e-3)


def test_a_grid_has_an_offset_too():
    x, _, z = moved({**STRIP, "offset": 0.02}, {"edge": "x0"}, {"edge": "x1", "attach": "mean"}, (1, 0, 0))
    assert z == pytest.approx(0.02 / (2 * YOUNG * INERTIA), rel=2e-3)
    # Nodes that are held in place and against rotation, one by one: the same.
    held = espalier.Model({"bodies": {"s": {**STRIP, "offset": 0.02}}, "supports": {"a": {"body": "s", "edge": "x0", "hold": "xyz", "rotations": "xyz"}},
                           "markers": {"m": {"body": "s", "edge": "x1", "attach": "mean"}}, "forces": {"f": {"type": "load", "a": "m", "force": [1, 0, 0]}},
                           "statics": {"linear": True}, "output": {"quantities": ["m.position.x", "m.position.z"]}}).run().summary["values"]
    assert held["m.position.z"] == pytest.approx(z, rel=1e-4) and held["m.position.x"] - 1 == pytest.approx(x, rel=1e-4)


def test_thickness_varies():
    """w = integral of F (L - x)^2 / (E I(x))."""
    x = (np.arange(20000) + 0.5) / 20000
    truth = -np.mean((1 - x) ** 2 / (YOUNG * 0.2 * (0.02 - 0.01 * x) ** 3 / 12))
    tapered = {**STRIP, "nx": 20, "thickness": [0.02, 0.01, 0.01, 0.02]}
    assert moved(tapered, {"edge": "x0"}, {"edge": "x1", "attach": "mean"})[2] == pytest.approx(truth, rel=5e-3)
    with pytest.raises(espalier.Error, match="four corners"):
        espalier.Model({"bodies": {"s": {**STRIP, "thickness": [0.1, 0.2]}}}).check()


def test_thickness_by_sections_of_the_deck(tmp_path):
    """A step at the middle, which is smeared over the elements beside it: half the error with half their length."""
    thick, thin = YOUNG * INERTIA * 8, YOUNG * INERTIA
    truth, errors = -((1 - 0.125) / 3 / thick + 0.125 / 3 / thin), []
    for n in (20, 40):
        nodes, quads = grid(n, 2)
        path = deck(tmp_path / f"s{n}.inp", nodes, {"S4": quads}, sets=ends(nodes))
        left = [k + 1 for k, q in enumerate(quads) if nodes[q[0]][0] < 0.4999]
        right = sorted(set(range(1, len(quads) + 1)) - set(left))
        text = open(path).read().replace("ELSET=ALL,MATERIAL=STEEL\n0.01\n", "ELSET=thick,MATERIAL=Steel\n0.02\n*SHELL SECTION,ELSET=THIN,MATERIAL=STEEL\n0.01\n")
        text += "".join(f"*ELSET,ELSET={name}\n" + "".join(f"{m},\n" for m in members) for name, members in (("Thick", left), ("THIN", right)))
        open(path, "w").write(text)
        result = cantilever(of_file(path), ROOT, TIP)
        errors.append(1 - result.summary["values"]["tip.position.z"] / truth)
        assert any("thicknesses from 0.01 to 0.02" in note for note in result.summary["notices"])
    assert 0 < errors[0] < 0.06 and errors[1] == pytest.approx(errors[0] / 2, rel=0.1)


# Up 1, then along 0.5: a force F down at the end bends the column by F b, which turns the arm and moves its end down by
# F b^2 h / (E I) + F b^3 / (3 E I), and along by F b h^2 / (2 E I).
@pytest.mark.parametrize("angle", [90, 45])
def test_a_fold_is_stiff(tmp_path, angle):
    nodes, quads = grid(60, 2, 1.5)  # elements at a fold are stiff
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    folded = {k: (x, y, z) if x <= 1 else (1 + (x - 1) * c, y, (x - 1) * s) for k, (x, y, z) in nodes.items()}
    tip = [k for k, p in nodes.items() if p[0] == 1.5]
    path = deck(tmp_path / "s.inp", folded, {"S4": quads}, sets={"ROOT": [k for k, p in nodes.items() if p[0] == 0], "TIP": tip})
    x, _, z = moved(of_file(path), ROOT, TIP, (-s, 0, c), (1 + 0.5 * c, 0.1, 0.5 * s))  # across the arm
    bending = YOUNG * INERTIA
    # work by a unit moment line: m(t) on the arm is t; on the root part 0.5 + c * (distance from the fold)
    t = (np.arange(20000) + 0.5) / 20000
    truth = 0.5**3 / (3 * bending) + np.mean((0.5 + c * t) ** 2) / bending
    assert -s * x + c * z == pytest.approx(truth, rel=0.02)


def test_what_is_no_shell_is_refused(tmp_path):
    nodes, quads = grid(2, 1)
    nodes[7], nodes[8] = (0.5, 0, 0.3), (0.5, 0.2, 0.3)
    path = deck(tmp_path / "t.inp", nodes, {"S4": quads + [(2, 5, 8, 7)]})
    with pytest.raises(espalier.Error, match="3 elements meet at the edge from node 2 to 5"):
        espalier.Model({"bodies": {"s": of_file(path)}}).modes(1)
    nodes, quads = grid(2, 1)
    wrong = {"twice": [(1, 2, 2, 4), quads[1]], "has no area|is folded": [(1, 2, 4, 5), quads[1]]}
    for message, elements in wrong.items():
        with pytest.raises(espalier.Error, match=message):
            espalier.Model({"bodies": {"s": of_file(deck(tmp_path / "w.inp", nodes, {"S4": elements}))}}).modes(1)
    with pytest.raises(espalier.Error, match="folded .* at node 5"):
        espalier.Model({"bodies": {"s": of_file(deck(tmp_path / "c.inp", {**nodes, 5: (0.1, 0.05, 0)}, {"S4": quads}))}}).modes(1)
    nodes3, quads3 = grid(3, 1)
    strip = [quads3[0], quads3[1], (3, 5, 1, 7)]
    with pytest.raises(espalier.Error, match="Moebius|folded"):
        espalier.Model({"bodies": {"s": of_file(deck(tmp_path / "m.inp", nodes3, {"S4": strip}))}}).modes(1)
    path = deck(tmp_path / "u.inp", nodes, {"S4": quads})
    for keys, message in ((dict(element_set="NO"), "NO"), (dict(nx=3), "does not go with 'mesh'"), (dict(thickness=-1), "thickness")):
        with pytest.raises(espalier.Error, match=message):
            espalier.Model({"bodies": {"s": of_file(path, **keys)}}).modes(1)
    text = open(path).read()
    open(path, "w").write(text[:text.index("*SHELL")])
    with pytest.raises(espalier.Error, match="needs 'thickness'"):
        espalier.Model({"bodies": {"s": of_file(path)}}).modes(1)
    with pytest.raises(espalier.Error, match="states none for its shells"):
        espalier.Model({"bodies": {"s": of_file(path, thickness=0.01)}}).modes(1)
    with pytest.raises(espalier.Error, match="has no 'LEFT'"):
        espalier.Model({"bodies": {"s": of_file(path, thickness=0.01, material=MATERIAL)},
                        "supports": {"a": {"body": "s", "nodes": "LEFT", "hold": "all"}}}).modes(1)


def test_nastran_shells_with_their_offset(tmp_path):
    nodes, quads = grid(10, 2)
    lines = [f"GRID,{k},,{x!r},{y!r},{z!r}" for k, (x, y, z) in nodes.items()]
    lines += [f"CQUAD4,{k + 1},7,{a},{b},{c},{d},,0.02" for k, (a, b, c, d) in enumerate(quads)]
    lines += ["PSHELL,7,3,0.01", f"MAT1,3,{YOUNG},,0.,{DENSITY}"]
    root, tip = ends(nodes).values()
    lines += [f"SPC,1,{k},123,0." for k in root] + [f"FORCE,2,{k},,1.,1.,0.,0." for k in tip]
    path = tmp_path / "s.bdf"
    path.write_text("BEGIN BULK\n" + "\n".join(lines) + "\nENDDATA\n")
    x, _, z = moved(of_file(str(path)), {"nodes": "SPC-1"}, {"nodes": "FORCE-2", "attach": "mean"}, (1, 0, 0))
    assert z == pytest.approx(0.02 / (2 * YOUNG * INERTIA), rel=2e-3)


def test_normals_are_made_to_agree(tmp_path):
    nodes, quads = grid(6, 2)
    path = deck(tmp_path / "s.inp", nodes, {"S4": [q if k % 3 else q[::-1] for k, q in enumerate(quads)]}, sets=ends(nodes))
    result = cantilever(of_file(path), ROOT, TIP, quantities=["tip.position.z"])
    assert result.summary["values"]["tip.position.z"] == pytest.approx(-1 / (3 * YOUNG * INERTIA), rel=1e-2)
    assert any("normals of" in n for n in result.summary["notices"])


def test_stresses_at_the_surfaces_and_pressure_of_a_deck(tmp_path):
    """sigma = +-6 M / (b h^2) at the root of a cantilever under pressure, M = p b L^2 / 2; the page is written."""
    nodes, quads = grid(40, 2)
    path = deck(tmp_path / "s.inp", nodes, {"S4": quads}, sets=ends(nodes))
    model = espalier.Model({"bodies": {"s": of_file(path)}, "supports": {"wall": {"body": "s", "nodes": "ROOT", "hold": "all"}},
                            "forces": {"wind": {"type": "pressure", "body": "s", "face": "top", "pressure": 10}},
                            "statics": {"linear": True},
                            "output": {"quantities": ["s[ROOT top].stress.xx.mean", "s[ROOT bottom].stress.xx.mean", "s[node 41].stress.xx",
                                                      "wall.force.z", "s[ALL].strain_energy"]}})
    values = model.run(out=str(tmp_path / "out")).summary["values"]
    stress = 6 * (10 * 0.2 / 2) / (0.2 * 0.01**2)
    assert values["s[ROOT top].stress.xx.mean"] == pytest.approx(stress, rel=0.03)
    assert values["s[ROOT bottom].stress.xx.mean"] == pytest.approx(-stress, rel=0.03)
    assert values["wall.force.z"] == pytest.approx(2.0, rel=1e-6)
    assert (tmp_path / "out" / "index.html").stat().st_size > 10000


# Half of a cantilever is a solid, half a shell, welded edge to face; the truth is a beam of one section.
def test_a_shell_welded_to_a_solid(tmp_path):
    solid = {"type": "solid", "mesh": {"part": "block", "lx": 0.5, "ly": 0.2, "lz": 0.01, "divisions": [10, 2, 1]}, "hex8": "shell", "material": MATERIAL}
    shell = {"type": "shell", "origin": [0.5, 0, 0.005], "x": [0.5, 0, 0], "y": [0, 0.2, 0], "nx": 5, "ny": 2, "thickness": 0.01, "material": MATERIAL}
    model = espalier.Model({"bodies": {"a": solid, "b": shell}, "supports": {"wall": {"body": "a", "face": "x0", "hold": "all"}},
                            "joints": {"weld": {"type": "fixed", "a": {"body": "a", "face": "x1"}, "b": {"body": "b", "edge": "x0"}}},
                            "markers": {"tip": {"body": "b", "edge": "x1", "attach": "mean"}},
                            "forces": {"load": {"type": "load", "a": "tip", "force": [0, 0, -1]}},
                            "statics": {"linear": True}, "output": {"quantities": ["tip.position.z", "weld.force.z", "weld.moment.y"]}})
    values = model.run().summary["values"]
    assert values["tip.position.z"] - 0.005 == pytest.approx(-1 / (3 * YOUNG * INERTIA), rel=5e-3)
    assert abs(values["weld.force.z"]) == pytest.approx(1, rel=1e-6)
    assert abs(values["weld.moment.y"]) == pytest.approx(0.5, rel=1e-5)


def test_a_beam_welded_to_a_shell():
    beam = {"type": "beam", "start": [0.5, 0.1, 0], "end": [1, 0.1, 0], "y": [0, 1, 0], "elements": 4, "height": 0.2, "width": 0.01, "material": MATERIAL}
    shell = {**STRIP, "x": [0.5, 0, 0], "nx": 5}
    model = espalier.Model({"bodies": {"a": shell, "b": beam}, "supports": {"wall": {"body": "a", "edge": "x0", "hold": "all"}},
                            "joints": {"weld": {"type": "fixed", "a": {"body": "a", "edge": "x1"}, "b": {"body": "b", "node": 1}}},
                            "markers": {"tip": {"body": "b", "node": -1}},
                            "forces": {"load": {"type": "load", "a": "tip", "force": [0, 0, -1]}},
                            "statics": {"linear": True}, "output": {"quantities": ["tip.position.z"]}})
    assert model.run().summary["values"]["tip.position.z"] == pytest.approx(-1 / (3 * YOUNG * INERTIA), rel=5e-3)


def test_an_edge_moment_bends_to_a_parabola():
    model = espalier.Model({"bodies": {"s": STRIP}, "supports": {"wall": {"body": "s", "edge": "x0", "hold": "all"}},
                            "markers": {"tip": {"body": "s", "edge": "x1", "attach": "mean"}},
                            "forces": {"load": {"type": "load", "a": "tip", "moment": [0, 1, 0]}},
                            "statics": {"linear": True}, "output": {"quantities": ["tip.position.z"]}})
    assert model.run().summary["values"]["tip.position.z"] == pytest.approx(-1 / (2 * YOUNG * INERTIA), rel=2e-3)


HINGE = {"a": {"body": "ground", "point": [0, 0.025, 0], "axis": [0, 1, 0]}, "b": {"body": "s", "edge": "x0", "axis": [0, 1, 0]}}


def hinged(joint):
    """Frequencies of a strip with one edge hinged: one motion without stiffness, then (b L)^2 sqrt(E I / m) / L^2 / (2 pi)."""
    model = espalier.Model({"bodies": {"s": {**STRIP, "nx": 24, "y": [0, 0.05, 0], "ny": 1}}, **joint})
    return model.modes(6)["frequency"]


@pytest.mark.parametrize("joint", [
    {"supports": {"hinge": {"body": "s", "edge": "x0", "hold": "xyz"}}},
    {"joints": {"hinge": {"type": "revolute", "attach": "mean", **HINGE}}},
    {"joints": {"hinge": {"type": "revolute", "attach": "rigid", **HINGE}}}])
def test_a_hinged_edge(joint):
    found = hinged(joint)
    speed = math.sqrt(YOUNG * 0.01**2 / 12 / DENSITY) / (2 * math.pi)
    truth = [3.926602**2 * speed, 7.068583**2 * speed]
    assert found[0] < 1e-2 * found[1]
    for f in truth:  # others bend in the plane and twist
        assert np.abs(found / f - 1).min() < 1e-2


def test_an_edge_welded_to_a_rigid_body():
    """A strip with a heavy block at its end: f = sqrt(3 E I / (L^3 (M + 33/140 m))) / (2 pi) for a block without extent."""
    model = espalier.Model({"bodies": {"s": STRIP, "r": {"type": "rigid", "mass": 100, "box": [1e-3, 1e-3, 1e-3], "position": [1, 0.1, 0]}},
                            "supports": {"wall": {"body": "s", "edge": "x0", "hold": "all"}},
                            "joints": {"weld": {"type": "fixed", "a": "r", "b": {"body": "s", "edge": "x1"}}}})
    truth = math.sqrt(3 * YOUNG * INERTIA / (100 + 33 / 140 * 0.002 * DENSITY)) / (2 * math.pi)
    assert model.modes(1)["frequency"][0] == pytest.approx(truth, rel=5e-3)


def test_a_frame_of_two_beams():
    """An L of round tubes under a force out of its plane: F (a^3 + b^3) / (3 E I) + F a^2 b / (G J)."""
    r, a, b = 0.01, 0.6, 1.0
    material = {"young": YOUNG, "poisson": 0.25, "density": DENSITY}
    beam = {"type": "beam", "radius": r, "elements": 8, "material": material}
    model = espalier.Model({"bodies": {"p": {**beam, "start": [0, 0, 0], "end": [b, 0, 0]}, "q": {**beam, "start": [b, 0, 0], "end": [b, a, 0]}},
                            "joints": {"wall": {"type": "fixed", "a": "ground", "b": {"body": "p", "node": 1}},
                                       "corner": {"type": "fixed", "a": {"body": "p", "node": -1}, "b": {"body": "q", "node": 1}}},
                            "markers": {"tip": {"body": "q", "node": -1}},
                            "forces": {"load": {"type": "load", "a": "tip", "force": [0, 0, -1]}},
                            "statics": {"linear": True}, "output": {"quantities": ["tip.position.z"]}})
    area = math.pi * r**4 / 4
    truth = -(a**3 + b**3) / (3 * YOUNG * area) - a * a * b / (YOUNG / 2.5 * 2 * area)
    assert model.run().summary["values"]["tip.position.z"] == pytest.approx(truth, rel=2e-3)


def test_shells_of_other_files_and_pieces(tmp_path):
    """The same cantilever out of Gmsh, MEDIT and VTK; two strips that share no node."""
    nodes, quads = grid(10, 2)
    cells = "".join(f"{k + 1} 3 2 2 2 {' '.join(map(str, q))}\n" for k, q in enumerate(quads))
    (tmp_path / "s.msh").write_text(
        '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 1 "root"\n2 2 "plate"\n$EndPhysicalNames\n'
        f"$Nodes\n{len(nodes)}\n" + "".join(f"{k} {x} {y} {z}\n" for k, (x, y, z) in nodes.items())
        + f"$EndNodes\n$Elements\n{len(quads) + 2}\n{cells}98 1 2 1 1 1 12\n99 1 2 1 1 12 23\n$EndElements\n")
    (tmp_path / "s.mesh").write_text(
        f"MeshVersionFormatted 1\nDimension 3\nVertices\n{len(nodes)}\n" + "".join(f"{x} {y} {z} {5 if x == 0 else 0}\n" for x, y, z in nodes.values())
        + f"Quadrilaterals\n{len(quads)}\n" + "".join(" ".join(map(str, q)) + " 1\n" for q in quads) + "End\n")
    (tmp_path / "s.vtk").write_text(
        f"# vtk DataFile Version 2.0\nstrip\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {len(nodes)} double\n"
        + "".join(f"{x} {y} {z}\n" for x, y, z in nodes.values()) + f"CELLS {len(quads)} {5 * len(quads)}\n"
        + "".join("4 " + " ".join(str(k - 1) for k in q) + "\n" for q in quads) + f"CELL_TYPES {len(quads)}\n" + "9\n" * len(quads)
        + f"POINT_DATA {len(nodes)}\nSCALARS end int 1\nLOOKUP_TABLE default\n" + "".join(f"{int(x == 0)}\n" for x, _, _ in nodes.values()))
    own = espalier.Model({"bodies": {"s": STRIP}, "supports": {"w": {"body": "s", "edge": "x0", "hold": "all"}}}).modes(3)["frequency"]
    for name, wall in (("s.msh", "root"), ("s.mesh", "vertex-5"), ("s.vtk", "end-1")):
        body = of_file(str(tmp_path / name), thickness=0.01, material=MATERIAL)
        found = espalier.Model({"bodies": {"s": body}, "supports": {"w": {"body": "s", "nodes": wall, "hold": "all"}}}).modes(3)["frequency"]
        assert found == pytest.approx(own, rel=1e-9), name
    apart = {**nodes, **{100 + k: (x, y + 1, z) for k, (x, y, z) in nodes.items()}}
    path = deck(tmp_path / "p.inp", apart, {"S4": quads + [tuple(100 + k for k in q) for q in quads]})
    result = espalier.Model({"bodies": {"s": of_file(path)}, "supports": {"w": {"body": "s", "nodes": "boundary", "hold": "all"}},
                             "statics": {"linear": True}}).run()
    assert any("falls into 2 pieces" in note for note in result.summary["notices"])
    assert not any("SHELL" in note for note in result.summary["notices"])


def weight(body, sets):
    """What supports at the sets carry of the weight, each."""
    model = espalier.Model({"gravity": [0, 0, -10], "bodies": {"s": body},
                            "supports": {f"w{k}": {"body": "s", "nodes": name, "hold": "all"} for k, name in enumerate(sets)},
                            "statics": {"linear": True}, "output": {"quantities": [f"w{k}.force.z" for k in range(len(sets))]}})
    values = model.run().summary["values"]
    return [values[f"w{k}.force.z"] for k in range(len(sets))]


def test_parts_whose_sets_have_one_name_keep_their_thickness(tmp_path):
    part = ("*PART, NAME={0}\n*NODE\n1,0,0,0\n2,0.5,0,0\n3,0.5,0.1,0\n4,0,0.1,0\n*ELEMENT,TYPE=S4,ELSET=ALL\n1,1,2,3,4\n"
            "*NSET,NSET=ROOT\n1,4\n*SHELL SECTION, ELSET=ALL, MATERIAL=STEEL\n{1}\n*END PART\n")
    path = tmp_path / "two.inp"
    path.write_text(part.format("A", 0.01) + part.format("B", 0.02) + "*ASSEMBLY, NAME=X\n*INSTANCE, NAME=A-1, PART=A\n*END INSTANCE\n"
                    "*INSTANCE, NAME=B-1, PART=B\n1,0,0\n*END INSTANCE\n*END ASSEMBLY\n"
                    f"*MATERIAL, NAME=STEEL\n*ELASTIC\n{YOUNG},0\n*DENSITY\n{DENSITY}\n")
    own = [DENSITY * 10 * 0.05 * t for t in (0.01, 0.02)]
    assert weight(of_file(str(path)), ["A-1.ROOT", "B-1.ROOT"]) == pytest.approx(own, rel=1e-6)


@pytest.mark.parametrize("parameters, section, message", [
    (",COMPOSITE", "0.005,3,OTHER,0", r"s.inp:\d+: layers of 'OTHER'"), (",NODAL THICKNESS", "0.01", "states none for element 1 at node")])
def test_sections_that_say_more_are_refused_and_the_text_may_say_all(tmp_path, parameters, section, message):
    nodes, quads = grid(2, 1)
    path = deck(tmp_path / "s.inp", nodes, {"S4": quads}, section, parameters, ends(nodes))
    with pytest.raises(espalier.Error, match=message):
        weight(of_file(path, **({} if "NODAL" in parameters else {"thickness": 0.01})), ["ROOT"])
    whole = of_file(path, thickness=0.01, material=MATERIAL, offset=0)
    assert weight(whole, ["ROOT"]) == pytest.approx([DENSITY * 10 * 0.2 * 0.01], rel=1e-6)


@pytest.mark.parametrize("more, shell, message", [
    ("", "3", None), ("", "", "no MID2"), ("", "4", "MID2"), ("", "3,4.", "12I"), ("", "3,,,,0.5", "NSM")])
def test_what_nastran_says_beside_the_thickness_is_not_dropped(tmp_path, more, shell, message):
    nodes, quads = grid(2, 1)
    lines = [f"GRID,{k},,{x!r},{y!r},{z!r}" for k, (x, y, z) in nodes.items()]
    lines += [f"CQUAD4,{k + 1},7,{a},{b},{c},{d},," + (",\n" + more if more else "") for k, (a, b, c, d) in enumerate(quads)]
    lines += [f"PSHELL,7,3,0.01,{shell}", f"MAT1,3,{YOUNG},,0.,{DENSITY}", f"MAT1,4,{YOUNG},,0.,{DENSITY}", "SPC,1,1,123,0.", "SPC,1,4,123,0."]
    path = tmp_path / "s.bdf"
    path.write_text("BEGIN BULK\n" + "\n".join(lines) + "\nENDDATA\n")
    model = espalier.Model({"bodies": {"s": of_file(str(path))}, "supports": {"w": {"body": "s", "nodes": "SPC-1", "hold": "all"}},
                            "statics": {"linear": True}})
    if message in (None, "no MID2"):
        assert [n for n in model.run().summary["notices"] if "MID2" in n] == ([] if message is None else [
            "s: property-7 has no MID2, which makes a membrane of it in Nastran: here it bends as well"])
    else:
        with pytest.raises(espalier.Error, match=message):
            model.run()


def test_an_offset_along_normals_of_both_sides_is_refused(tmp_path):
    nodes, quads = grid(6, 2)
    path = deck(tmp_path / "s.inp", nodes, {"S4": [q if k % 3 else q[::-1] for k, q in enumerate(quads)]}, parameters=",OFFSET=SNEG", sets=ends(nodes))
    with pytest.raises(espalier.Error, match="along the normal of each element"):
        weight(of_file(path), ["ROOT"])
    assert weight(of_file(path, offset=0.005), ["ROOT"]) == pytest.approx([DENSITY * 10 * 0.2 * 0.01], rel=1e-6)
