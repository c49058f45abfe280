"""Convex quadratic programs by an active set: min x'Px/2 + q'x with l <= Ax <= u.

A proximal method of multipliers (Rockafellar 1976) outside; inside, semismooth Newton steps with an exact line search, as in QPALM
(Hermans, Themelis and Patrinos, Mathematical Programming Computation 14, 2022). A step solves with the rows that are active,

    [ P + eps I   A_E'     A_J' ] [ x   ]   [ eps x_k - q        ]
    [ A_E        -delta I       ] [ y_E ] = [ b_E - delta y_k,E  ]
    [ A_J                -delta I] [ y_J ]   [ b_J - delta y_k,J  ]

of which the part with P and the equations A_E is factorized once. The active rows J come and go around that factor
(espalier.ChangedSystem), many at a time; it is factorized anew by itself where that is cheaper.

    python active_set_qp.py [UNKNOWNS [ROWS]]      a random problem
"""

import sys
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

import espalier


@dataclass
class QpResult:
    x: np.ndarray
    y: np.ndarray  # multipliers: above 0 at u, below 0 at l
    objective: float
    solved: bool
    primal_residual: float  # largest violation of a row
    dual_residual: float    # of Px + q + A'y
    steps: int
    flips: int  # rows that came or went
    factorizations: int

    @property
    def active(self):
        """1 where a row is at u, -1 at l, 0 between."""
        return np.sign(self.y).astype(int)


def _equilibrate(P, q, A, steps=10):
    """Scales of columns, rows and costs (Ruiz; as in OSQP): entries of the KKT matrix come to about 1."""
    n, m = P.shape[0], A.shape[0]
    d, e = np.ones(n), np.ones(m)
    for _ in range(steps):
        Ps, As = sp.diags(d) @ P @ sp.diags(d), sp.diags(e) @ A @ sp.diags(d)
        columns = np.maximum(abs(Ps).max(axis=0).toarray().ravel(), abs(As).max(axis=0).toarray().ravel() if m else 0)
        rows = abs(As).max(axis=1).toarray().ravel() if m else np.ones(0)
        d /= np.sqrt(np.where(columns > 1e-12, columns, 1))
        e /= np.sqrt(np.where(rows > 1e-12, rows, 1))
    Ps = sp.diags(d) @ P @ sp.diags(d)
    typical = max(abs(Ps).max(axis=0).toarray().mean() if Ps.nnz else 0, np.abs(d * q).max(initial=0))
    return d, e, 1 / typical if typical > 0 else 1.0


class _ActiveRows:
    """Solves with the KKT matrix of the equations and the rows that are active."""

    def __init__(self, P, A, equal, eps, delta, options):
        n = P.shape[0]
        self.n, self.delta, self.flips = n, delta, 0
        self.columns = A.T.tocsc()
        self.equal = np.flatnonzero(equal)
        lower = sp.bmat([[P + eps * sp.eye(n), None], [A[self.equal], -delta * sp.eye(len(self.equal))]]) if len(self.equal) else P + eps * sp.eye(n)
        self.solver = espalier.Solver(sp.tril(lower, format="csc"), **{"symmetry": "lower", "kind": "ldlt", "zero_pivot": 1e-20, **options})  # regular, if barely
        self.changed = espalier.ChangedSystem(self.solver)
        self.number = np.full(A.shape[0], -1)  # unknown of a row's multiplier; -1: it was never active
        self.number[self.equal] = n + np.arange(len(self.equal))
        self.active = np.array(equal, dtype=bool)

    def take(self, active):
        come, go = np.flatnonzero(active & ~self.active), np.flatnonzero(self.active & ~active)
        known = come[self.number[come] >= 0]
        new = come[self.number[come] < 0]
        if len(go):
            self.changed.remove(self.number[go])
        if len(known):
            self.changed.restore(self.number[known])
        for part in np.array_split(new, (len(new) + 127) // 128) if len(new) else ():
            self.number[part] = len(self.changed) + np.arange(len(part))
            self.changed.add(self.columns[:, part], corner=-self.delta * np.eye(len(part)))
        self.flips += len(come) + len(go)
        self.active = active

    def solve(self, top, rows):
        """@param rows  right-hand sides by rows of A, read where they are active"""
        b = np.zeros(len(self.changed))
        b[:self.n] = top
        known = self.number >= 0
        b[self.number[known]] = rows[known]
        v = self.changed.solve(b)
        y = np.zeros(len(rows))
        y[known] = v[self.number[known]]
        return v[:self.n], y


def _line_search(slope_at_0, curvature, w, step, l, u, delta):
    """The zero t > 0 of a rising, piecewise linear slope: slope_at_0 + t curvature + step'(clipped part at t - at 0) / delta."""
    def beyond(t):
        v = w + t * step
        return v - np.clip(v, l, u)

    start = beyond(0.0)

    def slope(t):
        return slope_at_0 + t * curvature + step @ (beyond(t) - start) / delta

    with np.errstate(divide="ignore", invalid="ignore"):
        bends = np.concatenate([(u - w) / step, (l - w) / step])
    bends = np.unique(bends[np.isfinite(bends) & (bends > 0)])
    low, high = -1, len(bends)  # slope(bends[low]) < 0 <= slope(bends[high])
    while high - low > 1:
        middle = (low + high) // 2
        if slope(bends[middle]) < 0:
            low = middle
        else:
            high = middle
    left = bends[low] if low >= 0 else 0.0
    right = bends[high] if high < len(bends) else left + 1.0
    at_left, at_right = slope(left), slope(right)
    return left - at_left * (right - left) / (at_right - at_left) if at_right > at_left else left


def solve_qp(P, q, A, l, u, *, tolerance=1e-9, eps=1e-7, delta=1e-6, most_steps=2000, **options):
    """P: (n, n), symmetric positive semidefinite, both triangles. Infinite bounds are none. options: of espalier.Solver."""
    P, A = sp.csc_matrix(P, dtype=float), sp.csr_matrix(A, dtype=float)
    q, l, u = (np.asarray(v, dtype=float) for v in (q, l, u))
    if P.shape != (len(q), len(q)) or A.shape != (len(l), len(q)) or len(u) != len(l):
        raise ValueError(f"P {P.shape}, q {q.shape}, A {A.shape}, l {l.shape}, u {u.shape} do not fit")
    if not all(np.isfinite(v).all() for v in (P.data, A.data, q)) or np.isnan(l).any() or np.isnan(u).any():
        raise ValueError("P, q and A must be finite, bounds must be numbers")
    if (l > u).any():
        raise ValueError(f"row {np.flatnonzero(l > u)[0]} has a lower bound above its upper one")
    d, e, c = _equilibrate(P, q, A)
    Ps, As, qs = c * (sp.diags(d) @ P @ sp.diags(d)).tocsc(), (sp.diags(e) @ A @ sp.diags(d)).tocsr(), c * d * q
    ls, us = e * np.where(l < -1e19, -np.inf, l), e * np.where(u > 1e19, np.inf, u)
    equal = ls == us
    rows = _ActiveRows(Ps, As, equal, eps, delta, options)
    x, y, steps, outer = np.zeros(len(q)), np.zeros(len(l)), 0, 0
    flips, factorizations, solved = 0, 0, False
    while True:
        x_k, y_k = x, y
        outer += 1
        if outer % 10 == 0 and eps > 1e-10:  # slow along directions in which nothing curves
            flips, factorizations, eps = flips + rows.flips, factorizations + rows.changed.cost.factorizations + 1, eps / 10
            rows = _ActiveRows(Ps, As, equal, eps, delta, options)
        at_bend = None
        while steps < most_steps:  # the proximal problem around x_k, y_k
            w = As @ x + delta * y_k
            v = w if at_bend is None else at_bend
            active = equal | (v > us) | (v < ls)
            rows.take(active)
            bound = np.where(v > us, us, ls)
            x_new, y_new = rows.solve(eps * x_k - qs, np.where(active, bound - delta * y_k, 0))
            steps += 1
            w_new = As @ x_new + delta * y_k
            same = (active == (equal | (w_new > us) | (w_new < ls))) & (equal | ((w_new > us) == (v > us)))
            step = x_new - x
            if same.all() or np.abs(step).max() <= 1e-11 * (1 + np.abs(x).max()):  # or rows that are active by roundings come and go
                x, y = x_new, np.where(active, y_new, 0)
                break
            moved = As @ step
            clipped = np.clip(w, ls, us)
            gradient = Ps @ x + qs + eps * (x - x_k) + As.T @ ((w - clipped) / delta)
            curvature = step @ (Ps @ step) + eps * step @ step
            t = _line_search(gradient @ step, curvature, w, moved, ls, us, delta)
            if not t > 0 or np.abs(gradient).max() < 1e-3 * tolerance:  # roundings alone are left
                y = (w - clipped) / delta
                break
            # At a bend a row may be active by its last digit: then the next step takes the rows behind it.
            at_bend = w_new if at_bend is None and np.abs(t * step).max() <= 1e-14 * np.abs(x).max() else None
            x = x + t * step
        ax = As @ x
        primal = np.abs(ax - np.clip(ax, ls, us)).max(initial=0) / (1 + np.abs(ax).max(initial=0))
        terms = Ps @ x, As.T @ y
        dual = np.abs(terms[0] + qs + terms[1]).max() / (1 + max(np.abs(v).max(initial=0) for v in (*terms, qs)))
        solved = primal <= tolerance and dual <= tolerance
        if solved or steps >= most_steps or not (np.isfinite(primal) and np.isfinite(dual)):
            break
    x, y = d * x, e * y / c
    ax = A @ x
    return QpResult(x, y, float(x @ (P @ x) / 2 + q @ x), bool(solved), float(np.abs(ax - np.clip(ax, l, u)).max(initial=0)),
                    float(np.abs(P @ x + q + A.T @ y).max()), steps, flips + rows.flips, factorizations + rows.changed.cost.factorizations)


def random_qp(n, m, seed=0, rank=None):
    """With bounds on all unknowns, some equations, and P of the given rank."""
    rng = np.random.default_rng(seed)
    M = sp.random_array((n, rank or n), density=min(1, 4 / n), rng=rng)
    P = (M @ M.T + (sp.eye(n) * 0.01 if rank is None else 0 * sp.eye(n))).tocsc()
    A = sp.vstack([sp.random_array((m, n), density=min(1, 4 / n), rng=rng), sp.eye(n)]).tocsr()
    inside = A @ rng.uniform(-1, 1, n)
    l, u = inside - rng.uniform(0, 1, m + n), inside + rng.uniform(0, 1, m + n)
    l[: m // 4] = u[: m // 4] = inside[: m // 4]
    l[m // 4: m // 2] = -np.inf
    return P, rng.standard_normal(n), A, l, u


if __name__ == "__main__":
    sizes = [int(v) for v in sys.argv[1:]]
    n = sizes[0] if sizes else 2000
    P, q, A, l, u = random_qp(n, sizes[1] if len(sizes) > 1 else n // 2)
    r = solve_qp(P, q, A, l, u)
    print(f"objective {r.objective:.10g}, {np.count_nonzero(r.active)} of {len(l)} rows active, residuals {r.primal_residual:.1e} and {r.dual_residual:.1e}; "
          f"{r.steps} solves, {r.flips} rows came or went, {r.factorizations} factorizations of the changed matrix{'' if r.solved else '; NOT SOLVED'}")
