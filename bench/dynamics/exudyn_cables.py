#!/usr/bin/env python3
"""The hanging cables of cables.cpp in Exudyn (pip install exudyn numpy), run beside ours, with the distance of the ends.

exudyn_cables.py path/to/espalier_bench_cables [--cables 32] [--elements 8] [--steps 1000] [--repeats 5]

Both have the same elements (ANCF cables of Gerstmayr and Irschik), the same method and step. Both programs run one after
the other, `repeats` times in turn; the least time of each counts, and the ratio is the median of the pairs'. The error of
an end is its distance from the same program's run with a tenth of the step."""
import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time


def exudyn_run(args, steps):
    import warnings
    warnings.simplefilter('ignore')  # names that older versions know too
    import exudyn as exu
    from exudyn.beams import GenerateStraightLineANCFCable, GenerateStraightLineANCFCable2D
    from exudyn.itemInterface import ObjectANCFCable
    from exudyn.utilities import Cable2D

    sc = exu.SystemContainer()
    mbs = sc.AddSystem()
    radius, young, density = 0.005, 1e8, 1000
    area = math.pi * radius**2
    ends = []
    for k in range(args.cables):
        section = {'massPerLength': density * area, 'bendingStiffness': young * area * radius**2 / 4,
                   'axialStiffness': young * area}
        if args.plane:
            template = Cable2D(**{'physics' + key[0].upper() + key[1:]: v for key, v in section.items()})
            generate, hinge = GenerateStraightLineANCFCable2D, [1, 1, 0, 0]
        else:
            template, generate, hinge = ObjectANCFCable(**section), GenerateStraightLineANCFCable, [1, 1, 1, 0, 0, 0]
        items = generate(mbs, [0, 0, 0.1 * k], [1, 0, 0.1 * k], args.elements, template,
                         massProportionalLoad=[0, -9.81, 0], fixedConstraintsNode0=hinge)
        ends.append(items[0][-1])
    mbs.Assemble()
    s = exu.SimulationSettings()
    s.timeIntegration.numberOfSteps = steps
    s.timeIntegration.endTime = args.until
    s.timeIntegration.generalizedAlpha.spectralRadius = args.radius
    s.timeIntegration.newton.useModifiedNewton = True
    s.timeIntegration.verboseMode = 0
    s.solutionSettings.writeSolutionToFile = False
    s.solutionSettings.sensorsWritePeriod = 1
    s.displayComputationTime = False
    s.linearSolverType = exu.LinearSolverType.EigenSparse
    begin = time.perf_counter()
    mbs.SolveDynamic(s)
    seconds = time.perf_counter() - begin
    out = {'seconds': seconds,
           'positions': [list(map(float, mbs.GetNodeOutput(n, exu.OutputVariableType.Position))) for n in ends]}
    if 'dynamicSolver' in mbs.sys:
        counts = mbs.sys['dynamicSolver'].it
        out.update(iterations=counts.newtonStepsCount, factorizations=counts.newtonJacobiCount)
    return out


def exudyn_in_own_process(args, steps):
    command = [sys.executable, __file__, '--child', '--cables', str(args.cables), '--elements', str(args.elements),
               '--steps', str(steps), '--until', str(args.until), '--radius', str(args.radius)]
    command += ['--plane'] if args.plane else []
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1])


def ours(args, steps):
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, 'out.json')
        subprocess.run([args.program, '--cables', str(args.cables), '--elements', str(args.elements), '--steps',
                        str(steps), '--until', str(args.until), '--radius', str(args.radius), '--json', file],
                       check=True, capture_output=True)
        with open(file, encoding='utf-8') as f:
            return json.load(f)


def distance(a, b):
    return max(math.dist(x, y) for x, y in zip(a['positions'], b['positions']))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('program', nargs='?')
    parser.add_argument('--cables', type=int, default=32)
    parser.add_argument('--elements', type=int, default=8)
    parser.add_argument('--steps', type=int, default=1000)
    parser.add_argument('--until', type=float, default=1.0)
    parser.add_argument('--radius', type=float, default=0.8)
    parser.add_argument('--repeats', type=int, default=5)
    parser.add_argument('--plane', action='store_true', help="Exudyn's plane cables, with two thirds of the unknowns")
    parser.add_argument('--no-reference', action='store_true', help='times only')
    parser.add_argument('--child', action='store_true', help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        print(json.dumps(exudyn_run(args, args.steps)))
        return
    if not args.program:
        parser.error('the path of espalier_bench_cables is missing')
    runs = [(ours(args, args.steps), exudyn_in_own_process(args, args.steps)) for _ in range(args.repeats)]
    best = [min((r[k] for r in runs), key=lambda x: x['seconds']) for k in (0, 1)]
    for name, r in zip(('espalier', 'exudyn'), best):
        print(f"{name}: {r['seconds']:.3f} s ({r.get('iterations', '?')} iterations, "
              f"{r.get('factorizations', '?')} factorizations)")
    print(f"ratio exudyn / espalier: {statistics.median(b['seconds'] / a['seconds'] for a, b in runs):.2f}")
    if args.no_reference:
        return
    fine = ours(args, 10 * args.steps), exudyn_in_own_process(args, 10 * args.steps)
    for name, r, f in zip(('espalier', 'exudyn'), best, fine):
        print(f'{name}: ends {distance(r, f):.3e} m from a tenth of the step')
    print(f'the two fine runs: ends {distance(*fine):.3e} m apart')


if __name__ == '__main__':
    main()
