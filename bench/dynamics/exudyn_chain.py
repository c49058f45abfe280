#!/usr/bin/env python3
"""The chain of chain.cpp in Exudyn (pip install exudyn), run beside ours, with the errors of both.

exudyn_chain.py path/to/espalier_bench_chain [--bars 400] [--steps 1000] [--repeats 3]

Both programs run one after the other, `repeats` times in turn; the least time of each counts. The error of an end
position is its distance from the same program's run with a tenth of the step, and from the other program's such run."""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time


def exudyn_run(bars, steps, until, radius):
    import exudyn as exu
    import exudyn.graphics  # noqa: F401  (makes the utilities import)
    from exudyn.utilities import AddRigidBody, InertiaCuboid  # noqa: F401
    import numpy as np

    sc = exu.SystemContainer()
    mbs = sc.AddSystem()
    length, side, density = 0.1, 0.02, 1000
    previous = mbs.CreateGround()
    bodies = []
    for i in range(bars):
        body = mbs.CreateRigidBody(
            inertia=InertiaCuboid(density=density, sideLengths=[length, side, side]),
            referencePosition=[(i + 0.5) * length, 0, 0], gravity=[0, -9.81, 0])
        axis = [0, 0, 1] if i % 2 == 0 else [0, 1, 0]
        mbs.CreateRevoluteJoint(bodyNumbers=[previous, body], position=[i * length, 0, 0], axis=axis,
                                useGlobalFrame=True)
        bodies.append(body)
        previous = body
    mbs.Assemble()
    s = exu.SimulationSettings()
    s.timeIntegration.numberOfSteps = steps
    s.timeIntegration.endTime = until
    s.timeIntegration.generalizedAlpha.spectralRadius = radius
    s.timeIntegration.newton.useModifiedNewton = True
    s.timeIntegration.verboseMode = 0
    s.solutionSettings.writeSolutionToFile = False
    s.solutionSettings.sensorsWritePeriod = 1
    s.displayComputationTime = False
    s.linearSolverType = exu.LinearSolverType.EigenSparse
    begin = time.perf_counter()
    mbs.SolveDynamic(s)
    seconds = time.perf_counter() - begin
    positions = [list(map(float, mbs.GetObjectOutputBody(b, exu.OutputVariableType.Position, [0, 0, 0])))
                 for b in bodies]
    counts = mbs.sys['dynamicSolver'].it if 'dynamicSolver' in mbs.sys else None
    out = {'seconds': seconds, 'positions': positions, 'finite': bool(np.all(np.isfinite(positions)))}
    if counts is not None:
        out['iterations'] = counts.newtonStepsCount
        out['factorizations'] = counts.newtonJacobiCount
    return out


def exudyn_in_own_process(args, steps):
    command = [sys.executable, __file__, '--child', '--bars', str(args.bars), '--steps', str(steps), '--until',
               str(args.until), '--radius', str(args.radius)]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return json.loads(text.splitlines()[-1])


def ours(args, steps, extra=()):
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, 'out.json')
        subprocess.run([args.program, '--bars', str(args.bars), '--steps', str(steps), '--until', str(args.until),
                        '--radius', str(args.radius), '--json', file, *extra], check=True, capture_output=True)
        with open(file, encoding='utf-8') as f:
            return json.load(f)


def error(a, b):
    """Largest and root mean square distance of the bars' centres."""
    d = [math.dist(x, y) for x, y in zip(a['positions'], b['positions'])]
    return max(d), math.sqrt(sum(x * x for x in d) / len(d))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('program', nargs='?')
    parser.add_argument('--bars', type=int, default=400)
    parser.add_argument('--steps', type=int, default=1000)
    parser.add_argument('--until', type=float, default=1.0)
    parser.add_argument('--radius', type=float, default=0.8)
    parser.add_argument('--repeats', type=int, default=3)
    parser.add_argument('--no-reference', action='store_true', help='times only')
    parser.add_argument('--child', action='store_true', help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        print(json.dumps(exudyn_run(args.bars, args.steps, args.until, args.radius)))
        return
    if not args.program:
        parser.error('the path of espalier_bench_chain is missing')
    runs = {'espalier': [], 'exudyn': []}
    for _ in range(args.repeats):
        runs['espalier'].append(ours(args, args.steps))
        runs['exudyn'].append(exudyn_in_own_process(args, args.steps))
    best = {name: min(r, key=lambda x: x['seconds']) for name, r in runs.items()}
    for name, r in best.items():
        print(f"{name}: {r['seconds']:.3f} s ({r.get('iterations', '?')} iterations, "
              f"{r.get('factorizations', '?')} factorizations)")
    print(f"ratio exudyn / espalier: {best['exudyn']['seconds'] / best['espalier']['seconds']:.2f}")
    if args.no_reference:
        return
    fine = {'espalier': ours(args, 10 * args.steps), 'exudyn': exudyn_in_own_process(args, 10 * args.steps)}
    for name, r in best.items():
        for other, f in fine.items():
            largest, rms = error(r, f)
            print(f'{name} against {other} with a tenth of the step: largest {largest:.3e} m, rms {rms:.3e} m')
    largest, rms = error(fine['espalier'], fine['exudyn'])
    print(f'the two fine runs against each other: largest {largest:.3e} m, rms {rms:.3e} m')


if __name__ == '__main__':
    main()
