"""Models as FMUs. tests/fmi has the truth of the steps; here is Python's call, and what FMPy, another importer, says of
the files where it is installed (python -m pip install fmpy; in .ci/run it is)."""

import math
import zipfile

import numpy as np
import pytest

import espalier as esp

MODEL = """
units = "SI"
[parameters]
mass = 2
[inputs]
push = 1
[bodies.m]
type = "point"
mass = "mass"
position = [1, 0, 0]
velocity = [0, 1, 0]
[forces.spring]
type = "spring"
a = "ground"
b = "m"
stiffness = 50
rest = 1
damping = 0.3
[forces.push]
type = "load"
a = "m"
force = ["inputs.push * cos(3*t)", 0, 0]
[integrator]
method = "generalized-alpha"
step = 0.002
end = 1
"""
OUTPUTS = ["m.position", "m.acceleration.x", "energy.total"]
NAMES = ["m.position.x", "m.position.y", "m.position.z", "m.acceleration.x", "energy.total"]


@pytest.fixture(scope="module", params=[2, 3])
def fmu(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("fmu") / f"spring{request.param}"
    return request.param, esp.Model.from_text(MODEL).export_fmu(path, version=request.param, outputs=OUTPUTS)


def test_what_is_written(fmu):
    version, made = fmu
    assert made.path.endswith(f"spring{version}.fmu") and made.bytes < 15e6 and made.files == ()
    kinds = {kind: [v.name for v in made.variables if v.kind == kind] for kind in ("input", "output", "parameter")}
    assert kinds == {"input": ["push"], "output": NAMES, "parameter": ["parameters.mass"]}
    assert {v.name: v.unit for v in made.variables}["m.acceleration.x"] == "m/s^2"
    names = zipfile.ZipFile(made.path).namelist()
    assert zipfile.ZipFile(made.path).testzip() is None
    assert ("binaries/linux64/" if version == 2 else "binaries/x86_64-linux/") + f"spring{version}.so" in names
    assert made.model_exchange and len([v for v in made.variables if v.kind == "state"]) == 6


def test_why_no_model_exchange(tmp_path):
    model = esp.Model.from_text(MODEL)
    model.body("rigid", mass=1, inertia=[1, 1, 1])
    made = model.export_fmu(tmp_path / "a.fmu", outputs=["rigid.position"])
    assert not made.model_exchange and "quaternion" in made.no_model_exchange
    model.joint("hinge", "revolute", bodies=["ground", "rigid"], at=[0, 0, 0], axis=[0, 0, 1])
    assert "constraint" in model.export_fmu(tmp_path / "a.fmu", outputs=["rigid.position"]).no_model_exchange


def test_what_is_refused(tmp_path):
    model = esp.Model.from_text(MODEL)
    for words, wrong in (("did you mean 'push'", {"inputs": ["pusch"]}), ("did you mean 'mass'", {"parameters": ["mas"]}),
                         ("did you mean 'm'|there is no", {"outputs": ["mm.position"]}), ("bodies.n: needs 'type'", {"set": {"bodies.n.mas": 3}})):
        with pytest.raises(esp.InvalidInputError, match=words):
            model.export_fmu(tmp_path / "a.fmu", **{"outputs": ["m.position"], **wrong})
    with pytest.raises(esp.InvalidInputError, match="without outputs"):
        model.export_fmu(tmp_path / "a.fmu")
    with pytest.raises(ValueError):
        model.export_fmu(tmp_path / "a.fmu", version=1)
    assert not list(tmp_path.iterdir())


def test_another_importer_runs_it(fmu):
    fmpy = pytest.importorskip("fmpy")
    from fmpy.validation import validate_fmu

    version, made = fmu
    assert validate_fmu(made.path) == []
    rows = fmpy.simulate_fmu(made.path, stop_time=0.5, output_interval=0.02, start_values={"parameters.mass": 3.0, "push": 2.0},
                             output=NAMES, fmi_type="CoSimulation")
    truth = esp.Simulation(esp.Model.from_text(MODEL), set={"parameters.mass": 3, "inputs.push": 2}, page=False)
    for row in rows:
        if row["time"] > 0:
            truth.step_to(float(row["time"]))
        assert all(row[name] == truth.value(name) for name in NAMES)


def test_another_integrator_runs_it(fmu):
    """Model exchange: FMPy's CVODE holds the states."""
    fmpy = pytest.importorskip("fmpy")
    rows = fmpy.simulate_fmu(fmu[1].path, stop_time=0.5, output_interval=0.1, relative_tolerance=1e-10, output=NAMES,
                             fmi_type="ModelExchange", solver="CVode")
    truth = esp.Simulation(esp.Model.from_text(MODEL), set={"integrator.step": 2e-5}, page=False)
    truth.step_to(0.5)
    assert all(math.isclose(rows[-1][name], truth.value(name), rel_tol=2e-6, abs_tol=2e-6) for name in NAMES)


def instance_of(made, version, kind="coSimulation"):
    """In its initialization, and the value references by name."""
    pytest.importorskip("fmpy")
    from fmpy import extract, fmi2, fmi3, read_model_description

    d = read_model_description(made.path)
    makers = {("coSimulation", 2): fmi2.FMU2Slave, ("coSimulation", 3): fmi3.FMU3Slave,
              ("modelExchange", 2): fmi2.FMU2Model, ("modelExchange", 3): fmi3.FMU3Model}
    fmu = makers[kind, version](guid=d.guid, unzipDirectory=extract(made.path), modelIdentifier=getattr(d, kind).modelIdentifier,
                                instanceName="a")
    fmu.instantiate()
    if version == 2:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    return fmu, {v.name: v.valueReference for v in d.modelVariables}


def test_directional_derivatives(fmu):
    version, made = fmu
    slave, reference = instance_of(made, version)
    known, unknown = [reference["parameters.mass"]], [reference["m.acceleration.x"], reference["energy.total"]]
    by_mass = list(slave.getDirectionalDerivative(unknown, known, [1.0]))
    assert by_mass[0] == pytest.approx(-1 / 4, rel=1e-7)  # a = push / m
    assert by_mass[1] == pytest.approx(0.5, rel=1e-7)  # v^2 / 2
    slave.exitInitializationMode()
    slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.5)
    known = [reference["push"]]
    by_push = list(slave.getDirectionalDerivative(unknown, known, [2.0]))
    assert by_push[0] == pytest.approx(2 * math.cos(1.5) / 2, rel=1e-9) and by_push[1] == pytest.approx(0, abs=1e-9)
    slave.terminate()
    slave.freeInstance()


def test_directional_derivatives_of_inputs_near_zero(tmp_path):
    """sin(pi) is 1.2e-16; and a seed over inputs of 1e-5 and 1e6. Truth: a = (9.81 + small + push / 1e6) / m, within what is left of a in the last bit
    of a step of 1e-3 times 1e-5."""
    text = MODEL.replace("push = 1\n", "push = 0\nsmall = 0\n").replace('"inputs.push * cos(3*t)"', '"9.81 + inputs.small + inputs.push/1e6"')
    made = esp.Model.from_text(text).export_fmu(tmp_path / "near", outputs=["m.acceleration.x"])
    slave, reference = instance_of(made, 3)
    slave.exitInitializationMode()
    unknown, known = [reference["m.acceleration.x"]], [reference["small"], reference["push"]]
    for small, push in ((0.0, 0.0), (1.2e-16, 0.0), (1e-9, 1e-300), (1e-5, 1e6), (1e3, 0.0)):
        slave.setFloat64(known, [small, push])
        assert slave.getDirectionalDerivative(unknown, known, [1.0, 1.0])[0] == pytest.approx(0.5 * (1 + 1e-6), abs=1e-15 / 1e-8)
    with pytest.raises(Exception, match="fmi3SetFloat64"):
        slave.setFloat64(known, [math.nan, 0.0])
    slave.terminate()
    slave.freeInstance()


RIG = """
units = "SI"
gravity = [0, -9.81, 0]
[inputs]
push = 0.7
valve = 0.4
[bodies.a]
type = "point"
mass = 2
position = [1, 0, 0]
velocity = [0.3, 1, 0]
[bodies.b]
type = "point"
mass = 3
position = [2, 0.5, 0.2]
[bodies.c]
type = "solid"
position = [3, 0, 0]
mesh = { part = "block", lx = 0.1, ly = 0.1, lz = 0.6, divisions = [1, 1, 2] }
material = { density = 800, young = 1e6, poisson = 0.3 }
[forces.spring]
type = "spring"
a = "a"
b = "b"
stiffness = 80
rest = 0.9
damping = 0.5
actuator = "30*inputs.valve^2"
[forces.tie]
type = "spring"
a = "b"
b = { body = "c", near = [3, 0, 0] }
stiffness = 200
rest = 0.5
damping = 1
[forces.push]
type = "load"
a = "b"
force = ["inputs.push*cos(inputs.push)", "-0.3*b.velocity.y^3", "inputs.valve*a.position.x"]
[integrator]
method = "generalized-alpha"
step = 0.002
end = 1
"""


@pytest.mark.parametrize("version", [2, 3])
def test_derivatives_of_model_exchange(tmp_path, version):
    """Every derivative by every state and input, beside central differences of what the FMU says."""
    made = esp.Model.from_text(RIG).export_fmu(tmp_path / "rig", version=version, outputs=["spring.strength", "energy.total", "b.acceleration.x"])
    fmu, reference = instance_of(made, version, "modelExchange")
    states = [reference[v.name] for v in made.variables if v.kind == "state"]
    unknowns = [reference[v.name] for v in made.variables if v.kind in ("output", "derivative")]
    inputs = [reference["push"], reference["valve"]]
    get = fmu.getReal if version == 2 else fmu.getFloat64
    set_values = fmu.setReal if version == 2 else fmu.setFloat64
    fmu.exitInitializationMode()
    (fmu.enterContinuousTimeMode if version == 3 else lambda: None)()
    at = np.array(get(states + inputs))
    generator = np.random.default_rng(1)
    for _ in range(3):  # along random directions, and then one by one
        seeds = [generator.uniform(-1, 1, len(at))]
        seeds += [row for k, row in enumerate(np.eye(len(at))) if k % 5 == 0 or k >= len(states)]
        point = at + generator.uniform(-1e-2, 1e-2, len(at))
        for seed in seeds:
            set_values(states + inputs, list(point))
            told = np.array(fmu.getDirectionalDerivative(unknowns, states + inputs, list(seed)))

            def value(way):
                set_values(states + inputs, list(point + way * seed))
                return np.array(get(unknowns))

            h = 1e-4
            truth = (8 * (value(h) - value(-h)) - value(2 * h) + value(-2 * h)) / (12 * h)
            assert np.max(np.abs(truth)) > 0.1
            assert np.max(np.abs(told - truth)) < 1e-7 * np.max(np.abs(truth))
    fmu.terminate()
    fmu.freeInstance()


PENDULUM = """
units = "SI"
gravity = [0, -9.81, 0]
[inputs]
torque = 0.5
[bodies.bob]
type = "rigid"
mass = 2
inertia = [0.01, 0.01, 0.01]
position = [0.7, 0, 0]
[joints.hinge]
type = "revolute"
bodies = ["ground", "bob"]
axis = [0, 0, 1]
at = [0, 0, 0]
[forces.drive]
type = "torque-motor"
bodies = ["ground", "bob"]
at = [0, 0, 0]
axis = [0, 0, 1]
torque = "inputs.torque + 2*sin(inputs.torque)"
[integrator]
method = "generalized-alpha"
step = 0.002
end = 1
"""


@pytest.mark.parametrize("version", [2, 3])
def test_derivatives_through_joints(tmp_path, version):
    """Co-simulation with constraints: closed form at each communication point, and differences of starts before."""
    made = esp.Model.from_text(PENDULUM).export_fmu(tmp_path / "p", version=version, outputs=[
        "bob.acceleration", "hinge.force", "hinge.angle"])
    fmu, reference = instance_of(made, version)
    names = ["bob.acceleration.x", "bob.acceleration.y", "hinge.force.x", "hinge.force.y", "hinge.angle"]
    unknowns, known = [reference[n] for n in names], [reference["torque"]]
    pin, arm = 0.01 + 2 * 0.7**2, 0.7

    def truth(torque, angle):
        spin = (1 + 2 * math.cos(torque)) / pin  # d(angular acceleration)/d(input)
        a = np.array([-math.sin(angle), math.cos(angle)]) * spin * arm
        return np.array([*a, *(2 * a), 0])

    before = np.array(fmu.getDirectionalDerivative(unknowns, known, [1.0]))  # by differences
    fmu.exitInitializationMode()
    at_start = np.array(fmu.getDirectionalDerivative(unknowns, known, [1.0]))
    assert np.allclose(before, truth(0.5, 0), rtol=0, atol=1e-7)
    assert np.allclose(at_start, truth(0.5, 0), rtol=0, atol=1e-11)
    for k in range(5):
        torque = 0.5 - 0.3 * k
        (fmu.setReal if version == 2 else fmu.setFloat64)(known, [torque])
        fmu.doStep(currentCommunicationPoint=0.1 * k, communicationStepSize=0.1)
        angle = (fmu.getReal if version == 2 else fmu.getFloat64)([reference["hinge.angle"]])[0]
        told = np.array(fmu.getDirectionalDerivative(unknowns, known, [1.0]))
        assert np.allclose(told, truth(torque, angle), rtol=0, atol=1e-10)
    fmu.terminate()
    fmu.freeInstance()
