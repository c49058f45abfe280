#!/usr/bin/env python3
"""Forces and tangents of elements.cpp's bodies in felupe and NGSolve (PyPI), on the same mesh with the same law.

elements_peers.py path/to/espalier_bench_elements [--elements 4096] [--seconds 1] [--only tet10] [--peers felupe,ngsolve]

For each case: microseconds of an element, force / tangent, assembled, fastest call, one thread each (BLAS of NumPy
too), and the largest difference of the two programs' forces and of their tangents times one direction, relative to the
largest entry. NGSolve's energies are compiled. Ends with an error where a difference is above 1e-10.
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
# NGSolve calls its compiler by name.
os.environ['PATH'] = os.path.dirname(sys.executable) + os.pathsep + os.environ['PATH']

import numpy as np  # noqa: E402

YOUNG, POISSON = 200, 0.3  # as in elements.cpp
MU, LAMBDA = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
# Four points of degree 2 (Hammer, Marlowe, Stroud 1956).
NEAR, FAR = (5 + 3 * 5 ** 0.5) / 20, (5 - 5 ** 0.5) / 20


class Felupe:
    """A body. `force` and `tangent` assemble; both are read by nodes, three numbers each."""
    name = 'felupe'
    # The law that both write out; its rule for tet10 has 8 digits, so the points are set.
    cases = {(element, 'neo-Hookean') for element in ('tet4', 'tet10', 'hex8 full')}

    def __init__(self, element, _law, data):
        import felupe
        cell, region = {'tet4': ('tetra', 'RegionTetra'), 'tet10': ('tetra10', 'RegionQuadraticTetra'),
                        'hex8 full': ('hexahedron', 'RegionHexahedron')}[element]
        nodes = np.array(data['nodes'])
        rule = {}
        if element == 'tet10':
            rule['quadrature'] = felupe.quadrature.Tetrahedron(order=2)
            rule['quadrature'].points = np.where(rule['quadrature'].points > 0.5, NEAR, FAR)
        mesh = felupe.Mesh(nodes, np.array(data['elements']), cell)
        self._field = felupe.FieldContainer([felupe.Field(getattr(felupe, region)(mesh, **rule), dim=3)])
        self._field[0].values[:] = np.array(data['positions']).reshape(-1, 3) - nodes
        self._body = felupe.SolidBody(felupe.NeoHookeCompressible(mu=MU, lmbda=LAMBDA), self._field)

    def force(self):
        return self._body.assemble.vector(self._field)

    def tangent(self):
        return self._body.assemble.matrix(self._field)

    def forces_by_node(self):
        return np.asarray(self.force().todense()).reshape(-1, 3)

    def product_by_node(self, direction):
        return (self.tangent() @ direction.ravel()).reshape(-1, 3)


class NgSolve:
    """Likewise. Its functions of order 2 on edges are bubbles: u(middle) = mean of the ends + bubble * coefficient."""
    name = 'ngsolve'
    cases = {(element, law) for element in ('tet4', 'tet10', 'hex8 full') for law in ('SVK', 'neo-Hookean')}

    def __init__(self, element, law, data):
        import ngsolve as ng
        ng.SetNumThreads(1)
        nodes = np.array(data['nodes'])
        mesh, order = self._mesh(nodes, data['elements'], 4 if element.startswith('tet') else 8), 1
        rule = {ng.TET: ng.IntegrationRule([[0.25] * 3], [1 / 6]),
                ng.HEX: ng.IntegrationRule([[0.5 + x / 12 ** 0.5 for x in (a, b, c)] for a in (-1, 1)
                                            for b in (-1, 1) for c in (-1, 1)], [1 / 8] * 8)}
        if element == 'tet10':
            order = 2
            rule[ng.TET] = ng.IntegrationRule([[NEAR if i == k else FAR for k in range(3)] for i in range(4)],
                                              [1 / 24] * 4)
        space = ng.VectorH1(mesh, order=order)
        gradient = ng.Id(3) + ng.Grad(space.TrialFunction())
        square = gradient.trans * gradient
        if law == 'SVK':
            strain = 0.5 * (square - ng.Id(3))
            energy = 0.5 * LAMBDA * ng.Trace(strain) ** 2 + MU * ng.InnerProduct(strain, strain)
        else:
            change = ng.log(ng.Det(gradient))
            energy = 0.5 * MU * (ng.Trace(square) - 3) - MU * change + 0.5 * LAMBDA * change ** 2
        self._form = ng.BilinearForm(space)
        self._form += ng.Variation(energy.Compile(True, wait=True) * ng.dx(intrules=rule))
        self._u = ng.GridFunction(space)
        self._f = self._u.vec.CreateVector()
        # By its coefficients: component after component, vertices before edges.
        self._vertices = mesh.nv
        self._ends = np.array([[v.nr for v in e.vertices] for e in mesh.edges]) if order == 2 else None
        self._middles, self._bubble = None, 0
        if order == 2:
            place = {tuple(np.round(x, 9)): i for i, x in enumerate(nodes)}
            corners = np.array([mesh[ng.NodeId(ng.VERTEX, i)].point for i in range(mesh.nv)])
            centres = corners[self._ends].mean(axis=1)
            self._middles = np.array([place[tuple(np.round(x, 9))] for x in centres])
            self._u.vec[:] = 0
            self._u.vec[mesh.nv] = 1
            self._bubble = self._u(mesh(*centres[0]))[0]
        self._set(np.array(data['positions']).reshape(-1, 3) - nodes, self._u.vec)

    @staticmethod
    def _mesh(nodes, elements, corners):
        import ngsolve as ng
        from netgen.meshing import Element3D, FaceDescriptor, Mesh, MeshPoint, Pnt
        mesh = Mesh(dim=3)
        elements = [e[:corners] for e in elements]
        for x in nodes[:1 + max(max(e) for e in elements)]:
            mesh.Add(MeshPoint(Pnt(*x)))
        mesh.Add(FaceDescriptor(surfnr=1, domin=1, bc=1))
        for e in elements:
            mesh.Add(Element3D(1, [a + 1 for a in e]))
        return ng.Mesh(mesh)

    def _set(self, values, vector):
        parts = vector.FV().NumPy().reshape(3, -1)
        parts[:, :self._vertices] = values[:self._vertices].T
        if self._ends is not None:
            parts[:, self._vertices:] = ((values[self._middles] - values[self._ends].mean(axis=1)) / self._bubble).T

    def _by_node(self, vector):
        parts = np.array(vector.FV().NumPy().reshape(3, -1))
        out = np.zeros((parts.shape[1], 3))
        out[:self._vertices] = parts[:, :self._vertices].T
        if self._ends is not None:
            out[self._middles] = parts[:, self._vertices:].T / self._bubble
            for end in self._ends.T:
                np.add.at(out, end, -0.5 * out[self._middles])
        return out

    def force(self):
        self._form.Apply(self._u.vec, self._f)

    def tangent(self):
        self._form.AssembleLinearization(self._u.vec)

    def forces_by_node(self):
        self.force()
        return self._by_node(self._f)

    def product_by_node(self, direction):
        self.tangent()
        along = self._u.vec.CreateVector()
        self._set(direction.reshape(-1, 3), along)
        self._f.data = self._form.mat * along
        return self._by_node(self._f)


def fastest(call, seconds):
    call()
    begin, best = time.perf_counter(), float('inf')
    while time.perf_counter() - begin < seconds:
        start = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - start)
    return best


def difference(ours, theirs):
    return float(np.abs(ours.ravel() - theirs.ravel()).max() / np.abs(ours).max())


def ours_of(program, name, args):
    """Our figures, and the body with its results."""
    with tempfile.TemporaryDirectory() as folder:
        figures = os.path.join(folder, 'figures')
        subprocess.run([program, '--elements', str(args.elements), '--seconds', str(args.seconds),
                        '--only', name, '--dump', folder, '--json', figures], check=True, capture_output=True)
        with open(os.path.join(folder, name + '.json'), encoding='utf-8') as file:
            data = json.load(file)
        with open(figures, encoding='utf-8') as file:
            return next(f for f in json.load(file) if f['case'] == name), data


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('program')
    parser.add_argument('--elements', type=int, default=4096)
    parser.add_argument('--seconds', type=float, default=1, help='time spent on each figure, at least')
    parser.add_argument('--only', default='', help='cases whose names begin so')
    parser.add_argument('--peers', default='felupe,ngsolve')
    args = parser.parse_args()
    peers = [p for p in (Felupe, NgSolve) if p.name in args.peers.split(',')]
    wrong = False
    print('microseconds an element: force, tangent')
    for element in ('tet4', 'tet10', 'hex8 full'):
        for law in ('SVK', 'neo-Hookean'):
            name = f'{element}, {law}'
            if not name.startswith(args.only) or not any((element, law) in p.cases for p in peers):
                continue
            ours, data = ours_of(args.program, name, args)
            count = len(data['elements'])
            print(f"{name:24}{count:6}  espalier {1e6 * ours['force_seconds']:8.3f} {1e6 * ours['tangent_seconds']:8.3f}")
            for peer in peers:
                if (element, law) not in peer.cases:
                    continue
                body = peer(element, law, data)
                worst = max(difference(np.array(data['forces']), body.forces_by_node()),
                            difference(np.array(data['tangent_times_direction']),
                                       body.product_by_node(np.array(data['direction']))))
                times = [1e6 * fastest(call, args.seconds) / count for call in (body.force, body.tangent)]
                wrong = wrong or not worst < 1e-10
                print(f'{"":30}  {peer.name:8} {times[0]:8.3f} {times[1]:8.3f}   difference {worst:.1e}'
                      f'{"  WRONG" if not worst < 1e-10 else ""}', flush=True)
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main())
