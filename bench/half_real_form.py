"""Rounding errors of the real form of a complex matrix (src/solver/analysis/real_form.hpp), eliminated tile by tile in numpy: all
columns of what is left computed, or one column of each pair, from which the other is made
(src/device/cuda/kernels/half_products.cuh). No pivoting. Prints max |A - L D L^T| / max |A| for both.

Run: python bench/half_real_form.py
"""
import numpy as np

ORDER, TILE = 256, 64


def real_form(a, sign):
    r = np.empty((2 * a.shape[0], 2 * a.shape[1]))
    r[0::2, 0::2], r[0::2, 1::2] = a.real, -a.imag
    r[1::2, 0::2], r[1::2, 1::2] = -sign * a.imag, -sign * a.real
    return r


def from_half(x, sign):
    """Column 2k of a pair counts where k is even, else column 2k + 1."""
    y = x.copy()
    for c in range(0, x.shape[1], 2):
        if c // 2 % 2 == 0:
            y[0::2, c + 1], y[1::2, c + 1] = sign * x[1::2, c], -sign * x[0::2, c]
        else:
            y[0::2, c], y[1::2, c] = -sign * x[1::2, c + 1], sign * x[0::2, c + 1]
    return y


def error(r, sign, half):
    left, product = r.copy(), np.zeros_like(r)
    for k in range(0, r.shape[0], TILE):
        e = k + TILE
        d = (left[k:e, k:e] + left[k:e, k:e].T) / 2
        lower = np.linalg.solve(d, left[k:, k:e].T).T
        update = lower @ d @ lower.T
        product[k:, k:] += update
        rest = left[e:, e:] - update[TILE:, TILE:]
        left[e:, e:] = from_half(rest, sign) if half else rest
    return np.abs(product - r).max() / np.abs(r).max()


def main():
    random = np.random.default_rng(1)
    g = random.standard_normal((ORDER, ORDER)) + 1j * random.standard_normal((ORDER, ORDER))
    q = np.linalg.qr(g)[0]
    for condition in (1e2, 1e8, 1e12):
        a = (q * np.geomspace(1, 1 / condition, ORDER)) @ q.conj().T
        r = real_form((a + a.conj().T) / 2, -1)
        print(f"definite, condition {condition:.0e}: all {error(r, -1, False):.1e}, half {error(r, -1, True):.1e}")
    for name, a, sign in (("symmetric", g + g.T, 1), ("Hermitian", g + g.conj().T, -1)):
        r = real_form(a, sign)
        print(f"{name}, random: all {error(r, sign, False):.1e}, half {error(r, sign, True):.1e}")


if __name__ == "__main__":
    main()
