"""Values along paths, and where stresses are largest: against single quantities, closed forms, the pictures of the page."""

import csv

import numpy as np
import pytest

import espalier as esp

BAR = """[bodies.bar]
type = "solid"
mesh = { part = "block", element = "hex20", lx = 10, ly = 1, lz = 1, divisions = [8, 1, 2] }
material = { young = 2e5, poisson = 0.0, density = 1 }
[joints.wall]
type = "fixed"
a = { body = "ground", point = [0, 0.5, 0.5] }
b = { body = "bar", face = "x0" }
[forces.tip]
type = "load"
a = { body = "bar", face = "x1" }
force = [0, 0, -1e-3]
[statics]
LINEAR
[output]
quantities = ["bar[5 0.5 1].stress.xx", "bar.stress.von_mises.max"]
[output.paths.top]
body = "bar"
through = [[2, 0.5, 1], [8, 0.5, 1], [12, 0.5, 1]]
points = 11
quantities = ["stress.xx", "strain.xx", "stress.von_mises"]
[output.paths.across]
body = "bar"
through = [[5, 0.5, 0], [5, 0.5, 1]]
points = 3
quantities = ["stress.xx", "strain"]
"""


@pytest.mark.parametrize("linear", [False, True])
def test_bending_along_and_across_a_bar(tmp_path, linear):
    (tmp_path / "bar.toml").write_text(BAR.replace("LINEAR", "linear = true" if linear else ""))
    result = esp.Model.load(tmp_path / "bar.toml").run(out=tmp_path / "out", progress=False)
    top, across = result.summary["paths"]
    np.testing.assert_allclose(top["length"], np.arange(11))
    x = np.array(top["places"]).reshape(-1, 3)[:, 0]
    inside = x <= 10
    assert inside.sum() == 9 and np.isnan(np.array(top["values"]["stress.xx"])[~inside]).all()
    truth = 1e-3 * (10 - x) * 0.5 / (1 / 12)  # M c / I, with no Poisson's ratio
    np.testing.assert_allclose(np.array(top["values"]["stress.xx"])[inside], truth[inside], rtol=0.02, atol=6e-4)  # the load's end is stiff
    np.testing.assert_allclose(np.array(top["values"]["strain.xx"])[inside], truth[inside] / 2e5, rtol=0.02, atol=3e-9)
    stress = np.array(across["values"]["stress.xx"])
    assert abs(stress[1]) < 1e-6 * abs(stress[0]) + 1e-6 and stress[0] == pytest.approx(-stress[2], rel=1e-3)
    assert set(across["values"]) >= {"strain.xx", "strain.yy", "strain.xz"}
    assert stress[2] == pytest.approx(result.summary["values"]["bar[5 0.5 1].stress.xx"], rel=1e-9)
    with open(tmp_path / "out/paths.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 14 and rows[13]["stress.von_mises"] == ""
    assert [float(r["stress.xx"]) for r in rows[11:]] == list(stress)
    assert rows[10]["stress.xx"] == "nan"
    # The largest is that of the whole body, by the same means.
    (peak,) = result.summary["stress_peaks"]
    assert peak["body"] == "bar" and peak["t"] == 1
    assert peak["value"] == pytest.approx(result.summary["values"]["bar.stress.von_mises.max"], rel=1e-8)
    assert 0 <= peak["place"][0] <= 2.5 and peak["node"] > 0


@pytest.mark.parametrize("change, says", [
    ('body = "bar"\nthrough', "beam"), ("through = [[2, 0.5, 1], [8, 0.5, 1], [12, 0.5, 1]]", "two points"),
    ("points = 11", "points"), ('"stress.xx", "strain.xx", "stress.von_mises"', "stress.xyz"),
    ("[[5, 0.5, 0], [5, 0.5, 1]]", "no point of the path"), ("points = 3", "did you mean 'points'")])
def test_mistakes(tmp_path, change, says):
    by = {"beam": 'body = "beam"\nthrough', "two points": "through = [[2, 0.5, 1]]", "points": "points = 1", "stress.xyz": '"stress.xyz"',
          "no point of the path": "[[50, 0.5, 0], [50, 0.5, 1]]", "did you mean 'points'": "point = 3"}[says]
    text = BAR.replace("LINEAR", "").replace(change, by, 1)
    with pytest.raises(Exception, match=says):
        esp.Model.from_text(text).run(progress=False) if hasattr(esp.Model, "from_text") else run_text(tmp_path, text)


def run_text(tmp_path, text):
    (tmp_path / "bar.toml").write_text(text)
    esp.Model.load(tmp_path / "bar.toml").run(progress=False)
