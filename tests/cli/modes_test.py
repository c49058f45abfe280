#!/usr/bin/env python3
"""Black-box tests of `espalier modes`: a string of masses and springs, whose eigenvalues are 4 sin^2(j pi / (2 n + 2))."""

import csv
import json
import math
import signal
import subprocess
import sys
import time
import unittest

from cli_test import BINARY, Cli, coordinate, second_difference

N = 40
TRUTH = [4 * math.sin(j * math.pi / (2 * N + 2)) ** 2 for j in range(1, N + 1)]


class Modes(Cli):
    def setUp(self):
        super().setUp()
        self.k = self.file("K.mtx", coordinate(N, second_difference(N), "symmetric"))
        self.m = self.file("M.mtx", coordinate(N, [(i, i, 1.0) for i in range(1, N + 1)], "symmetric"))

    def report(self, *arguments, code=0):
        return json.loads(self.expect(code, "modes", *arguments, "--json").stdout)

    def test_finds_and_proves_the_lowest(self):
        report = self.report(self.k, self.m, "--count", 5)
        self.assertEqual(report["problem"], "vibration")
        self.assertTrue(report["complete"], report["completeness"])
        self.assertEqual((report["unknowns"], report["finite"], report["massless"]), (N, N, 0))
        for mode, truth in zip(report["modes"], TRUTH[:5], strict=True):
            self.assertAlmostEqual(mode["eigenvalue"], truth, delta=1e-13)
            self.assertAlmostEqual(mode["frequency"], math.sqrt(truth) / (2 * math.pi), delta=1e-12)
            self.assertLess(mode["residual"], 1e-9)
        self.assertLess(report["orthogonality"], 1e-12)
        self.assertGreaterEqual(report["factorizations"], 1)

    def test_a_model_as_it_stands(self):
        model = self.file("spring.toml", """
[bodies.mass]
type = "rigid"
mass = 2
inertia = [1, 1, 1]
[joints.slide]
type = "prismatic"
bodies = ["ground", "mass"]
at = [0, 0, 0]
axis = [1, 0, 0]
[forces.spring]
type = "axial-spring"
bodies = ["ground", "mass"]
at = [0, 0, 0]
axis = [1, 0, 0]
stiffness = 8
""")
        table = f"{self.folder}/modes.csv"
        report = self.report(model, "--count", 1, "--csv", table)
        self.assertEqual(report["number"], "")
        (mode,) = report["points"][0]["modes"]
        self.assertAlmostEqual(mode["frequency"], 2 / (2 * math.pi), delta=1e-9)
        with open(table, newline="") as f:
            rows = list(csv.DictReader(f))
        self.assertEqual(list(rows[0])[:2], ["mode", "frequency"])
        self.assertAlmostEqual(float(rows[0]["frequency"]), 2 / (2 * math.pi), delta=1e-9)
        self.assertIn("frequency", self.expect(0, "modes", model, "--count", 1).stdout)
        self.expect(0, "view", model, "--no-browser")
        self.expect(2, "modes", model, "--speeds", "0:1:1", "--over", "parameters.a=0:1:1")

    def test_clusters_and_what_lies_far_below(self):
        pairs = [entry for i in range(1, 40, 2) for entry in ((i, i, 1.0), (i + 1, i, -1.0), (i + 1, i + 1, 1.0))]
        k = self.file("pairs.mtx", coordinate(N, pairs, "symmetric"))
        report = self.report(k, self.m, "--count", 25)
        self.assertTrue(report["complete"], report["completeness"])
        for mode, truth in zip(report["modes"], [0.0] * 20 + [2.0] * 5, strict=True):
            self.assertAlmostEqual(mode["eigenvalue"], truth, delta=1e-12)
        k, m = (self.file(name, coordinate(5, [(i + 1, i + 1, float(v)) for i, v in enumerate(values)], "symmetric"))
                for name, values in (("far.mtx", (-3e12, -1, 0, 2, 5)), ("ones.mtx", (1,) * 5)))
        for count in range(1, 6):
            report = self.report(k, m, "--count", count)
            self.assertTrue(report["complete"], report["completeness"])
            for mode, truth in zip(report["modes"], (-3e12, -1, 0, 2, 5)):
                self.assertAlmostEqual(mode["eigenvalue"], truth, delta=1e-12 + 1e-15 * abs(truth))

    def test_dependent_constraints_are_singular(self):
        k = self.file("c.mtx", coordinate(4, [(1, 1, 2.0), (2, 2, 3.0), (3, 1, 1.0), (4, 1, 1.0)], "symmetric"))
        m = self.file("m.mtx", coordinate(4, [(1, 1, 1.0), (2, 2, 1.0)], "symmetric"))
        for arguments in (["--count", 1], ["--count", 3], ["--below", 10]):
            self.expect(3, "modes", k, m, *arguments, says="constraints depend on each other")

    def test_bounds_beyond_everything(self):
        for bound, count in ((1e300, N), (1e12, N), (-1e300, 0), (-1e12, 0)):
            report = self.report(self.k, self.m, "--below", bound)
            self.assertEqual(len(report["modes"]), count)
            self.assertTrue(report["complete"], report["completeness"])

    def test_finds_all_below_a_bound(self):
        bound = (TRUTH[6] + TRUTH[7]) / 2
        self.assertEqual(len(self.report(self.k, self.m, "--below", bound)["modes"]), 7)
        self.assertEqual(len(self.report(self.k, self.m, "--below", bound, "--count", 3)["modes"]), 3)

    def test_writes_shapes_table_and_report(self):
        out, table, report = (self.folder / name for name in ("x.mtx", "modes.csv", "report.json"))
        result = self.expect(0, "modes", self.k, self.m, "--count", 3, "--out", out, "--csv", table, "--report", report)
        self.assertIn("eigenvalue", result.stdout)
        self.assertIn("proven", result.stdout)
        with open(table, newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([row["mode"] for row in rows], ["1", "2", "3"])
        numbers = [float(word) for line in out.read_text().splitlines() if not line.startswith("%")
                   for word in line.split()]
        self.assertEqual(numbers[:2], [N, 3])
        shape = numbers[2:2 + N]  # sin(pi i / (n + 1)), M-normalised, the largest component positive
        norm = math.sqrt(sum(math.sin(math.pi * i / (N + 1)) ** 2 for i in range(1, N + 1)))
        for i, x in enumerate(shape, start=1):
            self.assertAlmostEqual(x, math.sin(math.pi * i / (N + 1)) / norm, delta=1e-9)
        self.assertEqual(json.loads(report.read_text())["exit_code"], 0)

    def test_buckling(self):
        # Kg = 1: load factors are the eigenvalues of K.
        report = self.report(self.k, self.m, "--buckling", "--count", 2)
        self.assertEqual(report["problem"], "buckling")
        for mode, truth in zip(report["modes"], TRUTH[:2], strict=True):
            self.assertAlmostEqual(mode["eigenvalue"], truth, delta=1e-13)
            self.assertNotIn("frequency", mode)

    def test_generates_both_matrices(self):
        report = self.report("--generate", "elasticity 3", "--count", 4)
        self.assertEqual((report["unknowns"], len(report["modes"])), (144, 4))
        self.expect(2, "modes", "--generate", "plate 3", "--count", 4, says="a mass is known for elasticity")

    def test_wrong_usage(self):
        short = self.file("short.mtx", coordinate(3, [(1, 1, 1.0)], "symmetric"))
        negative = self.file("negative.mtx", coordinate(N, [(i, i, -1.0) for i in range(1, N + 1)], "symmetric"))
        self.expect(2, "modes", self.k, says="give two matrix files")
        self.expect(2, "modes", self.k, self.m, says="nothing is asked for")
        self.expect(2, "modes", self.k, short, "--count", 1, says="K is 40 x 40, M is 3 x 3")
        self.expect(2, "modes", self.k, negative, "--count", 1, says="M is not positive semi-definite")
        self.expect(2, "modes", self.k, self.m, "--count", N + 1, says="41 modes are asked for, and there are 40")
        self.expect(2, "modes", self.k, self.m, "--count", 0)
        self.expect(2, "modes", self.k, self.m, "--count", 1, "--kind", "lu", says="--kind has no meaning here")
        self.expect(2, "modes", self.k, self.m, "--count", 1, "--out", self.k, says="would replace the file of K")
        self.expect(3, "modes", self.m, self.m, "--count", 1, "--shift", 1, says="the shift 1 is an eigenvalue")
        self.expect(2, "modes", self.k, self.m, "--count", 1, "--shift", "nan", says="'nan' is not a finite number")
        self.expect(4, "modes", "--generate", "elasticity 8", "--count", 40, "--host-memory", "100K", says="budget")

    def test_stops_at_ctrl_c(self):
        process = subprocess.Popen([BINARY, "modes", "--generate", "elasticity 20", "--count", "300", "-v"],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for line in process.stderr:  # at work: the first shift
            if "modes: shift" in line:
                break
        process.send_signal(signal.SIGINT)
        start = time.monotonic()
        output, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, errors)
        self.assertLess(time.monotonic() - start, 20)
        self.assertIn("stopped", errors)


if __name__ == "__main__":
    sys.exit(unittest.main())
