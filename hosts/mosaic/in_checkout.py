#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Espalier in a checkout of Mosaic (https://github.com/pasteurlabs/mosaic), through its own harness, without containers.

    git clone https://github.com/pasteurlabs/mosaic
    pip install espalier scipy -e mosaic/mosaic/mosaic_shared -e mosaic
    hosts/mosaic/in_checkout.py mosaic [--out DIR] [--sizes 32,128,256] [--other torch_fem_thermal,...]

Copies the solver's files into the checkout, names it among the solvers that take tractions, and runs the experiments of
structural-mesh and thermal-mesh (--suites forward,gradient,cost). Prints how far the answers are from Mosaic's own
references, the error of its gradients beside its finite differences, and what a solution and a gradient cost. --sizes adds
meshes: N elements along x, 2 across, N / 2 up; for heat N, N / 2, 1. --other runs solvers of the checkout that are
installed here in the same way. Ends with 1 where an answer is off by more than 1e-4, a gradient by more than 1e-3, or
an experiment failed; with 2 where the checkout cannot be used.
"""

import argparse
import contextlib
import importlib
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
DOMAINS = {"structural-mesh": ("compliance", "rho"), "thermal-mesh": ("thermal_compliance", "rho")}
MOST_ERROR, MOST_GRADIENT_ERROR = 1e-4, 1e-3


def install(checkout):
    """Copies our files and applies the registration, once."""
    for folder in ("mosaic_shared", "tesseracts"):
        shutil.copytree(HERE / folder, checkout / "mosaic" / folder, dirs_exist_ok=True)
    physics = checkout / "mosaic/benchmarks/problems/structural_mesh/physics.py"
    if '"espalier",' in physics.read_text():
        return
    subprocess.run(
        ["git", "apply", "--unidiff-zero", "--recount", str(HERE / "registration.patch")], cwd=checkout, check=True
    )


def records_of(problem, tags, suites, out):
    """Runs the experiments of the suites; of each the records of its result.json, none where it failed."""
    found = {}
    for name in sorted(problem.experiments):
        if name.split("/")[0] not in suites:
            continue
        try:
            with open(out / "harness.log", "a") as log, contextlib.redirect_stdout(log):
                problem.experiments[name].fn(problem, tags)
        except Exception as error:  # the harness hands on whatever a solver raises
            print(f"{problem.name} {name}: {error}")
        files = sorted((out / problem.name / name).glob("**/result.json"))
        found[name] = [record for file in files for record in json.loads(file.read_text())["results"]]
    return found


def best_gradient_error(metrics):
    """The error of a gradient beside differences of the best step: the mean over directions."""
    errors = []
    for of_step in metrics["eps_sweep"].values():
        if "rel_error_mean" in of_step:
            errors.append(of_step["rel_error_mean"])
        else:
            errors.append(sum(of_step["rel_error"]) / len(of_step["rel_error"]))
    return min(errors)


def report(domain, solver, found):
    """Prints a line for each experiment. True if ours are as exact as they must be."""
    good = True
    for name, records in found.items():
        metrics = [record["metrics"] for record in records if record["solver"] == solver]
        text = "FAILED"
        if metrics and name.startswith("forward/") and all("error" in m for m in metrics):
            worst = max(m["error"] for m in metrics)
            text = f"largest error {worst:.1e}" + ("" if worst <= MOST_ERROR else "  TOO LARGE")
        elif metrics and name.startswith("forward/"):
            text = f"{len(metrics)} answers"
        elif metrics and name.startswith("gradient/"):
            worst = max(best_gradient_error(m) for m in metrics)
            text = f"largest error of a gradient {worst:.1e}" + ("" if worst <= MOST_GRADIENT_ERROR else "  TOO LARGE")
        elif metrics and all(m.get("mean") is not None for m in metrics):
            text = "ms: " + ", ".join(
                f"{record['sweep_value']}: {1e3 * record['metrics']['mean']:.1f}"
                for record in records
                if record["solver"] == solver
            )
        good = good and "FAILED" not in text and "TOO LARGE" not in text
        print(f"  {solver:12} {name:28} {text}")
    return good


def time_size(domain, tesseract, make_inputs, n, trials=5):
    """Median seconds of a solution and of a gradient on a mesh of Mosaic's form with n elements along x."""
    import numpy as np

    output, variable = DOMAINS[domain]
    inputs = make_inputs(nx=n, ny=2, nz=n // 2) if domain == "structural-mesh" else make_inputs(nx=n, ny=n // 2, nz=1)
    inputs["rho"] = np.random.default_rng(0).uniform(0.2, 0.9, len(inputs["rho"])).astype(np.float32)

    def seconds(call):
        begin = time.perf_counter()
        call()
        return time.perf_counter() - begin

    first = seconds(lambda: tesseract.apply(inputs))
    forward = sorted(seconds(lambda: tesseract.apply(inputs)) for _ in range(trials))[trials // 2]
    ones = {output: np.float32(1)}
    gradient = sorted(
        seconds(lambda: tesseract.vector_jacobian_product(inputs, [variable], [output], ones)) for _ in range(trials)
    )[trials // 2]
    return first, forward, gradient


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkout", type=Path)
    parser.add_argument("--out", type=Path, default=Path("mosaic-results"))
    parser.add_argument("--suites", default="forward,gradient,cost")
    parser.add_argument("--sizes", default="32,128,256")
    parser.add_argument("--other", default="")
    arguments = parser.parse_args()
    checkout, out = arguments.checkout.resolve(), arguments.out.resolve()
    if not (checkout / "mosaic/tesseracts/structural-mesh").is_dir():
        print(f"{checkout} is no checkout of Mosaic: it has no mosaic/tesseracts/structural-mesh", file=sys.stderr)
        return 2
    install(checkout)
    os.environ["MOSAIC_RESULTS_DIR"] = str(out)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    try:
        from mosaic.benchmarks.problems import get_config
        from tesseract_core import Tesseract
    except ImportError as error:
        print(f"{error}: install what the first lines of this file name", file=sys.stderr)
        return 2
    out.mkdir(parents=True, exist_ok=True)
    good = True
    for domain in DOMAINS:
        problem = get_config(domain)
        names = {solver.key: solver.name for solver in problem.solvers}
        wanted = ["espalier"] + [key for key in arguments.other.split(",") if key in names]
        files = {key: checkout / "mosaic/tesseracts" / domain / key.replace("_", "-") / "tesseract_api.py" for key in wanted}
        tags = {names[key]: f"inprocess:{file}" for key, file in files.items()}
        problem.solvers = [solver for solver in problem.solvers if solver.key in wanted]
        print(domain)
        found = records_of(problem, tags, arguments.suites.split(","), out)
        for key in wanted:
            exact = report(domain, names[key], found)
            good = good and (exact or key != "espalier")
        inputs_of = importlib.import_module(f"mosaic_shared.problems.{domain.replace('-', '_')}").make_default_inputs
        for key in wanted:
            tesseract = Tesseract.from_tesseract_api(str(files[key]))
            for n in (int(size) for size in arguments.sizes.split(",") if size):
                first, forward, gradient = time_size(domain, tesseract, inputs_of, n)
                print(
                    f"  {names[key]:12} N = {n}: first {first:.2f} s, then solution {forward:.3f} s, gradient {gradient:.3f} s"
                )
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
