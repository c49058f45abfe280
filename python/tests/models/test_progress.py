"""progress=function: what long calls tell. Truth: what is known of them at the end."""

import math
import pickle

import numpy as np
import pytest
import scipy.sparse as sp
from test_page import PENDULUM
from test_process import poisson

import espalier as esp


class Told:
    def __init__(self):
        self.reports, self.error = [], None

    def __call__(self, report):
        self.reports.append(report)
        if self.error is not None and report.state == "running":
            raise self.error

    def last(self):
        """The report at the end, after a look at all of them."""
        assert [r.state for r in self.reports] == ["running"] * (len(self.reports) - 1) + ["ended"]
        done = {}
        for r in self.reports:
            assert isinstance(r, esp.Progress)
            assert r.done >= done.get(r.phase, 0) and (r.total == 0 or r.done <= r.total)
            done[r.phase] = r.done
            assert r.seconds >= 0 and (math.isnan(r.seconds_left) or r.seconds_left >= 0)
        reports, self.reports = self.reports, []
        return reports[-1]


def test_of_a_solver():
    told, a = Told(), poisson(8)
    solver = esp.Solver(progress=told, device="cpu", threads=2)
    solver.analyze(a)
    assert told.last().phase == "analysis"
    solver.factorize(a)
    last = told.last()
    assert (last.phase, last.unit, last.total) == ("factorization", "flops", solver.analysis.flops)
    assert last.done == last.total
    b = np.ones((a.shape[0], 40))
    assert np.abs(a @ solver.solve(b) - b).max() < 1e-9
    assert told.last().phase in ("substitution", "refinement")
    solver.solve(b[:, :1])  # too short for anybody to wait
    assert told.reports == []
    other = pickle.loads(pickle.dumps(solver))  # the function stays here
    assert np.abs(a @ other.solve(b) - b).max() < 1e-9 and told.reports == []


def test_what_it_raises_ends_the_call():
    told, a = Told(), poisson(32)  # a call takes longer than the tenth of a second between two questions
    told.error = KeyboardInterrupt
    solver = esp.Solver(progress=told, device="cpu", threads=1)
    with pytest.raises(KeyboardInterrupt):
        solver.factorize(a)
    told.error, a = None, poisson(8)
    solver.factorize(a)
    b = np.ones(a.shape[0])
    assert np.abs(a @ solver.solve(b) - b).max() < 1e-9


def test_of_modes_and_responses():
    told, k = Told(), poisson(7)
    m = sp.identity(k.shape[0], format="csc")
    assert esp.modes(k, m, 12, progress=told, threads=1).complete
    last = told.last()
    assert (last.phase, last.done, last.total, last.unit) == ("modes", 12, 12, "modes")
    esp.buckling_modes(k, m, 3, progress=told, threads=1)
    last = told.last()
    assert (last.phase, last.done, last.total, last.unit) == ("modes", 3, 3, "load factors")
    esp.harmonic(k, m, np.ones(k.shape[0]), frequencies=np.linspace(0.01, 0.02, 7), loss_factor=0.01, progress=told)
    last = told.last()
    assert (last.phase, last.done, last.total, last.unit) == ("frequency response", 7, 7, "frequencies")


def test_of_models():
    told, model = Told(), esp.Model(PENDULUM)
    model.run(progress=told)
    last = told.last()
    assert (last.phase, last.done, last.total, last.unit) == ("motion", 0.5, 0.5, "time")
    model.modes_over("bodies.bob.mass", [1.0, 2.0, 3.0], 1, progress=told)
    last = told.last()
    assert (last.phase, last.done, last.total, last.unit) == ("modes", 3, 3, "points")
    bodies = {key: PENDULUM[key] for key in ("bodies", "joints")}
    statics = esp.Model({**bodies, "statics": {}, "gravity": [1, -10, 0],
                         "forces": {"hold": {"type": "rotational-spring", "a": {"body": "ground", "axis": [0, 0, 1]},
                                             "b": {"body": "bob", "axis": [0, 0, 1]}, "stiffness": 100.0}}})
    statics.run(progress=told)
    last = told.last()
    assert (last.phase, last.done, last.total, last.unit) == ("statics", 1, 1, "load factor")


def test_of_a_call_that_fails():
    told = Told()
    with pytest.raises(esp.SingularMatrixError):
        esp.Solver(sp.csc_matrix(np.diag([1.0, 0.0])), progress=told, kind="ldlt")
    assert told.reports[-1].state == "ended"
