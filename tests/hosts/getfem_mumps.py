#!/usr/bin/env python3
"""GetFEM's MUMPS on our solver and on its own: the same displacements, and how long each took.

    apt-get install python3-getfem
    /usr/bin/python3 tests/hosts/getfem_mumps.py --library build/release/hosts/libespalier_mumps.so [--sizes 8 14 20]
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import time


def solve(size):
    """A clamped elastic block (symmetric), and heat in a wind (not symmetric)."""
    import getfem as gf
    import numpy as np

    results = {}
    for name in ("elasticity", "wind"):
        line = np.linspace(0, 1, size + 1)
        mesh = gf.Mesh("cartesian", line, line, line)
        fem = gf.MeshFem(mesh, 3 if name == "elasticity" else 1)
        fem.set_fem(gf.Fem("FEM_QK(3,1)"))
        integration = gf.MeshIm(mesh, gf.Integ("IM_GAUSS_PARALLELEPIPED(3,3)"))
        faces = mesh.outer_faces()
        normals = mesh.normal_of_faces(faces)
        mesh.set_region(1, faces[:, normals[0] < -0.5])
        model = gf.Model("real")
        model.add_fem_variable("u", fem)
        if name == "elasticity":
            model.add_initialized_data("lambda", 1.0)
            model.add_initialized_data("mu", 1.0)
            model.add_isotropic_linearized_elasticity_brick(integration, "u", "lambda", "mu")
            model.add_linear_term(integration, "-0.01*Test_u(3)")
        else:
            model.add_linear_term(integration, "0.1*Grad_u.Grad_Test_u + [1;2;0.5].Grad_u*Test_u - Test_u")
        model.add_Dirichlet_condition_with_simplification("u", 1)
        model.assembly()
        matrix, right = model.tangent_matrix(), model.rhs()
        seconds = []
        for _ in range(2):
            begin, used = time.perf_counter(), time.process_time()
            u = gf.linsolve_mumps(matrix, right).ravel()
            seconds.append((time.perf_counter() - begin, time.process_time() - used))
        residual = matrix.mult(u).ravel() - right
        results[name] = {"unknowns": int(u.size), "seconds": min(s for s, _ in seconds), "cpu_seconds": min(c for _, c in seconds),
                         "norm": float(np.linalg.norm(u)), "residual": float(np.abs(residual).max() / np.abs(right).max())}
    return results


def in_child(library, size):
    environment = dict(os.environ)
    if library:
        environment["LD_PRELOAD"] = str(library.resolve())
    done = subprocess.run([sys.executable, __file__, "--child", str(size)], env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"size {size}: {done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", type=pathlib.Path)
    parser.add_argument("--sizes", type=int, nargs="+", default=[8, 14, 20], help="elements along an edge")
    parser.add_argument("--out", help="all results as JSON")
    parser.add_argument("--child", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        print(json.dumps(solve(arguments.child)))
        return 0
    try:
        import getfem  # noqa: F401
    except ImportError:
        print("skipped: python3-getfem is not installed for this Python")
        return 0
    results, wrong = [], 0
    for size in arguments.sizes:
        own, ours = in_child(None, size), in_child(arguments.library, size)
        for name, o in own.items():
            u = ours[name]
            u["wrong"] = "" if abs(u["norm"] / o["norm"] - 1) < 1e-9 and u["residual"] < max(1e-10, 10 * o["residual"]) else "another solution"
            wrong += bool(u["wrong"])
            results.append({"system": name, "own": o, "ours": u})
            print(f"{name:12} {o['unknowns']:7}  own {o['seconds']:8.3f} s   ours {u['seconds']:8.3f} s  {u['wrong'] or 'same'}", flush=True)
    if arguments.out:
        pathlib.Path(arguments.out).write_text(json.dumps(results))
    return 1 if wrong or not results else 0


if __name__ == "__main__":
    sys.exit(main())
