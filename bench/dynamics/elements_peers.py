#!/usr/bin/env python3
"""Forces and tangents of elements.cpp's bodies in felupe (pip install felupe), on the same mesh with the same law.

elements_peers.py path/to/espalier_bench_elements [--elements 4096] [--seconds 1] [--only tet10]

For each case: microseconds of an element, force / tangent, assembled, fastest call, one thread each (BLAS of NumPy
too), and the largest difference of the two programs' forces and of their tangents times one direction, relative to the
largest entry. Ends with an error where one is above 1e-10.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile
import time

for name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ[name] = '1'

import felupe  # noqa: E402
import numpy as np  # noqa: E402

YOUNG, POISSON = 200, 0.3  # as in elements.cpp
MU, LAMBDA = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
REGIONS = {'tet4': ('tetra', 'RegionTetra'), 'tet10': ('tetra10', 'RegionQuadraticTetra'),
           'hex8 full': ('hexahedron', 'RegionHexahedron')}
LAWS = {'neo-Hookean': lambda: felupe.NeoHookeCompressible(mu=MU, lmbda=LAMBDA)}  # the law that both write out


def four_points():
    """felupe's rule for tet10 has 8 digits; these are the numbers that are meant (Hammer, Marlowe, Stroud 1956)."""
    rule = felupe.quadrature.Tetrahedron(order=2)
    rule.points = np.where(rule.points > 0.5, (5 + 3 * 5 ** 0.5) / 20, (5 - 5 ** 0.5) / 20)
    return {'quadrature': rule}


def fastest(call, seconds):
    call()
    begin, best = time.perf_counter(), float('inf')
    while time.perf_counter() - begin < seconds:
        start = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - start)
    return best


def difference(ours, theirs):
    return float(np.abs(ours - theirs).max() / np.abs(ours).max())


def peer(element, law, data, seconds):
    """Forces, tangent times direction, seconds of a force and of a tangent."""
    cell, region = REGIONS[element]
    nodes = np.array(data['nodes'])
    mesh = felupe.Mesh(nodes, np.array(data['elements']), cell)
    rule = four_points() if element == 'tet10' else {}
    field = felupe.FieldContainer([felupe.Field(getattr(felupe, region)(mesh, **rule), dim=3)])
    field[0].values[:] = np.array(data['positions']).reshape(-1, 3) - nodes
    body = felupe.SolidBody(LAWS[law](), field)

    def force():
        return body.assemble.vector(field)

    def tangent():
        return body.assemble.matrix(field)
    f = np.asarray(force().todense()).ravel()
    product = tangent() @ np.array(data['direction'])
    return f, product, fastest(force, seconds), fastest(tangent, seconds)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('program')
    parser.add_argument('--elements', type=int, default=4096)
    parser.add_argument('--seconds', type=float, default=1, help='time spent on each figure, at least')
    parser.add_argument('--only', default='', help='cases whose names begin so')
    args = parser.parse_args()
    wrong = False
    print(f'microseconds an element, force / tangent{"":14}espalier        felupe {felupe.__version__}   difference')
    for element in REGIONS:
        for law in LAWS:
            name = f'{element}, {law}'
            if not name.startswith(args.only):
                continue
            with tempfile.TemporaryDirectory() as folder:
                figures = os.path.join(folder, 'figures')
                subprocess.run([args.program, '--elements', str(args.elements), '--seconds', str(args.seconds),
                                '--only', name, '--dump', folder, '--json', figures], check=True, capture_output=True)
                with open(os.path.join(folder, name + '.json'), encoding='utf-8') as file:
                    data = json.load(file)
                with open(figures, encoding='utf-8') as file:
                    ours = next(f for f in json.load(file) if f['case'] == name)
            force, product, *seconds = peer(element, law, data, args.seconds)
            worst = max(difference(np.array(data['forces']), force),
                        difference(np.array(data['tangent_times_direction']), product))
            wrong = wrong or not worst < 1e-10
            count = len(data['elements'])
            times = [1e6 * s / count for s in seconds]
            print(f"{name:34}{count:6} {1e6 * ours['force_seconds']:8.3f} {1e6 * ours['tangent_seconds']:8.3f}"
                  f'{times[0]:10.2f} {times[1]:8.2f} {worst:12.1e}{"  WRONG" if not worst < 1e-10 else ""}', flush=True)
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main())
