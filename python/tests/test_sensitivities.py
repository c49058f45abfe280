"""Derivatives from Python. Truth: closed forms, and an optimum that is known."""

import numpy as np
import pytest

import espalier as esp


def oscillator(k=4.0):
    model = esp.Model(parameters={"k": k, "m": 2.0}, integrator={"relative": 1e-8, "absolute": 1e-9, "end": 2.0})
    model.body("mass", "point", mass="m", position=[1.5, 0, 0])
    model.force("spring", "spring", a={"body": "ground"}, b={"body": "mass"}, stiffness="k", rest=1)
    return model


def test_derivatives_of_an_oscillator():
    r = oscillator().derivatives(["parameters.k", "parameters.m"], quantities=["mass.position.x"])
    w = np.sqrt(2.0)
    by_w = -0.5 * r.t * np.sin(w * r.t)
    assert r.derivatives.shape == (len(r.t), 1, 2)
    np.testing.assert_allclose(r["mass.position.x"][:, 0], by_w * w / 8, atol=1e-5)
    np.testing.assert_allclose(r["mass.position.x"][:, 1], -by_w * w / 4, atol=1e-5)
    value, gradient = oscillator().gradient("mass.position.x", ["parameters.k"])
    assert gradient.shape == (1,) and value == r.value("mass.position.x")
    assert r.frequencies.shape == (0,)


def test_scipy_finds_the_stiffness():
    optimize = pytest.importorskip("scipy.optimize")
    target = 1 + 0.5 * np.cos(np.sqrt(3.0 / 2) * 2.0)

    def objective(x):
        value, gradient = oscillator().gradient("mass.position.x", ["parameters.k"], set={"parameters.k": float(x[0])})
        return (value - target) ** 2, 2 * (value - target) * gradient

    found = optimize.minimize(objective, [2.0], jac=True, method="BFGS", options={"gtol": 1e-9})
    assert abs(found.x[0] - 3) < 1e-4


def test_mistakes():
    with pytest.raises(esp.InvalidInputError, match="parameters.q"):
        oscillator().derivatives(["parameters.q"])
    with pytest.raises(esp.InvalidInputError, match="no parameter"):
        oscillator().derivatives([])
    with pytest.raises(esp.InvalidInputError, match="give a step"):
        oscillator().derivatives(["bodies.mass.position.1"])
    r = oscillator().derivatives({"bodies.mass.position.1": 1e-3}, quantities="mass.position.y")
    assert r.derivatives.shape[1:] == (1, 1)
