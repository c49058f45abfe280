"""examples/active_set_qp.py against brute force over all active sets."""

import importlib.util
import itertools
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "active_set_qp.py"
spec = importlib.util.spec_from_file_location("active_set_qp", EXAMPLE)
qp = importlib.util.module_from_spec(spec)
import sys
sys.modules["active_set_qp"] = qp
spec.loader.exec_module(qp)


def by_brute_force(P, q, A, l, u):
    """(objective, active set): the KKT point among those of all active sets."""
    n, best = len(q), None
    for signs in itertools.product((-1, 0, 1), repeat=len(l)):
        signs = np.array(signs)
        if ((signs == 0) & (l == u)).any() or ((signs == -1) & (l == u)).any():
            continue
        rows = np.flatnonzero(signs)
        bound = np.where(signs > 0, u, l)[rows]
        if not np.isfinite(bound).all() or len(rows) > n:
            continue
        K = np.block([[P, A[rows].T], [A[rows], np.zeros((len(rows), len(rows)))]])
        if np.linalg.cond(K) > 1e12:
            continue
        v = np.linalg.solve(K, np.concatenate([-q, bound]))
        x, y = v[:n], v[n:]
        free = (l == u)[rows]
        if (A @ x < l - 1e-9).any() or (A @ x > u + 1e-9).any() or (y[~free] * signs[rows][~free] < -1e-9).any():
            continue
        f = x @ P @ x / 2 + q @ x
        if best is None or f < best[0]:
            best = f, signs
    return best


@pytest.mark.parametrize("seed", range(12))
def test_random_problems_against_brute_force(seed):
    rng = np.random.default_rng(seed)
    n, m = 4, 6
    M = rng.standard_normal((n, n))
    P = M @ M.T + 0.1 * np.eye(n)
    A = rng.standard_normal((m, n))
    inside = A @ rng.standard_normal(n)
    l, u = inside - rng.random(m), inside + rng.random(m)
    l[0] = u[0] = inside[0]
    l[1] = -np.inf
    q = 5 * rng.standard_normal(n)
    objective, signs = by_brute_force(P, q, A, l, u)
    r = qp.solve_qp(sp.csc_matrix(P), q, sp.csr_matrix(A), l, u, threads=1)
    assert r.solved
    assert abs(r.objective - objective) <= 1e-7 * (1 + abs(objective))
    free = l == u
    found = np.where(np.abs(r.y) > 1e-7, np.sign(r.y), 0)
    assert (found[~free] == signs[~free]).all()


@pytest.mark.parametrize("n, m, rank", [(60, 30, None), (80, 60, 10), (300, 100, None)])
def test_optimality_of_sparse_problems(n, m, rank):
    """The conditions of Karush, Kuhn and Tucker, formed here; P may be singular."""
    P, q, A, l, u = qp.random_qp(n, m, seed=n, rank=rank)
    r = qp.solve_qp(P, q, A, l, u)
    assert r.solved and r.flips > 0
    ax = A @ r.x
    assert np.abs(P @ r.x + q + A.T @ r.y).max() < 1e-6
    assert (ax > l - 1e-7).all() and (ax < u + 1e-7).all()
    up, down = r.y > 1e-6, r.y < -1e-6
    assert np.abs(ax - u)[up].max(initial=0) < 1e-6 and np.abs(ax - l)[down].max(initial=0) < 1e-6


def test_what_is_no_problem():
    P, q, A, l, u = qp.random_qp(10, 4)
    with pytest.raises(ValueError, match="row 3"):
        bad = l.copy()
        bad[3] = u[3] + 1
        qp.solve_qp(P, q, A, bad, u)
    with pytest.raises(ValueError):
        qp.solve_qp(P, q[:-1], A, l, u)
    with pytest.raises(ValueError):
        qp.solve_qp(P * np.nan, q, A, l, u)
