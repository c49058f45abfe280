"""Every object after every kind of failure: it is usable again, or says what to do. Truth: NumPy's dense answers, and the
answers of an object that nothing has happened to."""

import logging
import math
import signal
import threading

import numpy as np
import pytest
import scipy.sparse as sp

import espalier as esp

N = 20


def string(n=N):
    return sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(n, n)).tocsc()


def plate(n):
    return sp.csc_array(sp.kron(string(n), sp.eye_array(n)) + sp.kron(sp.eye_array(n), string(n)))


def with_zero(k, stored=True):
    """string() with a row and column k of zeros, stored or not."""
    a = string().tolil()
    a[k, :] = a[:, k] = 0
    a = a.tocsc()
    if not stored:
        return a
    full = string()
    rows = np.repeat(np.arange(N), np.diff(full.tocsr().indptr))
    full = full.tocsr()
    full.data[(rows == k) | (full.indices == k)] = 0
    return full.tocsc()


class Interrupted(Exception):
    pass


class Interrupts(logging.Logger):
    """Raises at one line of the log, as a handler may, and as Ctrl-C does between two lines."""

    def __init__(self, line, error):
        super().__init__("interrupts", logging.DEBUG)
        self.line, self.error, self.lines = line, error, 0

    def debug(self, *_):
        self.lines += 1
        if self.lines == self.line:
            raise self.error


NAN = string()
NAN.data[4] = np.nan
WRONG = {  # name -> (matrix, what it raises)
    "NaN": (NAN, esp.InvalidInputError), "zero row": (with_zero(3), esp.SingularMatrixError),
    "structure": (with_zero(3, False), esp.SingularMatrixError), "another pattern with NaN": (NAN + sp.eye_array(N, k=5), esp.InvalidInputError),
    "another size, singular": (sp.csc_array((np.zeros(4), (np.arange(4), np.arange(4)))), esp.SingularMatrixError),
    "no matrix": (np.eye(N), (TypeError, ValueError)), "complex NaN": (string() * (1 + 1j * np.inf), esp.InvalidInputError)}


def check(solver, a=string()):
    b = np.arange(1.0, a.shape[0] + 1)
    np.testing.assert_allclose(a @ solver.solve(b), b, atol=1e-10)


@pytest.mark.parametrize("layout", ["csc", "csr"])
@pytest.mark.parametrize("name", WRONG)
def test_solver_after_a_matrix_that_fails(name, layout):
    wrong, error = WRONG[name]
    wrong = wrong.asformat(layout) if hasattr(wrong, "asformat") else wrong
    good = string().asformat(layout)
    for begin in (lambda: esp.Solver(good), esp.Solver):
        solver = begin()
        for _ in range(2):
            with pytest.raises(error):
                solver.factorize(wrong)
            if solver.factor is None:
                with pytest.raises(RuntimeError, match=r"call |factoriz"):
                    solver.solve(np.ones(solver._n or 1))
                with pytest.raises(RuntimeError, match="call factorize"):
                    solver.inertia
        solver.factorize(good)
        check(solver)
        solver.factorize(2 * good.data)
        check(solver, 2 * string())
        check(esp.Solver(good).clone().factorize(good) and solver, 2 * string())


@pytest.mark.parametrize("call", ["values", "size of values", "NaN", "right-hand side", "analyze_change", "load_analysis", "save_analysis"])
def test_solver_after_a_call_that_fails(call, tmp_path):
    solver = esp.Solver(string())
    file = tmp_path / "analysis"
    file.write_bytes(b"nonsense")
    zeros = np.zeros(len(string().data))
    calls = {"values": lambda: solver.factorize(zeros), "size of values": lambda: solver.factorize(zeros[1:]),
             "NaN": lambda: solver.factorize(zeros * np.nan), "right-hand side": lambda: solver.solve(np.full(N, np.nan)),
             "analyze_change": lambda: solver.analyze_change(np.eye(N)), "load_analysis": lambda: solver.load_analysis(file, string()),
             "save_analysis": lambda: solver.save_analysis(tmp_path / "none" / "file")}
    with pytest.raises({"size of values": ValueError, "analyze_change": TypeError}.get(call, esp.Error)):
        calls[call]()
    if solver.factor is not None:
        check(solver)
    if solver.analysis is not None:
        solver.factorize(string().data)
        check(solver)
    else:
        with pytest.raises(RuntimeError, match=r"call factorize\(A\)"):
            solver.factorize(string().data)
    solver.factorize(string())
    check(solver)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("of a handler")])
@pytest.mark.parametrize("line", range(1, 9))
def test_solver_and_schur_complement_after_a_handler_that_raises(line, error):
    a, other = plate(30), plate(31)
    raised = 0
    for make in (lambda log: esp.Solver(log=log), lambda log: None):
        log = Interrupts(line, error)
        solver = make(log)
        try:
            solver = solver or esp.SchurComplement(a, [3, 50], log=log)
            solver.factorize(a)
            solver.factorize(other)
        except type(error):
            raised += 1
        log.line = 0
        if solver is None:  # nothing has been made
            continue
        for m in (a, other, a):
            solver.factorize(m)
            check(solver, m)
    assert raised > 0 or line > 2


def interrupted(call, seconds):
    """Whether a signal after so many seconds ended the call."""
    def stop(*_):
        raise Interrupted

    before = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds)
        try:
            call()
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)  # where the signal may still arrive
        return False
    except Interrupted:
        return True
    finally:
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("seconds", [0.005, 0.02, 0.06, 0.15])
def test_objects_after_signals(seconds):
    a, other = plate(120), plate(121)
    solver, schur = esp.Solver(a), esp.SchurComplement(a, [7, 100])
    batch, values = esp.Batch(a), np.tile(a.data, (40, 1))
    calls = [lambda: solver.analyze(other), lambda: solver.factorize(other), lambda: solver.factorize(a),
             lambda: solver.solve(np.ones((len(a.indptr) - 1, 400))), lambda: schur.factorize(other), lambda: schur.factorize(a),
             lambda: schur.solve(np.ones((a.shape[0], 200))), lambda: batch.solve(values, np.ones((40, a.shape[0]))),
             lambda: esp.solve_systems([(a, np.ones(a.shape[0]))] * 8), lambda: esp.modes(a, sp.eye_array(a.shape[0]), 30),
             lambda: esp.harmonic(a, sp.eye_array(a.shape[0]), np.ones(a.shape[0]), between=(0.01, 0.1), points=30, observed=[0])]
    ended = 0
    for call in calls:
        if solver.factor is None:
            solver.factorize(a)
        ended += interrupted(call, seconds)
        for m in (a, other, a):
            solver.factorize(m)
            check(solver, m)
            schur.factorize(m)
            check(schur, m)
        found = batch.solve(values[:2], np.ones((2, a.shape[0])))
        np.testing.assert_allclose(a @ found.x[1], 1, atol=1e-9)
    assert ended > 0 or seconds > 0.1


@pytest.mark.parametrize("layout", ["csc", "csr"])
@pytest.mark.parametrize("name", [n for n in WRONG if "complex" not in n])
def test_schur_complement_after_a_matrix_that_fails(name, layout):
    wrong, error = WRONG[name]
    good = string().asformat(layout)
    listed = [0, 2]
    schur = esp.SchurComplement(good, listed)
    truth = schur.complement.copy()
    for _ in range(2):
        with pytest.raises(error):
            schur.factorize(wrong.asformat(layout) if hasattr(wrong, "asformat") else wrong)
        if name != "no matrix":
            for call in (lambda: schur.complement, lambda: schur.inertia, lambda: schur.solve(np.ones(wrong.shape[0])),
                         lambda: schur.condense(np.ones(wrong.shape[0])), lambda: schur.expand(np.ones(wrong.shape[0]), np.ones(2))):
                with pytest.raises(RuntimeError, match=r"call factorize\(A\)"):
                    call()
    for scale in (1, 3):
        schur.factorize(scale * good)
        np.testing.assert_allclose(schur.complement, scale * truth, rtol=1e-12)
        check(schur, scale * string())


def test_schur_complement_that_is_singular_itself():
    a = sp.csc_array(np.array([[2.0, 1, 0], [1, 2, 1], [0, 1, 2 / 3]]))
    schur = esp.SchurComplement(a, [2])
    assert abs(schur.complement) < 1e-14
    with pytest.raises(esp.SingularMatrixError):
        schur.solve(np.ones(3))
    assert schur.condense(np.ones(3)) == pytest.approx([2 / 3])
    schur.factorize(2.5 * sp.eye_array(3).tocsc() + a)
    check(schur, a + 2.5 * sp.eye_array(3))


def test_changed_system_after_everything_that_fails():
    a = string()
    solver = esp.Solver(a)
    changed = esp.ChangedSystem(solver)
    b = np.arange(1.0, N + 1)
    full = a.toarray()
    for call, error in ((lambda: changed.add(np.full(N, np.nan)), ValueError), (lambda: changed.add(np.ones(3)), ValueError),
                        (lambda: changed.add_low_rank(np.ones(N), [[np.inf]]), ValueError), (lambda: changed.remove([1, 1]), ValueError),
                        (lambda: changed.remove([N]), ValueError), (lambda: changed.restore([1]), ValueError),
                        (lambda: changed.solve(np.full(N, np.nan)), ValueError), (lambda: changed.solve(np.ones(3)), ValueError),
                        (lambda: changed.add(None), TypeError)):
        with pytest.raises(error):
            call()
        assert len(changed) == N
        np.testing.assert_allclose(full @ changed.solve(b), b, atol=1e-10)
    changed.add(np.zeros(N))
    for _ in range(2):
        with pytest.raises(esp.SingularMatrixError):
            changed.solve(np.ones(N + 1))
    changed.remove([N])
    np.testing.assert_allclose(full @ changed.solve(np.r_[b, 0])[:N], b, atol=1e-10)

    def begun_anew(scale):
        with pytest.raises(RuntimeError, match=r"reset\(\)"):
            changed.solve(np.ones(len(changed)))
        changed.reset()
        assert len(changed) == N
        np.testing.assert_allclose(scale * full @ changed.solve(b), b, atol=1e-10)

    changed.add(np.ones(N))
    solver.factorize(2 * a)
    begun_anew(2)
    with pytest.raises(esp.Error):
        solver.factorize(NAN)
    with pytest.raises(RuntimeError, match="call solver.factorize"):
        changed.reset()
    solver.factorize(sp.csc_array(string(7)))
    changed.reset()
    assert len(changed) == 7
    solver.factorize(a * (1 + 1j))
    with pytest.raises(RuntimeError, match=r"reset\(\)"):
        changed.solve(np.ones(7))
    changed.reset()
    np.testing.assert_allclose((1 + 1j) * (full @ changed.solve(b)), b, atol=1e-10)
    solver.factorize(a)
    changed.reset()
    np.testing.assert_allclose(full @ changed.solve(b), b, atol=1e-10)
    solver.close()
    with pytest.raises(RuntimeError, match="closed"):
        changed.solve(b)


def test_batches_after_everything_that_fails():
    a = string()
    batch = esp.Batch(a)
    good, b = np.tile(a.data, (3, 1)), np.ones((3, N))
    truth = np.linalg.solve(a.toarray(), np.ones(N))
    for values, right, error in ((good * np.nan, b, esp.Error), (good * 0, b, esp.Error), (good, b * np.nan, esp.Error), (good[:, 1:], b, ValueError),
                                 (good, b[:2], ValueError), (good.astype(complex), b, TypeError), (good, np.ones((3, N, 0)), ValueError)):
        with pytest.raises(error):
            batch.solve(values, right)
        np.testing.assert_allclose(batch.solve(good, b).x, np.tile(truth, (3, 1)), rtol=1e-12)
    assert batch.solve(good[:0], b[:0]).x.shape == (0, N)
    found = esp.solve_systems([])
    assert found.x == [] and found.errors == {} and len(found.backward_errors) == len(found.negative) == 0
    with pytest.raises(esp.SingularMatrixError):
        esp.Batch(with_zero(1, False))


def wheel():
    """A point mass whose force is 1 / inputs.d, which is no number where d is 0."""
    model = esp.Model(integrator={"end": 1.0, "relative": 1e-8, "absolute": 1e-8})
    model.body("bob", "point", mass=2)
    model.input("d", 1.0)
    model.force("push", "load", a={"body": "bob"}, force=["1/inputs.d", 0, 0])
    return model


def test_simulation_after_everything_that_fails():
    sim, twin = esp.Simulation(wheel()), esp.Simulation(wheel())
    state = sim.save()
    for _ in range(3):
        sim.set_input("d", 0.0)
        with pytest.raises(esp.Error):
            sim.step(0.1)
        sim.set_input("d", 1.0)
        sim.restore(state)
        sim.step(0.1)
        assert sim["bob.position.x"] == pytest.approx(0.1**2 / 4, abs=1e-7)
    sim.restore(state)

    def stop(step):
        raise Interrupted

    for error, call in ((Interrupted, lambda: sim.run(stop)), (Interrupted, lambda: sim.step_to(0.5, stop)), (ValueError, lambda: sim.step(-1)),
                        (ValueError, lambda: sim.step_to(math.nan)), (ValueError, lambda: sim.value("nothing")), (TypeError, lambda: sim.run(3)),
                        (ValueError, lambda: sim.set_input("d", math.nan)), (ValueError, lambda: sim.set_input("e", 1)),
                        (esp.InvalidInputError, lambda: sim.restore(b"x")), (esp.InvalidInputError, lambda: sim.restore(state[:-9])),
                        (RuntimeError, lambda: sim.run(lambda s: sim.run()))):
        with pytest.raises(error):
            call()
    end = sim.run().summary
    assert end["t_end"] == 1 and sim["bob.position.x"] == pytest.approx(0.25, abs=1e-6)
    assert twin.run()["bob.position.x"][-1] if "bob.position.x" in twin.run().names else True


def test_own_equations_after_everything_that_fails():
    trouble = {}

    def force(t, q, v):
        if "raise" in trouble:
            raise Interrupted
        return np.array([trouble.get("value", 1.0)]) if "shape" not in trouble else np.ones(2)

    dae = esp.Dae(1, mass=lambda q: np.eye(1), force=force, relative=1e-9, absolute=1e-9)
    with pytest.raises((RuntimeError, esp.Error), match="start"):
        dae.integrate(1)
    for what, error in (({"raise": 1}, Interrupted), ({"shape": 1}, ValueError), ({"value": np.nan}, esp.Error)):
        trouble.update(what)
        with pytest.raises(error):
            dae.start(0, [0], [0])
        trouble.clear()
        dae.start(0, [0], [0])
        dae.integrate(0.5)
        trouble.update(what)
        with pytest.raises(error):
            dae.integrate(1)
        trouble.clear()
        dae.start(0, [0], [0])  # anew
        dae.integrate(0.5)
        with pytest.raises(Interrupted):
            dae.integrate(1, lambda t: (_ for _ in ()).throw(Interrupted()))
        with pytest.raises((ValueError, esp.Error)):
            dae.start(0, [np.nan], [0])
        dae.start(0, [0], [0])
        dae.integrate(1)
        assert dae.t == 1 and dae.q[0] == pytest.approx(0.5, abs=1e-6)


def test_a_sweep_and_derivatives_after_everything_that_fails():
    model = wheel()
    for call in (lambda: esp.sweep(model, {"inputs.d": [1.0, 0.0]}, workers=1), lambda: esp.derivatives(model, ["inputs.none"]),
                 lambda: model.gradient(lambda t, v: (1.0, v[:0]), ["bodies.bob.mass"], quantities="bob.position.x"),
                 lambda: model.harmonic(loads="nothing", between=(1, 2), quantities="bob.position.x")):
        with pytest.raises((esp.Error, ValueError)):
            call()
    value, slope = model.gradient("bob.position.x", ["bodies.bob.mass"])
    assert value == pytest.approx(0.25, abs=1e-6) and slope == pytest.approx([-0.125], abs=1e-5)


def test_threads_after_a_failure_of_another():
    solver = esp.Solver(string())
    failed = []

    def fail():
        try:
            solver.factorize(NAN)
        except esp.InvalidInputError as error:
            failed.append(error)

    threads = [threading.Thread(target=fail) for _ in range(4)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert len(failed) == 4
    solver.factorize(string())
    check(solver)
