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


def cantilever(segments=6):
    """A chain of beams with heights of their own, and a weight at its end."""
    heights = {f"h{i}": 0.02 for i in range(segments)}
    model = esp.Model(parameters=heights, statics={"tolerance": 1e-11})
    for i in range(segments):
        model.body(f"b{i}", "beam", start=[i / segments, 0, 0], end=[(i + 1) / segments, 0, 0], elements=2, height=f"h{i}",
                   width=0.02, material={"young": 2e9, "poisson": 0.0, "density": 1000.0})
        before = {"body": f"b{i - 1}", "node": -1} if i else {"body": "ground"}
        model.joint(f"j{i}", "fixed", a=before, b={"body": f"b{i}", "node": 1})
    model.marker("tip", body=f"b{segments - 1}", node=-1)
    model.force("load", "load", a="tip", force=[0, -0.01, 0])
    return model


def test_adjoint_is_forward_and_finds_the_best_heights():
    optimize = pytest.importorskip("scipy.optimize")
    n = 6
    names = [f"parameters.h{i}" for i in range(n)]
    model = cantilever(n)
    adjoint = model.derivatives(names, quantities="tip.position.y", method="adjoint")
    forward = model.derivatives(names, quantities="tip.position.y", method="forward")
    assert adjoint.adjoint and not forward.adjoint and adjoint.defect < 1e-4
    np.testing.assert_allclose(adjoint.derivatives, forward.derivatives, rtol=1e-4)
    assert model.derivatives(names, quantities="tip.position.y").adjoint  # more parameters than quantities

    def sag(h):  # as stiff as can be with the volume of a beam of height 0.02
        value, gradient = model.gradient("tip.position.y", names, set=dict(zip(names, h)))
        return -1e4 * value, -1e4 * gradient

    best = optimize.minimize(sag, np.full(n, 0.02), jac=True, method="SLSQP", bounds=[(0.003, 0.05)] * n,
                             constraints={"type": "eq", "fun": lambda h: 50 * (h.mean() - 0.02),
                                          "jac": lambda h: np.full(n, 50 / n)}, options={"ftol": 1e-10})
    # The mean of the squared moment over segment i, over h^3, has the slope -3 m_i / h^4, alike for all: h ~ m_i^(1/4).
    x = np.arange(n + 1) / n
    m = ((1 - x[:-1]) ** 3 - (1 - x[1:]) ** 3) ** 0.25
    np.testing.assert_allclose(best.x, 0.02 * m / m.mean(), rtol=5e-3)


def test_adjoint_mistakes():
    with pytest.raises(ValueError, match="backwards"):
        oscillator().derivatives(["parameters.k"], quantities="mass.position.x", method="backwards")


def test_adjoint_of_a_motion():
    names = ["parameters.k", "parameters.m"]
    forward = oscillator().derivatives(names, quantities="mass.position.x")
    adjoint = oscillator().derivatives(names, quantities="mass.position.x", method="adjoint")
    assert adjoint.adjoint and adjoint.t.shape == (1,) and adjoint.derivatives.shape == (1, 1, 2)
    np.testing.assert_allclose(adjoint.derivatives[-1], forward.derivatives[-1], rtol=1e-7)

    def objective(t, values):
        share = np.gradient(t)[:, None]
        return float((share * values**2).sum()), 2 * share * values

    value, gradient = oscillator().gradient(objective, names, quantities="mass.position.x")
    truth, slopes = objective(forward.t, forward.values)
    assert value == truth
    np.testing.assert_allclose(gradient, np.einsum("tq,tqp->p", slopes, forward.derivatives), rtol=1e-7)


def test_scipy_finds_the_stiffness_of_a_measured_motion():
    optimize = pytest.importorskip("scipy.optimize")

    def objective(t, values):
        lack = values[:, 0] - (1 + 0.5 * np.cos(np.sqrt(3.0 / 2) * t))
        return float(lack @ lack), 2 * lack[:, None]

    def of(x):
        return oscillator().gradient(objective, ["parameters.k"], quantities=["mass.position.x"], set={"parameters.k": float(x[0])})

    found = optimize.minimize(of, [2.0], jac=True, method="BFGS", options={"gtol": 1e-6})
    assert abs(found.x[0] - 3) < 1e-4


def test_objective_mistakes():
    model = oscillator()
    with pytest.raises(ValueError, match="shape"):
        model.gradient(lambda t, values: (0.0, values[:, 0]), ["parameters.k"], quantities="mass.position.x")
    with pytest.raises(ZeroDivisionError):
        model.gradient(lambda t, values: (1 / 0, values), ["parameters.k"], quantities="mass.position.x")
    with pytest.raises(TypeError):
        model.gradient(lambda t, values: 1.0, ["parameters.k"], quantities="mass.position.x")
    with pytest.raises(ValueError, match="is nan"):
        model.gradient(lambda t, values: (np.nan, values), ["parameters.k"], quantities="mass.position.x")
