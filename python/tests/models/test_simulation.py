"""Models, runs and steps from Python. Truth: closed forms, and the C++ side's own runs."""

import math
import os
import pickle
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import espalier as esp
from espalier._models.toml import toml_of

ROOT = Path(__file__).parents[3]
BDF = {"relative": 1e-9, "absolute": 1e-9, "end": 2.0}


def cart():
    model = esp.Model(title="cart", integrator=BDF)
    body = model.body("cart", "point", mass=2)
    model.input("push", 0)
    model.force("push", "load", a={"body": body}, force=["inputs.push", 0, 0])
    return model


def pendulum(**keys):
    model = esp.Model(gravity=[0, -10, 0], integrator={**BDF, **keys})
    model.body("bob", mass=2, inertia=np.full(3, 1e-9), position=(1, 0, 0))
    model.joint("hinge", "revolute", bodies=["ground", "bob"], at=[0, 0, 0], axis=[0, 0, 1])
    return model


def test_toml_of_trees():
    tomllib = pytest.importorskip("tomllib")  # of Python 3.11
    tree = {"a": 1, "b": True, "c": [1.5, 1e300, -2], "d": 'quote " and \\ and \n', "e": np.float64(0.1),
            "section": {"x": np.arange(3), "part one": {"deep": {"deeper": [{"k": 1}]}}}, "empty": {}, "inf": math.inf}
    back = tomllib.loads(toml_of(tree))
    assert back["section"]["x"] == [0, 1, 2] and back["section"]["part one"] == tree["section"]["part one"]
    for key in "abcde":
        assert back[key] == tree[key]
    for bad, word in (({"a": object()}, "a: object"), ({"s": {"p": {"q": [1, None]}}}, r"s\.p\.q\[1\]"), ({1: 2}, "name")):
        with pytest.raises(TypeError, match=word):
            toml_of(bad)


def test_run_from_calls_dictionaries_texts_and_files(tmp_path):
    model = pendulum()
    options = {"quantities": ["bob.position", "energy.total", "hinge.force.norm"]}
    first = model.run(**options)
    (tmp_path / "pendulum.toml").write_text(model.text)
    for other in (esp.Model(model.tree), esp.Model.from_text(model.text), esp.Model.load(tmp_path / "pendulum.toml")):
        again = other.run(**options)
        assert (again.values == first.values).all() and (again.t == first.t).all()
    assert esp.Simulation(tmp_path / "pendulum.toml").run().summary["steps"] == first.summary["steps"]
    assert esp.Simulation(model.tree).run().summary["steps"] == first.summary["steps"]
    r = first["bob.position"]
    assert r.shape == (len(first.t), 3) and first["bob.position.x"] == pytest.approx(r[:, 0])
    assert np.hypot(r[:, 0], r[:, 1]) == pytest.approx(np.ones(len(r)), abs=1e-9)
    assert np.ptp(first["energy.total"]) < 1e-6
    assert first["hinge.force.norm"] == pytest.approx(-60 * r[:, 1], abs=1e-4)  # 3 m g cos of the angle from below
    assert "bob.position.x" in first and "bob.velocity.x" not in first
    with pytest.raises(KeyError, match="quantities="):
        first["bob.velocity.x"]
    assert first.summary["t_end"] == 2 and first.summary["values"]["bob.position.x"] == r[-1, 0]
    assert "<table>" in first._repr_html_() and "bdf" in repr(first)
    assert (pickle.loads(pickle.dumps(first)).values == first.values).all()


def test_frames_of_data():
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    result = pendulum(end=0.1).run(quantities="bob.position")
    frame, data = result.to_pandas(), result.to_xarray()
    assert isinstance(frame, pandas.DataFrame) and isinstance(data, xarray.Dataset)
    assert (frame["bob.position.y"].to_numpy() == result["bob.position.y"]).all() and frame.index.name == "t"
    assert (data["bob.position"].sel(axis="y").values == result["bob.position.y"]).all()
    assert (data.sel(t=result.t[3], axis="y")["bob.position"] == result["bob.position.y"][3]).all()


def test_steps_inputs_and_saved_states():
    sim = esp.Simulation(cart())
    assert sim.inputs == {"push": 0} and sim.quantities["cart.velocity.x"] == "length/time"
    x = v = 0.0
    for k in range(10):
        push = float((k * 3) % 5 - 2)
        sim.set_input("push", push)
        sim.step(0.1)
        x, v = x + v * 0.1 + push / 4 * 0.01, v + push / 2 * 0.1
        if k == 4:
            saved = sim.save()
    assert sim.time == pytest.approx(1, abs=1e-12)
    assert (sim["cart.position.x"], sim.value("cart.velocity.x")) == pytest.approx((x, v), abs=1e-6)
    end = sim["cart.position.x"]
    for other in (sim, esp.Simulation(cart())):
        other.restore(saved)
        assert other.time == pytest.approx(0.5) and other.inputs == {"push": 0.0}
        for k in range(5, 10):
            other.set_input("push", float((k * 3) % 5 - 2))
            other.step(0.1)
        assert other["cart.position.x"] == end
    for call, error in ((lambda: sim.set_input("pull", 1), ValueError), (lambda: sim.set_input("push", math.nan), ValueError),
                        (lambda: sim.value("cart.positon.x"), ValueError), (lambda: sim.step(-1), ValueError),
                        (lambda: sim.restore(b"nonsense"), esp.InvalidInputError)):
        with pytest.raises(error):
            call()
    assert sim["cart.position.x"] == end


@pytest.mark.parametrize("method", ["bdf", "generalized-alpha"])
def test_slivers_of_time_do_no_harm(method):
    """Who adds up times meets differences of rounding: t + 1e-14 after t."""
    keys = {"integrator": {"method": method, "step": 0.01, "end": 2.0}} if method != "bdf" else {}
    model = esp.Model({**pendulum().tree, **keys})
    plain = esp.Simulation(model)
    plain.step_to(1)
    truth, steps = plain["bob.position.x"], plain.result().summary["steps"]
    for slivers in ((1e-18,), (1e-16, 1e-14, 1e-12), (1e-9,) * 3):
        sim = esp.Simulation(model)
        for k, sliver in enumerate(slivers):
            sim.step(sliver)
            sim.step_to(0.2 * (k + 1))
            for _ in range(3):
                sim.step(sliver)
        sim.step_to(1)
        assert sim["bob.position.x"] == pytest.approx(truth, abs=2e-6)
        assert sim.result().summary["steps"] < 1.5 * steps + 8 * len(slivers)
        with pytest.raises(ValueError, match="too short|no time"):
            esp.Simulation(model).step(1e-300)


def test_states_in_any_bytes():
    sim = esp.Simulation(cart())
    sim.step(0.1)
    state = sim.save()
    for same in (bytearray(state), memoryview(state)):
        sim.step(0.1)
        sim.restore(same)
        assert sim.time == pytest.approx(0.1)
    for wrong in ("text", None, 3):
        with pytest.raises(TypeError):
            sim.restore(wrong)


def test_observers_stop_raise_and_control():
    sim = esp.Simulation(cart())
    steps = []

    def three(step):
        steps.append(step)
        return len(steps) < 3

    result = sim.run(three)
    assert result.summary["status"] == "interrupted" and [s.index for s in steps] == [1, 2, 3] and steps[-1].t == sim.time
    with pytest.raises(ZeroDivisionError):
        sim.run(lambda step: 1 / 0)
    with pytest.raises(RuntimeError, match="own observer"):
        sim.run(lambda step: sim.step(1))

    def hold(step):  # a controller, with looks at the state and new inputs during the run
        sim.set_input("push", -40 * (sim["cart.position.x"] - 0.5) - 15 * sim["cart.velocity.x"])

    assert sim.step_to(20, hold) is None and sim["cart.position.x"] == pytest.approx(0.5, abs=1e-3)


def test_errors_have_places():
    model = pendulum()
    text = model.text.replace("mass =", "mas =")
    model.tree["bodies"]["bob"]["mas"] = 3
    with pytest.raises(esp.InvalidInputError, match=r"^bodies\.bob\.mas: unknown key; did you mean 'mass'"):
        esp.Simulation(model)
    with pytest.raises(esp.InvalidInputError, match=r"^model:\d+: bodies\.bob\.mas: "):
        esp.Simulation(esp.Model.from_text(text))
    with pytest.raises(esp.InvalidInputError, match="absent.toml"):
        esp.Simulation("absent.toml")
    with pytest.raises(ValueError, match="there already"):
        model.body("bob")
    with pytest.raises(esp.InvalidInputError, match="needs 'mass'"):
        esp.Model.from_text("").body("bob")
    with pytest.raises(TypeError, match="no argument 'colour'"):
        esp.Simulation(pendulum(), colour="red")


def test_overrides_until_and_files(tmp_path):
    result = esp.Simulation(pendulum(), set={"bodies.bob.position": [2, 0, 0], "title": "long"}, until=0.5, out=tmp_path,
                            quantities=["bob.position.x"], threads=1).run()
    assert result.summary["title"] == "long" and result.t[-1] == 0.5 and result["bob.position.x"][0] == 2
    assert {Path(f).name for f in result.summary["files"]} >= {"quantities.csv", "state.restart"}
    more = esp.Simulation(pendulum(), set={"bodies.bob.position": [2, 0, 0], "title": "long"}, until=1,
                          restart=tmp_path / "state.restart").run()
    assert more.t[0] == 0.5 and more.t[-1] == 1


def test_statics():
    model = esp.Model(statics={}, gravity=[0, 0, -10])
    model.material("rubber", young=1e7, density=1000)
    model.body("beam", "beam", start=[0, 0, 0], end=[1, 0, 0], elements=8, radius=0.02, material="rubber")
    model.joint("clamp", "fixed", a={"body": "ground"}, b={"body": "beam", "node": 1})
    model.marker("tip", body="beam", node=-1)
    result = model.run(quantities=["tip.position"])
    assert result.summary["method"] == "statics" and result.t[-1] == 1 and result["tip.position.z"][-1] < -0.1
    with pytest.raises(RuntimeError, match="statics"):
        esp.Simulation(model).step(1)


def test_linear_statics_and_supports():
    # A strip of shells without a density: F L^3 / (3 E I) and F L / (5/6 G A).
    model = esp.Model(statics={"linear": True})
    model.body("strip", "shell", x=[1, 0, 0], y=[0, 0.1, 0], nx=20, ny=1, thickness=0.01,
               material={"young": 1.2e8, "poisson": 0})
    model.support("wall", body="strip", edge="x0", hold="all")
    model.marker("tip", body="strip", edge="x1")
    model.force("p", "load", a="tip", force=[0, 0, 2])
    result = model.run(quantities=["tip.position.z", "wall.force.z", "wall.moment.y"])
    truth = 2 / (3 * 1.2e8 * 0.1 * 1e-6 / 12) + 2 / (5 / 6 * 0.6e8 * 1e-3)
    assert result["tip.position.z"][-1] == pytest.approx(truth, rel=2e-3)
    assert result["wall.force.z"][-1] == pytest.approx(-2) and result["wall.moment.y"][-1] == pytest.approx(2)
    assert result.summary["method"] == "linear statics" and result.summary["statics_backward_error"] < 1e-12
    large = model.run(quantities=["tip.position.z"], set={"statics.load": 1e6})
    assert large["tip.position.z"][-1] == pytest.approx(1e6 * result["tip.position.z"][-1], rel=1e-9)
    assert large.t[-1] == 1e6 and any("displacements as small" in n for n in large.summary["notices"])
    led = esp.Model(statics={"linear": True}, bodies=model.tree["bodies"])
    led.support("left", body="strip", edge="x0", hold="xyz", motion={"x": -1e-3})
    with pytest.raises(esp.Error, match="'strip' can turn about y"):
        led.run()
    with pytest.raises(esp.InvalidInputError, match="density"):
        model.run(set={"gravity": [0, 0, -10]})


def test_reactions_of_least_norm():
    # A table of 2 kg on four legs, gravity 10: 5 N each, in statics and in motion, at every place that tells them.
    model = esp.Model(gravity=[0, 0, -10], integrator={"end": 0.01})
    model.body("top", mass=2, inertia=[1, 1, 1])
    legs = [f"leg{k}.force.z" for k in range(4)]
    for k, (x, y) in enumerate([(0.6, 0.4), (-0.6, 0.4), (-0.6, -0.4), (0.6, -0.4)]):
        model.joint(f"leg{k}", "prescribed", a={"body": "ground", "point": [x, y, 0]}, b={"body": "top", "point": [x, y, 0]},
                    motion="0", direction="z")
    model.joint("rail", "prismatic", bodies=["ground", "top"], at=[0, 0, 0], axis=[0, 0, 1])
    trees = [model.tree, {**model.tree, "statics": {}}, {**model.tree, "statics": {"linear": True}}]
    for tree in trees:
        tree = {k: v for k, v in tree.items() if k != "integrator" or "statics" not in tree}
        simulation = esp.Simulation(esp.Model(tree), quantities=legs)
        result = simulation.run()
        for leg in legs:
            assert result[leg][-1] == pytest.approx(5, abs=1e-6)
            assert result.summary["values"][leg] == pytest.approx(5, abs=1e-6)
            assert simulation.value(leg) == pytest.approx(5, abs=1e-6)
        assert any("least norm" in line for line in result.summary["redundant"])


def test_sweep():
    points = esp.sweep(pendulum(), {"bodies.bob.mass": [1, 2], "integrator.end": [0.1, 0.2]}, workers=2,
                       quantities=["hinge.force.y"])
    assert [tuple(p.values()) for p, _ in points] == [(1, 0.1), (1, 0.2), (2, 0.1), (2, 0.2)]
    for point, result in points:
        assert result.t[-1] == point["integrator.end"]
    assert points[2][1]["hinge.force.y"] == pytest.approx(2 * points[0][1]["hinge.force.y"], rel=1e-5, abs=1e-4)
    with pytest.raises(esp.InvalidInputError, match="mas"):
        esp.sweep(pendulum(), {"bodies.bob.mas": [1, 2]}, workers=2)


def test_sweeps_say_what_failed_and_end():
    with pytest.raises(esp.InvalidInputError) as caught:
        esp.sweep(pendulum(end=0.1), {"bodies.bob.mass": [1, -2, 3]}, workers=2)
    assert caught.value.point == {"bodies.bob.mass": -2}
    with pytest.raises(esp.InvalidInputError) as caught:
        esp.sweep(pendulum(end=0.1), {"bodies.bob.mass": [1, -2]}, workers=1)
    assert caught.value.point == {"bodies.bob.mass": -2}


def workers_of_a_sweep():
    """Processes that this one has spawned."""
    me, found = os.getpid(), []
    for p in Path("/proc").iterdir():
        try:
            if p.name.isdigit() and int((p / "stat").read_text().rpartition(")")[2].split()[1]) == me:
                if "spawn_main" in (p / "cmdline").read_text():
                    found.append(int(p.name))
        except OSError:
            pass
    return found


@pytest.mark.parametrize("what", ["worker killed", "ctrl-c"])
def test_sweeps_that_are_broken_off(what):
    def strike():
        deadline = time.monotonic() + 20
        while not (found := workers_of_a_sweep()) and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(0.3)
        if what == "ctrl-c":
            os.kill(os.getpid(), signal.SIGINT)
        else:
            os.kill(found[0], signal.SIGKILL)

    thread = threading.Thread(target=strike)
    thread.start()
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt if what == "ctrl-c" else RuntimeError, match=None if what == "ctrl-c" else "killed"):
        esp.sweep(pendulum(end=1e5), {"bodies.bob.mass": [1, 2, 3]}, workers=2)
    assert time.monotonic() - begin < 20
    thread.join()
    assert not workers_of_a_sweep()


def test_analyses_are_kept_for_others(tmp_path):
    def run(folder):
        return esp.Simulation(ROOT / "models/chain.toml", set={"parameters.unknowns": 2000}, until=1e-3, analyses=folder,
                              quantities="energy.total").run()

    alone = run("")
    run(tmp_path)
    made = {f: f.stat().st_ino for f in tmp_path.iterdir()}
    assert made and all(f.suffix == ".analysis" for f in made)
    found = run(tmp_path)
    assert {f: f.stat().st_ino for f in tmp_path.iterdir()} == made  # nothing was analyzed again
    assert found.values[-1] == pytest.approx(alone.values[-1], rel=1e-9)
    for f in made:
        f.write_bytes(f.read_bytes()[:-9])
    assert run(tmp_path).values[-1] == pytest.approx(alone.values[-1], rel=1e-9)  # damaged: made anew
    assert {f.stat().st_ino for f in tmp_path.iterdir()}.isdisjoint(made.values())
    assert run(tmp_path / "absent").summary["steps"] > 0


def test_threads_run_side_by_side():
    ends = {}

    def work(k):
        ends[k] = esp.Simulation(pendulum(), quantities="bob.position").run().values[-1]

    team = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    [t.start() for t in team], [t.join() for t in team]
    assert len(ends) == 4 and all((e == ends[0]).all() for e in ends.values())


def test_ctrl_c_and_on():
    sim = esp.Simulation(pendulum(end=1e4), quantities="bob.position.x")
    threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    begin = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        sim.run()
    assert time.perf_counter() - begin < 3
    reached = sim.time
    assert reached > 0
    sim.step(0.1)
    assert sim.time == pytest.approx(reached + 0.1)
    assert (np.diff(sim.result().t) > 0).all()


def test_progress(capfd, monkeypatch):
    from espalier import _progress

    monkeypatch.setattr(_progress.time, "monotonic", iter(np.arange(0, 1e6, 2.0)).__next__)
    pendulum(end=0.1).run(progress=True)
    assert "t = 0." in capfd.readouterr().err
    monkeypatch.setattr(_progress.sys.stderr, "isatty", lambda: False)
    pendulum(end=0.1).run()
    assert capfd.readouterr().err == ""


def test_model_files_of_the_repository():
    sim = esp.Simulation(ROOT / "models/chain.toml", set={"parameters.unknowns": 1000}, until=1e-3)
    assert sim.end_time == 1e-3 and sim.result().summary["bodies"] > 5 and len(sim.quantities) > 100
    assert all(math.isfinite(sim[q]) for q in list(sim.quantities)[:200])


class TestDae:
    @staticmethod
    def functions():
        """A point of mass 2 on a circle of radius 1 under gravity 10."""
        return dict(mass=lambda q: 2 * np.eye(2), force=lambda t, q, v: np.array([0, -20.0]),
                    constraint=lambda t, q: np.array([q @ q - 1]),
                    energy=lambda t, q, v, a, lam: (v @ v, 20 * q[1]))

    def test_pendulum(self):
        dae = esp.Dae(2, 1, relative=1e-9, absolute=1e-9, **self.functions())
        dae.start(0, [1, 0], [0, 0])
        times = []
        dae.integrate(1, times.append)
        assert times[-1] == dae.t == 1 and len(times) == dae.summary["steps"]
        truth = pendulum(end=1.0).run(quantities="bob.position")
        assert dae.q == pytest.approx(truth["bob.position"][-1, :2], abs=1e-5)
        assert sum(dae.energy()) == pytest.approx(0, abs=1e-5)
        assert dae.q @ dae.v == pytest.approx(0, abs=1e-9) and dae.lam.shape == (1,)
        dae.integrate(2, lambda t: t < 1.5)
        assert 1.5 <= dae.t < 2

    def test_given_derivatives_and_sparse_matrices(self):
        sp = pytest.importorskip("scipy.sparse")
        f = {**self.functions(), "mass": lambda q: sp.csr_array(2 * np.eye(2)),
             "constraint_jacobian": lambda t, q: sp.coo_array(2 * q[None, :]),
             "constraint_gamma": lambda t, q, v: np.array([-2 * v @ v]),
             "tangent": lambda t, q, v, a, lam, wa, wv, wq: (2 * wa + 2 * lam[0] * wq) * np.eye(2)}
        dae = esp.Dae(2, 1, relative=1e-9, absolute=1e-9, tangent_pattern=[(0, 0), (1, 1)], **f)
        dae.start(0, [1, 0], [0, 0.5])
        assert dae.check_jacobians()["largest"] < 1e-7
        dae.integrate(0.5)
        other = esp.Dae(2, 1, relative=1e-9, absolute=1e-9, **self.functions())
        other.start(0, [1, 0], [0, 0.5])
        other.integrate(0.5)
        assert dae.q == pytest.approx(other.q, abs=1e-7)
        wrong = esp.Dae(2, 1, **{**f, "constraint_gamma": lambda t, q, v: np.array([2 * v @ v])})
        wrong.start(0, [1, 0], [0, 0.5])
        assert wrong.check_jacobians()["gamma"] > 0.1

    def test_generalized_alpha_and_sparse_solver(self):
        n = 80  # a chain of masses and springs: its first mode
        k = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        pattern = [(i, j) for i in range(n) for j in range(n) if abs(i - j) < 2]
        dae = esp.Dae(n, mass=lambda q: np.eye(n), force=lambda t, q, v: -k @ q, tangent_pattern=pattern,
                      method="generalized-alpha", step=0.05, spectral_radius=1, solver={"threads": 1})
        mode = np.sin(np.pi * np.arange(1, n + 1) / (n + 1))
        dae.start(0, mode, np.zeros(n))
        dae.integrate(10)
        omega = 2 * np.sin(np.pi / (2 * (n + 1)))
        assert dae.q == pytest.approx(mode * math.cos(omega * 10), abs=1e-5)

    def test_errors(self):
        f = self.functions()
        for change, error, word in (({"mass": lambda q: np.eye(3)}, ValueError, r"mass.*\(2, 2\)"),
                                    ({"force": lambda t, q, v: np.ones(3)}, ValueError, r"force.*\(2,\)"),
                                    ({"constraint": lambda t, q: 1 / 0}, ZeroDivisionError, ""),
                                    ({"constraint": lambda t, q: np.array([q @ q + 1])}, esp.Error, "")):
            with pytest.raises(error, match=word):
                esp.Dae(2, 1, **{**f, **change}).start(0, [1, 0], [0, 0])
        for options, error in (({"colour": 1}, TypeError), ({"method": "euler"}, ValueError), ({"max_order": 9}, ValueError)):
            with pytest.raises(error):
                esp.Dae(2, 1, **f, **options)
        with pytest.raises(ValueError):
            esp.Dae(2, 1, **f).start(0, [1, 0, 0], [0, 0])
        with pytest.raises((RuntimeError, ValueError)):
            esp.Dae(2, 1, **f).integrate(1)
        sparse = esp.Dae(2, tangent_pattern=[(0, 0), (1, 1)], mass=lambda q: np.ones((2, 2)), force=f["force"])
        with pytest.raises((RuntimeError, ValueError)):
            sparse.start(0, [1, 0], [0, 0])

    def test_answers_that_are_none(self):
        f = self.functions()
        for change, error, word in (({"force": lambda t, q, v: None}, TypeError, "force: None"),
                                    ({"force": lambda t, q, v: np.array([1j, 0])}, TypeError, "force: numbers of dtype complex"),
                                    ({"mass": lambda q: 1j * np.eye(2)}, TypeError, "mass: numbers of dtype complex"),
                                    ({"constraint": lambda t, q: None}, TypeError, "constraint: None"),
                                    ({"force": lambda t, q, v: np.array([math.nan, 0])}, esp.Error, "not a finite number"),
                                    ({"force": lambda t: 1}, TypeError, "argument")):
            with pytest.raises(error, match=word):
                esp.Dae(2, 1, **{**f, **change}).start(0, [1, 0], [0, 0])
        dae = esp.Dae(2, 1, **{**f, "energy": lambda *args: None})
        dae.start(0, [1, 0], [0, 0])
        with pytest.raises(TypeError, match="energy: None"):
            dae.energy()
        with pytest.raises(ValueError, match=r"q has shape \(1, 2\)"):
            dae.start(0, [[1, 0]], [0, 0])
        for options, error in (({"relative": "x"}, TypeError), ({"max_order": 1.5}, TypeError), ({"relative": None}, TypeError)):
            with pytest.raises(error, match="option"):
                esp.Dae(2, 1, **f, **options)
        with pytest.raises(ValueError, match="too many"):
            esp.Dae(2 * 10**9, mass=f["mass"], force=f["force"])

    def test_what_raises_late_leaves_the_system_usable(self):
        broken = []

        def force(t, q, v):
            if broken and t > 0.05:
                raise ZeroDivisionError
            return np.array([0, -20.0])

        dae = esp.Dae(2, 1, **{**self.functions(), "force": force})
        dae.start(0, [1, 0], [0, 0])
        broken.append(True)
        with pytest.raises(ZeroDivisionError):
            dae.integrate(1)
        broken.clear()
        reached = dae.t
        dae.integrate(1)
        assert reached <= 0.05 and dae.t == 1 and sum(dae.energy()) == pytest.approx(0, abs=1e-2)


def test_modes_over_the_speed():
    model = esp.Model(initial={"modes": 8, "rotation": {"axis": [0, 0, 1], "speed": 0, "bodies": ["disc"]}}, integrator={"end": 1e-3})
    model.body("disc", mass=20, inertia=[0.5, 0.5, 0.9])
    model.body("housing", mass=1, inertia=[0.05, 0.05, 0.05])
    model.joint("bearing", "revolute", bodies=["housing", "disc"], at=[0, 0, 0], axis=[0, 0, 1])
    model.force("mount", "bushing", bodies=["ground", "housing"], at=[0, 0, 0], stiffness=[4e5, 4e5, 9e5],
                angular_stiffness=[3e3, 3e3, 5e3])
    speeds = [100.0, 300.0]
    table = model.modes_over("initial.rotation.speed", speeds)
    for speed in speeds:  # 0.55 w^2 -+ 0.9 speed w - 3000 = 0
        half = 0.9 * speed / 1.1
        forward = half + math.sqrt(half**2 + 3e3 / 0.55)
        rows = table[table["value"] == speed]
        nearest = rows[np.argmin(abs(2 * math.pi * rows["frequency"] - forward))]
        assert abs(2 * math.pi * nearest["frequency"] / forward - 1) < 1e-9
        assert nearest["whirl"] > 0.999 and abs(nearest["growth"]) < 1e-6
    with pytest.raises(ValueError, match="parameters.none"):
        model.modes_over("parameters.none.x", [1])
    with pytest.raises(TypeError, match="values"):
        model.modes_over("initial.rotation.speed", ["fast"])
    run = esp.Simulation(model).run()
    assert run.summary["modes"] and all("whirl" in m for m in run.summary["modes"])


def test_rolling():
    model = esp.Model(gravity=[3, 0, -9], integrator={**BDF, "end": 1.0}, output={"quantities": ["rolls.longitudinal_force"]})
    model.body("disc", mass=2, inertia=[0.045, 0.09, 0.045], position=[0, 0, 0.3])
    model.joint("rolls", "rolling", a={"body": "ground", "axis": [0, 0, 1]}, b={"body": "disc", "axis": [0, 1, 0]}, radius=0.3)
    assert abs(model.run()["rolls.longitudinal_force"][-1] + 2) < 1e-6

def test_stresses_envelopes_and_modes():
    """M c / I and F / A of a cantilever, by names that say where; extremes with time and place; damping by ratio."""
    model = esp.Model(statics={}, initial={"modes": 2}, output={"envelopes": ["beam.section.Mz"]})
    model.body("beam", "beam", start=[0, 0, 0], end=[1, 0, 0], elements=4, height=0.02, width=0.01,
               material={"young": 2e11, "poisson": 0.3, "density": 7800}, damping={"ratio": 0.03})
    model.joint("wall", "fixed", a={"body": "ground"}, b={"body": "beam", "node": 1})
    model.force("tip", "load", a={"body": "beam", "node": -1}, force=[0.3, 0.2, 0])
    names = ["beam[0.5 0.01 0].stress.xx", "beam[node 1].section.Mz", "joints[*].force.x"]
    sim = esp.Simulation(model, quantities=names)
    result = sim.run()
    assert sim[names[0]] == pytest.approx(0.3 / 2e-4 - 0.1 * 0.01 / (0.01 * 0.02**3 / 12), rel=1e-3)
    assert sim[names[1]] == pytest.approx(0.2, rel=1e-3) and sim[names[2]] == pytest.approx(-0.3, rel=1e-6)
    envelope = result.summary["envelopes"][0]
    assert envelope["largest"]["node"] == 1 and envelope["largest"]["t"] == 1
    assert envelope["largest"]["place"] == (0, 0, 0) and envelope["largest"]["value"] == pytest.approx(0.2, rel=1e-3)
    assert [m["damping_ratio"] for m in result.summary["modes"]] == pytest.approx([0.03, 0.03], rel=1e-3)
    assert set(result.summary["modes"][0]["values"]) == {names[1]} | {names[0]}
    with pytest.raises(Exception, match="many places"):
        sim["beam.section.Mz"]
