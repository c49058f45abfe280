#!/usr/bin/env python3
"""Black-box tests of `espalier condense`: a string of springs, whose complement of its ends is known."""

import json
import sys
import unittest

from cli_test import Cli, coordinate, second_difference

N = 20


def array(path):
    with open(path) as file:
        lines = [line for line in file if not line.startswith("%")]
    return tuple(map(int, lines[0].split())), [float(line) for line in lines[1:]]


class Condense(Cli):
    def setUp(self):
        super().setUp()
        self.a = self.file("A.mtx", coordinate(N, second_difference(N), "symmetric"))

    # Springs of 1 between N masses and two walls: between the ends lies a spring of 1 / (N - 1).
    def test_a_string_becomes_one_spring(self):
        out = self.folder / "S.mtx"
        report = json.loads(self.expect(0, "condense", self.a, "--unknowns", f"{N - 1},0", "--out", out, "--json").stdout)
        self.assertEqual((report["unknowns"], report["listed"], report["rank_of_rest"]), (N, 2, N - 2))
        self.assertEqual(report["inertia"]["complement"], {"positive": 2, "negative": 0, "zero": 0})
        shape, s = array(out)
        self.assertEqual(shape, (2, 2))
        for value, truth in zip(s, [1 + 1 / (N - 1), -1 / (N - 1), -1 / (N - 1), 1 + 1 / (N - 1)], strict=True):
            self.assertAlmostEqual(value, truth, delta=1e-14)

    def test_lists_ranges_and_right_hand_sides(self):
        b = self.file("b.mtx", f"%%MatrixMarket matrix array real general\n{N} 1\n" + "1\n" * N)
        unknowns = self.file("list.txt", "0-4 19\n6, 5\n")
        g = self.folder / "g.mtx"
        self.expect(0, "condense", self.a, "--list", unknowns, "--rhs", b, "--out-rhs", g, "-q")
        shape, values = array(g)
        self.assertEqual(shape, (8, 1))
        self.assertAlmostEqual(values[0], 1, delta=1e-14)
        # Between 6 and 19 hang 12 masses: half of them pull at either end.
        self.assertAlmostEqual(values[6], 1 + 6, delta=1e-12)
        self.assertAlmostEqual(values[5], 1 + 6, delta=1e-12)

    def test_complex_right_hand_sides(self):
        b = self.file("b.mtx", f"%%MatrixMarket matrix array complex general\n{N} 1\n" + "1 -2\n" * N)
        g = self.folder / "g.mtx"
        self.expect(0, "condense", self.a, "--unknowns", f"0,{N - 1}", "--rhs", b, "--out-rhs", g, "-q")
        lines = [line.split() for line in g.read_text().splitlines() if not line.startswith("%")]
        self.assertEqual(lines[0], ["2", "1"])
        for real, imaginary in lines[1:]:  # half of the masses between pull at either end
            self.assertAlmostEqual(float(real), N / 2, delta=1e-12)
            self.assertAlmostEqual(float(imaginary), -N, delta=1e-12)

    def test_lists_that_ask_for_much_memory(self):
        self.expect(2, "condense", self.a, "--unknowns", "0-2147483647", says="none of the 20 unknowns")
        self.expect(2, "condense", self.a, "--unknowns", ",".join(["0-19"] * 20000), says="longer than the 20")
        self.expect(2, "condense", self.a, "--list", "/dev/zero", says="no index")
        k, m = self.a, self.file("M.mtx", coordinate(N, [(i, i, 1.0) for i in range(1, N + 1)], "symmetric"))
        for option in ("--at", "--observe"):
            words = ["--at", "0"] if option == "--observe" else []
            self.expect(2, "harmonic", k, m, *words, option, "0-2000000000", "--from", 0, "--to", 1, says="20 unknowns")

    def test_says_what_is_wrong(self):
        self.expect(2, "condense", self.a)
        self.expect(2, "condense", self.a, "--unknowns", "0,0")
        self.expect(2, "condense", self.a, "--unknowns", "0,20")
        self.expect(2, "condense", self.a, "--unknowns", "5-3")
        self.expect(2, "condense", self.a, "--unknowns", "x")
        self.expect(2, "condense", self.a, "--unknowns", "-1")
        self.expect(2, "condense", self.a, "--unknowns", "1", "--list", self.a)
        self.expect(2, "condense", self.a, "--unknowns", "1", "--rhs", self.a)
        self.expect(2, "condense", self.a, "--list", self.folder / "nowhere.txt")
        free = self.file("F.mtx", coordinate(3, [(1, 1, 1.0), (2, 1, -1.0), (2, 2, 1.0), (3, 3, 1.0)], "symmetric"))
        error = self.expect(3, "condense", free, "--unknowns", "2").stderr
        self.assertIn("rank is 1 of 2", error)


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
