"""espalier.SchurComplement, ChangedSystem, Batch and Solver.analyze_change against dense algebra."""

import numpy as np
import pytest
import scipy.sparse as sp

import espalier as esp


def system(n, kind, seed):
    rng = np.random.default_rng(seed)
    a = sp.random_array((n, n), density=4 / n, rng=rng).toarray()
    if kind != "lu":
        a = a + a.T
    return a + np.diag(n * np.ones(n) if kind == "llt" else np.where(rng.random(n) < 0.5, -3.0, 3.0))


def layouts(a, layout):
    s = sp.csc_array(a)
    if layout == "triple":
        r = s.tocsr()
        return r.indptr, r.indices, r.data
    return s.asformat(layout)


@pytest.mark.parametrize("layout", ["csc", "csr", "coo", "triple"])
@pytest.mark.parametrize("kind", ["llt", "ldlt", "lu"])
def test_schur_complement(kind, layout):
    n = 60
    a = system(n, kind, 3)
    listed = np.array([7, 50, 3, 20])
    rest = np.setdiff1d(np.arange(n), listed)
    schur = esp.SchurComplement(layouts(a, layout), listed, kind=kind, threads=2)
    s = a[np.ix_(listed, listed)] - a[np.ix_(listed, rest)] @ np.linalg.solve(a[np.ix_(rest, rest)], a[np.ix_(rest, listed)])
    np.testing.assert_allclose(schur.complement, s, rtol=1e-9, atol=1e-9)
    b = np.random.default_rng(1).random((n, 2))
    g = schur.condense(b)
    x = schur.expand(b, np.linalg.solve(s, g))
    np.testing.assert_allclose(a @ x, b, atol=1e-9)
    np.testing.assert_allclose(a @ schur.solve(b[:, 0]), b[:, 0], atol=1e-10)
    np.testing.assert_allclose(a.T @ schur.solve(b, transpose=True), b, atol=1e-10)
    assert schur.last_solve.backward_error < 1e-14
    if kind != "lu":
        of_rest, of_s = schur.inertia
        assert of_rest.negative + of_s.negative == (np.linalg.eigvalsh(a) < 0).sum()
    schur.factorize(layouts(2 * a, layout))
    np.testing.assert_allclose(schur.complement, 2 * s, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("layout", ["csc", "csr"])
def test_schur_complement_of_values_that_are_symmetric_no_more(layout):
    a = system(30, "ldlt", 3)
    schur = esp.SchurComplement(layouts(a, layout), [2, 9])
    a[a != 0] *= 1 + 0.2 * np.random.default_rng(5).random(np.count_nonzero(a))
    schur.factorize(layouts(a, layout))
    b = np.arange(30.0)
    np.testing.assert_allclose(a @ schur.solve(b), b, atol=1e-9)
    with pytest.raises(esp.InvalidInputError, match="nan"):
        schur.factorize(layouts(a * np.nan, layout))


def test_schur_complements_that_cannot_be():
    a = sp.csc_array(system(10, "llt", 1))
    for listed in ([], [3, 3], [10]):
        with pytest.raises(esp.InvalidInputError):
            esp.SchurComplement(a, listed)
    free = sp.diags_array([[-1.0] * 4, [1, 2, 2, 2, 1], [-1.0] * 4], offsets=[-1, 0, 1]).tolil()
    free.resize((6, 6))
    free[5, 5] = 1
    with pytest.raises(esp.SingularMatrixError):
        esp.SchurComplement(free.tocsc(), [5])
    schur = esp.SchurComplement(a, [1])
    with pytest.raises(ValueError):
        schur.condense(np.ones(9))
    with pytest.raises(esp.InvalidInputError):
        schur.solve(np.full(10, np.nan))


@pytest.mark.parametrize("kind", ["llt", "ldlt", "lu"])
def test_changed_system(kind):
    n = 40
    a = system(n, kind, 5)
    rng = np.random.default_rng(2)
    solver = esp.Solver(sp.csc_array(a), kind=kind, threads=2)
    changed = esp.ChangedSystem(solver)
    u, c, g = rng.random((n, 2)), np.array([[2.0, 0.5], [0.5, -1.0]]), rng.random((n, 3))
    changed.add_low_rank(u, c)
    changed.add(g)
    changed.remove([4, n + 1])
    assert len(changed) == n + 3
    full = np.block([[a + u @ c @ u.T, g], [g.T, np.zeros((3, 3))]])
    kept = np.setdiff1d(np.arange(n + 3), [4, n + 1])
    b = rng.random(n + 3)
    x = changed.solve(b)
    assert x[4] == 0 and x[n + 1] == 0
    np.testing.assert_allclose(full[np.ix_(kept, kept)] @ x[kept], b[kept], atol=1e-9)
    assert changed.last_solve.backward_error < 1e-13
    if kind != "lu":
        assert changed.inertia.negative == (np.linalg.eigvalsh(full[np.ix_(kept, kept)]) < 0).sum()
    changed.restore([4])
    with pytest.raises(esp.InvalidInputError):
        changed.restore([4])
    with pytest.raises(ValueError):
        changed.add(np.ones(n + 1))
    solver.factorize(sp.csc_array(2 * a))
    with pytest.raises(RuntimeError):
        changed.solve(b)
    solver.close()
    with pytest.raises(RuntimeError):
        changed.solve(b)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("kind", ["llt", "ldlt", "lu"])
def test_rows_that_come_and_go(kind, sparse):
    """Every change, by arrays and by sparse matrices, before and after a factorization of the changed matrix."""
    n = 50
    a = system(n, kind, 7)
    rng = np.random.default_rng(4)
    as_given = (lambda m: sp.csc_array(m)) if sparse else (lambda m: m)
    changed = esp.ChangedSystem(esp.Solver(sp.csc_array(a), kind=kind, threads=2), folding=False)
    g, corner = rng.random((n, 2)) * (rng.random((n, 2)) < 0.2), np.array([[-1.0, 0.25], [0.25, -2.0]])
    changed.add(as_given(g), corner=corner)
    full = np.block([[a, g], [g.T, corner]])
    column = np.zeros((n + 2, 1))
    column[[3, 8, 20, n + 1], 0] = [30.0, 1.0, -2.0, 0.5]
    changed.replace([3], as_given(column))
    full[:, 3] = full[3, :] = column[:, 0]
    u = np.zeros((n, 1))
    u[[10, 11], 0] = 1
    changed.add_low_rank(as_given(u), [[2.0]])
    full[:n, :n] += 2 * u @ u.T
    changed.flip([5, 9, n])
    changed.flip([9, 12])
    kept = np.setdiff1d(np.arange(n + 2), [5, 12, n])
    b = rng.random((n + 2, 3))
    truth = np.zeros_like(b)
    truth[kept] = np.linalg.solve(full[np.ix_(kept, kept)], b[kept])
    np.testing.assert_allclose(changed.solve(b), truth, atol=1e-9)
    cost = changed.cost
    assert cost.factorizations == 0 and cost.columns == 2 + 2 + 1 + 2 - 1 and 0 < cost.changes
    changed.fold()
    assert changed.cost.factorizations == 1 and changed.cost.columns == 0
    np.testing.assert_allclose(changed.solve(b), truth, atol=1e-9)
    changed.flip([5, n])
    kept = np.setdiff1d(np.arange(n + 2), [12])
    truth[kept] = np.linalg.solve(full[np.ix_(kept, kept)], b[kept])
    truth[12] = 0
    np.testing.assert_allclose(changed.solve(b), truth, atol=1e-9)
    if kind != "lu":
        assert changed.inertia.negative == (np.linalg.eigvalsh(full[np.ix_(kept, kept)]) < 0).sum()


def test_changes_that_cannot_be():
    changed = esp.ChangedSystem(esp.Solver(sp.csc_array(system(20, "llt", 1))))
    with pytest.raises(esp.InvalidInputError, match="twice"):
        changed.flip([3, 3])
    with pytest.raises(esp.InvalidInputError, match="no unknown 20"):
        changed.flip([20])
    with pytest.raises(ValueError, match="at most 20 rows"):
        changed.add(sp.csc_array(np.ones((21, 1))))
    with pytest.raises(ValueError):
        changed.replace([1, 2], np.ones((20, 1)))
    with pytest.raises(ValueError):
        changed.add(sp.csc_array(np.full((20, 1), np.nan)))
    changed.remove([4])
    with pytest.raises(esp.InvalidInputError, match="removed"):
        changed.replace([4], np.ones((20, 1)))
    changed.add(np.zeros(20))
    for call in (changed.fold, changed.prepare, lambda: changed.solve(np.ones(21))):
        with pytest.raises(esp.SingularMatrixError):
            call()
    changed.remove([20])
    assert changed.solve(np.ones(21))[20] == 0


@pytest.mark.parametrize("layout", ["csc", "csr"])
@pytest.mark.parametrize("kind", ["llt", "lu"])
def test_batch(kind, layout):
    n, count = 30, 9
    a = layouts(system(n, kind, 8), layout)
    rng = np.random.default_rng(4)
    values = a.data * (1 + 0.1 * rng.random((count, 1)) if kind == "llt" else 1 + 0.1 * rng.random((count, len(a.data))))
    batch = esp.Batch(a, kind=kind, threads=2)
    for shape in [(count, n), (count, n, 2)]:
        b = rng.random(shape)
        found = batch.solve(values, b)
        assert found.x.shape == shape and not found.errors and found.backward_errors.max() < 1e-14
        for k in range(count):
            one = a.copy()
            one.data = values[k]
            np.testing.assert_allclose(one @ found.x[k], b[k], atol=1e-10)
    values[3] = 0
    b = rng.random((count, n))
    with pytest.raises(esp.Error, match="system 3"):
        batch.solve(values, b)
    found = batch.solve(values, b, check=False)
    assert list(found.errors) == [3] and np.isnan(found.x[3]).all() and not np.isnan(found.x[4]).any()
    with pytest.raises(ValueError):
        batch.solve(values[:, 1:], b)


def test_systems_of_patterns_of_their_own():
    rng = np.random.default_rng(5)
    kinds = ["llt", "ldlt", "lu"]
    matrices = [layouts(system(n, kinds[n % 3], n), ["csc", "csr"][n % 2]) for n in range(5, 40)]
    sides = [rng.random((len(a.indptr) - 1, 2) if k % 3 == 0 else len(a.indptr) - 1) for k, a in enumerate(matrices)]
    found = esp.solve_systems(zip(matrices, sides), threads=2)
    assert len(found.x) == len(matrices) and not found.errors and found.backward_errors.max() < 1e-14
    for a, b, x in zip(matrices, sides, found.x):
        assert x.shape == b.shape
        np.testing.assert_allclose(a @ x, b, atol=1e-10)
    transposed = esp.solve_systems(zip(matrices, sides), transpose=True)
    for a, b, x in zip(matrices, sides, transposed.x):
        np.testing.assert_allclose(a.T @ x, b, atol=1e-10)
    bad = matrices[4].copy()
    bad.data[:] = 0
    pairs = list(zip(matrices, sides))
    pairs[4] = (bad, sides[4])
    with pytest.raises(esp.Error, match="system 4"):
        esp.solve_systems(pairs)
    found = esp.solve_systems(pairs, check=False)
    assert list(found.errors) == [4] and np.isnan(found.x[4]).all() and np.isfinite(found.x[5]).all()
    assert esp.solve_systems([]).x == [] and not esp.solve_systems([]).errors
    for wrong in ([(matrices[0], sides[1])], [matrices[0]], [(None, sides[0])]):
        with pytest.raises(ValueError, match="system"):
            esp.solve_systems(wrong)


@pytest.mark.parametrize("layout", ["csc", "csr"])
def test_analyze_change(layout):
    rng = np.random.default_rng(6)
    line = sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(20, 20))
    a = sp.csc_array(sp.kron(line, sp.eye_array(20)) + sp.kron(sp.eye_array(20), line))
    solver = esp.Solver(a.asformat(layout))
    with pytest.raises(RuntimeError):
        esp.Solver().analyze_change(a)
    b = a.tolil()
    for u, v in [(3, 44), (100, 142), (200, 260)]:
        b[u, v] = b[v, u] = -0.1
    b = b.tocsc().asformat(layout)
    change = solver.analyze_change(b)
    assert not change.full and change.added_entries in (3, 6) and change.kept_fronts > 0
    solver.factorize(b)
    right = rng.random(400)
    np.testing.assert_allclose(b @ solver.solve(right), right, atol=1e-10)
    assert solver.analyze_change(sp.eye_array(7, format="csc")).full


class TestPartialRefactorization:
    @staticmethod
    def system(n=30):
        line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
        return (sp.kronsum(line, line) + 0.01 * sp.eye_array(n * n)).tocsc()

    @pytest.mark.parametrize("layout", ["csc", "csr", "coo"])
    @pytest.mark.parametrize("dtype", ["float64", "complex128"])
    def test_has_the_bits_of_a_whole_one(self, layout, dtype):
        rng = np.random.default_rng(3)
        A = self.system().astype(dtype).asformat(layout)
        partial, whole = esp.Solver(A, kind="lu", partial_refactorization=True), esp.Solver(A, kind="lu")
        b = rng.standard_normal(A.shape[0])
        for _ in range(6):
            A.data[rng.integers(A.nnz)] *= 1.0 + rng.random()
            assert partial.factorize(A).work_share < 1 and whole.factorize(A).work_share == 1
            assert partial.factor.determinant_log == whole.factor.determinant_log
            assert np.array_equal(partial.solve(b), whole.solve(b))

    def test_takes_entries_alone(self):
        A = self.system()
        solver = esp.Solver(A, kind="lu", partial_refactorization=True)
        assert solver.factorize_entries([5, 5], [7.0, 9.0]).work_share < 1
        A.data[5] = 9
        b = np.ones(A.shape[0])
        assert np.array_equal(solver.solve(b), esp.Solver(A, kind="lu").solve(b))

    def test_refused_entries_leave_the_factor(self):
        A = self.system()
        solver = esp.Solver(A, partial_refactorization=True)
        b = np.ones(A.shape[0])
        x = solver.solve(b)
        with pytest.raises(esp.InvalidInputError, match="no place 99999999"):
            solver.factorize_entries(99999999, 1.0)
        with pytest.raises(esp.InvalidInputError, match="nan"):
            solver.factorize_entries([0], [np.nan])
        with pytest.raises(ValueError, match="one length"):
            solver.factorize_entries([0, 1], [1.0])
        with pytest.raises(TypeError, match="whole numbers"):
            solver.factorize_entries([0.5], [1.0])
        with pytest.raises(TypeError, match="complex"):
            solver.factorize_entries([0], [1j])
        A.data[3] = np.inf
        with pytest.raises(esp.InvalidInputError):
            solver.factorize(A)
        assert np.array_equal(solver.solve(b), x)
        with pytest.raises(RuntimeError, match="no factorization"):
            esp.Solver().factorize_entries([0], [1.0])


@pytest.mark.parametrize("layout", ["csc", "csr", "coo", "triple"])
@pytest.mark.parametrize("kind", ["llt", "ldlt", "lu"])
def test_changed_system_transposed(kind, layout):
    """Unsymmetric changes around either layout, with A and A^T, before and after a factorization of the changed matrix."""
    n = 40
    a = system(n, kind, 5)
    rng = np.random.default_rng(2)
    changed = esp.ChangedSystem(esp.Solver(layouts(a, layout), kind=kind, threads=2), folding=False)
    u, c, v = rng.random((n, 2)), np.array([[2.0, 0.5], [0.1, -1.0]]), rng.random((n, 2))
    g, h, d = rng.random((n, 2)), rng.random((2, n)), np.array([[3.0, 1.0], [-1.0, 4.0]])
    changed.add_low_rank(u, c, v)
    changed.add(g, h, d)
    column, row = sp.csc_array(rng.random((n + 2, 1))), sp.csr_array(rng.random((1, n + 2)))
    changed.replace([7], column, row)
    changed.remove([4])
    full = np.block([[a + u @ c @ v.T, g], [h, d]])
    corner = column.toarray()[7, 0]
    full[:, 7], full[7] = column.toarray()[:, 0], row.toarray()[0]
    full[7, 7] = corner
    kept = np.delete(np.arange(n + 2), 4)
    b = rng.random((n + 2, 3))
    for _ in range(2):
        for transpose, op in ((False, full), (True, full.T), ("H", full.T)):
            x = changed.solve(b, transpose=transpose)
            assert not x[4].any()
            np.testing.assert_allclose(op[np.ix_(kept, kept)] @ x[kept], b[kept], atol=1e-9)
            assert changed.last_solve.backward_error < 1e-13
        changed.fold()
    with pytest.raises(ValueError, match="transpose"):
        changed.solve(b, transpose="T")
