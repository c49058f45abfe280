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

    def test_interpolates_from_a_frequency_at_which_the_system_is_singular(self):
        # A free chain moves away at frequency 0. Truth: the modes, cos((j + 1/2) i pi / n).
        n, eta = 12, 0.02
        k = self.file("free.mtx", coordinate(n, [(i, i, 1.0 if i in (1, n) else 2.0) for i in range(1, n + 1)]
                                             + [(i + 1, i, -1.0) for i in range(1, n)], "symmetric"))
        m = self.file("free_mass.mtx", coordinate(n, [(i, i, 1.0) for i in range(1, n + 1)], "symmetric"))

        def truth(frequency):
            w = 2 * math.pi * frequency
            return sum((1 if j == 0 else 2) / n * math.cos(j * math.pi / (2 * n)) ** 2
                       / (4 * math.sin(j * math.pi / (2 * n)) ** 2 * complex(1, eta) - w * w) for j in range(n))

        for lowest, highest in ((0, 5), (0, 0.4), (0, 1e-3)):
            rows = self.rows(k, m, "--at", "0", "--observe", "0", "--loss-factor", eta, "--from", lowest, "--to", highest,
                             "--tolerance", 1e-4, code=3)
            self.assertGreaterEqual(len(rows), 101)
            for row in rows[1:]:
                x = truth(float(row["frequency"]))
                self.assertAlmostEqual(float(row["amplitude_0_0"]) / abs(x), 1, delta=0.01)

    def test_a_system_that_is_singular_everywhere(self):
        k, m = (self.file(name, coordinate(3, [(1, 1, 1.0), (2, 2, value)], "symmetric"))
                for name, value in (("k.mtx", 2.0), ("m.mtx", 1.0)))
        for tolerance in ([], ["--tolerance", 1e-4]):
            self.expect(3, "harmonic", k, m, "--at", "0", "--from", 0, "--to", 1, *tolerance)

    def test_a_resonance_without_damping_is_exit_code_3(self):
        k, m = (self.file(name, coordinate(1, [(1, 1, value)], "general"))
                for name, value in (("k.mtx", 4 * math.pi ** 2), ("m.mtx", 1.0)))
        rows = self.rows(k, m, "--at", "0", "--from", 0.5, "--to", 1.5, "--points", 3, code=3)
        self.assertEqual([row["amplitude_0_0"] == "" for row in rows], [False, True, False])

    MODEL = """
[bodies.bob]
type = "rigid"
mass = 2.5
inertia = [1, 1, 1]
[joints.rail]
type = "prismatic"
a = { body = "ground", axis = [1, 0, 0] }
b = { body = "bob", axis = [1, 0, 0] }
[forces.spring]
type = "bushing"
a = { body = "ground" }
b = { body = "bob" }
stiffness = [400, 0, 0]
damping = [DAMPING, 0, 0]
[forces.shaker]
type = "load"
a = { body = "bob" }
force = [1, 0, 0]
factor = 0
[harmonic]
frequencies = FREQUENCIES
loads = ["shaker"]
quantities = ["bob.position.x"]
shapes = [1]
"""

    def model(self, damping, frequencies):
        return self.file("model.toml", self.MODEL.replace("DAMPING", str(damping)).replace("FREQUENCIES", str(frequencies)))

    def test_a_model_is_its_closed_form(self):
        out = self.folder / "out"
        shown = self.expect(0, "simulate", self.model(0.7, [0.5, 1, 2, 4]), "--out", out)
        self.assertIn("bob.position.x: ", shown.stdout)
        with open(out / "harmonic.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([float(row["frequency"]) for row in rows], [0.5, 1, 2, 4])
        for row in rows:
            w = 2 * math.pi * float(row["frequency"])
            x = 1 / complex(400 - 2.5 * w * w, 0.7 * w)
            self.assertAlmostEqual(float(row["amplitude_bob.position.x_shaker"]) / abs(x), 1, delta=1e-9)
            self.assertAlmostEqual(float(row["phase_bob.position.x_shaker"]), math.degrees(cmath.phase(x)), delta=1e-6)
        found = json.loads((out / "summary.json").read_text())
        self.assertEqual((found["integrator"]["method"], found["harmonic"]["frequencies"]), ("harmonic", 4))
        self.assertEqual(found["harmonic"]["peaks"][0]["frequency"], 2)
        self.assertTrue((out / "harmonic_shaker.vtkhdf").exists())

    def test_a_model_on_a_resonance_is_exit_code_3_and_writes_the_rest(self):
        resonance = math.sqrt(400 / 2.5) / (2 * math.pi)
        out = self.folder / "out"
        failed = self.expect(3, "simulate", self.model(0, [1, resonance, 4]), "--out", out)
        self.assertIn("resonance without damping", failed.stderr)
        with open(out / "harmonic.csv", newline="") as file:
            cells = [row["amplitude_bob.position.x_shaker"] for row in csv.DictReader(file)]
        self.assertEqual([cell == "" for cell in cells], [False, True, False])

    def test_a_model_with_mistakes_is_exit_code_2(self):
        for wrong in (("harmonic.loads=[\"spring\"]", "nothing drives"), ("harmonic.loads=[\"shakr\"]", "did you mean"),
                      ("harmonic.frequencies=[-1]", "not negative"), ("harmonic.frequencies=[nan]", "finite"),
                      ("harmonic.tolerance=7", "harmonic.tolerance")):
            failed = self.expect(2, "simulate", self.model(1, [1, 2]), "--set", wrong[0])
            self.assertIn(wrong[1], failed.stderr)

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
