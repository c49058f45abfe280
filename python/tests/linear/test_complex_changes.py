"""ChangedSystem and Solver.analyze_change around complex factors. Truth: dense algebra of NumPy."""

import numpy as np
import pytest
import scipy.sparse as sp

import espalier as esp

SYMMETRIES = {"general": ("general", "auto"), "symmetric": ("symmetric", "auto", "lower", "upper"),
              "hermitian": ("hermitian", "auto", "hermitian_lower", "hermitian_upper")}


def numbers(rng, *shape):
    return rng.uniform(-1, 1, shape) + 1j * rng.uniform(-1, 1, shape)


def system(rng, n, sort):
    a = np.where(rng.random((n, n)) < 0.2, numbers(rng, n, n), 0)
    if sort == "symmetric":
        a = np.tril(a) + np.tril(a, -1).T
    if sort == "hermitian":
        a = np.tril(a, -1) + np.tril(a, -1).conj().T
    a[np.diag_indices(n)] = (2 + abs(a).sum(axis=1)) * (np.ones(n) if sort == "hermitian" and rng.integers(2) else rng.choice([-1, 1], n))
    if sort == "symmetric":
        a[0, 0] += 0.5j
    return a


def as_given(rng, a, symmetry):
    stored = np.tril(a) if symmetry.endswith("lower") else np.triu(a) if symmetry.endswith("upper") else a
    return sp.csr_array(stored) if rng.integers(2) else sp.csc_array(stored)


def in_some_form(rng, a, sparse_too=True):
    """The same numbers in another order, stride or container."""
    forms = [lambda: a, lambda: np.asfortranarray(a), lambda: np.repeat(a, 2, axis=0)[::2], lambda: a[::-1].copy()[::-1]]
    if sparse_too and a.ndim == 2:
        forms += [lambda: sp.csc_array(a), lambda: sp.coo_array(a)]
    return forms[int(rng.integers(len(forms)))]()


class Sequence:
    """Random changes, and the dense matrix that they make."""

    def __init__(self, seed):
        self.rng = rng = np.random.default_rng(seed)
        self.sort = str(rng.choice(list(SYMMETRIES)))
        symmetry = str(rng.choice(SYMMETRIES[self.sort]))
        self.n = int(rng.integers(2, 60))
        self.a = system(rng, self.n, self.sort)
        solver = esp.Solver(as_given(rng, self.a, symmetry), symmetry=symmetry, threads=int(rng.integers(1, 3)), progress=False)
        self.changed = esp.ChangedSystem(solver, folding=bool(rng.integers(2)))
        assert self.changed.hermitian == (self.sort == "hermitian")
        self.removed = set()

    def star(self, m):
        return m.conj() if self.sort == "hermitian" else m

    def columns(self, rows, count):
        u = np.where(self.rng.random((rows, count)) < 0.3, numbers(self.rng, rows, count), 0)
        kind = int(self.rng.integers(4))  # some are real, some whole numbers
        return u.real.copy() if kind == 0 else np.round(3 * u.real).astype(np.int32) if kind == 1 else u

    def add(self):
        size, count, both = len(self.a), int(self.rng.integers(1, 4)), self.rng.integers(2)
        u = self.columns(self.n if self.rng.integers(2) else size, count)
        w = self.star(u) if both else self.columns(len(u), count)
        d = np.diag(self.rng.uniform(20, 30, count))
        self.changed.add(in_some_form(self.rng, u, False), None if both else in_some_form(self.rng, w.T, False), d)
        full = np.zeros((size + count, size + count), complex)
        full[:size, :size], full[:len(u), size:], full[size:, :len(u)], full[size:, size:] = self.a, u, w.T, d
        self.a = full

    def replace(self):
        there = [v for v in range(len(self.a)) if v not in self.removed]
        if not there:
            return
        v, both = int(self.rng.choice(there)), self.rng.integers(2)
        u = self.columns(len(self.a), 1).astype(complex)
        u[v] = 30
        w = self.star(u) if both else self.columns(len(self.a), 1)
        self.changed.replace([v], in_some_form(self.rng, u), None if both else in_some_form(self.rng, w.T))
        self.a[v], self.a[:, v] = w[:, 0], u[:, 0]

    def low_rank(self):
        rank, both = int(self.rng.integers(1, 3)), self.rng.integers(2)
        u = self.columns(self.n, rank)
        v = self.star(u) if both else self.columns(self.n, rank)
        c = numbers(self.rng, rank, rank)
        if both and self.rng.integers(2):
            c = c + self.star(c).T
        self.changed.add_low_rank(in_some_form(self.rng, u), c, None if both else in_some_form(self.rng, v))
        self.a[:self.n, :self.n] += u @ c @ v.T

    def flip(self):
        listed = self.rng.choice(len(self.a), int(self.rng.integers(1, min(8, len(self.a)) + 1)), replace=False)
        self.changed.flip(listed)
        self.removed ^= {int(v) for v in listed}

    def fold(self):
        try:
            self.changed.fold()
        except esp.SingularMatrixError:
            assert np.linalg.cond(self.left()[0]) > 1e12

    def left(self):
        kept = np.array([v for v in range(len(self.a)) if v not in self.removed], int)
        return self.a[np.ix_(kept, kept)], kept

    def check(self):
        m, kept = self.left()
        assert len(self.changed) == len(self.a)
        b = numbers(self.rng, len(self.a), 2)
        b = [b, b[:, 0], b.real, np.asfortranarray(b), b.astype(np.complex64)][int(self.rng.integers(5))]
        for transpose, op in ((False, m), (True, m.T), ("H", m.conj().T)):
            try:
                x = self.changed.solve(b, transpose=transpose)
            except esp.SingularMatrixError:
                assert len(kept) and np.linalg.cond(op) > 1e12
                return
            assert x.dtype == np.complex128 and x.shape == b.shape
            assert not x[sorted(self.removed)].any()
            if not len(kept):
                continue
            right, found = np.asarray(b, complex).reshape(len(b), -1)[kept], x.reshape(len(b), -1)[kept]
            scale = abs(op).sum(axis=1).max() * abs(found).max(axis=0) + abs(right).max(axis=0)
            error = (abs(op @ found - right).max(axis=0) / scale).max()
            assert error < 1e-13 and self.changed.last_solve.backward_error > error / 8 - 1e-15, (transpose, error, self.changed.last_solve)

    def run(self, calls):
        steps = [self.add, self.replace, self.low_rank, self.flip, self.flip, self.fold]
        for _ in range(calls):
            steps[int(self.rng.integers(len(steps)))]()
            self.check()


@pytest.mark.parametrize("first", range(0, 300, 50))
def test_the_system_that_was_changed(first):
    for seed in range(first, first + 50):
        try:
            Sequence(seed).run(8)
        except Exception as error:
            raise AssertionError(f"seed {seed}: {type(error).__name__}: {error}") from error


def test_inertia_and_refusals():
    rng = np.random.default_rng(1)
    a = system(rng, 30, "hermitian")
    changed = esp.ChangedSystem(esp.Solver(sp.csc_array(a)))
    g = numbers(rng, 30)
    changed.add(g)
    full = np.block([[a, g[:, None]], [g.conj()[None, :], np.zeros((1, 1))]])
    eigenvalues = np.linalg.eigvalsh(full)
    assert (changed.inertia.positive, changed.inertia.negative) == ((eigenvalues > 0).sum(), (eigenvalues < 0).sum())
    for bad in (np.nan, np.inf, 1j * np.inf):
        h = np.ones(31, complex)
        h[3] = bad
        for call in (lambda: changed.add(h), lambda: changed.replace([3], h), lambda: changed.solve(h), lambda: changed.add_low_rank(h[:30])):
            with pytest.raises(esp.InvalidInputError, match="3"):
                call()
    for call in (lambda: changed.add(np.ones(29)), lambda: changed.solve(np.ones(30)), lambda: changed.add_low_rank(g, np.ones((2, 2))),
                 lambda: changed.solve(np.ones(31), transpose="T"), lambda: changed.replace([1, 2], np.ones((31, 1)))):
        with pytest.raises(ValueError):
            call()
    with pytest.raises(esp.InvalidInputError, match="no unknown 31"):
        changed.flip([31])
    with pytest.raises(TypeError):
        changed.add(np.full(30, "a"))
    assert len(changed) == 31
    symmetric = esp.ChangedSystem(esp.Solver(sp.csc_array(system(rng, 9, "symmetric"))))
    assert symmetric.inertia == esp.Inertia(-1, -1, -1) and not symmetric.hermitian
    real = esp.ChangedSystem(esp.Solver(sp.csc_array(system(rng, 9, "hermitian").real)))
    with pytest.raises(TypeError, match="complex"):
        real.add(1j * np.ones(9))


def test_a_solver_that_becomes_real():
    rng = np.random.default_rng(2)
    a = sp.csc_array(system(rng, 12, "symmetric"))
    solver = esp.Solver(a)
    changed = esp.ChangedSystem(solver)
    solver.factorize(sp.csc_array(a.real))
    with pytest.raises(RuntimeError):
        changed.solve(np.ones(12))
    changed.reset()
    assert changed.solve(np.ones(12)).dtype == np.float64


@pytest.mark.parametrize("layout", ["csc", "csr"])
@pytest.mark.parametrize("sort", ["general", "symmetric", "hermitian"])
def test_analyze_change(sort, layout):
    rng = np.random.default_rng(6)
    line = sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(60, 60))
    real = sp.csc_array(sp.kron(line, sp.eye_array(60)) + sp.kron(sp.eye_array(60), line))
    p = np.exp(1j * rng.uniform(0, 6, 3600))
    q = {"general": np.exp(1j * rng.uniform(0, 6, 3600)), "symmetric": p, "hermitian": p.conj()}[sort]
    kind = {"general": "lu", "symmetric": "ldlt", "hermitian": "llt"}[sort]

    def twin(m):
        m = m.tocoo()
        data = m.data * p[m.row] * q[m.col]
        data[m.row == m.col] = data[m.row == m.col].real if sort == "hermitian" else data[m.row == m.col]
        if sort != "general":  # one number for both triangles
            low = {(r, c): v for r, c, v in zip(m.row, m.col, data) if r >= c}
            data = np.array([low[r, c] if r >= c else low[c, r].conj() if sort == "hermitian" else low[c, r] for r, c in zip(m.row, m.col)])
        return sp.csc_array((data, (m.row, m.col)), shape=m.shape).asformat(layout)

    solver = esp.Solver(twin(real), kind=kind, partial_refactorization=True)
    more = real.tolil()
    for u, v in [(3, 124), (100, 222), (200, 320)]:
        more[u, v] = more[v, u] = -0.1
    b = twin(more.tocsc())
    change = solver.analyze_change(b)
    assert not change.full and change.added_entries in (3, 6) and change.kept_fronts > 0 and change.analysis.kind == kind
    assert solver.factorize(b).work_share < 1
    right = numbers(rng, 3600)
    for transpose, op in ((False, b), (True, b.T), ("H", b.conj().T)):
        np.testing.assert_allclose(op @ solver.solve(right, transpose=transpose), right, atol=1e-10)
    bad = b.copy()
    bad.data[5] = np.nan
    with pytest.raises(esp.InvalidInputError):
        solver.analyze_change(bad)
    np.testing.assert_allclose(b @ solver.solve(right), right, atol=1e-10)
    if sort == "hermitian":
        assert not solver.analyze_change(real).full  # real numbers are taken as complex ones
    with pytest.raises(TypeError, match="real"):
        esp.Solver(real).analyze_change(b)
