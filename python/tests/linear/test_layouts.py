"""Every output of every call of Solver, for matrices in every layout, storage and dtype, and for arrays that lie in memory in
every way.

Truth: NumPy's dense algebra with the matrix itself, in FP64. Tolerances: c n eps |A| |x| with c = 100 (backward errors are
some eps), for inverses times the condition number, for which the matrices are made small."""

import pickle

import numpy as np
import pytest
import scipy.sparse as sp
from layouts import CASES, DTYPES, EPS, LAYOUTS, N, close, dense, laid_out, places, symmetries

import espalier as esp


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
