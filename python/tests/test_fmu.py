"""Models as FMUs. tests/fmi has the truth of the steps; here is Python's call, and what FMPy, another importer, says of
the files where it is installed (python -m pip install fmpy)."""

import math
import zipfile

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


def test_directional_derivatives(fmu):
    fmpy = pytest.importorskip("fmpy")
    from fmpy import extract, fmi2, fmi3, read_model_description

    version, made = fmu
    d = read_model_description(made.path)
    reference = {v.name: v.valueReference for v in d.modelVariables}
    folder = extract(made.path)
    slave = (fmi2.FMU2Slave if version == 2 else fmi3.FMU3Slave)(
        guid=d.guid, unzipDirectory=folder, modelIdentifier=d.coSimulation.modelIdentifier, instanceName="a")
    slave.instantiate()
    if version == 2:
        slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
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
    assert fmpy.__version__
