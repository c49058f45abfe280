#!/usr/bin/env python3
"""Systems whose pivots fail where the ordering puts them, as Matrix Market files.

    python3 -m venv venv && venv/bin/pip install numpy scipy ngsolve
    venv/bin/python bench/pivot_cases.py FOLDER [NAME ...]

Navier-Stokes and Stokes need NGSolve, the others NumPy and SciPy alone. Names (default: all):
  ns-H-NU      Newton's matrix of a driven cavity by Taylor-Hood elements of order 2/1, mesh size H, viscosity NU
  nsc-H-NU     likewise of the channel around a cylinder, elements of order 3/2
  stokes-H     Stokes' operator of the channel, elements of order 3/2, symmetric
  hachtel-M    least squares as [I A; A^T 0], M rows, symmetric
  kkt-N        a late step of an interior point method for a quadratic program, symmetric
  lp-N         a basis of a staircase linear program: entries mostly +-1, badly conditioned
"""
import pathlib
import sys

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

DEFAULT = ["ns-0.2-1", "ns-0.1-0.01", "ns-0.05-0.01", "ns-0.05-0.001", "ns-0.025-0.01", "ns-0.025-0.001",
           "nsc-0.2-0.01", "nsc-0.1-0.001", "nsc-0.05-0.01", "nsc-0.05-0.001", "stokes-0.1", "stokes-0.05",
           "hachtel-4000", "kkt-4000", "kkt-20000", "lp-5000"]


def write(path, a, symmetric):
    """A Matrix Market file of `a`; of a symmetric matrix the lower triangle."""
    a = sp.coo_matrix(sp.tril(a) if symmetric else a)
    kind = "symmetric" if symmetric else "general"
    with open(path, "w", encoding="ascii") as file:
        file.write(f"%%MatrixMarket matrix coordinate real {kind}\n{a.shape[0]} {a.shape[1]} {a.nnz}\n")
        np.savetxt(file, np.column_stack([a.row + 1, a.col + 1, a.data]), fmt=["%d", "%d", "%.17g"])


def flow(mesh, order, viscosity, dirichlet, inflow, steps):
    """Newton's matrix after `steps` steps, on the free unknowns; steps 0: Stokes' operator."""
    import ngsolve as ng
    velocity = ng.VectorH1(mesh, order=order, dirichlet=dirichlet)
    pressure = ng.H1(mesh, order=order - 1)
    space = velocity * pressure
    (u, p), (v, q) = space.TnT()
    forms = ng.InnerProduct(ng.Grad(u), ng.Grad(v)) * viscosity - ng.div(u) * q - ng.div(v) * p
    a = ng.BilinearForm(space)
    a += forms * ng.dx
    state = ng.GridFunction(space)
    # The pressure of a closed cavity is known up to a constant: its first unknown is left out.
    state.components[0].Set(inflow[0], definedon=mesh.Boundaries(inflow[1]))
    free = np.array(list(space.FreeDofs()), dtype=bool)
    if inflow[2]:
        free[velocity.ndof] = False
    newton = a
    if steps > 0:
        newton = ng.BilinearForm(space)
        newton += (forms + ng.InnerProduct(ng.Grad(u) * u, v)) * ng.dx

    def matrix(form, linear):
        if linear:
            form.Assemble()
        else:
            form.AssembleLinearization(state.vec)
        row, col, value = form.mat.COO()
        full = sp.csr_matrix((np.array(value), (np.array(row), np.array(col))), shape=(space.ndof, space.ndof))
        return full[free][:, free].tocsc()

    residual = state.vec.CreateVector()
    for step in range(steps + 1):
        form = a if step == 0 else newton
        jacobian = matrix(form, step == 0)
        form.Apply(state.vec, residual)
        if step < steps:
            state.vec.FV().NumPy()[free] -= spl.spsolve(jacobian, residual.FV().NumPy()[free])
    return matrix(a, True) if steps == 0 else jacobian


def cavity(h, viscosity):
    import ngsolve as ng
    mesh = ng.Mesh(ng.unit_square.GenerateMesh(maxh=h))
    lid = (ng.CF((4 * ng.x * (1 - ng.x), 0)), "top", True)
    return flow(mesh, 2, viscosity, ".*", lid, 3)


def channel(h, viscosity, steps):
    import ngsolve as ng
    from netgen.occ import Circle, Glue, OCCGeometry, Rectangle, X
    shape = Rectangle(2, 0.41).Face() - Circle((0.2, 0.2), 0.05).Face()
    shape.edges.name = "wall"
    shape.edges.Min(X).name = "inlet"
    shape.edges.Max(X).name = "outlet"
    mesh = ng.Mesh(OCCGeometry(Glue([shape]), dim=2).GenerateMesh(maxh=h)).Curve(3)
    inflow = (ng.CF((1.5 * 4 * ng.y * (0.41 - ng.y) / 0.41**2, 0)), "inlet", False)
    return flow(mesh, 3, viscosity, "wall|inlet", inflow, steps)


def hachtel(rows):
    rng = np.random.default_rng(16)
    cols = rows // 2
    a = sp.random(rows, cols, density=3 / cols, random_state=rng) + sp.eye(rows, cols)
    return sp.bmat([[1e-3 * sp.eye(rows), a], [a.T, None]])


def kkt(n):
    """Half of the variables at their bounds: the barrier's diagonal spans 16 digits."""
    rng = np.random.default_rng(16)
    m = n // 2
    side = int(np.sqrt(n))
    n = side * side
    one = sp.diags([-1, 2.1, -1], [-1, 0, 1], shape=(side, side))
    hessian = 1e-2 * (sp.kron(one, sp.eye(side)) + sp.kron(sp.eye(side), one))
    barrier = 10.0 ** rng.uniform(-8, 8, n)
    a = sp.random(m, n, density=3 / n, random_state=rng) + sp.eye(m, n)
    return sp.bmat([[hessian + sp.diags(barrier), a.T], [a, -1e-8 * sp.eye(m)]])


def lp_basis(n):
    """Stages balance flows (+-1, each stage regular by its dense determinant) and hand stocks on to later ones."""
    rng = np.random.default_rng(16)
    stage = 40
    n = n // stage * stage
    a = sp.lil_matrix((n, n))
    for first in range(0, n, stage):
        while True:
            block = np.zeros((stage, stage))
            for j in range(stage):
                block[j, j] = rng.choice([1.0, -1.0])
                for i in rng.choice(stage, size=rng.integers(0, 5), replace=False):
                    block[i, j] = rng.choice([1.0, -1.0])
            if np.linalg.cond(block) < 1e3:
                break
        a[first:first + stage, first:first + stage] = block
        for j in rng.choice(stage, size=12, replace=False):
            if first // stage % 3 != 2 and first + stage < n:
                a[rng.integers(first + stage, first + 2 * stage), first + j] = rng.choice([1.0, 12.5])
    a = a.tocsc()
    return a[rng.permutation(n)][:, rng.permutation(n)]


def make(name):
    kind, *numbers = name.split("-")
    x = [float(v) for v in numbers]
    if kind == "ns":
        return cavity(x[0], x[1]), False
    if kind == "nsc":
        return channel(x[0], x[1], 3), False
    if kind == "stokes":
        return channel(x[0], 1e-2, 0), True
    if kind == "hachtel":
        return hachtel(int(x[0])), True
    if kind == "kkt":
        return kkt(int(x[0])), True
    if kind == "lp":
        return lp_basis(int(x[0])), False
    raise SystemExit(f"{name}: no such system; see --help")


def main():
    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
        raise SystemExit(__doc__)
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[2:] or DEFAULT:
        a, symmetric = make(name)
        a = a.tocsc()
        write(folder / f"{name}.mtx", a, symmetric)
        print(f"{name}: {a.shape[0]} unknowns, {a.nnz} entries", flush=True)


if __name__ == "__main__":
    main()
