"""espalier.harmonic and Model.harmonic against dense solutions and closed forms."""

import math
import warnings

import numpy as np
import pytest
import scipy.sparse as sp

import espalier as esp


def string(n):
    return sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n)).tocsc()


def dense(k, c, m, eta, f, frequency):
    w = 2 * math.pi * frequency
    return np.linalg.solve(k.toarray() * (1 + 1j * eta) + 1j * w * c.toarray() - w * w * m.toarray(), f)


@pytest.mark.parametrize("gyroscopic", [False, True])
def test_is_the_dense_answer(gyroscopic):
    n = 30
    rng = np.random.default_rng(3)
    k, m, c = string(n), sp.diags_array(1 + rng.random(n)).tocsr(), 0.02 * string(n).tocoo()
    if gyroscopic:
        c = c + sp.diags_array([0.1, -0.1], offsets=[1, -1], shape=(n, n))
    f = rng.random((n, 2)) + 1j * rng.random((n, 2))
    at = np.linspace(0.01, 0.3, 7)
    found = esp.harmonic(k, m, f, C=c, frequencies=at, loss_factor=0.01, observed=[5, 0], shapes_at=[at[2]], threads=2)
    assert found.response.shape == (7, 2, 2) and found.shapes.shape == (1, n, 2) and len(found) == 7
    np.testing.assert_array_equal(found.frequencies, at)
    assert found.solved.all() and (found.backward_errors < 1e-14).all() and found.factorizations == 7
    for p, frequency in enumerate(at):
        x = dense(k, c, m, 0.01, f, frequency)
        np.testing.assert_allclose(found.response[p], x[[5, 0]], rtol=1e-10)
    np.testing.assert_allclose(found.shapes[0], dense(k, c, m, 0.01, f, at[2]), rtol=1e-10)
    one = esp.harmonic(k, m, f[:, 1], C=c, frequencies=at, loss_factor=0.01, observed=[5, 0])
    assert one.response.shape == (7, 2)
    np.testing.assert_allclose(one.response, found.response[:, :, 1], rtol=1e-12)
    np.testing.assert_allclose(one.amplitudes * np.exp(1j * np.radians(one.phases)), one.response, rtol=1e-13)


@pytest.mark.parametrize("symmetry", ["lower", "upper"])
def test_triangles(symmetry):
    n = 20
    part = {"lower": sp.tril, "upper": sp.triu}[symmetry]
    f = np.eye(n)[0]
    whole = esp.harmonic(string(n), sp.eye_array(n), f, between=(0.01, 0.3), points=5)
    for layout in ("csc", "csr"):
        half = esp.harmonic(part(string(n)).asformat(layout), part(sp.eye_array(n)).asformat(layout), f,
                            between=(0.01, 0.3), points=5, symmetry=symmetry)
        np.testing.assert_allclose(half.response, whole.response, rtol=1e-12)


def test_a_tolerance_finds_the_peaks():
    n = 20
    found = esp.harmonic(string(n), sp.eye_array(n, format="csc"), np.eye(n)[0], between=(0.005, 0.33), points=300,
                         tolerance=1e-4, loss_factor=1e-4, observed=[0])
    assert found.complete, found.completeness
    assert found.resonances.shape == (n, 3) and found.checked_error <= 1e-4
    assert found.solved.sum() < len(found) and np.isnan(found.backward_errors[~found.solved]).all()
    k, m = string(n), sp.eye_array(n, format="csc")
    truth = np.array([dense(k, 0 * k, m, 1e-4, np.eye(n)[0], f)[0] for f in found.frequencies])
    assert (abs(found.response[:, 0] - truth) <= 1e-3 * np.maximum(abs(truth), 0.01 * np.median(abs(truth)))).all()


def test_a_resonance_without_damping_is_nan_and_a_warning():
    k, m = sp.csc_array([[4 * math.pi**2]]), sp.csc_array([[1.0]])
    with pytest.warns(esp.AccuracyWarning, match="resonance without damping"):
        found = esp.harmonic(k, m, [1.0], frequencies=[0.5, 1, 2])
    assert np.isnan(found.response[1, 0]) and np.isfinite(found.response[[0, 2], 0]).all()
    with pytest.raises(esp.SingularMatrixError):
        esp.harmonic(k, m, [1.0], frequencies=[1])


def test_refuses_what_cannot_be():
    k, m, f = string(4), sp.eye_array(4, format="csc"), np.ones(4)
    good = {"between": (0.1, 0.2), "points": 3}
    assert len(esp.harmonic(k, m, f, **good)) == 3
    for wrong in ({}, {**good, "frequencies": [1]}, {"frequencies": []}, {"frequencies": [2, 1]}, {"frequencies": [-1]},
                  {"frequencies": [math.nan]}, {"between": (0.2, 0.1)}, {"between": (-1, 1)}, {"between": (0, math.nan)},
                  {**good, "points": 1}, {**good, "tolerance": 2}, {**good, "loss_factor": -1}, {**good, "observed": [4]},
                  {**good, "observed": []}, {**good, "kind": "lu"}, {**good, "symmetry": "none"},
                  {"between": (0, 1), "logarithmic": True}, {**good, "shapes_at": [-1]}, {**good, "max_solves": 1}):
        with pytest.raises(ValueError):
            esp.harmonic(k, m, f, **wrong)
    for loads in (np.ones(3), np.zeros(4), np.full(4, math.nan), np.ones((4, 0)), 1.0):
        with pytest.raises(ValueError):
            esp.harmonic(k, m, loads, **good)
    with pytest.raises(ValueError, match="one size"):
        esp.harmonic(k, sp.eye_array(3, format="csc"), f, **good)
    with pytest.raises(TypeError, match="K is a dense array"):
        esp.harmonic(np.eye(4), m, f, **good)


def oscillator():
    model = esp.Model()
    model.body("bob", type="point", mass=2)
    model.input("u")
    law = "-800*bob.position.{0} - 3*bob.velocity.{0}"
    model.force("law", type="load", a={"body": "bob"},
                force=[law.format("x") + " + inputs.u", law.format("y"), law.format("z")])
    model.force("x", type="load", a={"body": "bob"}, force=[1, 0, 0], factor=0)
    model.force("y", type="load", a={"body": "bob"}, force=[0, 1, 0], factor=0)
    return model


def test_of_a_model():
    at = np.array([0.5, 2, 3.2, 5])
    w = 2 * math.pi * at
    truth = 1 / (800 + 3j * w - 2 * w * w)
    found = oscillator().harmonic(loads={"turning": {"x": 1, "y": -1j}, "inputs.u": 3}, frequencies=at,
                                  quantities=["bob.position", "bob.velocity.x"], shapes_at=[2])
    assert sorted(found.loads) == ["inputs.u", "turning"] and found.response.shape == (4, 4, 2) and found.notices == []
    np.testing.assert_allclose(found["bob.position.x", "turning"], truth, rtol=1e-9)
    np.testing.assert_allclose(found["bob.position.y", "turning"], -1j * truth, rtol=1e-9)
    np.testing.assert_allclose(found["bob.velocity.x", "inputs.u"], 3j * w * truth, rtol=1e-9)
    np.testing.assert_allclose(found.shapes[0, :3, found.loads.index("turning")], [truth[1], -1j * truth[1], 0], rtol=1e-9, atol=1e-18)
    with pytest.raises(KeyError, match="bob.position.x"):
        found["bob.position.w"]
    single = oscillator().harmonic(loads="x", between=(1, 2), points=3, quantities="bob.position.x", loss_factor=0.1)
    assert single["bob.position.x"].shape == (3,)
    w = 2 * math.pi * 1.5
    assert abs(single["bob.position.x"][1] * (-2 * w * w) - 1) > 0.01
    for wrong in ({"loads": "z"}, {"loads": []}, {"quantities": "bab.position"}, {"between": (2, 1)}, {"points": 1}):
        with pytest.raises(esp.InvalidInputError):
            oscillator().harmonic(**{"loads": "x", "between": (1, 2), "quantities": "bob.position.x", **wrong})


def test_of_a_model_text_with_its_own_section(tmp_path):
    model = oscillator()
    model.tree["harmonic"] = {"from": 1, "to": 6, "points": 6, "loads": ["x"], "quantities": ["bob.position.x"], "shapes": [3]}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = model.harmonic(points=11)
    assert len(found) == 11
    path = tmp_path / "model.toml"
    path.write_text(model.text)
    np.testing.assert_array_equal(esp.Model.load(path).harmonic(points=11).response, found.response)
    result = model.run(out=tmp_path / "out", progress=False)
    assert result.summary["method"] == "harmonic"
    assert (tmp_path / "out" / "harmonic.csv").exists() and (tmp_path / "out" / "harmonic_x.vtkhdf").exists()
