"""espalier.modes against dense eigenvalues, closed forms and scipy's eigsh."""

import math
import threading
import time

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import espalier as esp


def string(n):
    return sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n)).tocsc()


def exact(n, count):
    return 4 * np.sin(np.pi * np.arange(1, count + 1) / (2 * (n + 1))) ** 2


def plate(nx, ny):
    return sp.csr_array(sp.kron(string(nx), sp.eye_array(ny)) + sp.kron(sp.eye_array(nx), string(ny)))


@pytest.mark.parametrize("layout", ["csc", "csr", "coo", "triple"])
def test_a_string_in_every_layout(layout):
    n = 300
    k, m = string(n).tocsr(), sp.eye_array(n, format="csr")
    if layout == "triple":
        k, m = (k.indptr, k.indices, k.data), (m.indptr, m.indices, m.data)
    else:
        k, m = k.asformat(layout), m.asformat(layout)
    found = esp.modes(k, m, 7, threads=2)
    assert found.complete, found.completeness
    assert found.vectors.shape == (n, 7) and len(found) == 7
    np.testing.assert_allclose(found.eigenvalues, exact(n, 7), rtol=1e-10)
    np.testing.assert_allclose(found.frequencies, np.sqrt(exact(n, 7)) / (2 * math.pi), rtol=1e-10)
    np.testing.assert_allclose(found.vectors.T @ found.vectors, np.eye(7), atol=1e-11)


@pytest.mark.parametrize("by_rows", [False, True])
@pytest.mark.parametrize("symmetry", ["lower", "upper", "symmetric"])
def test_triangles(symmetry, by_rows):
    n = 50
    k, m = string(n), sp.eye_array(n, format="csc")
    part = {"lower": sp.tril, "upper": sp.triu, "symmetric": lambda a: a}[symmetry]
    k, m = (part(a).asformat("csr" if by_rows else "csc") for a in (k, m))
    np.testing.assert_allclose(esp.modes(k, m, 4, symmetry=symmetry).eigenvalues, exact(n, 4), rtol=1e-10)


def test_against_dense_and_eigsh():
    rng = np.random.default_rng(5)
    k = plate(30, 25)
    m = sp.csr_array(sp.diags_array(1 + rng.random(750)))
    m = m + 0.05 * sp.csr_array(plate(30, 25) - sp.diags_array(plate(30, 25).diagonal()))
    truth = scipy.linalg.eigh(k.toarray(), m.toarray(), eigvals_only=True)
    found = esp.modes(k, m, 40)
    assert found.complete
    np.testing.assert_allclose(found.eigenvalues, truth[:40], rtol=1e-9)
    residual = k @ found.vectors - (m @ found.vectors) * found.eigenvalues
    assert np.abs(residual).max() < 1e-8
    other = np.sort(spla.eigsh(k.tocsc(), 40, m.tocsc(), sigma=0, return_eigenvectors=False))
    np.testing.assert_allclose(found.eigenvalues, other, rtol=1e-8)
    below = esp.modes(k, m, below=(truth[16] + truth[17]) / 2)
    assert len(below) == 17 and below.complete


def test_constraints_and_rows_without_mass():
    n = 60
    k = sp.lil_array((n + 1, n + 1))
    k[:n, :n] = string(n)
    k[n, 20] = k[20, n] = 1.0
    m = sp.diags_array(np.r_[np.ones(n), 0.0])
    found = esp.modes(k.tocsc(), m, 5)
    keep = [i for i in range(n) if i != 20]
    truth = np.linalg.eigvalsh(string(n).toarray()[np.ix_(keep, keep)])
    np.testing.assert_allclose(found.eigenvalues, truth[:5], rtol=1e-9)
    assert (found.finite, found.massless) == (n - 1, 1)
    assert np.abs(found.vectors[20]).max() < 1e-12


def test_buckling():
    n = 80
    found = esp.buckling_modes(string(n), sp.eye_array(n, format="csc"), 3)
    np.testing.assert_allclose(found.eigenvalues, exact(n, 3), rtol=1e-10)
    np.testing.assert_allclose(found.vectors.T @ (string(n) @ found.vectors), np.eye(3), atol=1e-11)
    assert found.complete


def test_what_is_refused():
    k, m = string(6), sp.eye_array(6, format="csc")
    for arguments, kind, says in (
        (((k, m), {}), ValueError, "nothing is asked for"),
        (((k, m, 0), {}), ValueError, "count is 0"),
        (((k, m, 7), {}), esp.InvalidInputError, "7 modes are asked for, and there are 6"),
        (((k, -m, 1), {}), esp.InvalidInputError, "not positive semi-definite"),
        (((k, sp.eye_array(5, format="csc"), 1), {}), esp.InvalidInputError, "one size"),
        (((k + sp.csc_array(([1.0], ([0], [3])), shape=(6, 6)), m, 1), {}), esp.InvalidInputError, "K is not symmetric"),
        (((k * math.nan, m, 1), {}), esp.InvalidInputError, "K: "),
        (((m, m, 1), {"shift": 1.0}), esp.SingularMatrixError, "the shift 1 is an eigenvalue"),
        (((k, m, 1), {"kind": "lu"}), ValueError, "kind has no meaning"),
        (((k, m, 1), {"symmetry": "general"}), ValueError, "symmetry"),
        (((k, m, 1), {"threads": -3}), esp.InvalidInputError, "threads"),
        (((plate(30, 30), sp.eye_array(900), 40), {"host_memory": "50K"}), esp.OutOfMemoryError, "budget|allowed"),
        (((1j * k, m, 1), {}), TypeError, "complex"),
    ):
        with pytest.raises(kind, match=says):
            esp.modes(*arguments[0], **arguments[1])


def test_the_same_bits_for_any_number_of_threads():
    k, m = plate(40, 30), sp.eye_array(1200, format="csr")
    one, three = (esp.modes(k, m, 20, threads=t) for t in (1, 3))
    assert (one.eigenvalues == three.eigenvalues).all() and (one.vectors == three.vectors).all()


def test_other_threads_run_meanwhile():
    k, m = plate(150, 140), sp.eye_array(21000, format="csr")
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    try:
        assert esp.modes(k, m, 30).complete
    finally:
        done.set()
        thread.join()
    assert len(ticks) > 5
