"""Solvers in processes and under signals: pickling, fork and spawn, Ctrl-C, memory over many cycles."""

import copy
import gc
import multiprocessing
import os
import pickle
import resource
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest
import scipy.sparse as sp

import espalier as esp
from test_solver import check, matrix


def poisson(n):
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
    one = sp.eye_array(n)
    return (sp.kron(sp.kron(line, one), one) + sp.kron(sp.kron(one, line), one)
            + sp.kron(sp.kron(one, one), line)).tocsc()


@pytest.mark.parametrize("form", ["csc", "csr", "bsr"])
@pytest.mark.parametrize("kind", ["llt", "ldlt", "lu"])
def test_pickled_solvers_give_the_same_bits(kind, form):
    a, b = matrix(200, kind).asformat(form), np.arange(200.0)
    solver = esp.Solver(a, refinement_steps=3, threads=1)
    solver.factorize(3 * a)
    for other in (pickle.loads(pickle.dumps(solver)), copy.copy(solver), copy.deepcopy(solver)):
        assert other.analysis.kind == kind and other.inertia == solver.inertia
        assert (other.solve(b) == solver.solve(b)).all()
        other.factorize(a)  # the same pattern
        check(a, other.solve(b), b)
        check(3 * a, solver.solve(b), b)  # the other one's factor is its own


def test_pickled_before_the_factor_and_the_analysis():
    a = matrix(50, "lu")
    empty = pickle.loads(pickle.dumps(esp.Solver(kind="lu", singular="report")))
    assert empty.factorize(sp.csc_array(np.ones((2, 2)))).rank == 1
    solver = esp.Solver()
    solver.analyze(a)
    again = pickle.loads(pickle.dumps(solver))
    assert again.analysis.nonzeros_factor == solver.analysis.nonzeros_factor and again.factor is None
    again.factorize(a.data)
    check(a, again.solve(np.ones(50)), np.ones(50))
    solver.close()
    with pytest.raises(RuntimeError, match="closed"):
        pickle.dumps(solver)


def test_pickled_with_triangles_duplicates_and_all_options():
    a = matrix(60, "llt").tocsc()
    solver = esp.Solver(sp.tril(a).tocsc(), symmetry="lower", permutation=np.arange(60)[::-1], precision="mixed")
    again = pickle.loads(pickle.dumps(solver))
    check(a, again.solve(np.ones(60)), np.ones(60))
    pointers, indices, data = np.array([0, 2, 4]), np.array([0, 0, 1, 1]), np.array([1.0, 2, 3, 4])
    solver = esp.Solver((pointers, indices, data))
    again = pickle.loads(pickle.dumps(solver))
    assert again.solve([3.0, 7.0]) == pytest.approx([1, 1], rel=1e-15)
    again.factorize(data[::-1].copy())
    assert again.solve([7.0, 3.0]) == pytest.approx([1, 1], rel=1e-15)


def test_changed_patterns_are_not_pickled():
    a = matrix(50, "lu").tocsc()
    solver = esp.Solver(a)
    a.indices[0] = (a.indices[0] + 1) % 50
    with pytest.raises(ValueError, match="changed since"):
        pickle.dumps(solver)


def solved(solver):
    return solver.solve(np.ones(300))


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_solvers_travel_to_other_processes(start):
    a = matrix(300, "llt")
    with ProcessPoolExecutor(2, multiprocessing.get_context(start)) as pool:
        for x in pool.map(solved, [esp.Solver(a), esp.Solver(2 * a)]):
            assert x.shape == (300,)
        check(2 * a, x, np.ones(300))


def interrupted(call):
    """Seconds from Ctrl-C to the exception that ends `call`, which is interrupted after a fifth of its usual time."""
    begin = time.perf_counter()
    call()
    usual = time.perf_counter() - begin
    if usual < 0.4:
        pytest.skip(f"the call took {usual:.2f} s: too short to be interrupted for certain")
    sent = []

    def send():
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(usual / 5, send)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        call()
    late = time.perf_counter() - sent[0]
    timer.join()
    assert late < max(0.3, usual / 3), f"{late:.2f} s after the signal; the whole call takes {usual:.2f} s"


def long(make, sizes):
    """The first of the systems that takes this machine, now, long enough to be interrupted for certain."""
    for n in sizes:
        call, *rest = make(n)
        begin = time.perf_counter()
        call()
        if time.perf_counter() - begin > 1.3:
            break
    return call, *rest


def test_ctrl_c_ends_analyses():
    def make(n):
        line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
        a = (sp.kron(line, sp.eye_array(n)) + sp.kron(sp.eye_array(n), line)).tocsc()
        solver = esp.Solver(threads=1)
        return lambda: solver.analyze(a), solver, a

    call, solver, a = long(make, (300, 500, 800))
    interrupted(call)
    assert solver.analysis is None
    with pytest.raises(RuntimeError):
        solver.solve(np.ones(a.shape[0]))
    solver.factorize(a)
    check(a, solver.solve(np.ones(a.shape[0])), np.ones(a.shape[0]))


def test_ctrl_c_ends_factorizations_and_solves():
    def make(n):
        a = poisson(n)
        solver = esp.Solver(a, threads=1)
        return lambda: solver.factorize(a.data), solver, a

    call, solver, a = long(make, (38, 44, 50))
    b = np.ones(a.shape[0])
    interrupted(call)
    assert solver.factor is None and solver.analysis is not None
    with pytest.raises(RuntimeError):
        solver.solve(b)
    solver.factorize(a.data)
    many = np.asfortranarray(np.ones((len(b), 60)))
    interrupted(lambda: solver.solve(many))
    assert solver.factor is not None
    check(a, solver.solve(b), b)


def test_handlers_that_raise_nothing_stop_nothing():
    a, seen = poisson(36), []
    solver = esp.Solver(a)
    before = signal.signal(signal.SIGALRM, lambda *_: seen.append(time.perf_counter()))
    try:
        end = time.perf_counter() + 1
        signal.setitimer(signal.ITIMER_REAL, 0.05, 0.05)
        while time.perf_counter() < end:
            solver.factorize(a.data)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert seen
    check(a, solver.solve(np.ones(a.shape[0])), np.ones(a.shape[0]))


def test_a_handler_that_uses_the_solver_is_refused():
    a = poisson(36)
    solver = esp.Solver(threads=1)
    before = signal.signal(signal.SIGALRM, lambda *_: solver.solve(np.ones(3)))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises((RuntimeError, ValueError)):
            for _ in range(100):
                solver.factorize(a)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    solver.factorize(a)


def memory():
    gc.collect()
    with open("/proc/self/statm") as f:
        return int(f.read().split()[1]) * resource.getpagesize()


def growth_of_cycles():
    """Bytes that a process of its own has more after 9,000 cycles than after the first 1,000."""
    a, b = matrix(30, "lu"), np.ones((30, 2))
    singular = sp.csc_array((3, 3))

    def cycle(k):
        solver = esp.Solver(a, threads=1)
        solver.factorize(a.data)
        solver.solve(b)
        other = solver.clone() if k % 10 else pickle.loads(pickle.dumps(solver))
        other.factorize(a)
        if k % 3:
            solver.close()
        try:
            esp.Solver(singular)
        except esp.SingularMatrixError:
            pass

    for k in range(1000):
        cycle(k)
    before = memory()
    for k in range(9000):
        cycle(k)
    return memory() - before


def test_ten_thousand_cycles_leak_nothing():
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        assert pool.submit(growth_of_cycles).result() < 3_000_000


def in_fork(work):
    """What `work` returns in a child that is forked now."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.write(write, str(work()).encode())
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read) as f:
        text = f.read()
    os.waitpid(child, 0)
    return text


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.parametrize("what", ["solver", "simulation"])
def test_fork_while_another_thread_is_inside(what):
    """The child cannot wait for a thread that it does not have: it is told, and can make a new object."""
    inside, leave = threading.Event(), threading.Event()

    def stay(*_):
        inside.set()
        leave.wait(60)

    if what == "solver":
        class Logger:
            debug = staticmethod(stay)

        thing = esp.Solver(log=Logger)
        team = threading.Thread(target=lambda: thing.analyze(matrix(200, "lu")))

        def use():
            thing.factorize(matrix(200, "lu"))
    else:
        model = esp.Model(integrator={"end": 1.0})
        model.body("bob", mass=1, box=[1, 1, 1])
        thing = esp.Simulation(model)
        team = threading.Thread(target=lambda: thing.run(stay))

        def use():
            thing.step(0.1)
    team.start()
    assert inside.wait(30)

    def work():
        try:
            use()
        except RuntimeError as error:
            x = esp.Solver(matrix(50, "lu")).solve(np.ones(50))
            return f"{error} {x.shape}"

    try:
        text = in_fork(work)
    finally:
        leave.set()
        team.join()
    assert "forked; make a new one here (50,)" in text
    use()
