"""Results as people use them. Truth: the simulation's own values, summary.json of the same run, and closed forms."""

import json
import math
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import espalier as esp

ROOT = Path(__file__).parents[3]


def pendulum(**keys):
    model = esp.Model(gravity=[0, -10, 0], title="<i>pendulum</i>", integrator={"end": 0.5, "relative": 1e-8, "absolute": 1e-9}, **keys)
    model.body("bob", mass=2, inertia=[1e-3, 1e-3, 1e-3], position=[1, 0, 0])
    model.joint("hinge", "revolute", bodies=["ground", "bob"], at=[0, 0, 0], axis=[0, 0, 1])
    return model


def twice_held():
    model = pendulum()
    model.joint("again", "revolute", bodies=["ground", "bob"], at=[0, 0, 0], axis=[0, 0, 1])
    return model


def test_usual_quantities_are_kept():
    sim = esp.Simulation(pendulum())
    result = sim.run(progress=False)
    assert result.values.shape == (len(result.t), len(result.names)) == (result.summary["steps"] + 1, 12)
    for name in result.names:
        assert result[name][-1] == pytest.approx(sim[name], rel=1e-12, abs=1e-12)
    for name in ("bob.position", "bob.velocity", "hinge.force"):
        assert result[name].shape == (len(result.t), 3) and result[name][-1] == pytest.approx(sim[name], rel=1e-12, abs=1e-12)
    assert np.ptp(result["energy.total"]) < 1e-5
    assert result["hinge.force.norm"][-1] == pytest.approx(sim["hinge.force.norm"])
    assert result["hinge.force.norm"] == pytest.approx(-60 * result["bob.position.y"], abs=0.05)  # 3 m g sin of the angle, and the inertia of 1e-3
    assert esp.Simulation(pendulum(), page=False).run(progress=False).values.shape[1] == 0
    chosen = pendulum().run(quantities=["energy.total"], progress=False)
    assert chosen.names == ["energy.total"]


def test_usual_quantities_beside_files_and_over_restored_states(tmp_path):
    sim = esp.Simulation(pendulum(), out=tmp_path)
    sim.step(0.1)
    saved, early = sim.save(), sim.result()
    sim.step(0.1)
    sim.restore(saved)
    assert (sim.result().t == early.t).all() and (sim.result().values == early.values).all()
    sim.step(0.1)
    sim.step(0.1)
    result = sim.result()
    assert "bob.velocity" in result and (np.diff(result.t) > 0).all() and result.t[-1] == pytest.approx(0.3)


def test_many_steps_are_thinned():
    model = esp.Model({**pendulum().tree, "integrator": {"end": 25.0, "max_step": 1e-3}})
    result = model.run(progress=False)
    assert result.summary["steps"] >= 25_000 and 10_000 < len(result.t) <= 20_001
    assert result.t[0] == 0 and result.t[-1] == 25 and (np.diff(result.t) > 0).all()


def test_a_result_is_a_mapping():
    result = pendulum().run(quantities=["bob.position", "energy.total"], progress=False)
    assert list(result) == result.keys() == result.names and len(result) == 4 and result
    assert [name for name, _ in result.items()] == result.names
    assert all((dict(result)[name] == result[name]).all() for name in result)
    assert "bob.position" in result and "bob.position.x" in result and "bob.velocity" not in result and 3 not in result
    assert result.dimensions["bob.position.x"] == "length"
    for wrong in ("bob.velocity", "energy.total.norm", "", "bob.position.w"):
        with pytest.raises(KeyError, match="quantities="):
            result[wrong]
    sim = esp.Simulation(pendulum())
    with pytest.raises(ValueError, match="bob.speed"):
        sim["bob.speed"]
    assert sim["bob.position"].shape == (3,) and isinstance(sim["energy.total"], float)


def test_series_with_units():
    result = pendulum().run(quantities=["bob.position", "energy.total"], progress=False)
    pandas = pytest.importorskip("pandas")
    frame = result.to_pandas()
    assert isinstance(frame, pandas.DataFrame) and frame.attrs["units"]["bob.position.y"] == "length"
    xarray = pytest.importorskip("xarray")
    data = result.to_xarray()
    assert isinstance(data, xarray.Dataset) and set(data) == {"bob.position", "energy.total"}
    assert data["bob.position"].dims == ("t", "axis") and data["bob.position"].attrs["units"] == "length"
    assert (data["bob.position"].sel(axis="y").values == result["bob.position.y"]).all()
    assert data["energy.total"].dims == ("t",) and data["energy.total"].attrs["units"]


def tree(x):
    """The keys alone, nested."""
    if isinstance(x, dict):
        return {k: tree(v) for k, v in x.items()}
    return [tree(x[0])] if isinstance(x, list) and x and isinstance(x[0], dict) else None


def test_summary_has_one_form(tmp_path):
    """Python's is that of summary.json, but for what only the command knows."""
    program = Path(os.environ.get("ESPALIER_BINARY", ROOT / "build/release/espalier"))
    if not program.exists():
        pytest.skip("the program espalier is not built")
    model = twice_held()
    model.tree["events"] = {"low": {"when": "t > 0.1"}}
    model.tree["initial"] = {"modes": 1}
    model.tree["output"] = {"quantities": ["bob.position"], "envelopes": ["bob.position.x"]}
    (tmp_path / "m.toml").write_text(model.text)
    subprocess.run([program, "simulate", tmp_path / "m.toml", "--out", tmp_path / "out", "-q"], check=True)
    told = json.loads((tmp_path / "out" / "summary.json").read_text())
    found = esp.Model.load(tmp_path / "m.toml").run(out=tmp_path / "py", progress=False).summary
    for own in ("espalier", "exit_code", "model"):
        told.pop(own)
    assert tree(told) == tree(found)
    for group, name in (("system", "velocities"), ("integrator", "steps"), ("counts", "factorizations"), ("time", "end"), ("events", "count")):
        assert told[group][name] == found[group][name], (group, name)
    assert told["system"]["redundant"] == found["redundant"] and found["steps"] == found["integrator"]["steps"]
    assert found["t_end"] == 0.5 and found["method"] == "bdf"
    with pytest.raises(KeyError, match="system"):
        found["colour"]


def test_what_a_result_says():
    result = twice_held().run(progress=False)
    assert "redundant: " in repr(result) and "again" in repr(result)
    html = result._repr_html_()
    for words in ("solved", "constraints miss by", "energy made", "redundant", "again", "bob.position", "&lt;i&gt;pendulum"):
        assert words in html, words
    assert "<i>" not in html and "data:image/png" in html
    assert html.count("<tr>") < 20  # not one row for each number
    plain = pendulum().run(progress=False)
    assert "redundant" not in repr(plain) and math.isfinite(plain.summary["energy"]["gain"])
