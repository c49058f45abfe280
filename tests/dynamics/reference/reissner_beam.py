#!/usr/bin/env python3
"""Geometrically exact (Reissner-Simo) beams by shooting: the numbers of tests/dynamics/bodies/beam_reference_test.cpp.

reissner_beam.py            needs numpy and scipy (a virtual environment: pip install numpy scipy)

Equations by the arc length s of the unstressed beam, all in global axes but the strains:
  r' = R (Gamma0 + C_n^-1 R^T n),  R' = R [K0 + C_m^-1 R^T m]_x,  n' = 0,  m' = n x r'
with dead loads n(L) = F, m(L) = M, R as a unit quaternion. The moment at the clamped end is found by Newton's method with
central differences; the ordinary differential equation is solved by DOP853 at a tolerance of 1e-13. Nothing here is
shared with the C++ code. K0 is the curvature of the unstressed beam (twist, about y, about z) in the axes of the section.
"""
import numpy as np
from scipy.integrate import solve_ivp


def matrix(q):
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def quaternion_rate(q, k):
    """q' = q [0, k] / 2 for a body-fixed turning rate k"""
    w, v = q[0], q[1:]
    return 0.5 * np.concatenate([[-v @ k], w * k + np.cross(v, k)])


def integrate(beam, moment, force):
    def rate(_, y):
        q, m = y[3:7], y[7:]
        rot = matrix(q)
        gamma = np.array([1.0, 0, 0]) + (rot.T @ force) / beam['force']
        kappa = beam['natural'] + (rot.T @ m) / beam['moment']
        dr = rot @ gamma
        return np.concatenate([dr, quaternion_rate(q, kappa), np.cross(force, dr)])

    start = np.concatenate([np.zeros(3), [1.0, 0, 0, 0], moment])
    return solve_ivp(rate, [0, beam['length']], start, method='DOP853', rtol=1e-13, atol=1e-13).y[:, -1]


def solve(beam, force, moment=np.zeros(3), steps=10):
    """Position and quaternion of the end; the clamped end is at the origin, section axes x y z there."""
    root = np.zeros(3)
    scale = beam['moment'].max() / beam['length']
    for k in range(1, steps + 1):
        f, target = force * k / steps, moment * k / steps
        for _ in range(50):
            miss = integrate(beam, root, f)[7:] - target
            if np.abs(miss).max() < 1e-13 * scale * 10:
                break
            h = 1e-5 * scale
            jacobian = np.array([(integrate(beam, root + h * e, f) - integrate(beam, root - h * e, f))[7:] / (2 * h)
                                 for e in np.eye(3)]).T
            step = np.linalg.solve(jacobian, miss)
            root = root - step
            if np.abs(step).max() < 1e-12 * scale:
                break
        else:
            raise RuntimeError('no convergence')
    end = integrate(beam, root, force)
    return end[:3], end[3:7] / np.linalg.norm(end[3:7])


def rectangle_torsion(a, b):
    a, b = max(a, b), min(a, b)
    n = np.arange(1, 4001, 2)
    return a * b**3 * (1 / 3 - 64 / np.pi**5 * b / a * np.sum(np.tanh(n * np.pi * a / (2 * b)) / n**5))


def rectangle(young, poisson, height, width, length, natural=(0, 0, 0)):
    g, area = young / (2 * (1 + poisson)), height * width
    shear = 10 * (1 + poisson) / (12 + 11 * poisson) * g * area
    return {'length': length, 'natural': np.array(natural, float),
            'force': np.array([young * area, shear, shear]),
            'moment': np.array([g * rectangle_torsion(height, width), young * height * width**3 / 12,
                                young * width * height**3 / 12])}


def show(name, beam, force, moment=(0, 0, 0), straight_end=None):
    r, q = solve(beam, np.array(force, float), np.array(moment, float))
    print(f'{name}: end at {r[0]:.11g}, {r[1]:.11g}, {r[2]:.11g}; '
          f'quaternion {q[0]:.12f}, {q[1]:.12f}, {q[2]:.12f}, {q[3]:.12f}', flush=True)


def main():
    # Bathe and Bolourchi (1979): an arc of 45 degrees, radius 100, in the x-y plane, load across it.
    bend = rectangle(1e7, 0, 1, 1, 100 * np.pi / 4, (0, 0, 0.01))
    for load in (300, 450, 600):
        show(f'bend, {load}', bend, (0, 0, load))
    show('bend, force and moment', bend, (0, 0, 300), (4e4, -3e4, 5e4))
    # Bend with three curvatures (a piece of a helix).
    helix = rectangle(1e7, 0.3, 1, 0.5, 60, (0.01, -0.02, 0.015))
    show('helix', helix, (50, -75, 100), (2500, 5000, -2500))
    # Princeton beam (Dowell and Traybar 1975): 8.896 N at angles from the stiff axis.
    for angle in (0, 15, 30, 45, 60, 75):
        a = np.radians(angle)
        princeton = rectangle(71.7e9, 0.31, 12.3777e-3, 3.2024e-3, 0.508)
        show(f'Princeton, {angle}', princeton, (0, 8.896 * np.cos(a), 8.896 * np.sin(a)))
    # Nachbagauer et al. (2011): thick cantilever, large load.
    show('Nachbagauer', rectangle(2.07e11, 0.3, 0.5, 0.1, 2), (0, 6.25e7, 0))


if __name__ == '__main__':
    main()
