"""Reduced matrices for other programs: each is held against the nodal model, and each file is read back."""

import importlib.util
import json

import numpy as np
import pytest

import espalier

ARM = """
units = "SI"
[bodies.arm]
type = "solid"
mesh = { part = "block", lx = 0.4, ly = 0.04, lz = 0.03, divisions = [8, 1, 1] }
material = { young = 70e9, poisson = 0.33, density = 2700 }
position = [1, 2, 3]
rotation = { axis = [0, 0, 1], angle = "pi/2" }
damping = { mass = 2.0, stiffness = 1e-5 }
[markers]
hub = { body = "arm", face = "x0" }
tip = { body = "arm", face = "x1" }
mid = { body = "arm", near = [0.2, 0, 0] }
"""
UNDAMPED = ARM.replace("damping =", "# damping =")


def arm(**keys):
    return espalier.Model.from_text(ARM).reduce("arm", interfaces=["hub", "tip"], **keys)


def rigid_motions(body):
    """Of the interfaces and modes: unit translations, and rotations about the origin of the mesh."""
    out = np.zeros((len(body.mass), 6))
    for i in body.interfaces:
        for k in range(3):
            out[i.first_row + k, k] = 1
            turn = np.eye(3)[k]
            out[i.first_row:i.first_row + 3, 3 + k] = np.cross(turn, i.position)
            if i.components == 6:
                out[i.first_row + 3:i.first_row + 6, 3 + k] = turn
    return out


def frequencies(K, M):
    import scipy.linalg

    return np.sqrt(np.maximum(scipy.linalg.eigh(K, M, eigvals_only=True), 0)) / (2 * np.pi)


def test_rigid_motion_is_free_and_has_the_mass():
    body = arm(modes=6)
    rigid = rigid_motions(body)
    assert np.abs(body.stiffness @ rigid).max() < 1e-10 * np.abs(body.stiffness).max()
    mass = rigid.T @ body.mass @ rigid
    expected = 2700 * 0.4 * 0.04 * 0.03
    assert body.total_mass == pytest.approx(expected, rel=1e-12)
    assert mass[:3, :3] == pytest.approx(expected * np.eye(3), abs=1e-10)
    assert body.centre == pytest.approx((0.2, 0.02, 0.015), abs=1e-12)  # of a block with its corner at the origin
    x, y, z = body.centre
    assert mass[3, 3] == pytest.approx(expected * ((0.04**2 + 0.03**2) / 12 + y * y + z * z), rel=1e-9)
    assert body.position == (1, 2, 3)
    assert body.rotation == pytest.approx(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]), abs=1e-15)


def test_modes_converge_to_those_of_the_free_nodal_body():
    nodal = espalier.Model.from_text(UNDAMPED.split("[markers]")[0]).modes(10)["frequency"]
    few, many = (frequencies(b.stiffness, b.mass)[:10] for b in (arm(modes=4), arm(modes=30)))
    elastic = slice(6, 10)
    assert (many[:6] < 1e-2 * many[6]).all()
    assert many[elastic] == pytest.approx(nodal[elastic], rel=1e-4)
    assert (few[elastic] >= many[elastic] * (1 - 1e-9)).all()  # Ritz: never below


def test_fixed_interface_modes_are_those_of_the_clamped_arm():
    clamped = UNDAMPED + """
[joints.a]
type = "fixed"
attach = "mean"
a = "ground"
b = "hub"
[joints.b]
type = "fixed"
attach = "mean"
a = "ground"
b = "tip"
"""
    truth = espalier.Model.from_text(clamped.replace("position = [1, 2, 3]", "")).modes(3)["frequency"]
    assert arm(modes=5).frequencies[:3] == pytest.approx(truth, rel=1e-6)


def test_static_shapes_move_one_interface_and_damping_is_rayleighs():
    body = arm(modes=3)
    assert body.damping == pytest.approx(2.0 * body.mass + 1e-5 * body.stiffness, rel=1e-12)
    assert np.array_equal(body.stiffness, body.stiffness.T) and np.array_equal(body.mass, body.mass.T)
    assert body.mass[12:, 12:] == pytest.approx(np.eye(3))
    assert body.stiffness[12:, 12:] == pytest.approx(np.diag((2 * np.pi * body.frequencies) ** 2), rel=1e-9)
    # displacement along x of the hub's face: its nodes have x = 0
    on_hub = np.abs(body.node_positions[:, 0]) < 1e-12
    x = body.shapes[0::3][on_hub]
    assert x[:, 0].mean() == pytest.approx(1, abs=1e-9) and np.abs(x[:, 1:].mean(axis=0)).max() < 1e-9


def test_a_node_has_three_components_and_holes_in_holding_are_modes():
    body = espalier.Model.from_text(ARM).reduce(interfaces=["mid"], modes=4, first_node=501)
    assert [tuple(u) for u in body.unknowns[:4]] == [(501, 1), (501, 2), (501, 3), (502, 0)]
    assert (body.frequencies[:3] == 0).all() and len(body.frequencies) == 7 and body.frequencies[3] > 100


@pytest.mark.parametrize("change, message", [
    (dict(interfaces=["hub", "hup"]), "did you mean 'hub'"),
    (dict(interfaces=["hub", "hub2"]), "unknown marker"),
    (dict(interfaces=[]), "needs an interface"),
    (dict(interfaces=["hub"], modes=-1), "modes"),
    (dict(interfaces=["mid"], modes=0), "keep a mode at least"),
    (dict(interfaces=["hub"], first_node=10**9), "between 1 and 90000000"),
])
def test_what_does_not_fit_is_refused(change, message):
    with pytest.raises((ValueError, espalier.Error), match=message):
        espalier.Model.from_text(ARM).reduce("arm", **change)


def test_bodies_that_have_no_matrices_are_refused():
    model = espalier.Model.from_text('[bodies.r]\ntype = "rigid"\nmass = 1\nbox = [1, 1, 1]\n')
    with pytest.raises(espalier.Error, match="rigid"):
        model.reduce("r")
    with pytest.raises(espalier.Error, match="no flexible body"):
        model.reduce()
    corners = "".join(f'c{k} = {{ body = "arm", near = [0, {y}, {z}] }}\n' for k, (y, z) in enumerate(((0, 0), (0.04, 0), (0, 0.03), (0.04, 0.03))))
    with pytest.raises(espalier.Error, match="moves with the others"):  # all nodes of the hub's face, and their mean
        espalier.Model.from_text(ARM + corners).reduce("arm", interfaces=["hub", "c0", "c1", "c2", "c3"], modes=2)
    same = espalier.Model.from_text(ARM + 'again = { body = "arm", face = "x0" }\n').reduce("arm", interfaces=["hub", "again"], modes=2)
    assert [i.name for i in same.interfaces] == ["hub"]  # the same place counts once


def test_files_are_read_back_to_the_last_bit(tmp_path):
    body = arm(modes=5, first_node=101)
    files = body.write(tmp_path / "arm", ("op4", "op4-text", "dmig", "mtx", "npz"))
    assert len(files) == 8  # three of Matrix Market, and the map
    with np.load(tmp_path / "arm.npz") as data:
        assert np.array_equal(data["K"], body.stiffness) and np.array_equal(data["M"], body.mass)
        assert np.array_equal(data["C"], body.damping) and np.array_equal(data["shapes"], body.shapes)
        assert np.array_equal(data["unknowns"], body.unknowns)
        assert np.array_equal(data["interface_positions"], [i.position for i in body.interfaces])
        assert np.array_equal(data["mesh_positions"], body.node_positions)
    import scipy.io

    assert np.array_equal(scipy.io.mmread(tmp_path / "arm_k.mtx"), body.stiffness)
    assert np.array_equal(scipy.io.mmread(tmp_path / "arm_c.mtx"), body.damping)
    said = json.loads((tmp_path / "arm.json").read_text())
    assert said["units"] == "SI" and said["unknowns"] == body.unknowns.tolist()
    assert [i["node"] for i in said["interfaces"]] == [101, 102] and said["size"] == 17


@pytest.mark.parametrize("file", ["arm.op4", "arm_text.op4", "arm.bdf"])
def test_our_own_reader_takes_the_files_as_a_body(tmp_path, file):
    body = arm(modes=8)
    body.write(tmp_path / "arm", ("op4", "op4-text", "dmig"))
    nodes = [{"label": i.node, "position": list(i.position)} for i in body.interfaces]
    model = espalier.Model({"bodies": {"arm": {
        "type": "substructure", "stiffness": {"file": str(tmp_path / file), "name": "KAA"},
        "mass": {"file": str(tmp_path / file), "name": "MAA"}, "nodes": nodes}}})
    found = model.modes(9)["frequency"][6:]
    assert found == pytest.approx(frequencies(body.stiffness, body.mass)[6:9], rel=1e-7)


@pytest.mark.skipif(importlib.util.find_spec("pyNastran") is None, reason="pyNastran is not installed")
def test_pynastran_reads_what_we_write(tmp_path):
    from pyNastran.bdf.bdf import read_bdf
    from pyNastran.op4.op4 import read_op4

    body = arm(modes=6, first_node=101)
    body.write(tmp_path / "arm", ("op4", "op4-text", "dmig"))
    for file in ("arm.op4", "arm_text.op4"):
        read = read_op4(str(tmp_path / file))
        arrays = {k: np.asarray(v.data if hasattr(v, "data") and not isinstance(v, (tuple, np.ndarray)) else v[1]) for k, v in read.items()}
        for key, own in (("KAA", body.stiffness), ("MAA", body.mass), ("BAA", body.damping), ("TGA", body.shapes)):
            assert np.array_equal(arrays[key], own), (file, key)
    bulk = read_bdf(str(tmp_path / "arm.bdf"), punch=True, xref=False, validate=False, debug=None)
    places = [bulk.nodes[i.node].xyz for i in body.interfaces]
    assert np.allclose(places, [i.position for i in body.interfaces], rtol=1e-12, atol=0)

    def matrix(name):
        dense, rows, columns = bulk.dmig[name].get_matrix(is_sparse=False, apply_symmetry=True)
        order = {tuple(u): k for k, u in enumerate(body.unknowns.tolist())}
        out = np.zeros_like(body.mass)
        for r, row in rows.items():
            for c, column in columns.items():
                out[order[tuple(int(x) for x in row)], order[tuple(int(x) for x in column)]] = dense[r, c]
        return out

    for name, own in (("KAA", body.stiffness), ("MAA", body.mass), ("BAA", body.damping)):
        assert np.abs(matrix(name) - own).max() < 1e-11 * np.abs(own).max()
        assert np.array_equal(matrix(name) + matrix(name + "L"), own)
    own = frequencies(body.stiffness, body.mass)[6:]
    assert frequencies(matrix("KAA") + matrix("KAAL"), matrix("MAA") + matrix("MAAL"))[6:] == pytest.approx(own, rel=1e-12)
