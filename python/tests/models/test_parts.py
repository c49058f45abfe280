"""Models made by calls: what is checked at once, signatures and tables of keys, loading and saving. Truth: the readers of
models themselves, which the calls ask, and the same models as texts."""

import ast
import inspect
import itertools
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import espalier as esp
from espalier import _core
from espalier._models.toml import _value, toml_of

ROOT = Path(__file__).parents[3]
STEEL = {"young": 2e11, "density": 7800}
PAIR = {"bodies": ["ground", "b"], "at": [0, 0, 0], "axis": [0, 0, 1]}
FRAMES = {k: {"body": "ground"} for k in "abcd"}
ALL_OF_BEAM = dict.fromkeys("axial shear_y shear_z torsion bending_y bending_z section_normal section_shear mass_per_length inertia_y"
                            " inertia_z".split(), 1.0)
# Parts that the readers take, so that each of their keys is asked for in one of them.
GOOD = {
    "bodies": {
        "rigid": [{"mass": 1, "inertia": [1, 1, 1]}, {"mesh": {"file": "corner.stl"}, "density": 1}], "point": [{"mass": 1}],
        "solid": [{"mesh": {"file": "a.inp"}, "material": STEEL}],
        "cable": [{"start": [0, 0, 0], "end": [1, 0, 0], "radius": 0.1, "material": STEEL},
                  {"start": [0, 0, 0], "end": [1, 0, 0], "axial": 1, "bending": 1, "mass_per_length": 1}, {"mesh": {"file": "a.inp"}}],
        "beam": [{"start": [0, 0, 0], "end": [1, 0, 0], "radius": 0.1, "material": STEEL},
                 {"start": [0, 0, 0], "direction": [1, 0, 0], "length": 1, "curvature": [0, 0, 1], "height": 1, "width": 1, "material": STEEL},
                 {"points": [[0, 0, 0], [1, 0, 0]], **ALL_OF_BEAM}, {"mesh": {"file": "a.inp"}}],
        "shell": [{"x": [1, 0, 0], "y": [0, 1, 0], "thickness": 0.1, "material": STEEL}, {"mesh": {"file": "a.inp"}}],
        "substructure": [{"stiffness": {"file": "a"}, "mass": {"file": "a"}, "nodes": {"file": "a"}}]},
    "joints": {
        **{t: [PAIR, {"a": "m", "b": "n"}] for t in ("fixed", "spherical", "universal", "planar", "point-on-line", "skate", "revolute",
                                                      "cylindrical", "prismatic", "distance", "revolute-spherical")},
        **{t: [{**PAIR, "motion": 0}, {"a": "m", "b": "n", "motion": 0}] for t in ("rotation-motor", "translation-motor")},
        "prescribed": [{**PAIR, "motion": 0, "direction": "x"}, {"a": "m", "b": "n", "motion": 0, "direction": "x"}],
        "gear": [{**FRAMES, "ratio": 1}], "rack-and-pinion": [{**FRAMES, "radius": 1}],
        "coupled-slides": [{**FRAMES, "ratio": 1}],
        **{t: [PAIR, {"a": "m", "b": "n"}] for t in ("constant-velocity", "parallel-axes", "in-plane", "in-line", "rack-pair")},
        **{t: [{**PAIR, **more}, {"a": "m", "b": "n", **more}] for t, more in (
            ("screw", {"lead": 1}), ("gear-pair", {"teeth": [1, 2]}), ("worm", {"lead": 1, "radius": 1}))},
        "point-on-surface": [
            {**pair, **more} for pair in (PAIR, {"a": "m", "b": "n"}) for more in (
                {"shape": "sphere", "radius": 1}, {"shape": "torus", "radius": 2, "rim": 1}, {"shape": "cone", "angle": 0.5},
                {"shape": "ellipsoid", "half_axes": [1, 1, 1]}, {"shape": "heights", "x": [0, 1], "y": [0, 1], "heights": [[0, 0], [0, 0]]})],
        "point-on-curve": [
            {**pair, **more} for pair in (PAIR, {"a": "m", "b": "n"}) for more in (
                {"points": [[0, 0, 0], [1, 0, 0]], "ends": "straight"}, {"file": "curve.csv", "ends": "straight", "motion": 0})],
        "cable": [{"through": ["m", "n"]}],
        "rolling": [{**PAIR, "radius": 1}, {"a": "m", "b": "n", "radius": 2}]},
    "forces": {
        **{t: [PAIR, {"a": "m", "b": "n"}] for t in ("spring", "axial-spring", "rotational-spring", "bushing")},
        "load": [{"a": "m"}, {"body": "b", "acceleration": [0, 0, 1]}], "pressure": [{"body": "b", "face": "f", "pressure": 1}],
        "guide": [{**part, "stiffness": 1, "smoothing": 1, "lengths": [1], "curvatures": [1]} for part in (PAIR, {"a": "m", "b": "n"})],
        "cable": [{"through": ["m", "n"], "stiffness": 1}], "line-load": [{"body": "b", "force": [0, 0, 1]}],
        "torque-motor": [{**PAIR, "torque": 1}, {"a": "m", "b": "n", "torque": 1}],
        "force-motor": [{**PAIR, "force": 1}, {"a": "m", "b": "n", "force": 1}]},
    "surfaces": {
        "plane": [{"body": "b"}], "sphere": [{"body": "b", "radius": 1}], "box": [{"body": "b", "size": [1, 1, 1]}],
        **{t: [{"body": "b", "radius": 1, "length": 1}] for t in ("capsule", "cylinder")}, "mesh": [{"body": "b", "file": "a"}],
        "faces": [{"body": "b"}], "sprocket": [{"body": "b", "pitch": 1, "roller_radius": 1, "width": 1}],
        "line": [{"body": "b", "radius": 1}]},
    "contacts": {"": [{"surfaces": ["a"], "stiffness": 1, "friction": 0.1, "static": 0.2, "stribeck_speed": 1}]},
    "materials": {"": [{"young": 1}]}, "markers": {"": [{"body": "b"}, {"same_as": "m"}]},
    "supports": {"": [{"body": "b", "hold": "all"}, {"body": "b", "symmetry": "x"}]},
    "splines": {"": [{"points": [[0, 0], [1, 1]]}, {"file": "table.csv"}]},
    "events": {"": [{"when": "t > 1"}, {"when": "opens", "contact": "c"}]}}
SAMPLES = (1, True, "x", "rigid", [1, 1, 1], ["x"], {}, {"file": "a"}, [[0, 0, 0], [1, 0, 0]], [1, 0])


def asked(section, keys, folder):
    """What the reader says of a part; "" where it takes it."""
    message = _core.check_model_part(section, "p", f"{section}.p = {_value(keys, section)}", str(folder / "model.toml"))[1]
    return message


@pytest.mark.parametrize("section", GOOD)
def test_tables_of_keys_are_those_of_the_readers(section, tmp_path):
    (tmp_path / "table.csv").write_text("0,0\n1,1\n")
    (tmp_path / "curve.csv").write_text("0,0,0\n1,1,0\n")
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    faces = "".join("facet normal 0 0 0\nouter loop\n" + "".join("vertex %d %d %d\n" % corners[k] for k in face) + "endloop\nendfacet\n"
                    for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)))
    (tmp_path / "corner.stl").write_text(f"solid corner\n{faces}endsolid\n")
    word = {"surfaces": "shape"}.get(section, "type")
    rows = {kind: keys for s, kind, keys in _core.model_part_keys() if s == section}
    assert set(rows) == set(GOOD[section])
    every = sorted({k for keys in rows.values() for k in keys})
    for kind, bases in GOOD[section].items():
        head = {word: kind} if kind else {}
        for base in bases:
            assert asked(section, {**head, **base}, tmp_path) == "", (kind, base)
        for key in every:
            said = (asked(section, {**head, **base, key: value}, tmp_path) for base in bases for value in SAMPLES)
            if key in rows[kind]:  # one sample at least is read, rightly or wrongly
                assert key in head or any("unknown key" not in text for text in said), (kind, key)
            else:
                assert all(itertools.islice(said, len(SAMPLES))), (kind, key)


def test_the_made_files_are_those_of_the_sources():
    script = ROOT / "docs/site/model_parts.py"
    if not script.exists():
        pytest.skip("the sources of the project are not here")
    done = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def model():
    return esp.Model(gravity=[0, 0, -10], parameters={"length": 2.0}, integrator={"end": 0.1})


@pytest.mark.parametrize("call, words", [
    (lambda m: m.body("bob", mass=1, bx=[1, 1, 1]), r"Model\.body\('bob'\): unknown key 'bx'; did you mean 'box'\?"),
    (lambda m: m.body("bob", mass=1, inertia=[1, 1, 1], bx=[1, 1, 1]), r"Model\.body\('bob'\): unknown key 'bx'; did you mean 'box'\?"),
    (lambda m: m.joint("h", "spherical", bodies=["ground", "bob"], at=[0, 0, 0], limits={}), r"Model\.joint\('h'\): limits: only revolute"),
    (lambda m: m.body("bob", mas=1, box=[1, 1, 1]), r"Model\.body\('bob'\): unknown key 'mas'; did you mean 'mass'\?"),
    (lambda m: m.body("bob", mass=1), r"Model\.body\('bob'\): needs 'inertia'"),
    (lambda m: m.body("bob", mass=-1, box=[1, 1, 1]), r"Model\.body\('bob'\): mass: must be greater than 0"),
    (lambda m: m.body("bob", mass=1, box=[1, 1]), r"Model\.body\('bob'\): box: must be a list of three numbers"),
    (lambda m: m.body("bob", mass=1, box="big"), r"box: must be a list of three numbers"),
    (lambda m: m.body("bob", "rgid", mass=1), r"type: unknown type 'rgid'; did you mean 'rigid'\?"),
    (lambda m: m.body("bob", mass="2*lengt", box=[1, 1, 1]), r"mass: .*did you mean 'length'\?"),
    (lambda m: m.body("bob", "shell", y=[0, 1, 0], thickness=1, material="m"), r"Model\.body\('bob'\): needs 'x'"),
    (lambda m: m.body("bob", "solid", mesh={"file": "a.inp", "scal": 1}, material="m"), r"unknown key 'mesh\.scal'; did you mean 'scale'\?"),
    (lambda m: m.body("bob", "solid", msh={"file": "a.inp"}), r"unknown key 'msh'; did you mean 'mesh'\?"),
    (lambda m: m.joint("h", "revolute", bodies=["ground", "bob"], at=[0, 0, 0], motion="t"), r"Model\.joint\('h'\): unknown key 'motion'"),
    (lambda m: m.joint("h", "revolute", bodies=["ground", "bob"], at=[0, 0, 0], limits={"lowr": 1}), r"Model\.joint\('h'\): limits"),
    (lambda m: m.force("f", "load", a={"body": "bob", "pont": [0, 0, 0]}), r"unknown key 'a\.pont'; did you mean 'point'\?"),
    (lambda m: m.surface("s", "sphere", body="bob"), r"Model\.surface\('s'\): needs 'radius'"),
    (lambda m: m.contact("c", surfaces=["s"]), r"Model\.contact\('c'\): needs 'stiffness'"),
    (lambda m: m.material("m", yung=1), r"Model\.material\('m'\): unknown key 'yung'; did you mean 'young'\?"),
    (lambda m: m.material("m", young=1, poisson=0.5), r"Model\.material\('m'\): poisson: must lie in"),
    (lambda m: m.marker("k", body="bob", axs=[0, 0, 1]), r"Model\.marker\('k'\): unknown key 'axs'; did you mean 'axis'\?"),
    (lambda m: m.spline("s", points=[[0, 0]]), r"Model\.spline\('s'\): "),
    (lambda m: m.spline("s", file="no such.csv"), r"Model\.spline\('s'\): .*no such\.csv"),
    (lambda m: m.support("w", body="bob", hold="w"), r"Model\.support\('w'\): hold: "),
    (lambda m: m.event("e", when="t = 1"), r"Model\.event\('e'\): when: must be one comparison"),
    (lambda m: m.sensor("s", "sin("), r"Model\.sensor\('s'\): "),
    (lambda m: m.input("i", "text("), r"Model\.input\('i'\): "),
    (lambda m: m.body("a b", mass=1, box=[1, 1, 1]), r"Model\.body\('a b'\): names are made of letters"),
])
def test_mistakes_are_said_by_the_call(call, words):
    m = model()
    before = dict(m.tree)
    with pytest.raises(esp.InvalidInputError, match=words) as found:
        call(m)
    assert "model:" not in str(found.value) and m.tree == before


def test_wrong_values_of_python():
    m = model()
    for call, kind, words in ((lambda: m.body("b", mass=object(), box=[1, 1, 1]), TypeError, r"Model\.body\('b'\): mass: object"),
                              (lambda: m.body("b", mass=math.nan, box=[1, 1, 1]), ValueError, "mass"), (lambda: m.body(3, mass=1), TypeError, "name"),
                              (lambda: esp.Model(gravty=[0, 0, 1]), TypeError, "did you mean 'gravity'"),
                              (lambda: m.part("bodys", "b", {}), ValueError, "bodys.*bodies")):
        with pytest.raises(kind, match=words):
            call()
    m.body("b", mass=1, box=[1, 1, 1])
    with pytest.raises(ValueError, match=r"Model\.body\('b'\): bodies\.b is there already"):
        m.body("b", mass=1, box=[1, 1, 1])


def test_what_others_will_bring_is_waited_for():
    """Materials, parameters, inputs and contacts may come later; check() and runs look for them."""
    m = model()
    m.body("plate", "shell", x=[1, 0, 0], y=[0, 1, 0], thickness="thick", material="steel")
    m.event("e", when="t > 0.05", set={"push": 1}, off=["f"])
    with pytest.raises(esp.InvalidInputError, match=r"^bodies\.plate\.material: unknown material 'steel'"):
        m.check()
    m.material("steel", **STEEL)
    with pytest.raises(esp.InvalidInputError, match=r"^bodies\.plate\.thickness: .*unknown name 'thick'"):
        m.check()
    m.tree["parameters"]["thick"] = 0.01
    with pytest.raises(esp.InvalidInputError, match=r"^events\.e\.set\.push: unknown input 'push'"):
        m.check()
    m.input("push", 0)
    with pytest.raises(esp.InvalidInputError, match=r"^events\.e: .*'f'"):
        m.run(progress=False)
    m.force("f", "load", a={"body": "ground"}, force=["inputs.push", 0, 0])
    m.joint("hold", "spherical", bodies=["ground", "plat"], at=[0, 0, 0])
    with pytest.raises(esp.InvalidInputError, match=r"^joints\.hold\.bodies: unknown body 'plat'; did you mean 'plate'"):
        m.check()
    del m.tree["joints"]
    m.check()
    m.check(set={"parameters.thick": 0.02})
    with pytest.raises(esp.InvalidInputError, match="thickness"):
        m.check(set={"parameters.thick": -1})
    for call, words in ((lambda: m.check(set={"bodies.plate.thicknes": 1}), r"^set: bodies\.plate\.thicknes: unknown key"),
                        (lambda: m.harmonic(loads="g", frequencies=[1.0]), r"^Model\.harmonic\(\): loads: ")):
        with pytest.raises(esp.InvalidInputError, match=words):
            call()


def test_values_of_numpy_and_paths():
    m = model()
    m.body("a", mass=np.float32(2), inertia=np.eye(3), position=np.arange(3), velocity=(0, np.float64(1), 0))
    m.body("b", "solid", mesh={"file": Path("x") / "a.inp", "scale": np.int64(2)}, material=STEEL, gravity=None)
    m.marker("k", body="a", point=range(3), global_=True)
    m.joint("t", "translation-motor", a="k", b={"body": "a"}, motion="0.1*t", from_="initial")
    assert m.tree["markers"]["k"]["global"] is True and m.tree["joints"]["t"]["from"] == "initial"
    assert 'file = "x/a.inp"' in m.text and "gravity" not in m.tree["bodies"]["b"]


def test_unknown_keys_come_first_in_texts_too():
    for text, words in (("[bodies.bob]\ntype = 'rigid'\nmass = 1\nbx = [1, 1, 1]\n[integrator]\nend = 1\n", r"model:4: bodies\.bob\.bx: unknown key; did you mean 'box'"),
                        ("[bodies.p]\ntype = 'shell'\ny = [0, 1, 0]\n[integrator]\nend = 1\n", "needs 'x'"),
                        ("[bodies.p]\ntype = 'point'\nmass = 1\n[integratr]\nend = 1\n", r"integratr: unknown key; did you mean 'integrator'"),
                        ("[bodies.p]\ntype = 'point'\nmass = 1\n[integrator]\nrelatve = 1e-3\n", r"relatve: unknown key; did you mean 'relative'")):
        with pytest.raises(esp.InvalidInputError, match=words):
            esp.Model.from_text(text).run(progress=False)


def test_keywords_that_a_call_does_not_have():
    sparse = pytest.importorskip("scipy.sparse").eye_array(3).tocsc()
    m = model()
    m.body("b", "point", mass=1)
    for call, words in ((lambda: m.run(unti=3), r"Model\.run\(\): there is no argument 'unti'; did you mean 'until'" if sys.version_info >= (3, 11) else "'until'"),
                        (lambda: esp.Simulation(m, quantites=["b.position"]), "did you mean 'quantities'"),
                        (lambda: esp.sweep(m, {"bodies.b.mass": [1, 2]}, thread=1), "did you mean 'threads'"),
                        (lambda: esp.derivatives(m, ["bodies.b.mass"], metod="auto"), "did you mean 'method'"),
                        (lambda: m.gradient("b.position.x", ["bodies.b.mass"], untill=1), "did you mean 'until'"),
                        (lambda: m.modes(sett={}), "did you mean 'set'"), (lambda: m.statics(linar=True), "did you mean 'linear'"),
                        (lambda: m.harmonic(load="x"), "did you mean 'loads'"), (lambda: m.show(heigth=3), "did you mean 'height'"),
                        (lambda: esp.Solver(thread=1), "did you mean 'threads'"), (lambda: esp.Dae(1, relativ=1), "did you mean 'relative'"),
                        (lambda: esp.modes(*2 * [sparse], 1, tolerence=1), "did you mean 'tolerance'")):
        with pytest.raises(TypeError, match=words):
            call()


def test_loading_changing_and_saving(tmp_path, monkeypatch):
    (tmp_path / "far").mkdir()
    (tmp_path / "table.csv").write_text("0,0\n1,2\n")
    text = ('# a comment\ngravity = [0, 0, -9.81]\n[splines.f]\nfile = "table.csv"\n[bodies.bob]\ntype = "point"\nmass = 2.0 # kg\n'
            '[forces.push]\ntype = "load"\na = { body = "bob" }\nforce = ["f(t)", 0, 0]\n[integrator]\nend = 1\nrelative = 1e-9\n')
    file = tmp_path / "m.toml"
    file.write_text(text)
    loaded = esp.Model.load(file)
    assert loaded.text == text and loaded.tree["bodies"]["bob"]["mass"] == 2.0 and list(loaded.tree)[0] == "gravity"
    truth = loaded.run(quantities=["bob.position"], progress=False)
    assert truth["bob.position.x"][-1] == pytest.approx(2 / 2 / 6, abs=1e-7)
    loaded.save(tmp_path / "same.toml")
    assert (tmp_path / "same.toml").read_text() == text
    loaded.save(tmp_path / "far/moved.toml")
    monkeypatch.chdir(tmp_path / "far")
    assert (esp.Model.load("moved.toml").run(quantities=["bob.position"], progress=False).values == truth.values).all()
    loaded.body("other", "point", mass=1)  # changed: files are still looked for beside the file that was read
    loaded.tree["bodies"]["bob"]["mass"] = 4.0
    again = loaded.run(quantities=["bob.position"], progress=False)
    assert again["bob.position.x"][-1] == pytest.approx(truth["bob.position.x"][-1] / 2, rel=1e-6)
    loaded.save(tmp_path / "changed.toml")
    assert esp.Model.load(tmp_path / "changed.toml").tree == loaded.tree
    del loaded.tree["integrator"]
    with pytest.raises(esp.InvalidInputError, match=r"^needs a section \[integrator\]"):
        loaded.run(progress=False)
    file.write_text(text.replace("mass = 2.0", "mass = -2.0"))
    with pytest.raises(esp.InvalidInputError, match=r"m\.toml:7: bodies\.bob\.mass"):
        esp.Model.load(file).run(progress=False)
    file.write_text("a = [")
    with pytest.raises(esp.InvalidInputError, match=r"m\.toml:1"):
        esp.Model.load(file)
    with pytest.raises(esp.InvalidInputError, match="none.toml"):
        esp.Model.load(tmp_path / "none.toml")


def test_trees_are_read_as_tomllib_reads_them():
    tomllib = pytest.importorskip("tomllib")
    text = ('title = "a \\"quoted\\" \\\\ \\u00e9 <&>\'"\nbig = 9007199254740993\nsmall = 5e-324\none = 1.0\nhuge = 1e300\nmany = [1, [2.5, "x"], { a = true }]\n'
            '[bodies."x"]\nmass = 0.1\n[[repeat]]\nto = 3\n[[repeat]]\nto = 4\n')
    found = esp.Model.from_text(text).tree
    truth = tomllib.loads(text)
    assert found == truth and [type(v) for v in found.values()] == [type(v) for v in truth.values()]
    assert esp.Model.from_text("a = [nan, inf, -inf]").tree["a"][1:] == [math.inf, -math.inf]


@pytest.mark.parametrize("path", sorted((ROOT / "models").glob("**/*.toml"))[:12], ids=lambda p: p.stem)
def test_models_survive_loading_and_writing(path):
    read = esp.Model.load(path)
    assert read.text == path.read_text()
    assert esp.Model.from_text(toml_of(read.tree)).tree == read.tree
    read.check()


def spring():
    m = esp.Model()
    m.body("bob", "point", mass=2)
    m.force("k", "spring", a={"body": "ground", "point": [-1, 0, 0]}, b={"body": "bob"}, stiffness=18)
    for axis in "yz":
        m.joint(f"hold_{axis}", "prescribed", a={"body": "ground"}, b={"body": "bob"}, motion=0, direction=axis)
    m.force("push", "load", a={"body": "bob"}, force=[9, 0, 0])
    return m


def test_answers_without_an_integrator():
    """x'' = (9 - 18 x) / 2: a frequency of 3 rad, 0.5 at rest."""
    m = spring()
    m.check()
    rows = m.modes(1)
    assert rows.shape == (1,) and rows["frequency"][0] == pytest.approx(3 / (2 * math.pi), rel=1e-6) and rows.dtype.names[0] == "mode"
    found = m.statics(quantities=["bob.position.x"], progress=False)
    assert found["bob.position.x"][-1] == pytest.approx(0.5, rel=1e-7) and "statics" in found.summary["method"]
    assert m.statics(quantities=["bob.position.x"], load=0.5, progress=False)["bob.position.x"][-1] == pytest.approx(0.25, rel=1e-7)
    answer = m.harmonic(loads="push", frequencies=[0.0], quantities=["bob.position.x"])
    assert abs(answer["bob.position.x"][0]) == pytest.approx(0.5, rel=1e-6)
    m.tree["integrator"] = {"end": 1.0}
    assert m.statics(quantities=["bob.position.x"], progress=False)["bob.position.x"][-1] == pytest.approx(0.5, rel=1e-7)
    assert m.modes_over("bodies.bob.mass", [2.0, 8.0], 1)["frequency"] == pytest.approx([3 / (2 * math.pi), 1.5 / (2 * math.pi)], rel=1e-6)
    del m.tree["integrator"]
    with pytest.raises(esp.InvalidInputError, match=r"^needs a section \[integrator\]"):
        m.run(progress=False)


def test_every_public_member_says_what_it_is():
    package = Path(esp.__file__).parent
    silent = []
    for name in esp.__all__:
        thing = getattr(esp, name)
        if not callable(thing):
            continue
        if not inspect.getdoc(thing):
            silent.append(name)
        for member, value in vars(thing).items() if inspect.isclass(thing) else ():
            value = getattr(value, "fget", getattr(value, "__func__", value))
            if not member.startswith("_") and inspect.isfunction(value) and not value.__doc__:
                silent.append(f"{name}.{member}")
    for module in ("jax", "mpi", "ngsolve", "scipy", "sfepy", "torch"):
        for node in ast.parse((package / f"{module}.py").read_text()).body:
            for item in [node, *(node.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_") else ())]:
                if isinstance(item, (ast.ClassDef, ast.FunctionDef)) and not item.name.startswith("_") and not ast.get_docstring(item):
                    silent.append(f"{module}.{item.name}")
    assert not silent
    for word in ("mass: number > 0 [mass], needed", "young", "default [0, 0, 0]", "thickness"):
        assert word in esp.Model.body.__doc__ + esp.Model.material.__doc__, word


def test_signatures_find_mistakes(tmp_path):
    """mypy --strict over good uses, and over mistakes each of which must be found in its line."""
    pytest.importorskip("mypy")
    good = (Path(__file__).parent / "typed_good.py").read_text()
    mistakes = [line for line in (Path(__file__).parent / "typed_wrong.py").read_text().splitlines() if "# wrong: " in line]
    assert len(mistakes) > 20
    (tmp_path / "good.py").write_text(good)
    (tmp_path / "wrong.py").write_text((Path(__file__).parent / "typed_wrong.py").read_text())
    cache = ROOT / "build/mypy_cache" if (ROOT / "build").is_dir() else tmp_path / "cache"  # what NumPy's stubs say, for the next time
    (tmp_path / "mypy.ini").write_text("[mypy]\n[mypy-espalier._core]\nignore_errors = True\n")  # that nanobind makes
    done = subprocess.run([sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--no-error-summary", "--hide-error-context",
                           "--cache-dir", str(cache), "good.py", "wrong.py"], cwd=tmp_path, capture_output=True, text=True,
                          env={"MYPYPATH": str(Path(esp.__file__).parent.parent), "PATH": "/usr/bin:/bin"})
    errors = [line for line in done.stdout.splitlines() if ": error: " in line]
    assert not [e for e in errors if not e.startswith("wrong.py")], done.stdout[:4000] + done.stderr
    by_line = {}
    for error in errors:
        by_line.setdefault(int(error.split(":")[1]), []).append(error)
    for number, line in enumerate((tmp_path / "wrong.py").read_text().splitlines(), 1):
        told = "\n".join(by_line.pop(number, []))
        if "# wrong: " in line:
            assert line.split("# wrong: ")[1] in told, f"{line}: {told or 'nothing is said'}"
        else:
            assert not told
    assert not by_line


def test_a_save_that_fails_leaves_the_file(tmp_path):
    """As on a full disk: the limit of a file's size is met in the middle of the text."""
    path = tmp_path / "m.toml"
    esp.Model(title="first", integrator={"end": 1}).save(path)
    before = path.read_text()
    code = ("import resource, signal, sys, espalier as esp\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
            "resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n"
            "m = esp.Model(title='x' * 5000, integrator={'end': 1})\n"
            "try:\n    m.save(sys.argv[1])\nexcept OSError:\n    sys.exit(7)\n")
    done = subprocess.run([sys.executable, "-B", "-c", code, str(path)], capture_output=True, text=True)
    assert done.returncode == 7, done.stderr
    assert path.read_text() == before
    assert [p.name for p in tmp_path.iterdir()] == ["m.toml"]
