"""The words of a model from Python: the same tree as a text. Truth: the same model with numbers, and closed forms."""

import math

import pytest

import espalier as esp


def swing(**keys):
    model = esp.Model({"integrator": {"end": 0.1, "relative": 1e-9, "absolute": 1e-9}, **keys})
    return model


def test_values_with_units():
    plain = swing(gravity=[0, -9810, 0])
    plain.body("bob", mass=0.54e-3, inertia=[1e-1, 1e-1, 1e-1], position=[500, 0, 0])
    plain.joint("hinge", "revolute", bodies=["ground", "bob"], at=[0, 0, 0], axis=[0, 0, 1])
    measured = swing(units="mm-t-s", gravity="[0, -9.81, 0] m/s^2", parameters={"arm": "0.5 m"})
    measured.body("bob", mass="0.54 kg", inertia=["1e-4 kg m^2", "1e-4 kg*m^2", 0.1], position=["arm", 0, 0])
    measured.joint("hinge", "revolute", bodies=["ground", "bob"], at=["0 mm", 0, 0], axis=[0, 0, 1])
    names = ["bob.position", "hinge.force"]
    truth, result = plain.run(quantities=names), measured.run(quantities=names)
    assert result["bob.position"][-1] == pytest.approx(truth["bob.position"][-1], rel=1e-9)
    assert result.summary["units"] == "mm-t-s" and "units" not in truth.summary
    assert result.dimensions["bob.position.x"] == "mm" and result.dimensions["hinge.force.x"] == "N"
    assert truth.dimensions["bob.position.x"] == "length"
    # A value that is set later has its unit, too.
    heavier = measured.run(quantities=["hinge.force.norm"], set={"bodies.bob.mass": "1.08 kg"})
    assert heavier["hinge.force.norm"][-1] == pytest.approx(2 * math.hypot(*result["hinge.force"][-1]), rel=0.05)
    with pytest.raises(esp.InvalidInputError, match="dimension length, and mass is expected"):
        measured.run(set={"bodies.bob.mass": "3 mm"})
    with pytest.raises(esp.InvalidInputError, match='units = "SI"'):
        plain.run(set={"bodies.bob.mass": "3 kg"})


def test_frames_by_name():
    model = swing(gravity=[0, -10, 0])
    model.body("bob", mass=2, inertia=[1e-9, 1e-9, 1e-9], position=[1, 0, 0])
    model.joint("hinge", "revolute", a="ground", b={"body": "bob", "point": [-1, 0, 0], "axis": [0, 0, 1], "name": "eye"})
    sim = esp.Simulation(model)
    sim.run(progress=False)
    assert sim["eye.position.norm"] == pytest.approx(0, abs=1e-9) and sim["hinge.b.position.x"] == sim["eye.position.x"]
    assert math.hypot(sim["bob.position.x"], sim["bob.position.y"]) == pytest.approx(1)


def test_joints_out_of_reach():
    model = swing()
    model.body("crank", mass=1, inertia=[1, 1, 1], position=[0.5, 0, 0])
    model.joint("hinge", "revolute", bodies=["ground", "crank"], at=[0, 0, 0], axis=[0, 0, 1])
    model.joint("rod", "distance", a={"body": "ground", "point": [0, 2, 0]}, b={"body": "crank", "point": [0.5, 0, 0]}, length=5)
    with pytest.raises(esp.InvalidInputError, match=r"joint 'rod': length 5 is asked, the mechanism reaches (3|2\.9999\d*) \(2 missing\)"):
        model.run()


def test_the_ground_where_only_bodies_can_be():
    model = swing()
    model.body("bob", mass=1, inertia=[1, 1, 1])
    model.support("clamp", body="ground", face="x0", hold="all")
    with pytest.raises(esp.InvalidInputError, match="the ground is no body here"):
        model.run()
