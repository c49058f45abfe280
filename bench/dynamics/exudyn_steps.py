#!/usr/bin/env python3
"""Generalized-alpha at equal steps in Espalier and in Exudyn (pip install exudyn): errors and times.

    exudyn_steps.py build/release/bench/espalier_bench_step_errors --json exudyn.json

Three mechanisms of tests/dynamics/integrators/step_cases.hpp: spatial slider crank, heavy top, flexible pendulum. Both programs run in
turn in their own processes with spectral radius 0.8 and index 3; the least of `--repeats` times counts. An error is the
largest difference of a number from the truth over the largest number of its kind, for positions, velocities and
accelerations of all bodies (nodes) at the end. The truth is espalier_bench_step_errors' own, by another integrator; for the
flexible pendulum each program has its own: the elements may differ in their quadrature, so Exudyn's is extrapolated from
its two finest runs by Richardson's rule and both truths are compared."""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time

CASES = {'spatial': 0.5, 'top': 0.2, 'flexible': 0.2}
STEPS = [100, 200, 500, 1000, 2000, 5000, 10000, 20000]


def spatial(exu, mbs):
    import numpy as np
    import exudyn.utilities as eu
    a, b, c = np.array([0, .1, .12]), np.array([0, .1, .2]), np.array([.2, 0, 0])
    g = [0, 0, -9.81]
    ez = np.array([0, 0, 1.])
    along = (c - b) / np.linalg.norm(c - b)
    across = np.cross(ez, along)
    across /= np.linalg.norm(across)
    rod_axes = np.array([along, across, np.cross(along, across)]).T
    vb, vc = np.array([0, -.48, 0]), np.array([.24, 0, 0])
    normal = np.cross(along, vc - vb) / np.linalg.norm(c - b)
    omega = normal - np.cross(normal, across)[2] / np.cross(along, across)[2] * along
    ground = mbs.CreateGround()

    def body(mass, inertia, place, velocity, spin, axes):
        return mbs.CreateRigidBody(inertia=eu.RigidBodyInertia(mass=mass, inertiaTensor=np.diag(inertia)), gravity=g,
                                   referencePosition=list(place), referenceRotationMatrix=axes,
                                   initialVelocity=list(velocity), initialAngularVelocity=list(spin))

    one = np.eye(3)
    crank = body(.12, [1e-4, 1e-5, 1e-4], a, [0, 0, 0], [6, 0, 0], one)
    rod = body(.5, [4e-4, 4e-3, 4e-3], (b + c) / 2, (vb + vc) / 2, omega, rod_axes)
    slider = body(2, [1e-4] * 3, c, vc, [0, 0, 0], one)
    marker = lambda n, p: mbs.AddMarker(eu.MarkerBodyRigid(bodyNumber=n, localPosition=list(p)))
    joint = lambda m, axes, r0=one, r1=one: mbs.AddObject(eu.GenericJoint(
        markerNumbers=m, constrainedAxes=axes, rotationMarker0=r0, rotationMarker1=r1))
    joint([marker(ground, a), marker(crank, [0, 0, 0])], [1, 1, 1, 0, 1, 1])
    joint([marker(crank, [0, 0, .08]), marker(rod, [-.15, 0, 0])], [1, 1, 1, 0, 0, 0])
    cross = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]).T * 1.0  # x along the global z
    joint([marker(slider, [0, 0, 0]), marker(rod, [.15, 0, 0])], [1, 1, 1, 0, 0, 1], r0=cross)
    joint([marker(ground, [0, 0, 0]), marker(slider, [0, 0, 0])], [0, 1, 1, 1, 1, 1])
    return [crank, rod, slider], []


def top(exu, mbs):
    import numpy as np
    import exudyn.utilities as eu
    spin = np.array([0, 150, -4.61538])
    body = mbs.CreateRigidBody(
        inertia=eu.RigidBodyInertia(mass=15, inertiaTensor=np.diag([.234375, .46875, .234375])), gravity=[0, 0, -9.81],
        referencePosition=[0, 1, 0], initialVelocity=list(np.cross(spin, [0, 1, 0])), initialAngularVelocity=list(spin))
    mbs.CreateSphericalJoint(bodyNumbers=[mbs.CreateGround(), body], position=[0, 0, 0])
    return [body], []


def flexible(exu, mbs):
    import exudyn.utilities as eu
    area, young, density, n = 25e-6, 1e9 / 625, 320.0, 4
    nodes = [mbs.AddNode(eu.NodePointSlope1(referenceCoordinates=[i / n, 0, 0, 1, 0, 0],
                                            initialVelocities=[0, 0, -4 * i / n, 0, 0, -4.])) for i in range(n + 1)]
    for i in range(n):
        cable = mbs.AddObject(eu.ObjectANCFCable(
            physicsLength=1 / n, physicsMassPerLength=density * area, physicsAxialStiffness=young * area,
            physicsBendingStiffness=young * area ** 2 / (4 * math.pi), nodeNumbers=[nodes[i], nodes[i + 1]],
            useReducedOrderIntegration=0))
        mbs.AddLoad(eu.LoadMassProportional(markerNumber=mbs.AddMarker(eu.MarkerBodyMass(bodyNumber=cable)),
                                            loadVector=[0, -9.81, 0]))
    fixed = mbs.AddMarker(eu.MarkerNodeCoordinate(
        nodeNumber=mbs.AddNode(eu.NodePointGround(referenceCoordinates=[0, 0, 0])), coordinate=0))
    for k in range(3):
        mbs.AddObject(eu.CoordinateConstraint(markerNumbers=[
            fixed, mbs.AddMarker(eu.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=k))]))
    return [], nodes


def exudyn_run(case, steps, radius):
    import exudyn as exu
    import exudyn.graphics  # noqa: F401  (makes the utilities import)
    mbs = exu.SystemContainer().AddSystem()
    bodies, nodes = {'spatial': spatial, 'top': top, 'flexible': flexible}[case](exu, mbs)
    mbs.Assemble()
    s = exu.SimulationSettings()
    s.timeIntegration.numberOfSteps = steps
    s.timeIntegration.endTime = CASES[case]
    s.timeIntegration.generalizedAlpha.spectralRadius = radius
    s.timeIntegration.verboseMode = 0
    s.solutionSettings.writeSolutionToFile = False
    s.displayComputationTime = False
    s.linearSolver.solverType = exu.LinearSolverType.EXUdense
    begin = time.perf_counter()
    mbs.SolveDynamic(s)
    seconds = time.perf_counter() - begin
    kinds = [exu.OutputVariableType.Position, exu.OutputVariableType.Velocity, exu.OutputVariableType.Acceleration]
    values = [[float(x) for b in bodies for x in mbs.GetObjectOutputBody(b, kind, [0, 0, 0])] +
              [float(x) for n in nodes for x in mbs.GetNodeOutput(n, kind)] for kind in kinds]
    return {'seconds': seconds, 'values': values}


def child(case, steps, radius):
    text = subprocess.run([sys.executable, __file__, '--child', case, str(steps), str(radius)], check=True,
                          capture_output=True, text=True).stdout
    return json.loads(text.splitlines()[-1])


def ours(program, case, steps, radius):
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, 'out.json')
        share = str(1 / steps)
        subprocess.run([program, '--cases', case, '--methods', 'alpha', '--radius', str(radius), '--largest', share,
                        '--smallest', share, '--json', file], check=True, capture_output=True)
        with open(file, encoding='utf-8') as f:
            return json.load(f)[0]


def errors(values, truth):
    return [max(abs(x - y) for x, y in zip(v, t)) / max(map(abs, t)) for v, t in zip(values, truth)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('program', nargs='?')
    parser.add_argument('--radius', type=float, default=0.8)
    parser.add_argument('--repeats', type=int, default=2)
    parser.add_argument('--cases', nargs='+', default=list(CASES))
    parser.add_argument('--steps', nargs='+', type=int, default=STEPS)
    parser.add_argument('--json')
    parser.add_argument('--child', nargs=3, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        print(json.dumps(exudyn_run(args.child[0], int(args.child[1]), float(args.child[2]))))
        return
    if not args.program:
        parser.error('the path of espalier_bench_step_errors is missing')
    rows = []
    for case in args.cases:
        pairs = []
        for steps in args.steps:
            runs = [(ours(args.program, case, steps, args.radius), child(case, steps, args.radius))
                    for _ in range(args.repeats)]
            pairs.append([min(r, key=lambda x: x['seconds']) for r in zip(*runs)])
        truth = other = pairs[0][0]['truth']
        if case == 'flexible' and len(pairs) > 1:
            coarse, fine = (p[1]['values'] for p in pairs[-2:])
            share = 1 / ((args.steps[-1] / args.steps[-2]) ** 2 - 1)
            other = [[f + share * (f - c) for f, c in zip(ff, cc)] for ff, cc in zip(fine, coarse)]
            print(f'{case}: the two truths differ by', ' '.join(f'{x:.1e}' for x in errors(other, truth)))
        for steps, (a, b) in zip(args.steps, pairs):
            row = {'case': case, 'title': a['title'], 'h': CASES[case] / steps, 'espalier': errors(a['values'], truth),
                   'exudyn': errors(b['values'], other), 'espalier_seconds': a['seconds'], 'exudyn_seconds': b['seconds']}
            rows.append(row)
            print(f"{case:9} h {row['h']:8.2e}  espalier q {row['espalier'][0]:7.1e} v {row['espalier'][1]:7.1e} "
                  f"a {row['espalier'][2]:7.1e} {a['seconds']:7.3f} s   exudyn q {row['exudyn'][0]:7.1e} "
                  f"v {row['exudyn'][1]:7.1e} a {row['exudyn'][2]:7.1e} {b['seconds']:7.3f} s", flush=True)
    if args.json:
        with open(args.json, 'w', encoding='utf-8') as f:
            json.dump(rows, f, indent=1)
            f.write('\n')


if __name__ == '__main__':
    main()
