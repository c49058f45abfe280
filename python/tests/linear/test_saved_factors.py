"""Solver.save_factor() and esp.load_factor(). Truth: the bits of the solver that was saved, residuals with the dense
matrix, and the file itself, which is cut and changed."""

import os
import pickle
import resource
import signal
import subprocess
import sys

import numpy as np
import pytest
import scipy.sparse as sp

import espalier as esp

SYMMETRIES = ["auto", "lower", "upper", "symmetric", "general", "hermitian", "hermitian_lower", "hermitian_upper"]


def whole(n, symmetry, kind, dtype, seed):
    """Regular, of the symmetry that the option speaks of ("auto": of the kind), with a zero diagonal here and there."""
    random = np.random.default_rng(seed)
    a = np.where(random.random((n, n)) < 0.15, random.uniform(-1, 1, (n, n)), 0).astype(dtype)
    if a.dtype.kind == "c":
        a += 0.5j * np.where(a != 0, random.uniform(-1, 1, (n, n)), 0)
    hermitian = symmetry.startswith("hermitian") or kind == "llt"
    if symmetry != "general" and not (symmetry == "auto" and kind == "lu"):
        a = np.tril(a) + (np.tril(a, -1).conj().T if hermitian else np.tril(a, -1).T)
    diagonal = 1 + abs(a).sum(axis=1) if kind == "llt" else np.where(np.arange(n) % 4 == 0, 0.01, 3)
    a[np.diag_indices(n)] = diagonal
    return a


def stored(a, symmetry):
    return np.tril(a) if symmetry.endswith("lower") else np.triu(a) if symmetry.endswith("upper") else a


def as_layout(a, layout):
    s = sp.csc_array(a)
    if layout == "triple":
        r = s.tocsr()
        return r.indptr, r.indices, r.data
    return s.asformat(layout)


def cases():
    for dtype in (np.float64, np.complex128):
        for symmetry in SYMMETRIES[:5] if dtype == np.float64 else SYMMETRIES:
            for kind in ("llt", "ldlt", "lu"):
                if kind != "lu" and symmetry == "general":
                    continue
                if dtype == np.complex128 and kind == "llt" and not symmetry.startswith(("hermitian", "auto")):
                    continue
                yield dtype, symmetry, kind


@pytest.mark.parametrize("layout", ["csc", "csr", "coo", "triple"])
@pytest.mark.parametrize("dtype, symmetry, kind", list(cases()))
def test_a_loaded_factor_is_the_one_that_was_saved(tmp_path, dtype, symmetry, kind, layout):
    n = 40
    a = whole(n, symmetry, kind, dtype, 3)
    before = esp.Solver(as_layout(stored(a, symmetry), layout), symmetry=symmetry, kind=kind, threads=1)
    before.save_factor(tmp_path / "factor")
    after = esp.load_factor(tmp_path / "factor", threads=2)
    assert after.restored and after.analysis.kind == before.analysis.kind == kind
    assert after.shape == before.shape and after.dtype == before.dtype
    assert after.inertia == before.inertia
    np.testing.assert_equal(after.slogdet, before.slogdet)
    b = np.random.default_rng(1).random((n, 3))
    rights = [b, np.asfortranarray(b), b[:, 0], b[::-1, ::2], b + 1j * b[::-1]]
    exact = dtype == np.float64 or kind != "lu" or symmetry in ("auto", "general")  # else L U has expanded a triangle
    for right in rights:
        for transpose, op in ((False, a), (True, a.T), ("H", a.conj().T)):
            x = after.solve(right, transpose=transpose)
            np.testing.assert_allclose(op @ x, right, atol=1e-11)
            if exact:
                np.testing.assert_array_equal(x, before.solve(right, transpose=transpose))
    np.testing.assert_allclose(after.inverse_diagonal(), np.diag(np.linalg.inv(a)), rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(after.selected_inverse().toarray()[0, 0], np.linalg.inv(a)[0, 0], rtol=1e-8)
    np.testing.assert_allclose(after.solve(b[:, :1], rows=[3, 1], transpose=True)[:, 0], np.linalg.solve(a.T, b[:, 0])[[3, 1]], rtol=1e-8)
    assert abs(after.condition() / before.condition() - 1) < 1e-8
    # It goes on: values in the order of its matrix, the matrix, another one, a pattern that changes.
    own = after.stored_matrix()
    after.factorize(2 * own.data)
    np.testing.assert_allclose(2 * a @ after.solve(b), b, atol=1e-11)
    after.factorize_entries([0], own.data[:1] * 2)
    again = esp.load_factor(tmp_path / "factor", symmetry=symmetry)
    again.factorize(as_layout(stored(3 * a, symmetry), layout))
    np.testing.assert_allclose(3 * a @ again.solve(b), b, atol=1e-11)
    other = whole(n + 3, symmetry, kind, dtype, 4)
    again.factorize(as_layout(stored(other, symmetry), layout))
    np.testing.assert_allclose(other @ again.solve(np.ones(n + 3)), np.ones(n + 3), atol=1e-11)
    for copy in (pickle.loads(pickle.dumps(esp.load_factor(tmp_path / "factor"))), esp.load_factor(tmp_path / "factor").clone()):
        if copy.factor is None:
            copy.factorize(own.data)
        np.testing.assert_allclose(a @ copy.solve(b), b, atol=1e-11)


@pytest.mark.parametrize("precision", ["fp64", "fp32", "mixed"])
def test_precision_is_that_of_the_file(tmp_path, precision):
    a = sp.csc_array(whole(60, "auto", "llt", np.float64, 2))
    before = esp.Solver(a, precision=precision, required_backward_error=1e-5)
    before.save_factor(tmp_path / "f")
    after = esp.load_factor(tmp_path / "f", required_backward_error=1e-5, precision="fp64")
    assert after.restored
    b = np.arange(60.0)
    np.testing.assert_array_equal(after.solve(b), before.solve(b))


def test_kind_and_storage_of_the_file_do_not_bind_later_matrices(tmp_path):
    """A triangle that is a matrix of its own, and values that are not definite or not symmetric any more."""
    a = whole(20, "auto", "llt", np.float64, 5)
    esp.Solver(sp.csc_array(np.tril(a)), symmetry="lower").save_factor(tmp_path / "f")
    solver = esp.load_factor(tmp_path / "f", symmetry="auto")
    triangle = sp.csc_array(np.tril(a))
    solver.factorize(triangle)  # "auto": as it stands there
    np.testing.assert_allclose(triangle @ solver.solve(np.ones(20)), np.ones(20), atol=1e-12)
    esp.Solver(sp.csc_array(a)).save_factor(tmp_path / "f")
    for change in (-a, a + np.triu(a, 1)):
        solver = esp.load_factor(tmp_path / "f")
        assert solver.analysis.kind == "llt"
        solver.factorize(sp.csc_array(change))
        np.testing.assert_allclose(change @ solver.solve(np.ones(20)), np.ones(20), atol=1e-11)
    solver = esp.load_factor(tmp_path / "f", kind="lu")  # of the file; the option is for what comes
    assert solver.analysis.kind == "llt"
    solver.factorize(sp.csc_array(whole(9, "auto", "llt", np.float64, 5)))
    assert solver.analysis.kind == "lu"
    copy = pickle.loads(pickle.dumps(esp.load_factor(tmp_path / "f", kind="lu")))
    np.testing.assert_allclose(a @ copy.solve(np.ones(20)), np.ones(20), atol=1e-12)


def test_another_process_with_another_number_of_threads(tmp_path):
    a = sp.csr_array(whole(300, "general", "lu", np.complex128, 8))
    solver = esp.Solver(a, threads=1)
    solver.save_factor(tmp_path / "f")
    x = solver.solve(np.ones(300), transpose="H")
    code = ("import sys, numpy as np, espalier as esp; s = esp.load_factor(sys.argv[1], threads=3); "
            "np.save(sys.argv[2], s.solve(np.ones(300), transpose='H')); print(s.restored)")
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "f"), str(tmp_path / "x.npy")], capture_output=True, text=True)
    assert done.stdout == "True\n", done.stderr
    np.testing.assert_array_equal(np.load(tmp_path / "x.npy"), x)


def test_damaged_files_are_refused_by_name(tmp_path):
    file = tmp_path / "f"
    esp.Solver(sp.csc_array(whole(30, "auto", "ldlt", np.complex128, 8))).save_factor(file)
    good = file.read_bytes()
    places = [*range(0, 140, 3), *range(140, len(good), 1 + len(good) // 60), len(good) - 1]
    for place in places:
        file.write_bytes(good[:place] + bytes([good[place] ^ 0x40]) + good[place + 1:])
        with pytest.raises(esp.InvalidInputError, match=str(file)):
            esp.load_factor(file)
    for size in (0, 7, 24, 31, 100, len(good) // 2, len(good) - 1):
        file.write_bytes(good[:size])
        with pytest.raises(esp.InvalidInputError, match=str(file)):
            esp.load_factor(file)
    file.write_bytes(good[:8] + bytes([9]) + good[9:])
    with pytest.raises(esp.InvalidInputError, match="version 9, made by a newer program"):
        esp.load_factor(file)
    file.write_bytes(good + b"x")
    with pytest.raises(esp.InvalidInputError):
        esp.load_factor(file)
    file.write_bytes(good)
    esp.load_factor(file)
    for other in (tmp_path, tmp_path / "none", os.devnull):
        with pytest.raises(esp.InvalidInputError):
            esp.load_factor(other)
    with pytest.raises(ValueError, match="NUL"):
        esp.load_factor("a\0b")
    with pytest.raises(TypeError):
        esp.load_factor(None)


def _limited(path, limit):
    """Saves under a limit of file sizes, which stands for a full disk; what was raised."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    try:
        esp.Solver(sp.csc_array(whole(200, "auto", "llt", np.float64, 9))).save_factor(path)
    except esp.InvalidInputError as error:
        return str(path) in str(error)
    return False


def test_a_full_disk_leaves_the_old_file(tmp_path):
    file = tmp_path / "f"
    esp.Solver(sp.csc_array(whole(200, "auto", "llt", np.float64, 8))).save_factor(file)
    good = file.read_bytes()
    child = os.fork()
    if child == 0:
        os._exit(0 if _limited(file, len(good) // 2) else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert file.read_bytes() == good and os.listdir(tmp_path) == ["f"]
    with pytest.raises(esp.InvalidInputError):
        esp.load_factor(file).save_factor(tmp_path / "none" / "f")
    solver = esp.Solver()
    with pytest.raises(RuntimeError, match="no factorization"):
        solver.save_factor(file)
    solver.factorize(sp.csc_array(np.eye(3)))
    solver.close()
    with pytest.raises(RuntimeError, match="closed"):
        solver.save_factor(file)
    assert file.read_bytes() == good


def test_what_a_changed_system_and_changes_of_the_pattern_make_of_it(tmp_path):
    a = whole(40, "auto", "ldlt", np.float64, 6)
    esp.Solver(sp.csc_array(a)).save_factor(tmp_path / "f")
    solver = esp.load_factor(tmp_path / "f")
    changed = esp.ChangedSystem(solver)
    changed.remove([3])
    kept = np.delete(np.arange(40), 3)
    b = np.arange(1.0, 41.0)
    np.testing.assert_allclose(a[np.ix_(kept, kept)] @ changed.solve(b)[kept], b[kept], atol=1e-10)
    with_entry = a.copy()
    with_entry[5, 9] = with_entry[9, 5] = 0.7
    solver.analyze_change(sp.csc_array(with_entry))
    solver.factorize(sp.csc_array(with_entry))
    np.testing.assert_allclose(with_entry @ solver.solve(b), b, atol=1e-10)


@pytest.mark.parametrize("symmetry", ["lower", "upper", "hermitian_lower", "hermitian_upper"])
@pytest.mark.parametrize("layout", ["csc", "csr", "coo"])
def test_a_triangle_that_is_given_again_is_taken_for_one(tmp_path, symmetry, layout):
    a = whole(30, symmetry, "ldlt", np.complex128 if "herm" in symmetry else np.float64, 5)
    given, b = as_layout(stored(a, symmetry), layout), np.arange(1.0, 31.0)
    esp.Solver(given, symmetry=symmetry).save_factor(tmp_path / "factor")
    loaded = esp.load_factor(tmp_path / "factor")
    loaded.factorize(2 * given)
    assert abs(2 * a @ loaded.solve(b) - b).max() < 1e-12


@pytest.mark.parametrize("symmetry", ["hermitian", "hermitian_lower", "hermitian_upper"])
@pytest.mark.parametrize("layout", ["csc", "csr"])
def test_a_hermitian_matrix_may_have_real_values(symmetry, layout):
    real = whole(30, "lower", "ldlt", np.float64, 6)
    turned = real + 1j * (np.tril(real, -1) - np.triu(real, 1))
    b = np.arange(1.0, 31.0)
    first, second = (as_layout(stored(a, symmetry), layout) for a in (real, turned))
    second = first.__class__((np.asarray(second[first.nonzero()]).ravel(), first.nonzero()), shape=first.shape).asformat(layout)
    solver = esp.Solver(first, symmetry=symmetry)
    for given, a in ((first, real), (second.data, turned), (first, real), (second, turned), (first.data + 0j, real)):
        solver.factorize(given)
        assert abs(a @ solver.solve(b) - b).max() < 1e-12
