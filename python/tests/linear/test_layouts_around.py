"""Every output of what is around a Solver (Schur complements, changes, batches, modes, SciPy's names), for matrices in every layout,
storage and dtype.

Truth: NumPy's dense algebra with the matrix itself, in FP64. Tolerances: c n eps |A| |x| with c = 100 (backward errors are
some eps), for inverses times the condition number, for which the matrices are made small."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from layouts import CASES, DTYPES, LAYOUTS, N, close, dense, laid_out, places, symmetries

import espalier as esp

REAL = [(dtype, sort) for dtype, sort in CASES if np.dtype(dtype).kind == "f"]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("dtype, sort", REAL)
def test_schur_complements(layout, dtype, sort):
    a = dense(sort, dtype, 29)
    whole = a.astype(float)
    listed = np.array([17, 3, 8])
    rest = np.setdiff1d(np.arange(N), listed)
    b = np.random.default_rng(6).random((N, 2))
    for symmetry, part in symmetries(sort, dtype):
        schur = esp.SchurComplement(laid_out(part(a), layout), listed, symmetry=symmetry)
        for scale in (1, 2):
            m = scale * whole
            s = m[np.ix_(listed, listed)] - m[np.ix_(listed, rest)] @ np.linalg.solve(m[np.ix_(rest, rest)], m[np.ix_(rest, listed)])
            close(schur.complement, s, whole)
            for transpose, of, complement in ((False, m, s), (True, m.T, s.T)):
                for lie in places().values():
                    g = schur.condense(lie(b), transpose=transpose)
                    close(g, b[listed] - of[np.ix_(listed, rest)] @ np.linalg.solve(of[np.ix_(rest, rest)], b[rest]), whole)
                    xs = np.linalg.solve(complement, g)
                    close(schur.expand(lie(b), lie(xs), transpose=transpose), np.linalg.solve(of, b), whole)
                    close(schur.solve(lie(b), transpose=transpose), np.linalg.solve(of, b), whole)
                    close(schur.solve(lie(b[:, 1]), transpose=transpose), np.linalg.solve(of, b[:, 1]), whole)
                    close(schur.condense(lie(b[:, 1]), transpose=transpose), g[:, 1], whole)
            if sort != "general":
                w, in_rest = np.linalg.eigvalsh(m), np.linalg.eigvalsh(m[np.ix_(rest, rest)])
                of_rest, of_s = schur.inertia
                assert of_rest == schur.rest_inertia == ((in_rest > 0).sum(), (in_rest < 0).sum(), 0)
                assert np.array_equal(np.add(of_rest, of_s), ((w > 0).sum(), (w < 0).sum(), 0))
            schur.factorize(laid_out(2 * part(a), layout))
    with pytest.raises(esp.SingularMatrixError) as caught:
        esp.SchurComplement(laid_out(dense(sort, dtype, 7, 2), layout), [0])
    assert caught.value.row is not None


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("dtype, sort", REAL)
def test_changed_systems(layout, dtype, sort):
    a = dense(sort, dtype, 31)
    whole = a.astype(float)
    rng = np.random.default_rng(9)
    u, v, c = rng.random((N, 2)), rng.random((N, 2)), np.array([[2.0, 0.5], [0.25, -1.0]])
    g, w, d = rng.random((N, 3)), rng.random((3, N)), np.diag([3.0, 4, 5])
    truth = np.block([[whole + u @ c @ v.T, g], [w, d]])
    b = rng.random((N + 3, 2))
    for symmetry, part in symmetries(sort, dtype):
        solver = esp.Solver(laid_out(part(a), layout), symmetry=symmetry)
        for lie in places().values():
            changed = esp.ChangedSystem(solver)
            changed.add_low_rank(lie(u), lie(c), lie(v))
            changed.add(lie(g), lie(w), lie(d))
            close(changed.solve(lie(b)), np.linalg.solve(truth, b), truth)
            close(changed.solve(lie(b[:, 1])), np.linalg.solve(truth, b[:, 1]), truth)
            close(changed.solve(lie(b), transpose=True), np.linalg.solve(truth.T, b), truth.T)
            changed.remove(lie(np.array([2, N + 1])))
            kept = np.setdiff1d(np.arange(N + 3), [2, N + 1])
            x = changed.solve(lie(b))
            assert not x[[2, N + 1]].any()
            close(x[kept], np.linalg.solve(truth[np.ix_(kept, kept)], b[kept]), truth)
        symmetric = esp.ChangedSystem(solver)
        symmetric.add_low_rank(u[:, 0])
        symmetric.add(sp.csr_array(g))
        if sort != "general":
            e = np.linalg.eigvalsh(np.block([[whole + np.outer(u[:, 0], u[:, 0]), g], [g.T, np.zeros((3, 3))]]))
            assert symmetric.inertia == ((e > 0).sum(), (e < 0).sum(), 0)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("dtype, sort", REAL)
def test_batches(layout, dtype, sort):
    a = dense(sort, dtype, 37)
    b = np.random.default_rng(6).random((4, N, 2))
    scales = np.array([1.0, 2, -3, 4] if sort != "definite" else [1.0, 2, 3, 4])
    for symmetry, part in symmetries(sort, dtype):
        given = laid_out(part(a), layout)
        batch = esp.Batch(given, symmetry=symmetry)
        data = given[2] if layout == "triple" else (given if layout in ("csc", "csr") else given.tocsc()).data
        values = scales[:, None] * data.astype(float)
        for transpose, m in ((False, a.astype(float)), (True, a.T.astype(float))):
            truth = np.linalg.solve(scales[:, None, None] * m, b)
            for lie in places().values():
                found = batch.solve(lie(values), lie(b) if np.ndim(lie(b)) == 3 else b, transpose=transpose)
                close(found.x, truth, a)
                close(batch.solve(lie(values), lie(b[:, :, 1]), transpose=transpose).x, truth[:, :, 1], a)
                if sort != "general":
                    assert list(found.negative) == [(np.linalg.eigvalsh(s * a) < 0).sum() for s in scales]
                several = esp.solve_systems([(given, lie(b[0])), (given, lie(b[0, :, 1]))], symmetry=symmetry, transpose=transpose)
                close(several.x[0], np.linalg.solve(m, b[0]), a)
                close(several.x[1], np.linalg.solve(m, b[0, :, 1]), a)
        singular = values.copy()
        singular[2] = (lambda g: g[2] if layout == "triple" else (g if layout in ("csc", "csr") else g.tocsc()).data)(
            laid_out(part(a), layout)) * 0
        found = batch.solve(singular, b, check=False)
        assert list(found.errors) == [2] and np.isnan(found.x[2]).all()


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("symmetry", ["auto", "symmetric", "lower", "upper"])
def test_modes_and_harmonic(layout, dtype, symmetry):
    k, m = dense("definite", dtype, 41), dense("definite", dtype, 43)
    c = 0.01 * k
    part = {"lower": np.tril, "upper": np.triu}.get(symmetry, lambda a: a)
    stored = [laid_out(part(x), layout) for x in (k, c, m)]
    k, c, m = (x.astype(float) for x in (k, c, m))
    w = scipy.linalg.eigvalsh(k, m)
    found = esp.modes(stored[0], stored[2], 4, symmetry=symmetry)
    assert found.eigenvalues == pytest.approx(w[:4], rel=1e-9) and found.complete
    close(k @ found.vectors, m @ found.vectors * found.eigenvalues, np.eye(2) * 1e5)
    assert found.vectors.T @ m @ found.vectors == pytest.approx(np.eye(4), abs=1e-9)
    buckled = esp.buckling_modes(stored[0], stored[2], 3, symmetry=symmetry)
    assert buckled.eigenvalues == pytest.approx(w[:3], rel=1e-9)
    assert buckled.vectors.T @ k @ buckled.vectors == pytest.approx(np.eye(3), abs=1e-9)
    if layout == "triple" or symmetry == "symmetric":
        return
    f = np.random.default_rng(3).random((N, 2)) + 1j
    for lie in places().values():
        answer = esp.harmonic(stored[0], stored[2], lie(f), C=stored[1], frequencies=[0.1, 0.3], symmetry=symmetry, observed=[5, 0],
                              shapes_at=[0.3])
        for p, frequency in enumerate([0.1, 0.3]):
            omega = 2 * np.pi * frequency
            x = np.linalg.solve(k + 1j * omega * c - omega**2 * m, f)
            close(answer.response[p], x[[5, 0]], k + 1j * omega * c - omega**2 * m)
        close(answer.shapes[0], x, k + 1j * omega * c - omega**2 * m)
    if symmetry == "auto":
        g = np.triu(k, 1) - np.triu(k, 1).T
        stored[1] = laid_out(g.astype(dtype), layout)
        motion = esp.quadratic_modes(stored[0], stored[1], stored[2], 4)
        for mu, x in zip(motion.eigenvalues, motion.vectors.T):
            q = mu**2 * m + mu * g + k
            assert np.linalg.norm(q @ x) <= 1e-9 * np.linalg.norm(x) * (abs(mu)**2 * np.linalg.norm(m) + abs(mu) * np.linalg.norm(g) + np.linalg.norm(k))


@pytest.mark.parametrize("layout", ["csc", "csr", "coo"])
@pytest.mark.parametrize("dtype, sort", CASES)
def test_scipys_names(layout, dtype, sort):
    import espalier.scipy as es

    a = dense(sort, dtype, 47)
    given = laid_out(a, layout)
    rng = np.random.default_rng(8)
    for of in DTYPES:
        b = (rng.random((N, 2)) + (1j * rng.random((N, 2)) if of.startswith("c") else 0)).astype(of)
        single = np.finfo(np.result_type(dtype, of)).eps > 1e-10
        for lie in places().values():
            for trans, m in (("N", a), ("T", a.T), ("H", a.conj().T)):
                x = es.splu(given).solve(lie(b), trans)
                truth = np.linalg.solve(m.astype(np.complex128), b)
                assert abs(x - truth).max() <= (1e-3 if single else 1e-10) * abs(truth).max()
            x = es.spsolve(given, lie(b))
            truth = np.linalg.solve(a.astype(np.complex128), b)
            assert x.shape == b.shape and abs(x - truth).max() <= (1e-3 if single else 1e-10) * abs(truth).max()
