#!/usr/bin/env python3
"""Black-box tests of `espalier harmonic`: one mass on a spring, and a string of masses, in closed form."""

import cmath
import csv
import json
import math
import unittest

from cli_test import Cli, coordinate, second_difference

N = 20


class Harmonic(Cli):
    def setUp(self):
        super().setUp()
        self.k = self.file("K.mtx", coordinate(N, second_difference(N), "symmetric"))
        self.m = self.file("M.mtx", coordinate(N, [(i, i, 1.0) for i in range(1, N + 1)], "symmetric"))

    def rows(self, *arguments, code=0):
        table = self.folder / "response.csv"
        self.expect(code, "harmonic", *arguments, "--csv", table, "--quiet")
        with open(table, newline="") as file:
            return list(csv.DictReader(file))

    def truth(self, frequency, eta):
        """x_0 for a unit force on it: sum over the modes sqrt(2 / (n + 1)) sin(j pi i / (n + 1))."""
        w = 2 * math.pi * frequency
        return sum(2 / (N + 1) * math.sin(j * math.pi / (N + 1)) ** 2
                   / (4 * math.sin(j * math.pi / (2 * N + 2)) ** 2 * complex(1, eta) - w * w) for j in range(1, N + 1))

    def test_one_mass_is_its_closed_form(self):
        k, c, m = (self.file(name, coordinate(1, [(1, 1, value)], "general"))
                   for name, value in (("k.mtx", 400.0), ("c.mtx", 0.7), ("m.mtx", 2.5)))
        rows = self.rows(k, m, "--damping", c, "--at", "0", "--from", 0.5, "--to", 4, "--points", 8)
        self.assertEqual([float(row["frequency"]) for row in rows], [0.5 * i for i in range(1, 9)])
        for row in rows:
            w = 2 * math.pi * float(row["frequency"])
            x = 1 / complex(400 - 2.5 * w * w, 0.7 * w)
            self.assertAlmostEqual(float(row["amplitude_0_0"]) / abs(x), 1, delta=1e-12)
            self.assertAlmostEqual(float(row["phase_0_0"]), math.degrees(cmath.phase(x)), delta=1e-9)

    def test_interpolates_to_the_tolerance_and_reports(self):
        report = self.folder / "report.json"
        rows = self.rows(self.k, self.m, "--at", "0", "--observe", "0", "--loss-factor", 1e-3, "--from", 0.01, "--to",
                         0.35, "--points", 500, "--tolerance", 1e-4, "--report", report)
        self.assertGreaterEqual(len(rows), 500)
        self.assertLess(sum(row["solved"] == "1" for row in rows), 250)
        for row in rows:
            x = self.truth(float(row["frequency"]), 1e-3)
            self.assertAlmostEqual(float(row["amplitude_0_0"]) / abs(x), 1, delta=1e-3)
        found = json.loads(report.read_text())
        self.assertTrue(found["complete"], found["completeness"])
        self.assertEqual((found["exit_code"], found["unknowns"], found["loads"]), (0, N, 1))
        self.assertEqual(len(found["resonances"]), N)
        self.assertLessEqual(found["checked_error"], 1e-4)

    def test_a_resonance_without_damping_is_exit_code_3(self):
        k, m = (self.file(name, coordinate(1, [(1, 1, value)], "general"))
                for name, value in (("k.mtx", 4 * math.pi ** 2), ("m.mtx", 1.0)))
        rows = self.rows(k, m, "--at", "0", "--from", 0.5, "--to", 1.5, "--points", 3, code=3)
        self.assertEqual([row["amplitude_0_0"] == "" for row in rows], [False, True, False])

    def test_refuses_what_cannot_be(self):
        good = (self.k, self.m, "--at", "0", "--from", 0.1, "--to", 0.2)
        self.expect(0, "harmonic", *good)
        for wrong in (("--at", "0", "--from", 0.2, "--to", 0.1), ("--at", "0", "--from", -1, "--to", 1),
                      ("--at", "0", "--from", "nan", "--to", 1), ("--from", 0.1, "--to", 0.2),
                      ("--at", N, "--from", 0.1, "--to", 0.2), ("--at", "x", "--from", 0.1, "--to", 0.2),
                      ("--at", "0", "--observe", N, "--from", 0.1, "--to", 0.2),
                      ("--at", "0", "--from", 0.1, "--to", 0.2, "--tolerance", 5),
                      ("--at", "0", "--from", 0.1, "--to", 0.2, "--points", 1),
                      ("--at", "0", "--from", 0.1, "--to", 0.2, "--kind", "lu")):
            self.expect(2, "harmonic", self.k, self.m, *wrong)
        self.expect(2, "harmonic", self.k, self.folder / "none.mtx", "--at", "0", "--from", 0.1, "--to", 0.2)


if __name__ == "__main__":
    unittest.main()
