# SPDX-License-Identifier: Apache-2.0
"""Linear finite elements on hexahedra of eight nodes, whose stiffness is one factor per element times a fixed matrix,
solved by Espalier (https://pypi.org/project/espalier): linear elasticity and heat conduction with SIMP densities.

K(s) u = f, K(s) = sum_e s_e K_e. Element matrices by 2 x 2 x 2 Gauss points (exact for parallelepipeds); loads by the
same shape functions. Nodes follow VTK's order, all numbers are SI or any consistent units, indices count from 0.
"""

import hashlib
import threading

import espalier
import numpy as np
import scipy.sparse as sp

_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float
)
_FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [3, 7, 6, 2], [0, 4, 7, 3], [1, 2, 6, 5]])
_GAUSS = _CORNERS / np.sqrt(3.0)  # weights are 1


def _shape(points, corners):
    """N (points, corners) of products of (1 + x c) / 2, and their derivatives (points, corners, dimensions)."""
    factors = 0.5 * (1 + points[:, None, :] * corners[None])
    dimensions = corners.shape[1]
    slopes = np.empty(factors.shape)
    for d in range(dimensions):
        others = [k for k in range(dimensions) if k != d]
        slopes[:, :, d] = 0.5 * corners[None, :, d] * factors[:, :, others].prod(axis=2)
    return factors.prod(axis=2), slopes


def isotropic(nu):
    """Stress of a strain (xx, yy, zz, 2yz, 2zx, 2xy) for E = 1: (6, 6)."""
    law = np.zeros((6, 6))
    law[:3, :3] = nu / ((1 + nu) * (1 - 2 * nu))
    law[range(3), range(3)] += 1 / (1 + nu)
    law[range(3, 6), range(3, 6)] = 0.5 / (1 + nu)
    return law


class Hex8Model:
    """A mesh with its supports: what does not depend on densities and loads. The pattern of K is analyzed once.

    points (n, 3), cells (m, 8), law (6, 6) of strains in 3 unknowns a node or None for heat (1 unknown a node);
    fixed: (n,) True where a node's unknowns are prescribed.
    """

    def __init__(self, points, cells, law, fixed):
        self.points, self.cells = np.asarray(points, dtype=float), np.asarray(cells, dtype=np.int64)
        self.unknowns = 1 if law is None else 3
        self.cells_of = (self.unknowns * self.cells[:, :, None] + np.arange(self.unknowns)).reshape(len(self.cells), -1)
        self._elements(law)
        self.free = np.flatnonzero(~np.repeat(np.asarray(fixed, dtype=bool), self.unknowns))
        self._assembly()
        self._solver = espalier.Solver(None, symmetry="lower", progress=False)
        self._indefinite = False

    def _elements(self, law):
        """Element matrices for a factor of 1 (m, 8 k, 8 k) and integrals of shape functions (m, 8)."""
        values, slopes = _shape(_GAUSS, _CORNERS)
        corners = self.points[self.cells]
        size = 8 * self.unknowns
        self.stiffness = np.zeros((len(self.cells), size, size))
        self.volumes = np.zeros((len(self.cells), 8))
        for n, dn in zip(values, slopes):
            jacobian = np.einsum("md,ema->eda", dn, corners)
            weight = np.linalg.det(jacobian)
            if not (weight > 0).all():
                raise ValueError(f"cell {int(np.argmin(weight))} is turned inside out or has no volume")
            gradient = np.linalg.solve(jacobian, np.broadcast_to(dn.T, (len(corners), 3, 8)))  # (m, 3, 8)
            self.volumes += weight[:, None] * n
            if law is None:
                self.stiffness += np.einsum("e,eda,edb->eab", weight, gradient, gradient, optimize=True)
                continue
            b = np.zeros((len(corners), 6, 8, 3))
            x, y, z = gradient[:, 0], gradient[:, 1], gradient[:, 2]
            b[:, 0, :, 0], b[:, 1, :, 1], b[:, 2, :, 2] = x, y, z
            b[:, 3, :, 1], b[:, 3, :, 2], b[:, 4, :, 0], b[:, 4, :, 2] = z, y, z, x
            b[:, 5, :, 0], b[:, 5, :, 1] = y, x
            b = b.reshape(len(corners), 6, size)
            self.stiffness += (weight[:, None, None] * b.transpose(0, 2, 1)) @ (law @ b)

    def _assembly(self):
        """The pattern of the free unknowns' lower triangle, and the matrix that makes its values of the factors."""
        number = np.full(self.unknowns * len(self.points), -1)
        number[self.free] = np.arange(len(self.free))
        local = number[self.cells_of]
        row, column = np.tril_indices(local.shape[1])
        i, j = local[:, row], local[:, column]
        kept = (i >= 0) & (j >= 0)
        element = np.broadcast_to(np.arange(len(local))[:, None], i.shape)[kept]
        low, high = np.minimum(i, j)[kept], np.maximum(i, j)[kept]
        place, entry = np.unique(high * len(self.free) + low, return_inverse=True)
        self._rows, self._columns = np.divmod(place, max(len(self.free), 1))
        self._starts = np.searchsorted(self._rows, np.arange(len(self.free) + 1))
        values = self.stiffness[:, row, column][kept]
        self._values_of = sp.csr_matrix((values, (entry, element)), shape=(len(place), len(local)))

    def factorize(self, factors):
        """Factorizes K of these factors (m,). Negative ones may make it indefinite."""
        self.factors = np.asarray(factors, dtype=float)
        matrix = sp.csr_array(
            (self._values_of @ self.factors, self._columns, self._starts), shape=(len(self.free), len(self.free))
        )
        try:
            self._solver.factorize(matrix)
        except espalier.NotPositiveDefiniteError:
            if self._indefinite:
                raise
            self._solver = espalier.Solver(None, symmetry="lower", kind="ldlt", progress=False)
            self._indefinite = True
            self._solver.factorize(matrix)

    def solve(self, load, prescribed=None):
        """u (n k,) with K u = load in the free unknowns and u = prescribed (n k,; None: 0) elsewhere."""
        u = np.zeros(self.unknowns * len(self.points)) if prescribed is None else prescribed.copy()
        u[self.free] = 0
        rest = load
        if u.any():
            forces = self.factors[:, None] * (self.stiffness @ u[self.cells_of][:, :, None])[:, :, 0]
            rest = load - np.bincount(self.cells_of.ravel(), forces.ravel(), len(load))
        u[self.free] = self._solver.solve(rest[self.free])
        return u

    def slopes(self, u, adjoint):
        """adjoint^T K_e u for every element (m,): minus the derivative of adjoint^T f by the factors."""
        there = (self.stiffness @ u[self.cells_of][:, :, None])[:, :, 0]
        return (there * adjoint[self.cells_of]).sum(axis=1)

    def surface_load(self, groups, values):
        """Loads (n k,) of tractions or fluxes values[g - 1] (k,) on faces of the surface with four nodes of group g."""
        faces = self.cells[:, _FACES].reshape(-1, 4)
        group = groups[faces]
        chosen = np.flatnonzero((group[:, 0] > 0) & (group == group[:, :1]).all(axis=1))
        ordered = np.sort(faces[chosen], axis=1)
        _, first, copies = np.unique(ordered, axis=0, return_index=True, return_counts=True)
        chosen = chosen[first[copies == 1]]  # a face between two cells is no surface
        n, dn = _shape(_GAUSS[4:, :2], np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float))
        load = np.zeros((len(self.points), self.unknowns))
        corners = self.points[faces[chosen]]
        for shape, slope in zip(n, dn):
            a, b = np.einsum("ad,fax->dfx", slope, corners)
            area = np.linalg.norm(np.cross(a, b), axis=1)
            part = area[:, None, None] * shape[None, :, None] * values[groups[faces[chosen, 0]] - 1][:, None, :]
            np.add.at(load, faces[chosen], part)
        return load.ravel()

    def source_load(self, source):
        """Loads (n,) of a source per volume in every cell (m,)."""
        return np.bincount(self.cells.ravel(), (self.volumes * source[:, None]).ravel(), len(self.points))


class Hex8Inputs:
    """What the schemas of Mosaic's mesh domains say: mesh, supports, loads. Each thread keeps the models of its last meshes,
    so that no call solves with the factor of another one."""

    _kept = threading.local()

    def __init__(self, inputs, law, material):
        """inputs: of a schema as a dictionary. law(): as for Hex8Model; material: what the law depends on."""
        mesh = inputs["hex_mesh"]
        self.cell_count = int(mesh["n_faces"])
        points = np.asarray(mesh["points"], dtype=float)[: int(mesh["n_points"])]
        cells = np.asarray(mesh["faces"], dtype=np.int64)[: self.cell_count]
        supports, groups = self._groups(inputs, "dirichlet", len(points))
        key = hashlib.sha256(repr(material).encode())
        for array in (points, cells, groups > 0):
            key.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        models = self._kept.__dict__
        name = key.hexdigest()
        if name not in models:
            while len(models) >= 4:
                models.pop(next(iter(models)))
            models[name] = Hex8Model(points, cells, law(), groups > 0)
        self.model = models[name]
        self.prescribed = np.zeros((len(points), self.model.unknowns))
        if supports is not None:
            self.prescribed[groups > 0] = supports[groups[groups > 0] - 1]
        self.prescribed = self.prescribed.ravel()
        tractions, groups = self._groups(inputs, "neumann", len(points))
        self.load = np.zeros(self.prescribed.shape)
        if tractions is not None and groups.any():
            self.load = self.model.surface_load(groups, tractions)

    @staticmethod
    def _groups(inputs, kind, count):
        condition = (inputs.get("boundary_conditions") or {}).get(kind) or {}
        groups = np.zeros(count, dtype=np.int64)
        mask = np.asarray(condition.get("mask", []), dtype=np.int64)[:count]
        groups[: len(mask)] = mask
        values = condition.get("values")
        values = None if values is None else np.asarray(values, dtype=float)
        if values is not None and groups.max(initial=0) > len(values):
            raise ValueError(f"{kind}.mask names group {groups.max()}; values has {len(values)}")
        return values, groups
