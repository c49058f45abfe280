"""Solvers as operators, and what objects and messages say. Truth: dense solutions of NumPy."""

import re

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import espalier as esp

RNG = np.random.default_rng(7)


def matrix(kind, n=40):
    A = sp.random_array((n, n), density=0.1, rng=RNG) + sp.diags_array(np.arange(4.0, 4.0 + n))
    if kind == "complex":
        A = A + 1j * sp.random_array((n, n), density=0.1, rng=RNG)
    if kind == "hermitian":
        A = A + 1j * sp.random_array((n, n), density=0.1, rng=RNG)
        A = A + A.conj().T
    return (A + A.T if kind == "symmetric" else A).tocsc()


@pytest.mark.parametrize("kind", ["general", "symmetric", "complex", "hermitian"])
@pytest.mark.parametrize("form", ["csc", "csr"])
def test_an_operator_is_the_inverse(kind, form):
    A = matrix(kind).asformat(form)
    solver, dense = esp.Solver(A, threads=1), A.toarray()
    assert solver.shape == A.shape and solver.dtype == A.dtype
    operator = spla.aslinearoperator(solver)
    assert operator.shape == A.shape and operator.dtype == A.dtype
    for b in (RNG.standard_normal(40), RNG.standard_normal((40, 1)), RNG.standard_normal(40) + 1j * RNG.standard_normal(40)):
        assert operator.matvec(b) == pytest.approx(np.linalg.solve(dense, b), rel=1e-10)
        assert operator.rmatvec(b) == pytest.approx(np.linalg.solve(dense.conj().T, b), rel=1e-10)
    B = RNG.standard_normal((40, 3))
    assert operator @ B == pytest.approx(np.linalg.solve(dense, B), rel=1e-10)
    assert operator.H @ B == pytest.approx(np.linalg.solve(dense.conj().T, B), rel=1e-10)
    x, failed = spla.gmres(A, B[:, 0], M=solver, rtol=1e-12)
    assert failed == 0 and A @ x == pytest.approx(B[:, 0], rel=1e-9)


def test_shapes_before_and_after():
    solver = esp.Solver()
    assert solver.shape == (0, 0) and solver.dtype == np.float64
    with pytest.raises(RuntimeError, match="no matrix"):
        solver.matvec(np.ones(1))
    solver.factorize(matrix("complex", 5))
    assert solver.shape == (5, 5) and solver.dtype == np.complex128


def test_dense_matrices_are_called_so():
    dense = np.eye(3)
    for call in (lambda: esp.Solver(dense), lambda: esp.solve(dense, np.ones(3)), lambda: esp.Solver().analyze(dense), lambda: esp.modes(dense, dense, 1),
                 lambda: esp.SchurComplement(dense, [0]), lambda: esp.Batch(dense), lambda: esp.harmonic(dense, dense, np.ones(3), frequencies=[1.0]),
                 lambda: esp.quadratic_modes(dense, dense, dense)):
        with pytest.raises((TypeError, ValueError), match=r"dense array of shape \(3, 3\).*csc_array"):
            call()


@pytest.mark.parametrize("device, near", [("cuda", "gpu:0"), ("cuda:1", "gpu:1"), ("gpu", "gpu:0"), ("GPU:0", "gpu:0"), ("CPU", "cpu"), ("CUDA", "gpu:0")])
def test_devices_by_other_names(device, near):
    with pytest.raises(esp.InvalidInputError, match=f"'{device}' is not understood; give '{near}'"):
        esp.Solver(device=device)


def test_threads_of_zero_are_all_cores():
    A = matrix("general")
    one, all_cores = esp.Solver(A, threads=1), esp.Solver(A, threads=0)
    assert (one.solve(np.ones(40)) == all_cores.solve(np.ones(40))).all()
    with pytest.raises(esp.InvalidInputError, match="0 for all cores"):
        esp.Solver(A, threads=-1)


def test_messages_have_names_of_python():
    A = matrix("general")
    solver = esp.Solver(A)
    said = []
    for call in (lambda: solver.factorize(np.ones(7)), lambda: esp.Solver(matrix("complex")).factorize(np.ones(7)), lambda: esp.ChangedSystem(solver).add_low_rank(np.ones((40, 0))),
                 lambda: solver.clone(threads=5000), lambda: esp.Dae(1, mass=lambda q: np.eye(1), force=lambda t, q, v: -q, newton_tolerance=-1.0).start(0, [1], [0])):
        with pytest.raises((ValueError, RuntimeError, esp.Error)) as found:
            call()
        said.append(str(found.value))
    for text in said:
        assert "::" not in text and not re.search(r"refactorize|Options|ComplexSolver", text), text
    assert said[0].startswith("Solver.factorize: 7 values") and said[1].startswith("Solver.factorize: 7 values")


def test_objects_say_what_they_are_and_no_more():
    n = 60
    K = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n)).tocsc()
    M = sp.eye_array(n).tocsc()
    solver = esp.Solver(K)
    modes = esp.modes(K, M, 25)
    found = {"modes": modes, "quadratic": esp.quadratic_modes(K, 0.01 * K, M, 3), "harmonic": esp.harmonic(K, M, np.ones((n, 2)), frequencies=[0.0, 0.1]),
             "one": esp.harmonic(K, M, np.ones(n), frequencies=[0.0, 0.1]), "solver": solver, "factor": solver.factor, "analysis": solver.analysis,
             "singular": esp.Solver(sp.diags_array(np.r_[np.ones(n), 0.0]).tocsc(), singular="null_vectors").factor,
             "schur": esp.SchurComplement(K, [1]), "changed": esp.ChangedSystem(solver), "batch": esp.Batch(K),
             "solved": esp.Batch(K).solve(K.data[None], np.ones((1, n)))}
    for name, thing in found.items():
        text = repr(thing)
        assert len(text) < 2500 and "array(" not in text and "object at" not in text and text.count("\n") < 30, (name, text)
        assert "array(" not in getattr(thing, "_repr_html_", str)(), name
    lines = repr(modes).splitlines()
    assert "25 of 60 unknowns, complete" in lines[0] and lines[1].split()[:3] == ["mode", "eigenvalue", "frequency"]
    assert len(lines) == 23 and "5 more" in lines[-1] and float(lines[2].split()[1]) == pytest.approx(modes.eigenvalues[0], rel=1e-5)
    assert f"{found['one'].amplitudes[:, 0].max():.6g}" in repr(found["one"])
    assert "<float64 (1, 61)>" in repr(found["singular"])
