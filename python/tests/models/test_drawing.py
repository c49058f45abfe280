"""Pictures of a run, drawn from its page. Truth: closed forms, the page itself, pixels, and exact meshes of the same run."""

import numpy as np
import pytest

import espalier as esp
from espalier._pictures import drawing as _drawing
from espalier._pictures.raster import Raster, creased_normals

Image = pytest.importorskip("PIL.Image")


def bar(divisions=(8, 2, 2), **keys):
    """A clamped bar of solids with a rigid end, statics."""
    model = esp.Model(statics={}, title='bar </script><b> "&', **keys)
    model.body("bar", "solid", mesh={"part": "block", "lx": 0.4, "ly": 0.04, "lz": 0.04, "divisions": list(divisions), "element": "hex20"},
               material={"young": 2e9, "poisson": 0.3, "density": 2000})
    model.body("tip", mass=1, box=[0.1, 0.06, 0.07], position=[0.45, 0.02, 0.02])
    model.support("wall", body="bar", face="x0", hold="all")
    model.joint("weld", "fixed", a={"body": "bar", "face": "x1"}, b={"body": "tip", "point": [-0.05, 0, 0]})
    model.force("pull", "load", a={"body": "tip"}, force=[0, 0, -30])
    return model


@pytest.fixture(scope="module")
def bent():
    return bar().run(progress=False)


def colours(image):
    return np.asarray(image.convert("RGB")).astype(int)


def test_the_nearest_triangle_is_seen():
    raster = Raster(40, 30)
    xy = np.array([[0.0, 0], [40, 0], [0, 30], [40, 30], [10, 5], [30, 5], [10, 25], [np.nan, 3]])
    depth = np.array([0.0, 0, 0, 0, 1, 1, -1, 0])
    corners = np.array([[0, 1, 2], [1, 3, 2], [4, 5, 6], [0, 7, 1]])
    raster.triangles(xy, depth, corners, lambda t, w: np.eye(3)[np.minimum(t, 2)])
    image = raster.image().reshape(30, 40, 3)
    assert not np.isnan(raster.rgb).any() and np.allclose(image.sum(axis=2), 1)  # no gap on the common side
    front = image[..., 2] == 1
    assert front.sum() == pytest.approx(200 * 0.75, rel=0.05)  # depth 1 at the upper side, -1 at the corner below: half its height is in front
    assert front[6, 15] and not front[24, 10] and (image[:, :, 1].sum() + image[:, :, 0].sum() + front.sum()) == 1200


def test_round_faces_are_smooth_and_edges_are_not():
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    points = np.concatenate([ring, ring + [0, 0, 1], [[0, 0, 1]]])
    k = np.arange(24)
    side = np.stack([k, (k + 1) % 24, k + 24], axis=1)
    side = np.concatenate([side, np.stack([(k + 1) % 24, (k + 1) % 24 + 24, k + 24], axis=1)])
    lid = np.stack([k + 24, (k + 1) % 24 + 24, 0 * k + 48], axis=1)
    normals = creased_normals(points, np.concatenate([side, lid]))
    assert normals[48:] == pytest.approx(np.broadcast_to([0, 0, 1], (24, 3, 3)))
    radial = np.stack([points[side][..., 0], points[side][..., 1], 0 * points[side][..., 0]], axis=-1)
    assert (np.abs(normals[:48] - radial).max()) < 0.1  # means of two flat faces at 15 degrees


def test_frames_of_the_page_are_those_of_the_meshes():
    model = bar((4, 2, 2))
    kept, page = model.run(frames=0, progress=False), model.run(progress=False)
    assert [f.t for f in kept.frames] == pytest.approx([f.t for f in page.frames])
    exact, shown = kept.frames[-1], page.frames[-1]
    size = np.ptp(exact.points, axis=0).max()  # places have 16 bits over the range of each coordinate
    start = exact.points - exact.displacement
    for point, moved in zip(page._scene.rest[::7], shown.points[::7]):
        k = int(np.argmin(np.linalg.norm(start - point, axis=1)))
        assert np.linalg.norm(moved - exact.points[k]) < 1e-4 * size
    cells = page.cells
    assert cells.bodies == ["bar", "tip"] and set(cells.types) == {5}
    assert page.frames[-1].von_mises[:10].max() > 0 and np.isnan(shown.von_mises[page._scene.rigid]).all()
    assert len(page.frames[1:3]) == 2 and page.frames[-1].t == 1 and "frames" in repr(page.frames)
    with pytest.raises(IndexError):
        page.frames[10_000]


def test_peak_is_named_where_it_is(bent):
    """M c / I at the clamp, by the nodes there; the whole range is on the scale."""
    scene = bent._scene
    state = _drawing.state_of(scene, scene.nearest(None), "principal")
    peak = _drawing.peak_of(scene, state)
    moment = 30 * 0.45
    assert peak.body == "bar" and peak.node > 0 and peak.place[0] == pytest.approx(0, abs=1e-4)
    assert abs(peak.value) == pytest.approx(moment * 0.02 / (0.04**4 / 12), rel=0.35)  # and what the clamp adds in the corner
    low, high = _drawing.limits_of([state], "principal")
    values = state.values[np.isfinite(state.values)]
    assert low == -high and low <= values.min() and high >= values.max()
    assert _drawing.limits_of([_drawing.state_of(scene, 0, "von_mises")], "von_mises")[0] == 0


@pytest.mark.parametrize("view", [None, "xy", "xz", "zy", "iso", (1, 2, 3), (0, 0, -1)])
@pytest.mark.parametrize("size", [(800, 500), (300, 900), (900, 120)])
def test_nothing_is_cut_off(bent, view, size):
    scene = bent._scene
    state = _drawing.state_of(scene, scene.nearest(None), "von_mises")
    camera = _drawing.Camera(scene, [state], view, size, True)
    for places in (state.points, state.marks.reshape(-1, 3), np.array([b for _, _, b in state.arrows])):
        flat = camera.flat(places)
        assert (flat >= -1e-6).all() and (flat <= np.array(size) + 1e-6).all()
    axes = camera.axes
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12) and np.linalg.det(axes) == pytest.approx(1)
    flat = camera.flat(state.points)
    assert np.ptp(flat, axis=0).max() > 0.15 * min(size)  # and it is not small


def test_rigid_bodies_are_neutral_and_values_have_their_colours(bent):
    image = colours(bent.picture(view="xz", size=(800, 400)))
    scene, state = bent._scene, _drawing.state_of(bent._scene, bent._scene.nearest(None), "von_mises")
    camera = _drawing.Camera(scene, [state], "xz", (800, 400), True)
    x, y = camera.flat(np.array([0.46, 0.02, 0.04]) + [0, 0, float(state.points[scene.rigid][:, 2].mean() - 0.02)]).round().astype(int)
    assert np.ptp(image[y, x]) < 25 and image[y, x].min() > 80  # grey
    x, y = camera.flat(state.points[np.nanargmax(state.values)] + [0.004, 0, -0.003]).round().astype(int)
    x2, y2 = camera.flat(np.array([0.3, 0.02, 0.02]) + [0, 0, float(np.interp(0.3, [0, 0.4], [0, state.points[:, 2].min()]))]).round().astype(int)
    assert image[y, x, 0] > image[y, x, 2]  # red
    assert image[y2, x2, 2] > image[y2, x2, 0]  # blue along the neutral axis


def test_pictures_and_animations(bent, tmp_path):
    image = bent.picture(path=tmp_path / "one.png", size=(300, 200))
    assert Image.open(tmp_path / "one.png").size == image.size == (300, 200)
    assert (colours(bent.picture(0, size=(300, 200))) != colours(image)).any()
    assert (colours(bent.picture(limits=(0, 1e9), size=(300, 200))) != colours(image)).any()
    seen = {bent.picture(scalars=s, size=(200, 120)).tobytes() for s in ("von_mises", "principal", "displacement", "deformation", "velocity", "body")}
    assert len(seen) == 6
    for name in ("moving.gif", "moving.webp"):
        assert bent.animate(tmp_path / name, seconds=0.3, size=(160, 120)) == str(tmp_path / name)
        moving = Image.open(tmp_path / name)
        assert moving.size == (160, 120) and moving.n_frames > 1
    for wrong in ({"scalars": "heat"}, {"view": "xx"}, {"view": (0, 0, 0)}, {"size": (1, 1)}, {"size": (100,)}, {"limits": (2, 1)}):
        with pytest.raises((ValueError, TypeError)):
            bent.picture(**wrong)
    with pytest.raises(ValueError, match=".gif"):
        bent.animate(tmp_path / "moving.mp4")
    with pytest.raises(ValueError, match="between 5 and 6"):
        bent.animate(between=(5, 6))
    for seconds in (0, -1, float("inf")):
        with pytest.raises(ValueError, match="seconds"):
            bent.animate(seconds=seconds)


def test_without_pillow(monkeypatch, bent):
    import sys

    monkeypatch.setitem(sys.modules, "PIL", None)
    with pytest.raises(ImportError, match="pip install pillow"):
        bent.picture()
    assert "<img" not in bent._repr_html_() and "image/png" not in bent.show()._repr_mimebundle_()


def test_beams_cables_and_shells_have_their_stress():
    """What the quantities of their nodes say, and M c / I, N / A; sections given by constants have none."""
    material = {"young": 2e11, "poisson": 0.3, "density": 7800}
    model = esp.Model(statics={})
    model.body("beam", "beam", start=[0, 0, 0], end=[1, 0, 0], elements=4, height=0.02, width=0.01, material=material)
    model.body("round", "beam", start=[0, 1, 0], end=[1, 1, 0], elements=2, radius=0.01, material=material)
    model.body("rope", "cable", start=[0, 2, 0], end=[1, 2, 0], elements=3, radius=0.005, material=material)
    model.body("shell", "shell", origin=[0, 3, 0], x=[1, 0, 0], y=[0, 1, 0], nx=4, ny=2, thickness=0.01, material=material)
    model.body("bare", "cable", start=[0, 5, 0], end=[1, 5, 0], elements=2, axial=1e6, bending=100, mass_per_length=1)
    for name in ("beam", "round", "rope", "bare"):
        if name in ("beam", "round"):
            model.joint(f"{name}_wall", "fixed", a={"body": "ground"}, b={"body": name, "node": 1})
        else:
            model.support(f"{name}_wall", body=name, node=1, hold="all")
        model.force(f"{name}_end", "load", a={"body": name, "node": -1}, force=[50, 0, 0] if name == "rope" else [0, 0.2, 0.3])
    model.support("shell_wall", body="shell", edge="x0", hold="all")
    model.force("shell_load", "pressure", body="shell", face="top", pressure=100)
    sim = esp.Simulation(model)
    result = sim.run(progress=False)
    frame, scene = result.frames[-1], result._scene
    at = lambda body, node: [k for k in range(scene.points) if scene.bodies[scene.body_of[k]].name == body and scene.labels[k] == node]
    for body, count in (("beam", 5), ("rope", 4), ("round", 3)):
        for node in (1, 2, count):
            truth = sim[f"{body}[node {node}].stress.xx.maxabs"] if body != "round" else sim[f"{body}[node {node}].stress.von_mises"]
            assert frame.von_mises[at(body, node)] == pytest.approx(truth, rel=1e-3, abs=1e-4 * np.nanmax(frame.von_mises)), (body, node)
    tolerance = 1e-4 * np.nanmax(frame.von_mises)
    assert frame.von_mises[at("beam", 1)] == pytest.approx(0.2 * 0.01 / (0.01 * 0.02**3 / 12) + 0.3 * 0.005 / (0.02 * 0.01**3 / 12), rel=2e-3)
    assert frame.principal[at("rope", 2)] == pytest.approx(50 / (np.pi * 0.005**2), rel=1e-2, abs=2 * tolerance)
    top, bottom = at("shell", 1)
    for point, side in ((top, "top"), (bottom, "bottom")):
        assert frame.von_mises[point] == pytest.approx(sim[f"shell[node 1 {side}].stress.von_mises"], rel=1e-3, abs=tolerance)
    assert frame.principal[top] > 0 > frame.principal[bottom]  # pressed downwards at the clamp: the top is pulled
    assert np.isnan(frame.von_mises[at("bare", 1)]).all()
    assert np.isfinite(frame.von_mises[[k for k in range(scene.points) if scene.bodies[scene.body_of[k]].name in ("beam", "rope")]]).all()
    assert _drawing.peak_of(scene, _drawing.state_of(scene, len(scene.times) - 1, "von_mises")).body in ("beam", "shell", "round")


def points(count):
    model = esp.Model(integrator={"end": 1e-3}, gravity=[0, 0, -10])
    for k in range(count):
        model.body(f"p{k}", "point", mass=1, position=[k % 50, k // 50, 0])
    return model


def lines():
    material = {"young": 2e9, "poisson": 0.3, "density": 2000}
    model = esp.Model(integrator={"end": 1e-3}, gravity=[0, 0, -10])
    model.body("a", "cable", start=[0, 0, 0], end=[1, 0, 0], elements=3, radius=0.01, material=material)
    model.body("b", "beam", start=[0, 1, 0], end=[1, 1, 0], y=[0, 1, 0], elements=2, height=0.05, width=0.03, material=material)
    model.body("c", "shell", origin=[0, 2, 0], x=[1, 0, 0], y=[0, 1, 0], nx=2, ny=2, thickness=0.02, material=material)
    return model


@pytest.mark.parametrize("make", [lambda: points(1), lambda: points(2), lambda: points(2000), lines], ids=["one point", "two", "2000 bodies", "lines"])
def test_odd_models_have_pictures(make, monkeypatch):
    monkeypatch.setenv("ESPALIER_NO_BROWSER", "1")
    result = make().run(progress=False)
    for scalars in ("auto", "displacement", "velocity"):
        image = colours(result.picture(scalars=scalars, size=(300, 200)))
        assert np.ptp(image) > 100 and (image[40:160, 20:200] < 250).any()
    assert result.to_html().count("</html>") == 1 and result._repr_html_()


def test_before_a_run_there_is_one_frame():
    result = esp.Simulation(lines()).result()
    assert len(result.frames) == 1 and result.picture(size=(200, 150)).size == (200, 150)


def test_numbers_that_are_none_are_left_out(bent):
    """A state that broke down: the picture is there, and says so."""
    from espalier._pictures.scene import Scene

    scene = Scene(bent.to_html())
    state = _drawing.state_of(scene, 0, "von_mises")
    bad = state._replace(points=state.points * np.nan, values=state.values * np.nan, marks=state.marks * np.nan, arrows=[])
    camera = _drawing.Camera(scene, [bad], None, (300, 200), True)
    assert _drawing.peak_of(scene, bad) is None
    assert _drawing.picture(scene, bad, camera, "von_mises", _drawing.limits_of([bad], "von_mises")).size == (300, 200)
    some = state._replace(points=np.where(np.arange(len(state.points))[:, None] < 20, np.nan, state.points))
    camera = _drawing.Camera(scene, [some], None, (300, 200), True)
    assert np.ptp(colours(_drawing.picture(scene, some, camera, "von_mises", (0, 1)))) > 100
