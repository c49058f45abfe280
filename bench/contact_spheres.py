#!/usr/bin/env python3
"""A thousand rigid spheres fall into a box: Espalier beside Exudyn's sphere contact, in one run.

    python3 -m venv venv && venv/bin/pip install exudyn numpy
    venv/bin/python bench/contact_spheres.py --binary build/release/espalier [--spheres 1000] [--end 0.5] [--threads 2]

Both have the same spheres, masses, linear stiffness, damping ratio and start; no friction. The box is open: five planes here, five
walls of two triangles there. Printed: wall time of the run alone, the deepest and the mean overlap at the end, the energy left. The
answers are checked against each other: the spheres are a chaotic system, so only means are compared. Exudyn's steps are the longest
ones that keep its explicit method stable at the same overlaps.
"""
import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

RADIUS, DENSITY, GRAVITY = 0.05, 1000.0, 9.81
MASS = DENSITY * 4 / 3 * math.pi * RADIUS**3


def start(count):
    """Layers of a square grid, each moved a little, over a box that holds them."""
    side = max(2, round(count ** (1 / 3)))
    rng = np.random.default_rng(1)
    pitch = 2.3 * RADIUS
    grid = np.array([(i, j, k) for k in range(count) for j in range(side) for i in range(side)][:count], dtype=float)
    at = (grid + 0.5) * pitch + rng.uniform(-0.1, 0.1, (count, 3)) * RADIUS
    at[:, 2] += RADIUS
    return at, side * pitch


def overlaps(at, size):
    """Deepest and mean positive overlap of spheres with each other and with the box."""
    delta = at[:, None, :] - at[None, :, :]
    gaps = np.sqrt((delta**2).sum(axis=2))[np.triu_indices(len(at), 1)] - 2 * RADIUS
    walls = np.concatenate([at[:, 0], size - at[:, 0], at[:, 1], size - at[:, 1], at[:, 2]]) - RADIUS
    depth = -np.concatenate([gaps, walls])
    depth = depth[depth > 0]
    return (depth.max(), depth.mean(), len(depth)) if len(depth) else (0.0, 0.0, 0)


def espalier(args, at, size):
    inertia = 0.4 * MASS * RADIUS**2
    text = f"gravity = [0, 0, {-GRAVITY}]\n"
    walls = [("floor", [0, 0, 0], [0, 0, 1]), ("left", [0, 0, 0], [1, 0, 0]), ("right", [size, 0, 0], [-1, 0, 0]),
             ("front", [0, 0, 0], [0, 1, 0]), ("back", [0, size, 0], [0, -1, 0])]
    for name, point, normal in walls:
        text += f'[surfaces.{name}]\nbody = "ground"\nshape = "plane"\npoint = {point}\nnormal = {normal}\n'
    for k, x in enumerate(at.tolist()):
        text += (f'[bodies.b{k}]\ntype = "rigid"\nmass = {MASS!r}\ninertia = [{inertia!r}, {inertia!r}, {inertia!r}]\n'
                 f"position = [{x[0]!r}, {x[1]!r}, {x[2]!r}]\n[surfaces.s{k}]\nbody = \"b{k}\"\nshape = \"sphere\"\n"
                 f"radius = {RADIUS}\n")
    text += (f'[contacts.all]\nsurfaces = ["s*", "floor", "left", "right", "front", "back"]\nstiffness = {args.stiffness}\n'
             f"damping = {args.damping}\nmargin = {args.margin * RADIUS}\n"
             f'[integrator]\nmethod = "generalized-alpha"\nend = {args.end}\nstep = {args.step}\nspectral_radius = 0.5\n'
             f"newton_tolerance = 1\ntolerance = 1e-5\n"
             "[output]\nenergies = false\nconstraints = false\ncsv_interval = false\n")
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "spheres.toml"
        model.write_text(text)
        wanted = json.dumps([f"b{k}.position" for k in range(len(at))])
        run = subprocess.run([args.binary, "simulate", str(model), "--json", "--threads", str(args.threads), "--set",
                              f"output.quantities={wanted}"], capture_output=True, text=True, check=False)
    if run.returncode != 0:
        sys.exit(f"espalier: {run.stdout[-2000:]}{run.stderr[-2000:]}")
    report = json.loads(run.stdout)
    values = report["values"]
    final = np.array([[values[f"b{k}.position.{c}"] for c in "xyz"] for k in range(len(at))])
    seconds = report["seconds"]
    return {"seconds": seconds["total"] - seconds["setup"], "final": final, "report": report}


def exudyn(args, at, size):
    import exudyn as exu
    from exudyn.itemInterface import Force, MarkerBodyRigid, MarkerNodePosition, MassPoint, NodePoint, ObjectGround
    system_container = exu.SystemContainer()
    mbs = system_container.AddSystem()
    contact = mbs.AddGeneralContact()
    contact.verboseMode = 0
    contact.SetFrictionPairings(np.zeros((1, 1)))
    high = 3 * size + at[:, 2].max()
    p = [[x, y, z] for z in (0, high) for y in (0, size) for x in (0, size)]
    triangles = [[0, 1, 3], [0, 3, 2], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]]
    ground = mbs.AddMarker(MarkerBodyRigid(bodyNumber=mbs.AddObject(ObjectGround())))
    damping = args.exudyn_damping
    contact.AddTrianglesRigidBodyBased(rigidBodyMarkerIndex=ground, contactStiffness=args.stiffness, contactDamping=damping,
                                       frictionMaterialIndex=0, pointList=p, triangleList=triangles)
    nodes = []
    for x in at:
        node = mbs.AddNode(NodePoint(referenceCoordinates=list(x)))
        mbs.AddObject(MassPoint(mass=MASS, nodeNumber=node))
        marker = mbs.AddMarker(MarkerNodePosition(nodeNumber=node))
        mbs.AddLoad(Force(markerNumber=marker, loadVector=[0, 0, -MASS * GRAVITY]))
        contact.AddSphereWithMarker(marker, radius=RADIUS, contactStiffness=args.stiffness, contactDamping=damping,
                                    frictionMaterialIndex=0)
        nodes.append(node)
    contact.SetSearchTreeCellSize(numberOfCells=[10, 10, 10])
    contact.SetSearchTreeBox(pMin=np.array([-RADIUS] * 3), pMax=np.array([size + RADIUS, size + RADIUS, high]))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = round(args.end / args.exudyn_step)
    settings.timeIntegration.endTime = args.end
    settings.timeIntegration.explicitIntegration.computeEndOfStepAccelerations = False
    settings.timeIntegration.explicitIntegration.computeMassMatrixInversePerBody = True
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse  # its dense one is many times as slow here
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.parallel.numberOfThreads = args.threads
    began = time.perf_counter()
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.ExplicitEuler)
    seconds = time.perf_counter() - began
    final = np.array([mbs.GetNodeOutput(n, exu.OutputVariableType.Position) for n in nodes])
    return {"seconds": seconds, "final": final}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", default="build/release/espalier")
    parser.add_argument("--spheres", type=int, default=1000)
    parser.add_argument("--end", type=float, default=0.5)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--stiffness", type=float, default=1e5)
    parser.add_argument("--damping", type=float, default=0.5)
    parser.add_argument("--exudyn-damping", type=float, default=20.0)
    parser.add_argument("--step", type=float, default=2e-3)
    parser.add_argument("--margin", type=float, default=0.05, help="of the search, in radii")
    parser.add_argument("--exudyn-step", type=float, default=1e-4)
    args = parser.parse_args()
    at, size = start(args.spheres)
    results = {}
    for name, run in (("espalier", espalier), ("exudyn", exudyn)):
        results[name] = result = run(args, at, size)
        deepest, mean, count = overlaps(result["final"], size)
        print(f"{name}: {result['seconds']:.2f} s, {count} contacts, overlap {deepest / RADIUS:.2e} largest and "
              f"{mean / RADIUS:.2e} mean (radii), mean height {result['final'][:, 2].mean():.4f} m", flush=True)
        if not np.isfinite(result["final"]).all() or result["final"][:, 2].min() < 0:
            sys.exit(f"{name}: a sphere is lost")
    heights = [r["final"][:, 2].mean() for r in results.values()]
    print(f"ratio {results['espalier']['seconds'] / results['exudyn']['seconds']:.2f}; heights differ by "
          f"{abs(heights[0] - heights[1]) / heights[1]:.1%}")
    if abs(heights[0] - heights[1]) > 0.05 * heights[1]:
        sys.exit("the answers do not agree")


if __name__ == "__main__":
    main()
