"""Every output of every call, for matrices in every layout, storage and dtype, and for arrays that lie in memory in every way.

Truth: NumPy's dense algebra with the matrix itself, in FP64. Tolerances: c n eps |A| |x| with c = 100 (backward errors are
some eps), for inverses times the condition number, for which the matrices are made small."""

import pickle

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp

import espalier as esp

N = 24
EPS = np.finfo(float).eps
LAYOUTS = ["csc", "csr", "coo", "bsr", "dia", "lil", "triple"]
DTYPES = ["float32", "float64", "complex64", "complex128"]
SORTS = ["general", "symmetric", "definite"]  # complex: "hermitian" and "hermitian definite" too
STORED = {"full": ["auto", "symmetric"], "lower": ["lower"], "upper": ["upper"]}


def dense(sort, dtype, seed, deficiency=0):
    """A matrix of N rows whose last `deficiency` unknowns are combinations of others, as its equations are; in the numbers of
    `dtype`. Entries of the combinations are small integers, so that the zeros are zeros to the rounding of FP64 and, with
    entries of 12 bits, exactly in FP32."""
    rng = np.random.default_rng(seed)

    def numbers(shape):
        real = rng.integers(-2000, 2000, shape) / 512
        return real + 1j * rng.integers(-2000, 2000, shape) / 512 if np.dtype(dtype).kind == "c" else real

    m = N - deficiency
    a = numbers((m, m)) * (rng.random((m, m)) < 0.2)
    a += np.diag(numbers(m) + 6)
    adjoint = np.conj if "hermitian" in sort or sort == "definite" else (lambda v: v)
    if sort != "general":
        a = a + adjoint(a).T
    if sort == "definite":
        a = a + np.diag(np.ceil(abs(a).sum(1)))
    c = np.zeros((deficiency, m))
    for k in range(deficiency):
        c[k, rng.choice(m, 2, replace=False)] = rng.choice([-1, 1, 2], 2)
    c = c * (1j if np.dtype(dtype).kind == "c" else 1)
    full = np.vstack([np.eye(m), c])
    other = full if sort == "general" else adjoint(full)
    return (other @ a @ full.T).astype(dtype)


def symmetries(sort, dtype):
    """(symmetry, which part is stored)"""
    part = {"lower": np.tril, "upper": np.triu}
    if sort == "general":
        return [("auto", lambda a: a), ("general", lambda a: a)]
    prefix = "hermitian_" if np.dtype(dtype).kind == "c" and sort != "symmetric" else ""
    both = "hermitian" if prefix else "symmetric"
    return [("auto", lambda a: a), (both, lambda a: a), (prefix + "lower", part["lower"]), (prefix + "upper", part["upper"])]


def sorts(dtype):
    return [*SORTS, "hermitian"] if np.dtype(dtype).kind == "c" else SORTS


def laid_out(a, layout):
    s = sp.coo_array(a)
    if layout == "triple":
        r = s.tocsr()
        return r.indptr, r.indices, r.data
    if layout == "bsr":
        return sp.bsr_array(a, blocksize=(2, 2) if np.tril(a, -1).any() and np.triu(a, 1).any() else (1, 1))
    return s.asformat(layout)


CASES = [(dtype, sort) for dtype in DTYPES for sort in sorts(dtype)]


def places():
    """Ways in which the same numbers lie in memory: name -> function of an array."""
    def strided(a):
        return np.repeat(np.repeat(a, 2, 0), 3, -1)[::2, ..., ::3] if a.ndim > 1 else np.repeat(a, 2)[::2]

    def backwards(a):
        return np.ascontiguousarray(a[(slice(None, None, -1),) * a.ndim])[(slice(None, None, -1),) * a.ndim]

    def unaligned(a):
        raw = np.empty(a.nbytes + 1, np.uint8)[1:]
        out = raw.view(a.dtype).reshape(a.shape, order="F")
        out[...] = a
        return out

    def read_only(a):
        a = a.copy()
        a.flags.writeable = False
        return a

    return {"C": np.ascontiguousarray, "F": np.asfortranarray, "strided": strided, "backwards": backwards, "unaligned": unaligned,
            "read-only": read_only, "big endian": lambda a: a.astype(a.dtype.newbyteorder(">")),
            "one row of columns": lambda a: np.ascontiguousarray(a.T).T, "list": lambda a: a.tolist(),
            "part of more": lambda a: np.pad(a, [(1, 2)] * a.ndim)[(slice(1, -2),) * a.ndim]}


def close(x, truth, matrix):
    bound = 100 * N * EPS * np.linalg.cond(matrix)
    assert x.shape == np.shape(truth)
    assert abs(x - truth).max(initial=0) <= bound * abs(np.asarray(truth)).max(initial=0)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("dtype, sort", CASES)
def test_solver(layout, dtype, sort, tmp_path):
    a = dense(sort, dtype, 3)
    whole = a.astype(np.complex128 if np.dtype(dtype).kind == "c" else np.float64)
    rng = np.random.default_rng(5)
    b = rng.random((N, 2)) + (1j * rng.random((N, 2)) if np.dtype(dtype).kind == "c" else 0)
    for symmetry, part in symmetries(sort, dtype):
        given = laid_out(part(a), layout)
        solver = esp.Solver(given, symmetry=symmetry)
        solver.save_analysis(tmp_path / "analysis")
        loaded = esp.Solver(symmetry=symmetry)
        loaded.load_analysis(tmp_path / "analysis", given)
        loaded.factorize(given)
        clone = solver.clone()
        clone.factorize(given)
        data = given[2] if layout == "triple" else (given if layout in ("csc", "csr") else given.tocsc()).data
        again = esp.Solver(symmetry=symmetry)
        again.factorize(given)
        again.factorize(2 * data)
        again.factorize(np.array(data))
        for s in (solver, loaded, clone, again, pickle.loads(pickle.dumps(solver))):
            for transpose, m in ((False, whole), (True, whole.T), ("H", whole.conj().T)):
                close(s.solve(b, transpose=transpose), np.linalg.solve(m, b), whole)
            sign, log = np.linalg.slogdet(whole)
            assert abs(s.slogdet[0] - sign) < 1e-10 and abs(s.slogdet[1] - log) < 1e-10 * N
            f = s.factor
            assert f.rank == N and f.dependent_rows == f.dependent_columns == [] and f.null_vectors is f.left_null_vectors is None
            if sort in ("hermitian", "definite") or sort == "symmetric" and np.dtype(dtype).kind == "f":
                w = np.linalg.eigvalsh(whole)
                assert f.inertia == ((w > 0).sum(), (w < 0).sum(), 0)
            else:
                assert f.inertia == (-1, -1, -1)
            truth = max(np.linalg.cond(whole, p) for p in (1, np.inf))
            assert truth / 10 <= s.condition() <= truth * (1 + 1e-6)
            assert s.last_solve.backward_error < 10 * EPS and s.analysis.kind == f.kind if hasattr(f, "kind") else True


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("dtype, sort", CASES)
@pytest.mark.parametrize("deficiency", [1, 3])
def test_null_spaces(layout, dtype, sort, deficiency):
    a = dense(sort, dtype, 7, deficiency)
    whole = a.astype(np.complex128)
    norm = np.linalg.norm(whole)
    assert np.linalg.matrix_rank(whole) == N - deficiency
    for symmetry, part in symmetries(sort, dtype):
        solver = esp.Solver(laid_out(part(a), layout), symmetry=symmetry, singular="report")
        clone = solver.clone()
        clone.factorize(laid_out(part(a), layout))
        for f in (solver.factor, clone.factor, pickle.loads(pickle.dumps(solver)).factor):
            assert f.rank == N - deficiency and f.determinant_sign == 0 and f.determinant_log == -np.inf
            for vectors, residual in ((f.null_vectors, whole @ f.null_vectors.T), (f.left_null_vectors, f.left_null_vectors @ whole)):
                assert vectors.shape == (deficiency, N) and vectors.dtype == (np.complex128 if np.dtype(dtype).kind == "c" else np.float64)
                assert np.linalg.norm(residual) <= 100 * N * EPS * norm * np.linalg.norm(vectors), symmetry
                assert abs(vectors).max(1) == pytest.approx(1, abs=1e-12)
                assert np.linalg.matrix_rank(vectors, 1e-6) == deficiency
            for listed, m in ((f.dependent_rows, whole), (f.dependent_columns, whole.T)):
                assert len(set(listed)) == deficiency
                assert np.linalg.matrix_rank(np.delete(m, listed, 0)) == N - deficiency
            if sort in ("hermitian", "definite"):
                w = np.linalg.eigvalsh(whole)
                assert f.inertia == ((w > 1e-9).sum(), (w < -1e-9).sum(), deficiency)
        x = np.arange(1.0, N + 1)
        for transpose, m in ((False, whole), (True, whole.T), ("H", whole.conj().T)):  # a right-hand side that has a solution
            b = m @ x if np.dtype(dtype).kind == "c" else (m @ x).real
            found = solver.solve(b, transpose=transpose)
            assert np.linalg.norm(m @ found - b) <= 1e-13 * (norm * np.linalg.norm(found) + np.linalg.norm(b))
        with pytest.raises(esp.SingularMatrixError) as caught:
            esp.Solver(laid_out(part(a), layout), symmetry=symmetry)
        named = [("rows", whole, caught.value.row)] if caught.value.row is not None else [("columns", whole.T, caught.value.column)]
        for _, m, number in named:
            assert np.linalg.matrix_rank(np.delete(m, number, 0)) == N - deficiency


@pytest.mark.parametrize("place", places())
@pytest.mark.parametrize("of", DTYPES + ["int16", "bool"])
@pytest.mark.parametrize("layout, dtype", [("csc", "float64"), ("csr", "float64"), ("csr", "complex128"), ("csc", "complex128")])
def test_right_hand_sides_and_solutions_anywhere_in_memory(place, of, layout, dtype):
    a = dense("general", dtype, 11)
    solver = esp.Solver(laid_out(a, layout))
    rng = np.random.default_rng(2)
    for shape in [(N,), (N, 1), (N, 3)]:
        plain = (4 * rng.random(shape) + (2j * rng.random(shape) if of.startswith("complex") else 0)).astype(of)
        b = places()[place](plain)
        kept = np.array(b)
        for transpose, m in ((False, a), (True, a.T), ("H", a.conj().T)):
            truth = np.linalg.solve(m, plain.astype(np.complex128 if plain.dtype.kind == "c" else np.float64))
            x = solver.solve(b, transpose=transpose)
            assert x.dtype == truth.dtype
            close(x, truth, a)
            if place in ("list", "read-only", "big endian"):
                continue
            out = places()[place](np.full(shape, np.nan, truth.dtype))
            assert solver.solve(b, transpose=transpose, out=out) is out
            close(out, truth, a)
            assert np.array_equal(out, x)
        assert np.array_equal(np.array(b), kept)
        if place not in ("list", "read-only", "big endian") and np.dtype(of) in (np.float64, np.complex128) and np.result_type(of, dtype) == of:
            solver.solve(b, out=b)  # in place
            close(b, np.linalg.solve(a, kept), a)


@pytest.mark.parametrize("columns", [1, 2, 5])
@pytest.mark.parametrize("shift", [-40, -24, -1, 0, 1, 24, 40])
def test_solutions_that_overlap_right_hand_sides(columns, shift):
    a = dense("general", "float64", 11)
    solver = esp.Solver(sp.csc_array(a))
    memory = np.random.default_rng(1).random(N * columns + 2 * 40)
    b = memory[40:40 + N * columns].reshape((N, columns), order="F")
    out = memory[40 + shift:40 + shift + N * columns].reshape((N, columns), order="F")
    truth = np.linalg.solve(a, b)
    solver.solve(b, out=out)
    close(out, truth, a)


@pytest.mark.parametrize("place", sorted(set(places()) - {"one row of columns"}))
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("index", ["int32", "int64", "uint16"])
def test_matrices_anywhere_in_memory(place, dtype, index):
    a = dense("general", dtype, 13)
    lie = places()[place]
    rows = sp.csr_array(a)
    given = lie(rows.indptr.astype(index)), lie(rows.indices.astype(index)), lie(rows.data)
    b = np.arange(1.0, N + 1)
    truth = np.linalg.solve(a.astype(np.complex128 if np.dtype(dtype).kind == "c" else np.float64), b)
    solver = esp.Solver(given)
    close(solver.solve(b), truth, a)
    solver.factorize(lie(2 * rows.data))
    close(2 * solver.solve(b), truth, a)
    assert solver.factorize(given) and esp.Solver().analyze(given[:2] + (None,))
    close(esp.solve(given, lie(b)), truth, a)


# Entries that stand twice, in any order, beside zeros that are stored.
@pytest.mark.parametrize("layout", ["csc", "csr", "coo", "triple"])
@pytest.mark.parametrize("dtype, sort", CASES)
def test_entries_in_any_order_and_twice(layout, dtype, sort):
    a = dense(sort, dtype, 17)
    rng = np.random.default_rng(3)
    for symmetry, part in symmetries(sort, dtype):
        i, j = np.nonzero(part(a))
        values = part(a)[i, j]
        zeros = rng.integers(0, len(i), 5)
        i, j, values = np.r_[i, i, i[zeros]], np.r_[j, j, j[zeros]], np.r_[values / 2, values / 2, 0 * values[zeros]]
        by_rows = layout in ("csr", "triple")
        order = rng.permutation(len(i))
        order = order[np.argsort((i if by_rows else j)[order], kind="stable")]
        i, j, values = i[order], j[order], values[order]
        pointers = np.r_[0, np.cumsum(np.bincount(i if by_rows else j, minlength=N))]
        given = (pointers, j if by_rows else i, values)
        if layout == "coo":
            given = sp.coo_array((values, (i, j)), shape=(N, N))
        elif layout != "triple":
            given = (sp.csr_array if by_rows else sp.csc_array)((given[2], given[1], given[0]), shape=(N, N))
        solver = esp.Solver(given, symmetry=symmetry)
        b = np.arange(1.0, N + 1)
        close(solver.solve(b), np.linalg.solve(a.astype(np.complex128 if np.dtype(dtype).kind == "c" else float), b), a)
        if layout != "coo":
            solver.factorize(3 * values)
            close(3 * solver.solve(b), np.linalg.solve(a.astype(np.complex128), b), a)
            close(pickle.loads(pickle.dumps(solver)).solve(b) * 3, np.linalg.solve(a.astype(np.complex128), b), a)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("dtype", DTYPES)
def test_rows_and_columns_in_errors(layout, dtype):
    a = dense("general", dtype, 19)
    a[5, 9] = np.nan
    with pytest.raises(esp.InvalidInputError, match=r"entry \(5, 9\) is"):
        esp.Solver(laid_out(a, layout))
    a = dense("general", dtype, 19)
    solver = esp.Solver(laid_out(a, layout))
    b = np.ones(N, np.result_type(dtype, float))
    b[7] = np.inf
    with pytest.raises(esp.InvalidInputError, match="row 7") as caught:
        solver.solve(b)
    assert caught.value.row == 7
    for lost in ("row", "column"):
        c = a.copy()
        c[4 if lost == "row" else slice(None), slice(None) if lost == "row" else 4] = 0
        with pytest.raises(esp.SingularMatrixError) as caught:
            esp.Solver(laid_out(c, layout), kind="lu")
        row, column = caught.value.row, caught.value.column
        assert (row is None) != (column is None)
        m, number = (c, row) if row is not None else (c.T, column)
        assert np.linalg.matrix_rank(np.delete(m, number, 0)) == N - 1 and f"{number}" in str(caught.value)
    for symmetry, part in symmetries("definite", dtype)[2:]:
        for wrong in (np.tril, np.triu):
            if wrong(np.ones((2, 2)))[1, 0] == part(np.ones((2, 2)))[1, 0]:
                continue
            with pytest.raises(esp.InvalidInputError, match="triangle"):
                esp.Solver(laid_out(wrong(dense("definite", dtype, 1)), layout), symmetry=symmetry)
    d = dense("definite", dtype, 23)
    d[6, 6] = -40 * abs(d).max()
    for symmetry, part in symmetries("definite", dtype):
        with pytest.raises(esp.NotPositiveDefiniteError) as caught:
            esp.Solver(laid_out(part(d), layout), symmetry=symmetry, kind="llt")
        assert caught.value.row == 6 or np.linalg.eigvalsh(np.delete(np.delete(d, 6, 0), 6, 1)).min() > 0


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
