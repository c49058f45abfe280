"""Ties of shells to solids, to shells and to beams, node by node, and loads per length, held against closed forms."""

import math

import numpy as np
import pytest

import espalier

YOUNG, DENSITY, T, B = 210e9, 7850.0, 0.01, 0.2
MATERIAL = {"young": YOUNG, "poisson": 0, "density": DENSITY}
INERTIA = B * T**3 / 12
EDGE = {"edge": "x1", "attach": "mean"}


def plate(origin, x, y, nx, ny, **more):
    return {"type": "shell", "origin": origin, "x": x, "y": y, "nx": nx, "ny": ny, "thickness": T, "material": MATERIAL, **more}


def strip(start, length, nx, ny=2, z=0.0):
    return plate([start, 0, z], [length, 0, 0], [0, B, 0], nx, ny)


def block(length, nx, ny, nz=1, **more):
    return {"type": "solid", "mesh": {"part": "block", "lx": length, "ly": B, "lz": T, "divisions": [nx, ny, nz]}, "hex8": "shell" if nz == 1 else "enhanced",
            "material": MATERIAL, **more}


def run(bodies, ties, supports, forces, quantities, statics=None, **more):
    model = espalier.Model({"bodies": bodies, "ties": ties, "supports": supports, "forces": forces, "statics": {"linear": True} if statics is None else statics,
                            "output": {"quantities": quantities}, **more})
    return model.run().summary


def displaced(summary, marker, rest):
    return [summary["values"][f"{marker}.position.{a}"] - x for a, x in zip("xyz", rest)]


# Half of a cantilever is a solid, half a shell; nodes of one follow the other, whose mesh does not fit.
@pytest.mark.parametrize("solid_first, cells, nodes", [(True, (10, 2), 3), (True, (10, 3), 5), (False, (10, 4), 2)])
def test_half_solid_half_shell(solid_first, cells, nodes):
    bodies = {"a": block(0.5, *cells), "b": strip(0.5, 0.5, 10, nodes, 0.5 * T)}
    tie = {"body": "b", "edge": "x0", "to": {"body": "a", "face": "x1"}} if solid_first else {"body": "a", "face": "x1", "to": {"body": "b"}}
    summary = run(bodies, {"weld": tie}, {"wall": {"body": "a", "face": "x0", "hold": "all"}},
                  {"load": {"type": "load", "a": {"name": "tip", "body": "b", **EDGE}, "force": [0, 0, -1]}}, [f"tip.position.{a}" for a in "xyz"])
    assert displaced(summary, "tip", (1, B / 2, T / 2))[2] == pytest.approx(-1 / (3 * YOUNG * INERTIA), rel=5e-3)
    assert not any("stay free" in note for note in summary["notices"])


def test_both_sides_of_a_tie_deform():
    """A pulled strip gets narrower everywhere, also at the weld: u_y = -nu F / (E t); a rigid weld would hinder that."""
    material = {**MATERIAL, "poisson": 0.3}
    bodies = {"a": {**block(0.5, 5, 2), "material": material}, "b": {**strip(0.5, 0.5, 5, 2, 0.5 * T), "material": material}}
    force, narrow = 1e6, 0.3 * 1e6 / (YOUNG * B * T)
    summary = run(bodies, {"weld": {"body": "b", "edge": "x0", "to": {"body": "a", "face": "x1"}}},
                  {"wall": {"body": "a", "face": "x0", "hold": "x"}, "side": {"body": "a", "face": "y0", "hold": "y"}, "low": {"body": "a", "face": "z0", "hold": "z"},
                   "side2": {"body": "b", "edge": "y0", "hold": "y"}},
                  {"load": {"type": "line-load", "body": "b", "edge": "x1", "force": [force / B, 0, 0]}},
                  [f"{m}.position.{a}" for m in ("corner", "tip") for a in "xyz"],
                  markers={"corner": {"body": "b", "edge": ["x0", "y1"]}, "tip": {"body": "b", "edge": ["x1", "y1"]}})
    stretch = force / (YOUNG * B * T)
    assert displaced(summary, "corner", (0.5, B, T / 2))[:2] == pytest.approx([0.5 * stretch, -narrow * B], rel=1e-5)
    assert displaced(summary, "tip", (1, B, T / 2))[:2] == pytest.approx([stretch, -narrow * B], rel=1e-5)


def test_a_shell_stands_on_a_block():
    """A wall on a thick block, bent at its top: F h^3 / (3 E I), the block hardly moves."""
    solid = {"type": "solid", "mesh": {"part": "block", "lx": 0.4, "ly": B, "lz": 0.2, "divisions": [40, 2, 10]}, "material": {**MATERIAL, "young": 100 * YOUNG}}
    wall = plate([0.2, 0, 0.2], [0, 0, 0.3], [0, B, 0], 12, 2)
    summary = run({"a": solid, "b": wall}, {"weld": {"body": "b", "edge": "x0", "to": {"body": "a", "face": "z1"}}},
                  {"floor": {"body": "a", "face": "z0", "hold": "all"}},
                  {"load": {"type": "load", "a": {"name": "tip", "body": "b", **EDGE}, "force": [1, 0, 0]}}, [f"tip.position.{a}" for a in "xyz"])
    assert displaced(summary, "tip", (0.2, B / 2, 0.5))[0] == pytest.approx(0.3**3 / (3 * YOUNG * INERTIA), rel=0.02)


@pytest.mark.parametrize("slope", [0, 10, 30, 45, 60])
def test_a_wall_that_leans_turns_with_its_block(slope):
    """Nothing is loaded: a hub turns the block by half a radian, the wall goes with it as one rigid piece, whatever its slope to the block."""
    b, angle = math.radians(slope), 0.5
    top = [0.3 + 0.3 * math.sin(b), B / 2, 0.2 + 0.3 * math.cos(b)]
    solid = {"type": "solid", "mesh": {"part": "block", "lx": 0.6, "ly": B, "lz": 0.2, "divisions": [6, 2, 2]}, "material": MATERIAL}
    wall = plate([0.3, 0, 0.2], [0.3 * math.sin(b), 0, 0.3 * math.cos(b)], [0, B, 0], 4, 2)
    summary = run({"hub": {"type": "rigid", "mass": 1, "box": [1, 1, 1]}, "a": solid, "b": wall}, {"weld": {"body": "b", "edge": "x0", "to": {"body": "a", "face": "z1"}}}, {}, {},
                  [f"tip.position.{a}" for a in "xyz"], statics={}, markers={"tip": {"body": "b", **EDGE}},
                  joints={"turn": {"type": "rotation-motor", "bodies": ["ground", "hub"], "at": [0, 0, 0], "axis": [0, 1, 0], "motion": str(angle)},
                          "axle": {"type": "revolute", "bodies": ["ground", "hub"], "at": [0, 0, 0], "axis": [0, 1, 0]},
                          "clamp": {"type": "fixed", "a": {"body": "hub"}, "b": {"body": "a", "face": "x0"}}})
    x, z = top[0], top[2]
    assert [summary["values"][f"tip.position.{a}"] for a in "xyz"] == pytest.approx(
        [x * math.cos(angle) + z * math.sin(angle), B / 2, z * math.cos(angle) - x * math.sin(angle)], abs=1e-7)


def test_a_tie_of_nodes_to_their_own_faces_is_refused():
    with pytest.raises(espalier.InvalidInputError, match="ties nothing: the nodes belong to"):
        run({"a": block(0.5, 2, 2)}, {"weld": {"body": "a", "face": "x1", "to": {"body": "a", "face": "x1"}}}, {"wall": {"body": "a", "face": "x0", "hold": "all"}}, {}, ["wall.force.z"])


def test_a_sheet_on_a_solid_bends_with_it():
    """A sheet of t on a beam of h, over all of its top: one section of h + t, w = F L^3 / (3 E b (h + t)^3 / 12)."""
    h, t = 0.04, 0.01
    solid = {"type": "solid", "mesh": {"part": "block", "lx": 1.0, "ly": B, "lz": h, "divisions": [20, 1, 4]}, "material": MATERIAL}
    sheet = plate([0, 0, h + t / 2], [1, 0, 0], [0, B, 0], 20, 1)
    summary = run({"a": solid, "b": sheet}, {"glue": {"body": "b", "nodes": "all", "to": {"body": "a", "face": "z1"}}},
                  {"wall": {"body": "a", "face": "x0", "hold": "all"}, "wall2": {"body": "b", "edge": "x0", "hold": "x"}},
                  {"load": {"type": "load", "a": {"name": "tip", "body": "a", "face": "x1"}, "force": [0, 0, -1000]}}, [f"tip.position.{a}" for a in "xyz"])
    truth = 1000 / (3 * YOUNG * B * (h + t) ** 3 / 12)
    assert displaced(summary, "tip", (1, B / 2, h / 2))[2] == pytest.approx(-truth, rel=0.01)


def test_shells_go_on_in_each_other():
    bodies = {"a": strip(0, 0.5, 8, 3), "b": strip(0.5, 0.5, 8, 4)}
    for tie in ({"body": "b", "edge": "x0", "to": {"body": "a"}}, {"body": "a", "edge": "x1", "to": {"body": "b"}}):
        summary = run(bodies, {"weld": tie}, {"wall": {"body": "a", "edge": "x0", "hold": "all"}},
                      {"load": {"type": "load", "a": {"name": "tip", "body": "b", **EDGE}, "force": [0, 0, -1]}}, [f"tip.position.{a}" for a in "xyz"])
        assert displaced(summary, "tip", (1, B / 2, 0))[2] == pytest.approx(-1 / (3 * YOUNG * INERTIA), rel=5e-3)


# As a fold of one shell: F b^2 h / (E I) + F b^3 / (3 E I), at any angle; see test_shells.py.
@pytest.mark.parametrize("angle", [90, 60, 45, 20, -135])
def test_a_corner(angle):
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    bodies = {"a": strip(0, 1, 30), "b": plate([1, 0, 0], [0.5 * c, 0, 0.5 * s], [0, B, 0], 15, 3)}
    summary = run(bodies, {"weld": {"body": "b", "edge": "x0", "to": {"body": "a"}}}, {"wall": {"body": "a", "edge": "x0", "hold": "all"}},
                  {"load": {"type": "load", "a": {"name": "tip", "body": "b", **EDGE}, "force": [-s, 0, c]}}, [f"tip.position.{a}" for a in "xyz"])
    x, _, z = displaced(summary, "tip", (1 + 0.5 * c, B / 2, 0.5 * s))
    t = (np.arange(20000) + 0.5) / 20000
    truth = (0.5**3 / 3 + np.mean((0.5 + c * t) ** 2)) / (YOUNG * INERTIA)
    assert -s * x + c * z == pytest.approx(truth, rel=5e-3)


# The wall stands on nodes, and between them, where the element below it is stiff: an error of first order.
@pytest.mark.parametrize("nx, tolerance", [(20, 0.01), (21, 0.07), (61, 0.03)])
def test_a_tee(nx, tolerance):
    """A wall h on the middle of a floor L that is clamped at both ends: the floor turns by M L / (16 E I), M = F h."""
    bodies = {"floor": strip(0, 1, nx), "wall": plate([0.5, 0, 0], [0, 0, 0.4], [0, B, 0], 10, 3)}
    summary = run(bodies, {"weld": {"body": "wall", "edge": "x0", "to": {"body": "floor"}}},
                  {"left": {"body": "floor", "edge": "x0", "hold": "all"}, "right": {"body": "floor", "edge": "x1", "hold": "all"}},
                  {"load": {"type": "load", "a": {"name": "tip", "body": "wall", **EDGE}, "force": [1, 0, 0]}}, [f"tip.position.{a}" for a in "xyz"])
    truth = 0.4 * 0.4 / (16 * YOUNG * INERTIA) + 0.4**3 / (3 * YOUNG * INERTIA)
    assert displaced(summary, "tip", (0.5, B / 2, 0.4))[0] == pytest.approx(truth, rel=tolerance)


SIDE, LENGTH = 0.2, 1.0


def tube(n, nx):
    """Four walls of a square tube, each tied to the one before; corners are shared lines."""
    a = SIDE / 2
    corners = [(-a, -a), (a, -a), (a, a), (-a, a)]
    bodies = {}
    for k, ((y, z), (y1, z1)) in enumerate(zip(corners, corners[1:] + corners[:1])):
        bodies[f"w{k}"] = plate([0, y, z], [LENGTH, 0, 0], [0, y1 - y, z1 - z], nx, n)
    ties = {f"t{k}": {"body": f"w{k}", "edge": "y0", "to": {"body": f"w{(k + 3) % 4}"}} for k in range(4)}
    return bodies, ties, [((y1 - y) / SIDE, (z1 - z) / SIDE) for (y, z), (y1, z1) in zip(corners, corners[1:] + corners[:1])]


def test_a_box_of_shells_twists_by_bredt():
    """A torque as shear flow q = M / (2 a^2) on the end's edges turns a square tube, which does not warp, by M L / (G a^3 t)."""
    bodies, ties, ways = tube(6, 12)
    flow = 1.0
    forces = {f"f{k}": {"type": "line-load", "body": f"w{k}", "edge": "x1", "force": [0, flow * y, flow * z]} for k, (y, z) in enumerate(ways)}
    summary = run(bodies, ties, {f"s{k}": {"body": f"w{k}", "edge": "x0", "hold": "all"} for k in range(4)}, forces,
                  [f"m{k}.position.{a}" for k in range(4) for a in "xyz"],
                  markers={f"m{k}": {"body": f"w{k}", "edge": ["x1", "y0"]} for k in range(4)})
    turn = flow * 2 * SIDE**2 * LENGTH / (YOUNG / 2 * SIDE**3 * T)
    a = SIDE / 2
    for k, (y, z) in enumerate([(-a, -a), (a, -a), (a, a), (-a, a)]):
        moved = displaced(summary, f"m{k}", (LENGTH, y, z))
        assert moved[1:] == pytest.approx([-turn * z, turn * y], rel=0.03)


def test_a_box_of_shells_bends():
    """Pure bending by forces along the walls, sigma t = M c t / I with I = 2/3 a^3 t: w = M L^2 / (2 E I)."""
    bodies, ties, _ = tube(4, 10)
    stress = 1e6
    forces = {"low": {"type": "line-load", "body": "w0", "edge": "x1", "force": [-stress * T, 0, 0]},
              "high": {"type": "line-load", "body": "w2", "edge": "x1", "force": [stress * T, 0, 0]}}
    # Flanges alone: M = sigma t a^2; the walls at the sides bend with them by shear, at some distance from the end.
    moment = stress * T * SIDE * SIDE
    summary = run(bodies, ties, {f"s{k}": {"body": f"w{k}", "edge": "x0", "hold": "all"} for k in range(4)}, forces,
                  [f"m{k}.position.{a}" for k in range(4) for a in "xyz"],
                  markers={f"m{k}": {"body": f"w{k}", "edge": ["x1", "y0"]} for k in range(4)})
    down = np.mean([displaced(summary, f"m{k}", (LENGTH, 0, z))[2] for k, z in enumerate((-SIDE / 2, -SIDE / 2, SIDE / 2, SIDE / 2))])
    assert down == pytest.approx(-moment * LENGTH**2 / (2 * YOUNG * 2 / 3 * SIDE**3 * T), rel=0.03)


def beam(start, end, **more):
    return {"type": "beam", "start": start, "end": end, "y": [0, 1, 0], "elements": 10, "height": B, "width": T, "material": MATERIAL, **more}


def test_a_shell_goes_on_in_a_beam():
    summary = run({"a": strip(0, 0.5, 10), "b": beam([0.5, B / 2, 0], [1, B / 2, 0])}, {"weld": {"body": "a", "edge": "x1", "to": {"body": "b"}}},
                  {"wall": {"body": "a", "edge": "x0", "hold": "all"}},
                  {"load": {"type": "load", "a": {"name": "tip", "body": "b", "along": 1}, "force": [0, 0, -1]}}, [f"tip.position.{a}" for a in "xyz"])
    assert displaced(summary, "tip", (1, B / 2, 0))[2] == pytest.approx(-1 / (3 * YOUNG * INERTIA), rel=5e-3)


def test_a_stiffener_under_a_plate():
    """A rib of h_r below a narrow plate, each node of which follows it: the parallel axes of both."""
    rib, width = 0.04, 0.02
    narrow = plate([0, 0, 0], [1, 0, 0], [0, 0.04, 0], 20, 1)
    below = (rib + T) / 2
    bodies = {"p": narrow, "r": {**beam([0, 0.02, -below], [1, 0.02, -below]), "height": width, "width": rib, "elements": 20}}
    summary = run(bodies, {"weld": {"body": "p", "nodes": "all", "to": {"body": "r"}}}, {"wall": {"body": "r", "node": 1, "hold": "all"}},
                  {"load": {"type": "load", "a": {"name": "tip", "body": "r", "node": -1}, "force": [0, 0, -100]}}, [f"tip.position.{a}" for a in "xyz"])
    areas, heights = (0.04 * T, width * rib), (0.0, -below)
    centre = np.dot(areas, heights) / sum(areas)
    own = 0.04 * T**3 / 12 + width * rib**3 / 12
    inertia = own + sum(a * (h - centre) ** 2 for a, h in zip(areas, heights))
    assert displaced(summary, "tip", (1, 0.02, -below))[2] == pytest.approx(-100 / (3 * YOUNG * inertia), rel=0.02)


def test_tied_shells_move_as_one_body():
    """A corner that spins freely in space is hardly strained, and keeps its angular momentum."""
    bodies = {"a": strip(-0.3, 0.3, 4), "b": plate([0, 0, 0], [0, 0, 0.3], [0, B, 0], 4, 3)}
    for body in bodies.values():
        body.update(angular_velocity=[1, 2, 3], velocity=[0, 0, 0])
    momentum = []
    for end in (2e-3, 1.0):
        model = espalier.Model({"bodies": bodies, "ties": {"weld": {"body": "b", "edge": "x0", "to": {"body": "a"}}},
                                "integrator": {"method": "generalized-alpha", "step": 2e-3, "end": end},
                                "output": {"quantities": ["energy.kinetic", "a.strain_energy", "b.strain_energy", "a.angular_momentum", "b.angular_momentum"]}})
        values = model.run().summary["values"]
        assert values["a.strain_energy"] + values["b.strain_energy"] < 1e-5 * values["energy.kinetic"]
        momentum.append([values[f"a.angular_momentum.{k}"] + values[f"b.angular_momentum.{k}"] for k in "xyz"])
    assert momentum[1] == pytest.approx(momentum[0], rel=1e-4)


def test_a_tied_corner_turns_far():
    """A moment per length rolls the second wall to a quarter of a circle, whose angle to the first one is kept by the tie."""
    angle = math.pi / 2
    bodies = {"a": plate([-0.2, 0, 0], [0.2, 0, 0], [0, B, 0], 2, 1), "b": plate([0, 0, 0], [0, 0, 1], [0, B, 0], 20, 2)}
    moment = YOUNG * T**3 / 12 * angle / 1.0
    # The first wall is held as a whole: it is the tie that clamps the second.
    summary = run(bodies, {"weld": {"body": "b", "edge": "x0", "to": {"body": "a"}}}, {"hold": {"body": "a", "nodes": "all", "hold": "all"}},
                  {"load": {"type": "line-load", "body": "b", "edge": "x1", "moment": [0, moment, 0]}}, [f"tip.position.{a}" for a in "xyz"], statics={},
                  markers={"tip": {"body": "b", **EDGE}})
    x, _, z = displaced(summary, "tip", (0, B / 2, 0))
    assert (x, z) == pytest.approx((1 / angle, 1 / angle), rel=2e-3)


def test_what_cannot_be_tied_is_said():
    bodies = {"s": strip(0, 1, 4), "b": beam([1, B / 2, 0], [2, B / 2, 0]), "c": block(0.5, 4, 1), "far": strip(3, 1, 4)}
    for tie, message in (({"body": "b", "node": 1, "to": {"body": "s"}}, "turn with their sections"), ({"body": "s", "edge": "x1", "to": {"body": "c"}}, "needs 'face'"),
                         ({"body": "s", "edge": "x1", "to": {"body": "b", "face": "x0"}}, "no face sets"), ({"body": "far", "edge": "x0", "to": {"body": "s"}}, "ties nothing")):
        with pytest.raises(espalier.Error, match=message):
            espalier.Model({"bodies": bodies, "ties": {"t": tie}, "statics": {}}).run()


# Loads per length -----------------------------------------------------------------------------------------------------


def test_loads_per_length_on_an_edge():
    for load, truth in (({"force": [0, 0, -10]}, 10 * B / (3 * YOUNG * INERTIA)), ({"moment": [0, 10, 0]}, 10 * B / (2 * YOUNG * INERTIA)),
                        ({"force": [0, 0, -10], "factor": "2*3"}, 60 * B / (3 * YOUNG * INERTIA))):
        summary = run({"s": strip(0, 1, 10)}, {}, {"wall": {"body": "s", "edge": "x0", "hold": "all"}}, {"load": {"type": "line-load", "body": "s", "edge": "x1", **load}},
                      [f"tip.position.{a}" for a in "xyz"] + ["wall.force.z", "load.factor"], markers={"tip": {"body": "s", **EDGE}})
        assert displaced(summary, "tip", (1, B / 2, 0))[2] == pytest.approx(-truth, rel=5e-3)
        assert summary["values"]["wall.force.z"] == pytest.approx(-load.get("force", [0, 0, 0])[2] * B * eval(load.get("factor", "1")), abs=1e-6)


def test_loads_per_length_on_a_beam():
    """q L^4 / (8 E I) + q L^2 / (2 k G A) with one element, and m L^3 / (3 E I) with ten, whose error is 1 / (4 n^2)."""
    inertia, shear = 0.02**4 / 12, YOUNG / 2 * 0.02**2 * 10 / 12
    for n, load, truth, rel in ((1, {"force": [0, 0, -10]}, 10 / (8 * YOUNG * inertia) + 10 / (2 * shear), 1e-6), (10, {"moment": [0, 10, 0]}, 10 / (3 * YOUNG * inertia), 3e-3)):
        summary = run({"b": {**beam([0, 0, 0], [1, 0, 0]), "elements": n, "height": 0.02, "width": 0.02}}, {}, {"wall": {"body": "b", "node": 1, "hold": "all"}}, {"load": {"type": "line-load", "body": "b", **load}},
                      [f"tip.position.{a}" for a in "xyz"] + ["wall.force.z", "wall.moment.y"], markers={"tip": {"body": "b", "node": -1}})
        assert displaced(summary, "tip", (1, 0, 0))[2] == pytest.approx(-truth, rel=rel)


@pytest.mark.parametrize("part", [(0.5, 1), (0.33, 1), (0, 0.07), (0.61, 0.63)])
def test_a_load_on_a_part_of_a_beam(part):
    """From a to b, also where no nodes are: q (b - a) at the root, and that times (a + b) / 2."""
    a, b = part
    summary = run({"b": beam([0, 0, 0], [1, 0, 0])}, {}, {"wall": {"body": "b", "along": 0, "hold": "all"}},
                  {"load": {"type": "line-load", "body": "b", "along": list(part), "force": [0, 0, -10]}}, ["wall.force.z", "wall.moment.y"])
    assert summary["values"]["wall.force.z"] == pytest.approx(10 * (b - a), rel=1e-9)
    assert abs(summary["values"]["wall.moment.y"]) == pytest.approx(10 * (b - a) * (a + b) / 2, rel=1e-6)


def test_a_load_on_no_length_is_refused():
    with pytest.raises(espalier.InvalidInputError, match="no length"):
        run({"b": beam([0, 0, 0], [1, 0, 0])}, {}, {"wall": {"body": "b", "along": 0, "hold": "all"}},
            {"load": {"type": "line-load", "body": "b", "along": [0.5, 0.5], "force": [0, 0, -10]}}, ["wall.force.z"])


def follower_elastica(q, length, bending):
    """Place of the tip under a load q across the beam that turns with it: N' = Q t', Q' = -N t' - q, M' = -Q, t' = M / (E I), all zero at the tip."""
    n, h = 4000, length / 4000
    def rate(u):
        turn = u[2] / bending
        return np.array([u[1] * turn, -u[0] * turn - q, -u[1], turn, math.cos(u[3]), math.sin(u[3])])
    u = np.zeros(6)
    for _ in range(n):
        k1 = rate(u); k2 = rate(u - h / 2 * k1); k3 = rate(u - h / 2 * k2); k4 = rate(u - h * k3)
        u = u - h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    c, s = math.cos(-u[3]), math.sin(-u[3])
    return c * -u[4] - s * -u[5], s * -u[4] + c * -u[5]


@pytest.mark.parametrize("kind", ["beam", "shell"])
def test_a_load_that_turns_with_the_line(kind):
    """Across the line, 12 E I / L^3: far beyond small displacements. A shell gets it on both long edges."""
    bending = YOUNG * INERTIA
    q = 12 * bending
    if kind == "beam":
        bodies, where = {"b": beam([0, 0, 0], [1, 0, 0])}, {"along": 0, "hold": "all"}
        forces = {"load": {"type": "line-load", "body": "b", "force": [0, 0, q], "follower": True}}
        tip, rest = {"along": 1}, (0, 0, 0)
    else:
        bodies, where = {"b": strip(0, 1, 20)}, {"edge": "x0", "hold": "all"}
        forces = {f"load{k}": {"type": "line-load", "body": "b", "edge": f"y{k}", "force": [0, 0, q / 2], "follower": True} for k in (0, 1)}
        tip, rest = EDGE, (0, B / 2, 0)
    summary = run(bodies, {}, {"wall": {"body": "b", **where}}, forces, [f"tip.position.{a}" for a in "xyz"], statics={}, markers={"tip": {"body": "b", **tip}})
    x, _, z = displaced(summary, "tip", rest)
    truth = follower_elastica(q, 1.0, bending)
    assert (x, z) == pytest.approx(truth, abs=8e-3)
    assert truth[1] > 0.5  # far


def test_loads_per_length_where_there_is_no_line():
    bodies = {"s": strip(0, 1, 4), "c": block(0.5, 4, 1), "w": {"type": "cable", "start": [0, 0, 0], "end": [1, 0, 0], "radius": 0.01, "material": MATERIAL}}
    for load, message in (({"body": "c", "face": "x0"}, "no shell, beam or cable"), ({"body": "s"}, "say where"), ({"body": "s", "nodes": "all"}, "no line"),
                          ({"body": "w", "moment": [0, 0, 1]}, "no axes"), ({"body": "s", "edge": ["x0", "y0"]}, "no line")):
        with pytest.raises(espalier.Error, match=message):
            espalier.Model({"bodies": bodies, "forces": {"f": {"type": "line-load", "force": [1, 0, 0], **load}}, "statics": {}}).run()


def test_loads_per_length_have_their_unit():
    model = {"units": "mm-t-s", "bodies": {"s": {**strip(0, 1000, 4), "y": [0, 200, 0], "thickness": 10, "material": {"young": "210 GPa", "density": 7.85e-9}}},
             "supports": {"wall": {"body": "s", "edge": "x0", "hold": "all"}}, "statics": {"linear": True}, "output": {"quantities": ["wall.force.z"]}}
    load = {"type": "line-load", "body": "s", "edge": "x1", "force": "[0, 0, -2] kN/m"}
    assert espalier.Model({**model, "forces": {"f": load}}).run().summary["values"]["wall.force.z"] == pytest.approx(400, rel=1e-6)
    with pytest.raises(espalier.Error, match="dimension"):
        espalier.Model({**model, "forces": {"f": {**load, "force": "[0, 0, -2] kN"}}}).check()


def test_pressure_on_a_part_of_a_shell(tmp_path):
    from test_shells import deck, ends, grid, of_file
    nodes, quads = grid(10, 2)
    path = deck(tmp_path / "s.inp", nodes, {"S4": quads}, sets=ends(nodes))
    left = [k + 1 for k, q in enumerate(quads) if nodes[q[0]][0] < 0.29]
    open(path, "a").write("*ELSET,ELSET=PATCH\n" + "".join(f"{m},\n" for m in left))
    for face, area in (("PATCH top", 0.3 * B), ("patch bottom", -0.3 * B), ("top", B)):
        summary = run({"s": of_file(path)}, {}, {"wall": {"body": "s", "nodes": "ROOT", "hold": "all"}},
                      {"wind": {"type": "pressure", "body": "s", "face": face, "pressure": 10}}, ["wall.force.z"])
        assert summary["values"]["wall.force.z"] == pytest.approx(10 * area, rel=1e-6)
    with pytest.raises(espalier.Error, match="no 'PATHC'.*PATCH"):
        run({"s": of_file(path)}, {}, {"wall": {"body": "s", "nodes": "ROOT", "hold": "all"}}, {"wind": {"type": "pressure", "body": "s", "face": "PATHC top", "pressure": 10}}, [])


# Contact of small round shapes with large elements ---------------------------------------------------------------------


@pytest.mark.parametrize("place", [(0.5, 0.1), (0.31, 0.07)])
@pytest.mark.parametrize("kind", ["shell", "solid"])
def test_a_small_ball_does_not_fall_through_large_elements(kind, place):
    """A ball of 1 cm on elements of 50 cm, between all points of a rule: it comes to rest on them, its weight on the plate."""
    body = strip(0, 1, 2, 1) if kind == "shell" else {"type": "solid", "mesh": {"part": "block", "lx": 1.0, "ly": B, "lz": 0.1, "divisions": [2, 1, 1]}, "material": MATERIAL}
    top = T / 2 if kind == "shell" else 0.1
    radius, mass = 0.01, 0.5
    model = espalier.Model({"gravity": [0, 0, -10], "bodies": {"p": body, "ball": {"type": "rigid", "mass": mass, "inertia": [1e-4] * 3, "box": [0.02] * 3, "position": [*place, top + radius + 2e-3]}},
                            "supports": {"hold": {"body": "p", "nodes": "all", "hold": "all"} if kind == "shell" else {"body": "p", "face": "z0", "hold": "all"}},
                            "surfaces": {"plate": {"body": "p", "shape": "faces", **({"set": "top"} if kind == "shell" else {})}, "ball": {"body": "ball", "shape": "sphere", "radius": radius}},
                            "contacts": {"touch": {"surfaces": ["plate", "ball"], "stiffness": 3e9, "damping": 30.0}},
                            "integrator": {"method": "generalized-alpha", "step": 5e-4, "end": 0.06}, "output": {"quantities": ["ball.position.z", "touch.normal_force", "touch.points"]}})
    values = model.run().summary["values"]
    assert values["ball.position.z"] == pytest.approx(top + radius, abs=0.15 * radius)
    assert values["touch.normal_force"] == pytest.approx(mass * 10, rel=0.2)


def test_a_ball_that_is_much_too_small_is_refused():
    model = {"bodies": {"p": strip(0, 10, 4, 1), "ball": {"type": "rigid", "mass": 1, "inertia": [1, 1, 1], "position": [0, 0, 1]}}, "statics": {},
             "surfaces": {"plate": {"body": "p", "shape": "faces"}, "ball": {"body": "ball", "shape": "sphere", "radius": 1e-4}},
             "contacts": {"touch": {"surfaces": ["plate", "ball"], "stiffness": 1e9}}}
    with pytest.raises(espalier.Error, match="too small for its faces.*radius is 0.0001"):
        espalier.Model(model).run()
