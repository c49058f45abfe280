"""Random sequences of calls on one solver, with arrays that change in place: a solution belongs to the values that were
factorized last, or there is an error. Truth: residuals with a copy of these values, without refinement, which would hide a
wrong factor; for a few unknowns and the inverse dense solutions.

    python test_stale_values.py [SEQUENCES [SEED]]     the campaign: 5 to 30 calls each; prints what was wrong, and a summary
"""

import copy
import os
import pickle
import sys
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import scipy.sparse as sp

import espalier as esp


class Sequence:
    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.complex = self.random.random() < 0.25
        self.symmetry = self.random.choice(["auto", "lower", "upper", "symmetric", "general"])
        self.options = {"symmetry": str(self.symmetry), "refinement_steps": 0, "required_backward_error": float("inf"), "progress": False,
                        "partial_refactorization": bool(self.random.integers(2))}
        self.solver = esp.Solver(threads=int(self.random.integers(1, 3)), **self.options)
        self.twin = None  # a solver, and the matrix that it has factorized
        self.truth = None  # the matrix of the last factorization, dense; None: no solution may come
        self.given = self.matrix()

    def matrix(self):
        """In the layout of this sequence; the whole matrix beside what is stored of it."""
        n = int(self.random.integers(1, 30))
        dense = np.where(self.random.random((n, n)) < 0.3, self.random.uniform(-1, 1, (n, n)), 0)
        if self.complex:
            dense = dense + 0.3j * np.where(dense != 0, self.random.uniform(-1, 1, (n, n)), 0)
        if self.symmetry != "general":
            dense = np.tril(dense) + np.tril(dense, -1).T
        dense[np.diag_indices(n)] = 4 + abs(dense).sum(axis=1)
        stored = {"lower": np.tril, "upper": np.triu}.get(self.symmetry, lambda a: a)(dense)
        sparse = sp.csc_array(stored) if self.random.integers(2) else sp.csr_array(stored)
        return sparse if self.random.integers(5) else sparse.tocoo()

    def whole(self, sparse):
        stored = sparse.toarray()
        if self.symmetry in ("lower", "upper"):
            return stored + stored.T - np.diag(np.diag(stored))
        return stored

    def scaled(self, sparse):
        """Other values on the same pattern: D A D, by powers of two, so that what is symmetric stays so."""
        d = sp.diags_array(2.0 ** self.random.integers(-2, 3, sparse.shape[0]))
        result = (d @ sparse @ d).asformat(sparse.format)
        assert result.nnz == sparse.nnz
        return result

    def factorize(self):
        self.given = self.scaled(self.given) if self.random.integers(2) else self.matrix()
        self.solver.factorize(self.given)
        self.truth = self.whole(self.given)

    def values(self):
        if self.solver.analysis is None or self.given.format == "coo":
            return
        new = self.scaled(self.given).asformat(self.given.format)
        data = [new.data, np.repeat(new.data, 2)[::2], new.data[::-1].copy()[::-1], new.data.astype(new.data.dtype.newbyteorder()),
                list(new.data)][int(self.random.integers(5))]
        self.solver.factorize(data)
        self.truth = self.whole(new)
        self.given = new

    def entries(self):
        if self.truth is None or self.given.format == "coo" or self.symmetry in ("auto", "symmetric"):
            return
        places = self.random.integers(0, self.given.nnz, 3)
        diagonal = [p for p in places if self._is_diagonal(p)]
        if not diagonal:
            return
        self.given = self.given.copy()
        self.given.data[diagonal] *= 2
        self.solver.factorize_entries(diagonal, self.given.data[diagonal])
        self.truth = self.whole(self.given)

    def _is_diagonal(self, place):
        major = int(np.searchsorted(self.given.indptr, place, side="right")) - 1
        return int(self.given.indices[place]) == major

    def in_place(self):
        """The caller's arrays change behind the solver's back."""
        self.given = self.given.copy()
        old = self.given
        self.solver.factorize(old)
        self.truth = self.whole(old).copy()
        self.given = old.copy()
        old.data[:] = np.nan

    def refused(self):
        bad = self.given.copy()
        bad.data[int(self.random.integers(len(bad.data)))] = np.nan
        what = bad.data if self.random.integers(2) and self.solver.analysis is not None and bad.format != "coo" else bad
        with pytest.raises(esp.Error):
            self.solver.factorize(what)
        if self.solver.factor is None:
            self.truth = None

    def wrong_count(self):
        if self.solver.analysis is None:
            return
        with pytest.raises(ValueError):
            self.solver.factorize(np.ones(self.given.nnz + 1))

    def bad_entries(self):
        """Refused; the factor stays."""
        if self.truth is None:
            return
        good, count = self.given.data[:1], self.given.nnz
        for places, values, kind in (([count], good, esp.InvalidInputError), ([-1], good, esp.InvalidInputError), ([0], [np.nan], esp.InvalidInputError),
                                     ([0.0], good, TypeError), ([0, 0], good, ValueError), ([[0]], [good], ValueError), ([0], ["a"], (TypeError, ValueError))):
            with pytest.raises(kind):
                self.solver.factorize_entries(places, values)
            assert self.solver.factor is not None
        self.solver.factorize_entries([], [])

    def singular_entries(self):
        """A row and a column of zeros: the error names one of them, and the factor of the values before is there."""
        if self.truth is None or self.given.format == "coo" or self.symmetry in ("auto", "symmetric"):
            return
        row = int(self.random.integers(self.given.shape[0]))
        major = np.repeat(np.arange(self.given.shape[0]), np.diff(self.given.indptr))
        places = np.flatnonzero((major == row) | (self.given.indices == row))
        with pytest.raises((esp.SingularMatrixError, esp.NotPositiveDefiniteError)):
            self.solver.factorize_entries(places, np.zeros(len(places)))
        assert self.solver.factor is not None

    def bad_values(self):
        """Of a kind that values cannot have: nothing has happened."""
        if self.solver.analysis is None:
            return
        for values in (np.full(self.given.nnz, "a"), np.ones((2, self.given.nnz)), [object()] * self.given.nnz):
            with pytest.raises((TypeError, ValueError)):
                self.solver.factorize(values)

    def read_only(self):
        """Arrays that nobody may write."""
        self.given = self.scaled(self.given)
        arrays = [self.given.data] + ([self.given.indices, self.given.indptr] if self.given.format != "coo" else [])
        for array in arrays:
            array.flags.writeable = False
        self.solver.factorize(self.given)
        self.truth = self.whole(self.given)
        self.given = self.given.copy()

    def change(self):
        """An entry more."""
        if self.solver.analysis is None or self.symmetry not in ("general", "lower"):
            return
        n = self.given.shape[0]
        i, j = sorted((int(k) for k in self.random.integers(0, n, 2)), reverse=True)
        new = (self.given.tocsc() + sp.csc_array(([1e-3 + 2e-3j if self.complex else 1e-3], ([i], [j])), shape=(n, n))).asformat(self.given.format)
        self.truth = None
        self.solver.analyze_change(new)
        self.given = new

    def rows(self):
        n = self.given.shape[0]
        wanted = self.random.integers(0, n, int(self.random.integers(1, 5)))
        b = np.where(self.random.random((n, 2)) < 2 / n, self.random.uniform(-1, 1, (n, 2)), 0)
        given = [b, np.asfortranarray(b), sp.csc_array(b), sp.coo_array(b)][int(self.random.integers(4))]
        if self.truth is None:
            if self.solver.analysis is not None:
                with pytest.raises(RuntimeError):
                    self.solver.solve(given, rows=wanted)
            return
        with pytest.raises(ValueError):
            self.solver.solve(given, rows=[n])
        x, truth = self.solver.solve(given, rows=wanted), np.linalg.solve(self.truth, b)
        assert abs(x - truth[wanted]).max() <= 1e-10 * max(abs(truth).max(), 1e-3), "the rows are not those of the last values"

    def inverse(self):
        if self.truth is None:
            return
        truth = np.linalg.inv(self.truth)
        assert abs(self.solver.inverse_diagonal() - np.diag(truth)).max() <= 1e-9 * abs(truth).max(), "the inverse is not that of the last values"

    def analyze(self):
        self.solver.analyze(self.given)
        self.truth = None

    def swap(self):
        """Goes on with a clone, a copy or what a pickle gives back, and keeps the other one."""
        if self.solver.analysis is None:
            return
        how = int(self.random.integers(3))
        if how and self.truth is not None:
            other = copy.copy(self.solver) if how == 1 else pickle.loads(pickle.dumps(self.solver))
            truth = self.truth
        else:
            other, truth = self.solver.clone(), None
        self.twin = (self.solver, self.truth)
        self.solver, self.truth = other, truth

    def saved(self):
        """Goes on with what a file gives back, and keeps the solver that was saved."""
        with TemporaryDirectory() as folder:
            file = os.path.join(folder, "factor")
            if self.truth is None:
                with pytest.raises(RuntimeError):
                    self.solver.save_factor(file)
                return
            self.solver.save_factor(file)
            other = esp.load_factor(file, threads=int(self.random.integers(1, 3)), **self.options)
        b = self.random.uniform(-1, 1, len(self.truth))
        assert other.restored and (other.solve(b) == self.solver.solve(b)).all(), "other bits than those of the saved factor"
        self.twin = (self.solver, self.truth)
        self.solver = other

    def around(self):
        """An unknown that is gone and one that has come, with A, A^T and A^H."""
        if self.truth is None or len(self.truth) < 3:
            return
        n = len(self.truth)
        changed = esp.ChangedSystem(self.solver)
        g, h = self.random.uniform(-1, 1, n), self.random.uniform(-1, 1, n)
        if self.complex:
            g = g + 1j * self.random.uniform(-1, 1, n)
        changed.add(g, h[None, :], [[4.0 * n]])
        gone = int(self.random.integers(n))
        changed.remove([gone])
        kept = np.delete(np.arange(n + 1), gone)
        full = np.block([[self.truth, g[:, None]], [h[None, :], np.array([[4.0 * n]])]])[np.ix_(kept, kept)]
        for transpose, op in ((False, full), (True, full.T), ("H", full.conj().T)):
            b = self.random.uniform(-1, 1, n + 1)
            x = changed.solve(b, transpose=transpose)
            scale = abs(op).sum(axis=1).max() * abs(x).max() + 1
            assert x[gone] == 0 and abs(op @ x[kept] - b[kept]).max() <= 1e-10 * scale, "changes around other values"
        self.solver.factorize(self.given)
        self.truth = self.whole(self.given)
        with pytest.raises(RuntimeError):
            changed.solve(np.ones(n + 1))

    def check(self, solver=None, truth=None):
        solver, truth = (self.solver, self.truth) if solver is None else (solver, truth)
        if truth is None:
            with pytest.raises(RuntimeError):
                solver.solve(np.ones(max(1, self.given.shape[0])))
            return
        n = len(truth)
        b = self.random.uniform(-1, 1, (n, 2) if self.random.integers(2) else n)
        if self.random.integers(3) == 0:
            b = b.astype(np.float32)
        transpose = self.random.choice([False, True])
        right = np.asarray(b, dtype=np.float64).copy()
        x = solver.solve(b if b.dtype == np.float32 else right, transpose=bool(transpose))
        a = truth.T if transpose else truth
        error = abs(right - a @ x).max() / (abs(a).sum(axis=1).max() * abs(x).max() + abs(right).max())
        assert error < (1e-6 if x.dtype == np.float32 else 1e-10), f"the solution is not that of the last values: {error}"

    def run(self, calls):
        steps = [self.factorize, self.factorize, self.values, self.values, self.entries, self.entries, self.in_place,
                 self.refused, self.wrong_count, self.analyze, self.swap, self.bad_entries, self.singular_entries, self.bad_values, self.read_only, self.change,
                 self.rows, self.rows, self.rows, self.inverse, self.saved, self.saved, self.around]
        for _ in range(calls):
            steps[int(self.random.integers(len(steps)))]()
            self.check()
            if self.twin is not None:
                self.check(*self.twin)


@pytest.mark.parametrize("first", range(0, 200, 20))
def test_solutions_are_those_of_the_last_values(first):
    for seed in range(first, first + 20):
        try:
            Sequence(seed).run(25)
        except Exception as error:
            raise AssertionError(f"seed {seed}: {error}") from error


def main(sequences=1000, first=1):
    wrong = calls = 0
    for seed in range(first, first + sequences):
        count = 5 + seed % 26
        try:
            Sequence(seed).run(count)
        except Exception as error:  # what it is does not matter
            wrong += 1
            print(f"WRONG seed {seed}: {type(error).__name__}: {error}")
        calls += count
    print(f"{sequences} sequences from seed {first} on, {calls} calls with a solution after each; {wrong} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in sys.argv[1:])))
