"""Pages of runs: what they hold, where they are shown, and that they follow results through files and processes."""

import json
import pickle
import re
import sys
import types

import numpy as np
import pytest

import espalier

PENDULUM = {
    "title": "<b>pendulum</b></script>", "gravity": [0, -10, 0],
    "bodies": {"bob": {"mass": 2, "inertia": [1e-3, 1e-3, 1e-3], "position": [1, 0, 0], "type": "rigid"}},
    "joints": {"hinge": {"type": "revolute", "bodies": ["ground", "bob"], "at": [0, 0, 0], "axis": [0, 0, 1]}},
    "integrator": {"end": 0.5},
}


def data_of(page):
    """What the page knows, as its scripts read it."""
    return json.loads(re.search(r'id="data">(.*?)</script>', page, re.S).group(1))


@pytest.fixture
def quiet(monkeypatch):
    monkeypatch.setenv("ESPALIER_NO_BROWSER", "1")


def test_page_of_a_run_has_its_numbers(tmp_path):
    result = espalier.Model(PENDULUM).run(quantities=["bob.position"], progress=False)
    page = result.to_html(tmp_path / "p.html")
    assert (tmp_path / "p.html").read_text(encoding="utf-8") == page
    data = data_of(page)
    assert data["summary"]["title"] == PENDULUM["title"]
    assert data["plots"]["names"] == result.names == ["bob.position.x", "bob.position.y", "bob.position.z"]
    import base64
    import gzip

    rows = np.frombuffer(gzip.decompress(base64.b64decode(re.search(r'id="rows">(.*?)<', page).group(1))))
    assert np.array_equal(rows.reshape(4, -1), np.vstack([result.t, result.values.T]))
    times = [frame["t"] for frame in data["scene"]["frames"]]
    assert times[0] == 0 and times[-1] == 0.5 and len(times) > 150


def test_page_has_plots_although_nobody_chose_quantities():
    result = espalier.Model(PENDULUM).run(progress=False)
    vector = lambda name: [f"{name}.{c}" for c in "xyz"]
    assert result.names == data_of(result.to_html())["plots"]["names"] == [
        *vector("bob.position"), *vector("bob.velocity"), *vector("hinge.force"), "energy.kinetic", "energy.potential", "energy.total"]


def test_model_is_shown_before_it_runs(quiet):
    shown = espalier.Model(PENDULUM).show()
    data = data_of(shown.text)
    assert len(data["scene"]["frames"]) == 1 and data["scene"]["marks"][0]["name"] == "hinge"
    assert shown.path and open(shown.path, encoding="utf-8").read() == shown.text
    with pytest.raises(espalier.InvalidInputError):
        espalier.Model({**PENDULUM, "joints": {"hinge": {"type": "revolute"}}}).show()


def test_notebook_gets_a_frame(monkeypatch):
    shell = types.SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(get_ipython=lambda: shell))
    result = espalier.Model(PENDULUM).run(progress=False)
    shown = result.show(height=300)
    assert shown.path == ""
    bundle = shown._repr_mimebundle_()
    frame = bundle["text/html"]
    assert "height:300px" in frame and "image/png" in bundle and "<page" in bundle["text/plain"]
    srcdoc = re.search(r'srcdoc="([^"]*)"', frame).group(1)
    import html

    assert html.unescape(srcdoc) == shown.text
    # Where frames are taken out (GitHub) and where only pictures are kept (PDF) the scene is there as a picture.
    left = re.sub(r"<iframe.*</iframe>", "", frame)
    assert f'src="data:image/png;base64,{bundle["image/png"]}"' in left and "<script" not in left
    import base64
    import io

    image = pytest.importorskip("PIL.Image").open(io.BytesIO(base64.b64decode(bundle["image/png"])))
    assert image.size[0] > 500 and len(np.unique(np.asarray(image.convert("RGB")).reshape(-1, 3), axis=0)) > 50
    for wrong in (0, -1, "tall"):
        with pytest.raises((ValueError, TypeError)):
            result.show(height=wrong)
    assert "<b>" not in result._repr_html_() and "pendulum" in result._repr_html_()


def test_page_goes_with_a_result_to_other_processes():
    result = espalier.Model(PENDULUM).run(progress=False)
    twin = pickle.loads(pickle.dumps(result))
    assert data_of(twin.to_html())["summary"]["steps"] == result.summary["steps"]
    (_, kept), = espalier.sweep(PENDULUM, {"gravity": [[0, -5, 0]]}, workers=1, page=True)
    assert data_of(kept.to_html())["gravity"] == [0, -5, 0]
    (_, without), = espalier.sweep(PENDULUM, {"gravity": [[0, -5, 0]]}, workers=1)
    with pytest.raises(ValueError, match="page=True"):
        without.to_html()


def test_folder_has_a_page_unless_it_is_not_wanted(tmp_path):
    espalier.Model(PENDULUM).run(out=tmp_path / "a", progress=False)
    assert (tmp_path / "a" / "index.html").exists()
    result = espalier.Model(PENDULUM).run(out=tmp_path / "b", page=False, progress=False)
    assert not (tmp_path / "b" / "index.html").exists()
    with pytest.raises(ValueError, match="page=False"):
        result.show()
    espalier.Model({**PENDULUM, "output": {"page": False}}).run(out=tmp_path / "c", progress=False)
    assert not (tmp_path / "c" / "index.html").exists()
