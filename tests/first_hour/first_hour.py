#!/usr/bin/env python3
"""The first hour with an Espalier that is installed: a solved matrix, a pendulum that bends, a bracket with the stress in
its fillet, the modes of a plate, CasADi on our solver; by the command line, by Python and by a program with the library.
Every number against its truth (truths.py), every time printed. Exit code 1 where one is wrong.

    first_hour.py --command env/bin/espalier --python env/bin/python [--without casadi]
    first_hour.py --command build/release/espalier --program build/first_hour      of with_cmake"""

import argparse
import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import bracket_mesh  # noqa: E402
import truths  # noqa: E402


def call(*words, **options):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, stdin=subprocess.DEVNULL, **options)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}\nended with {done.returncode}\n{done.stdout}{done.stderr}")
    return done


def matrix(command, folder):
    n = truths.MATRIX_ROWS
    with open(folder / "A.mtx", "w", encoding="ascii") as out:
        out.write(f"%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {2 * n - 1}\n")
        out.writelines(f"{k} {k} 2\n" + (f"{k + 1} {k} -1\n" if k < n else "") for k in range(1, n + 1))
    (folder / "b.mtx").write_text(f"%%MatrixMarket matrix array real general\n{n} 1\n" + "1\n" * n)
    call(command, "solve", folder / "A.mtx", "--rhs", folder / "b.mtx", "--out", folder / "x.mtx")
    lines = [line for line in (folder / "x.mtx").read_text().splitlines() if not line.startswith("%")]
    return {"largest unknown": max(map(float, lines[1:]))}


def pendulum(command, folder):
    call(command, "simulate", folder / "pendulum.toml", "--out", folder / "pendulum")
    if not (folder / "pendulum" / "index.html").exists():
        sys.exit("simulate has written no page")
    with open(folder / "pendulum" / "quantities.csv", encoding="ascii") as table:
        rows = list(csv.DictReader(table))
    columns = [[float(row[name]) for row in rows] for name in ("time", "tip.position.x", "tip.velocity.x", "hinge.force.z")]
    return truths.lowest_point(*columns)


def bracket(command, folder):
    values = json.loads(call(command, "simulate", folder / "bracket.toml", "--json").stdout)["values"]
    return {"stress in the fillet": values["bracket[nodes FILLET].stress.principal_1.max"], "force on the clamp": values["clamp.force.y"]}


def plate(command, folder):
    modes = json.loads(call(command, "simulate", folder / "plate.toml", "--json").stdout)["initial"]["modes"]
    return {f"frequency {k}": mode["frequency"] for k, mode in enumerate(modes, 1)}


def casadi(command, python):
    """In a Python of the user's: our library takes the place of HSL's, and says that it has worked."""
    done = call(command, "run", "--as", "hsl", "--", python, HERE / "casadi_problem.py")
    words = done.stdout.split()
    if words[:1] != ["objective"] or words[2:] != ["Solve_Succeeded"] or "ma57: " not in done.stderr:
        sys.exit(f"CasADi has not solved the problem with our ma57:\n{done.stdout}{done.stderr}")
    return {"objective": float(words[1])}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--command", required=True, help="the program espalier")
    parser.add_argument("--python", help="a Python with the package espalier, and CasADi")
    parser.add_argument("--program", help="what with_cmake makes with the library")
    parser.add_argument("--without", default="", help="problems that are left out, with commas between them")
    given = parser.parse_args()
    left_out = given.without.split(",")
    right, begin = True, time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for model in HERE.glob("*.toml"):
            shutil.copy(model, folder)
        bracket_mesh.write(folder / "bracket.inp")
        for problem in (matrix, pendulum, bracket, plate):
            if problem.__name__ in left_out:
                continue
            start = time.perf_counter()
            found = problem(given.command, folder)
            right = truths.check(problem.__name__, found, time.perf_counter() - start, "command line") and right
        if given.program:
            for problem, result in json.loads(call(given.program, folder).stdout).items():
                values = result["values"]
                found = truths.lowest_point(*values["steps"]) if "steps" in values else values
                right = truths.check(problem, found, result["seconds"], "C++") and right
        if given.python:
            done = call(given.python, HERE / "in_python.py", folder, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"})
            for problem, result in json.loads(done.stdout).items():
                right = truths.check(problem, result["values"], result["seconds"], "Python") and right
            if "casadi" not in left_out:
                start = time.perf_counter()
                found = casadi(given.command, given.python)
                right = truths.check("casadi", found, time.perf_counter() - start, "ma57") and right
    print(f"{'all right' if right else 'something is WRONG'}, {time.perf_counter() - begin:.1f} s")
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main())
