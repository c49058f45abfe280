#!/usr/bin/env python3
"""Allocations of the Python package fail in turn: MemoryError or an error of the package's own that says so, never a crash, and the same
object then gives the right answer. Truth: the run in which none fails.

    LD_PRELOAD=build/release/tests/espalier_faults.so python tests/faults/python_memory.py [--most 150] [--first 1] [CASE ...]

The process that is asked starts itself again for each case, so that a crash names the allocation: the last one told is it.
"""

import argparse
import ctypes
import os
import subprocess
import sys
import tempfile
import traceback
import warnings
from pathlib import Path
from typing import Callable

import numpy as np
import scipy.sparse as sp

import espalier as esp

MODEL = """
gravity = [0, 0, -9.81]
[bodies.bar]
type = "solid"
mesh = { part = "block", lx = 0.4, ly = 0.1, lz = 0.1, divisions = [2, 1, 1] }
material = { young = 2e9, poisson = 0.3, density = 1500 }
[joints.wall]
type = "fixed"
a = { body = "ground", point = [0, 0.05, 0.05] }
b = { body = "bar", face = "x0" }
[integrator]
method = "generalized-alpha"
step = 1e-3
end = 3e-3
[output]
quantities = ["bar.position", "wall.force.z"]
"""
rng = np.random.default_rng(3)
# Made here: scipy ends the process where it has no memory for a conversion.
GRID = (sp.kron(sp.eye(9), sp.diags([-1.0, 4.0, -1.0], [-1, 0, 1], (9, 9))) + sp.diags([-1.0, -1.0], [-9, 9], (81, 81))).tocsc()
TWICE, IDENTITY = (GRID * 2).tocsc(), sp.eye(81).tocsc()
RIGHT = rng.standard_normal((81, 2))


class Linear:
    """One solver, which is factorized with other values each time."""

    def __init__(self, folder: Path) -> None:
        self.solver = esp.Solver(GRID, threads=1)

    def run(self) -> np.ndarray:
        self.solver.factorize(TWICE)
        return self.solver.solve(RIGHT)


class Fresh:
    """Analysis, factor and solution of a new object."""

    def __init__(self, folder: Path) -> None:
        pass

    def run(self) -> np.ndarray:
        return esp.Solver(GRID, threads=1).solve(RIGHT)


class Simulated:
    """A simulation with its histories."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "model.toml"
        self.path.write_text(MODEL)

    def run(self) -> np.ndarray:
        run = esp.Model.load(self.path).run(threads=1, device="cpu")
        return np.concatenate([run.t, run["wall.force.z"], run["bar.position.z"]])


class Read:
    """The histories and frames of a run that is there."""

    def __init__(self, folder: Path) -> None:
        (folder / "model.toml").write_text(MODEL)
        self.result = esp.Model.load(folder / "model.toml").run(threads=1, device="cpu", frames=1e-3)

    def run(self) -> np.ndarray:
        points = [np.ravel(frame.points) for frame in self.result.frames]
        return np.concatenate([*(np.ravel(values) for _, values in self.result.items()), *points])


class Pencil:
    """The lowest modes."""

    def __init__(self, folder: Path) -> None:
        pass

    def run(self) -> np.ndarray:
        return esp.modes(GRID, IDENTITY, count=4, threads=1).eigenvalues


CASES: "dict[str, Callable[[Path], object]]" = {"linear": Linear, "fresh": Fresh, "simulated": Simulated, "read": Read, "pencil": Pencil}


def check(name: str, most: int, first: int) -> int:
    fault = ctypes.CDLL(None).fault_memory
    fault.restype, fault.argtypes = ctypes.c_long, [ctypes.c_long]
    with tempfile.TemporaryDirectory() as folder:
        case = CASES[name](Path(folder))
        for _ in range(3):  # what is made once and kept
            truth = case.run()
        fault(0)
        case.run()
        total, refused, numpys, wrong = fault(-1), 0, 0, 0
        for at in range(first, total + 1, max(1, total // most)):
            print(at, file=sys.stderr, flush=True)
            try:
                fault(at)
                found = case.run()
                fault(-1)
            except (MemoryError, esp.OutOfMemoryError):
                fault(-1)
                refused += 1
                found = None
            except Exception as error:  # noqa: BLE001
                fault(-1)
                found = None
                if isinstance(error, SystemError) and "numpy" in traceback.extract_tb(error.__traceback__)[-1].filename:
                    numpys += 1  # NumPy has no words for it in its sums
                    continue
                wrong += 1
                print(f"{name}: allocation {at} of {total}: {type(error).__name__}: {error}")
            if (found is not None and not np.array_equal(found, truth)) or not np.array_equal(case.run(), truth):
                wrong += 1
                print(f"{name}: allocation {at} of {total}: another answer")
    print(f"{name}: {total} allocations, {refused} refusals were told, {numpys} by a SystemError of NumPy, {wrong} wrong")
    return 1 if wrong or refused == 0 else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", default=list(CASES))
    parser.add_argument("--most", type=int, default=150)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--here", action="store_true", help="in this process")
    given = parser.parse_args()
    if given.here:
        warnings.simplefilter("ignore")
        return check(given.cases[0], given.most, given.first)
    failed = 0
    for name in given.cases:
        words = [sys.executable, __file__, "--here", "--most", str(given.most), "--first", str(given.first), name]
        done = subprocess.run(words, capture_output=True, text=True, timeout=900)
        print(done.stdout, end="", flush=True)
        if name not in done.stdout:
            print(f"{name}: ended with {done.returncode} at allocation {(done.stderr.split() or ['?'])[-1]}: {done.stderr[-800:]}")
        failed += done.returncode != 0
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
