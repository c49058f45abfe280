import logging
import multiprocessing
import pickle
import re
import subprocess
import sys
import threading
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import espalier as esp

FORMATS = ["csc", "csr", "coo", "bsr", "lil", "dok", "dia"]


def matrix(n, kind, seed=0):
    a = sp.random(n, n, min(1.0, 4 / n), random_state=seed, format="csr")
    if kind == "lu":
        return (a + 5 * sp.eye(n)).tocsr()
    sign = np.where(np.arange(n) % 3 == 1, -9.0, 9.0) if kind == "ldlt" else np.full(n, 9.0)
    return (a + a.T + sp.diags(sign)).tocsr()


def check(a, x, b):
    scale = abs(a).sum(axis=1).max() * abs(x).max() + abs(b).max()
    assert abs(a @ x - b).max() <= 1e-13 * scale


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("kind", ["llt", "ldlt", "lu"])
def test_formats_shapes_orders(form, kind):
    a = matrix(60, kind)
    solver = esp.Solver(a.asformat(form))
    assert solver.analysis.kind == kind
    for b in (np.arange(60.0), np.ones((60, 3)), np.asfortranarray(np.ones((60, 3))), np.arange(120.0)[::2],
              np.arange(60), np.ones((60, 1), ">f4"), np.ones((60, 0))):
        x = solver.solve(b)
        assert x.shape == b.shape and x.dtype == np.float64
        if b.size:
            check(a, x, b)
            check(a.T, solver.solve(b, transpose=True), b)
    sign, log = np.linalg.slogdet(a.toarray())
    assert solver.slogdet == pytest.approx((sign, log))
    if kind != "lu":
        w = np.linalg.eigvalsh(a.toarray())
        assert solver.inertia == ((w > 0).sum(), (w < 0).sum(), 0)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 25), st.integers(0, 10**6), st.booleans(), st.sampled_from(["int32", "int64"]))
def test_random_patterns_with_duplicates(n, seed, by_rows, dtype):
    rng = np.random.default_rng(seed)
    i, j = rng.integers(0, n, (2, 3 * n))
    rows, cols = np.r_[i, np.arange(n)], np.r_[j, np.arange(n)]
    order = np.lexsort((rng.random(len(rows)), rows))  # rows rise, columns in any order, entries may repeat
    values = np.r_[rng.normal(size=3 * n), np.full(n, 20.0)][order]
    pointers = np.r_[0, np.cumsum(np.bincount(rows, minlength=n))].astype(dtype)
    indices = cols[order].astype(dtype)
    a = sp.csr_matrix((values, indices, pointers), shape=(n, n))
    given_matrix = (pointers, indices, values) if by_rows else sp.csc_matrix((values, indices, pointers), shape=(n, n))
    b = rng.normal(size=n)
    check(a if by_rows else a.T.tocsr(), esp.solve(given_matrix, b), b)


def test_new_values_out_and_no_copies():
    a = sp.diags([-1.0, 4.0, -1.0], [-1, 0, 1], shape=(20000, 20000)).tocsc()
    b, x = np.ones(20000), np.empty(20000)
    solver = esp.Solver(a)
    values = 2 * a.data
    tracemalloc.start()
    solver.factorize(values)
    assert solver.solve(b, out=x) is x
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < b.nbytes / 4
    check(2 * a, x, b)
    values[:] = np.nan  # the solver has its own
    check(2 * a, solver.solve(b), b)
    y = b.copy()
    check(2 * a, solver.solve(y, out=y), b)


@pytest.mark.parametrize("shift", [1, 7, 199])
def test_out_that_overlaps_b(shift):
    a = matrix(200, "lu")
    solver = esp.Solver(a)
    memory = np.random.default_rng(shift).standard_normal(200 + shift)
    b = memory[:200].copy()
    check(a, solver.solve(memory[:200], out=memory[shift:]), b)
    memory = np.random.default_rng(shift).standard_normal(200 + shift)
    b = memory[shift:].copy()
    check(a, solver.solve(memory[shift:], out=memory[:200]), b)


def test_what_is_no_matrix_is_told():
    with pytest.raises(ValueError, match="dense array .*csc_array"):
        esp.solve(np.eye(3), np.ones(3))
    with pytest.raises(TypeError, match="None"):
        esp.solve(None, np.ones(3))
    with pytest.raises(RuntimeError, match="no matrix yet"):
        esp.Solver().solve(np.ones(3))
    with pytest.raises(RuntimeError, match="no matrix"):
        esp.Solver().factorize(np.ones(3))


def test_no_longer_symmetric_is_analyzed_again():
    a = matrix(30, "llt")
    solver = esp.Solver(a)
    c = a.copy()
    c.data[:] = np.random.default_rng(1).normal(size=c.nnz)
    with pytest.raises(esp.InvalidInputError, match="not symmetric"):
        solver.factorize(c.data)
    assert solver.factorize(c) and solver.analysis.kind == "lu"
    check(c, solver.solve(np.ones(30)), np.ones(30))


def test_analysis_is_kept_while_it_fits():
    a = matrix(30, "ldlt")
    for form, symmetry, part in (("csc", "auto", a), ("csr", "auto", a), ("csr", "lower", sp.tril(a)),
                                 ("csc", "upper", sp.triu(a))):
        part = part.asformat(form)
        solver = esp.Solver(part, symmetry=symmetry)
        analysis = solver.analysis
        solver.factorize(2 * part)
        check(2 * a, solver.solve(np.ones(30)), np.ones(30))
        bad = part.copy()
        bad.data[3] = np.nan
        with pytest.raises(esp.InvalidInputError, match="nan"):
            solver.factorize(bad)
        assert solver.analysis is analysis
        solver.factorize(part)
        check(a, solver.solve(np.ones(30)), np.ones(30))
    solver.factorize(sp.eye(30, format="csc"))
    assert solver.analysis is not analysis


# Truth: row 4 of A is twice row 2, and so column 4 of A^T twice column 2.
def test_rows_and_columns_in_errors():
    a = sp.random(9, 9, 0.6, random_state=3).toarray() + 4 * np.eye(9)
    a[4] = 2 * a[2]
    for form, given_matrix, word in (("csc", a, "row"), ("csr", a.T, "column")):
        given_matrix = sp.csc_matrix(given_matrix).asformat(form)
        with pytest.raises(esp.SingularMatrixError) as caught:
            esp.Solver(given_matrix, kind="lu")
        found = getattr(caught.value, word)
        assert found in (2, 4) and (caught.value.row is None) == (form == "csr")
        assert f"{word} {found} (counted from 0) depends on the other {word}s" in str(caught.value)
        report = esp.Solver(given_matrix, kind="lu", singular="report").factor
        assert report.rank == 8 and getattr(report, f"dependent_{word}s")[0] in (2, 4)
        assert abs(given_matrix @ report.null_vectors[0]).max() < 1e-12
        assert abs(given_matrix.T @ report.left_null_vectors[0]).max() < 1e-12
        given_matrix[3, 7] = np.inf
        with pytest.raises(esp.InvalidInputError, match=r"entry \(3, 7\) is inf"):
            esp.Solver(given_matrix)
        with pytest.raises(esp.InvalidInputError, match="outside the upper triangle"):
            esp.Solver(given_matrix, symmetry="upper")
    hollow = sp.csr_matrix(np.diag([1.0, 2, 0, 3]) + np.eye(4, k=3))
    for form, word in (("csc", "row"), ("csr", "column")):
        with pytest.raises(esp.SingularMatrixError, match=f"without partner: {word} 2"):
            esp.Solver(hollow.asformat(form), kind="lu")
    with pytest.raises(esp.InvalidInputError) as caught:
        esp.Solver(matrix(5, "lu")).solve([1, 2, np.nan, 4, 5])
    assert caught.value.row == 2 and "row 2" in str(caught.value)


@pytest.mark.parametrize("bad, error", [
    (np.eye(3), ValueError), (sp.eye(3, 4), ValueError), (sp.eye(3).astype(np.clongdouble), TypeError),
    (sp.csr_matrix((0, 0)), ValueError), (sp.diags([1.0, np.nan]), esp.InvalidInputError),
    (sp.csr_matrix((2, 2)), esp.SingularMatrixError), (([0, 1], [5], [1.0]), ValueError),
    (([0, 1], [-1], [1.0]), ValueError), (([0, 9], [0], [1.0]), esp.InvalidInputError),
    (([0, 2**40], [0], [1.0]), esp.InvalidInputError), (([0, 1], [2**40], [1.0]), ValueError),
    (([0, 1], [0], np.array([object()])), TypeError), (([0, 1], [0.0], [1.0]), TypeError),
])
def test_bad_matrices(bad, error):
    with pytest.raises(error):
        esp.Solver(bad)


def test_errors():
    assert issubclass(esp.SingularMatrixError, ArithmeticError) and issubclass(esp.OutOfMemoryError, MemoryError)
    with pytest.raises(TypeError, match="no argument"):
        esp.Solver(colour="red")
    solver = esp.Solver(matrix(5, "lu"))
    fixed = np.ones(5)
    fixed.flags.writeable = False
    solver.solve(fixed)
    for call in (lambda: solver.solve(np.ones(6)), lambda: solver.solve(np.ones(5), out=fixed),
                 lambda: solver.factorize(np.ones(2)), lambda: solver.factorize(np.full(5, np.nan))):
        with pytest.raises(ValueError):
            call()
    with pytest.raises(esp.NotPositiveDefiniteError):
        esp.Solver(matrix(9, "ldlt"), kind="llt")
    with pytest.raises(RuntimeError):
        esp.Solver().inertia
    solver.close()
    with pytest.raises(RuntimeError, match="closed"):
        solver.solve(np.ones(5))


def complex_matrix(n, sort, seed=3):
    rng = np.random.default_rng(seed)
    a = sp.random_array((n, n), density=4 / n, rng=rng).toarray() * np.exp(2j * np.pi * rng.random((n, n)))
    a = a + np.diag(rng.random(n) + 0.5j)
    if sort == "symmetric":
        a = a + a.T
    if sort in ("hermitian", "definite"):
        a = a + a.conj().T
    if sort == "definite":
        a = a + np.diag(abs(a).sum(1))
    return a


@pytest.mark.parametrize("sort", ["general", "symmetric", "hermitian", "definite"])
@pytest.mark.parametrize("format", ["csc", "csr", "coo"])
@pytest.mark.parametrize("dtype,device", [("complex128", "auto"), ("complex64", "auto"), ("complex128", "reference")])
def test_complex_systems(sort, format, dtype, device):
    a = complex_matrix(60, sort).astype(dtype)
    stored = {"general": [("auto", a)], "symmetric": [("auto", a), ("lower", np.tril(a)), ("upper", np.triu(a)), ("symmetric", a)]}.get(
        sort, [("auto", a), ("hermitian_lower", np.tril(a)), ("hermitian_upper", np.triu(a)), ("hermitian", a)])
    rng = np.random.default_rng(1)
    for symmetry, part in stored:
        solver = esp.Solver(sp.coo_array(part).asformat(format), symmetry=symmetry, device=device)
        assert solver.analysis.kind == {"general": "lu", "definite": "llt"}.get(sort, "ldlt")
        for b in (rng.random(60) + 1j, rng.random((60, 3)) * 1j, rng.random(60)):
            for transpose, m in ((False, a), (True, a.T), ("H", a.conj().T)):
                x = solver.solve(b, transpose=transpose)
                assert x.dtype == np.complex128 and x.shape == b.shape
                assert np.linalg.norm(m @ x - b) <= 1e-12 * np.linalg.norm(m) * np.linalg.norm(x)
        sign, log = np.linalg.slogdet(a.astype(complex))
        assert abs(solver.slogdet[1] - log) < 1e-5
        if device == "reference" and sort in ("general", "symmetric"):  # a real system of twice the size was factorized
            assert np.isnan(solver.slogdet[0])
        else:
            assert abs(solver.slogdet[0] - sign) < 1e-5
        if sort in ("hermitian", "definite"):
            w = np.linalg.eigvalsh(a)
            assert solver.inertia == ((w > 0).sum(), (w < 0).sum(), 0)
        other = pickle.loads(pickle.dumps(solver))
        assert np.array_equal(other.solve(b), solver.solve(b))
        assert solver.condition() > 1
        out = np.empty(60, complex)
        assert solver.solve(b, out=out) is out
        with pytest.raises(ValueError, match="complex128"):
            solver.solve(b, out=np.empty(60))


def test_real_and_complex_numbers_meet():
    a, rng = matrix(40, "lu").tocsr(), np.random.default_rng(2)
    b = rng.random(40) + 1j * rng.random(40)
    solver = esp.Solver(a)
    for transpose, m in ((False, a), (True, a.T), ("H", a.T)):
        assert np.linalg.norm(m @ solver.solve(b, transpose=transpose) - b) < 1e-9
    solver.factorize((1 + 2j) * a.data)  # a sweep that becomes complex
    assert np.linalg.norm((1 + 2j) * (a @ solver.solve(b)) - b) < 1e-9
    solver.factorize(a)
    assert solver.solve(b.real).dtype == np.float64
    with pytest.raises(esp.InvalidInputError, match="Hermitian"):
        esp.Solver(sp.csc_array(np.diag([1.0, 2 + 1e-3j])), symmetry="hermitian")
    with pytest.raises(TypeError, match="complex"):
        esp.modes(a.astype(complex), a, 2)
    for wrong in (np.nan, 1j * np.inf):
        with pytest.raises(esp.InvalidInputError):
            esp.Solver(sp.csc_array(np.diag([1.0, wrong])))
    singular = sp.csc_array(np.array([[1, 1j], [1j, -1]]))
    with pytest.raises(esp.SingularMatrixError):
        esp.Solver(singular)
    v = esp.Solver(singular, singular="report").factor.null_vectors
    assert v.shape == (1, 2) and np.linalg.norm(singular @ v[0]) < 1e-14


def test_scipy_with_complex_matrices():
    import espalier.scipy as es

    a = sp.csc_array(complex_matrix(50, "general"))
    b = np.random.default_rng(1).random(50)
    lu = es.splu(a)
    for trans, m in (("N", a), ("T", a.T), ("H", a.conj().T)):
        assert np.linalg.norm(m @ lu.solve(b, trans) - b) < 1e-9
    assert es.spsolve(a.astype("complex64"), b.astype("float32")).dtype == np.complex64
    assert np.linalg.norm(a @ es.factorized(a)(b) - b) < 1e-9


def test_arrays_that_are_none():
    a = matrix(12, "lu").tocsr()
    solver = esp.Solver(a)
    for wrong, word in ((np.ma.masked_equal(np.arange(12.0), 3), "masked"), (sp.csr_array(np.ones((12, 1))), "toarray"),
                        (None, "NoneType is no array"), ([object()] * 12, "list is no array"), (["x"] * 12, "dtype <U1")):
        with pytest.raises(TypeError, match=word):
            solver.solve(wrong)
    for wrong in ({}, "matrix", 3):
        with pytest.raises((TypeError, ValueError)):
            esp.Solver(wrong)
    with pytest.raises((TypeError, ValueError), match="indptr"):
        esp.Solver((3, [0], [1.0]))
    for wrong in (None, 3):
        with pytest.raises(TypeError):
            solver.save_analysis(wrong)


def test_paths_may_be_bytes(tmp_path):
    a = matrix(12, "lu")
    file = bytes(tmp_path / "a.analysis")
    esp.Solver(a).save_analysis(file)
    assert esp.Solver().load_analysis(file, a).kind == "lu"


@pytest.mark.parametrize("form", ["csc", "csr"])
@pytest.mark.parametrize("kind", ["llt", "ldlt", "lu"])
def test_clones(form, kind):
    a, b = matrix(500, kind).asformat(form), np.arange(500.0)
    lines = []
    logger = logging.Logger("test", logging.DEBUG)
    logger.debug = lines.append
    solver = esp.Solver(a, log=logger)
    check(a, solver.solve(b), b)
    clones = [solver.clone(threads) for threads in (0, 1, 2)]
    for k, clone in enumerate(clones):
        assert clone.analysis is solver.analysis and clone.factor is None and clone.last_solve is None
        with pytest.raises(RuntimeError):
            clone.solve(b)
        clone.factorize((k + 2) * a.data)
    solver.close()
    del solver
    lines.clear()
    for k, clone in enumerate(clones):
        check((k + 2) * a, clone.solve(b), b)
        clone.factorize(a)
        check(a, clone.solve(b), b)
        clone.factorize(matrix(700, kind))  # another analysis is its own
    assert lines
    with pytest.raises(ValueError):
        clones[0].clone(-1)
    with pytest.raises(RuntimeError):
        esp.Solver().clone()


# The loud thread keeps the global lock long enough for the other one to wait for it, with a call that has just ended.
def test_clones_log_for_the_thread_that_calls():
    a = matrix(200, "lu")
    loud, done, raised, stop = threading.local(), [], [], threading.Event()

    def log(line):
        if getattr(loud, "on", False):
            end = time.perf_counter() + 0.01
            while time.perf_counter() < end:
                pass
            raise ZeroDivisionError

    logger = logging.Logger("test", logging.DEBUG)
    logger.debug = log
    solver = esp.Solver(a, log=logger, threads=1)
    clone = solver.clone()

    def quiet():
        while not stop.is_set():
            try:
                done.append(solver.factorize(a.data))
            except ZeroDivisionError:
                raised.append(1)

    team = threading.Thread(target=quiet)
    interval = sys.getswitchinterval()
    try:
        sys.setswitchinterval(1)
        team.start()
        loud.on = True
        for _ in range(20):
            with pytest.raises(ZeroDivisionError):
                clone.analyze(a)
    finally:
        stop.set()
        team.join()
        sys.setswitchinterval(interval)
    assert done and not raised


@pytest.mark.parametrize("form", ["csc", "csr"])
def test_saved_analysis(form, tmp_path):
    a, b = matrix(300, "lu").asformat(form), np.ones(300)
    solver = esp.Solver(a)
    solver.save_analysis(tmp_path / "a.analysis")
    other = esp.Solver()
    loaded = other.load_analysis(tmp_path / "a.analysis", a)
    assert (loaded.kind, loaded.nonzeros_factor) == (solver.analysis.kind, solver.analysis.nonzeros_factor)
    other.factorize(a)
    assert other.analysis is loaded and (other.solve(b) == solver.solve(b)).all()
    with pytest.raises(esp.InvalidInputError):
        other.load_analysis(tmp_path / "a.analysis", matrix(301, "lu"))
    (tmp_path / "b.analysis").write_bytes((tmp_path / "a.analysis").read_bytes()[:-9])
    for file in ("b.analysis", "absent"):
        with pytest.raises(esp.InvalidInputError, match=file):
            other.load_analysis(tmp_path / file, a)
    with pytest.raises(esp.Error):
        solver.save_analysis(tmp_path / "no" / "folder")
    with pytest.raises(RuntimeError):
        esp.Solver().save_analysis(tmp_path / "c")


def test_threads_share_and_own_solvers():
    a, b = matrix(400, "lu"), np.ones(400)
    shared, failures = esp.Solver(a), []

    def work():
        own = [esp.Solver((k + 1) * a) for k in range(8)]
        for _ in range(5):
            for factor, solver in [*enumerate(own), (0, shared)]:
                if abs((factor + 1) * (a @ solver.solve(b)) - b).max() > 1e-10:
                    failures.append(1)

    team = [threading.Thread(target=work) for _ in range(8)]
    [t.start() for t in team], [t.join() for t in team]
    assert not failures


def in_child(a):
    return abs(a @ SOLVER.solve(np.ones(300)) - 1).max()


def test_fork():
    global SOLVER
    a = matrix(300, "llt")
    SOLVER = esp.Solver(a, threads=2)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert max(pool.map(in_child, [a] * 4)) < 1e-12


def test_progress_of_long_calls(capfd, monkeypatch):
    from espalier import _core, _progress

    a = matrix(200, "lu")
    now = iter(np.arange(0, 1e6, 2.0))
    monkeypatch.setattr(_progress.time, "monotonic", lambda: float(next(now)))
    ticks = []
    set_tick = _core.set_tick
    monkeypatch.setattr(_core, "set_tick", lambda tick: (ticks.append(tick), tick and (tick(), tick()), set_tick(tick)))
    solver = esp.Solver(a, progress=True)
    shown = capfd.readouterr().err
    assert "analyzing 200 unknowns: " in shown and "factorizing: " in shown and shown.endswith("\n")
    assert len(ticks) == 4 and ticks[1] is ticks[3] is None
    solver.solve(np.ones(200))
    esp.Solver(a, progress=False)
    esp.Solver(a)  # nobody looks: no terminal
    assert len(ticks) == 4 and capfd.readouterr().err == ""


def test_ticks_come_from_long_calls_and_may_raise():
    from espalier import _core
    from test_process import poisson

    a, solver, ticks = poisson(36), esp.Solver(device="cpu", threads=1), []  # slow enough on any machine

    def tick():
        ticks.append(time.perf_counter())
        if len(ticks) == 3:
            raise ZeroDivisionError

    try:
        _core.set_tick(tick)
        with pytest.raises(ZeroDivisionError):
            for _ in range(100):
                solver.factorize(a)
    finally:
        _core.set_tick(None)
    assert len(ticks) == 3
    solver.factorize(a)
    assert len(ticks) == 3
    check(a, solver.solve(np.ones(a.shape[0])), np.ones(a.shape[0]))


def test_log_that_raises_is_heard():
    logger = logging.Logger("test", logging.DEBUG)
    logger.debug = lambda line: 1 / 0
    with pytest.raises(ZeroDivisionError):
        esp.Solver(matrix(5, "lu"), log=logger)


def test_import_is_light():
    code = "import espalier, sys; print('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "False"


def test_guide():
    """Blocks of a page go on with the names of those before them; what needs other packages runs with the tests of docs."""
    guide = Path(__file__).parents[3] / "docs/guide/python.md"
    blocks = re.findall(r"(<!-- (?:needs|not run): .*? -->\n)?```python\n(.*?)```", guide.read_text(), re.S)
    assert blocks
    names = {}
    for needs, block in blocks:
        if not needs:
            exec(block, names)
