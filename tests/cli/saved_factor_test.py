#!/usr/bin/env python3
"""Black-box tests of `espalier solve --save-factor` and `--factor`. Truth: the bits of the solution by the run that saved the factor."""

import json
import sys
import unittest

from cli_test import Cli, coordinate, second_difference

N = 20


class SavedFactor(Cli):
    def setUp(self):
        super().setUp()
        self.factor, self.x, self.y = (self.folder / name for name in ("A.factor", "x.mtx", "y.mtx"))

    def same(self, matrix, *options):
        """By the matrix, then by the file, with other threads; the report of the second run."""
        self.expect(0, "solve", *matrix, "--save-factor", self.factor, "--out", self.x, "--threads", "1", "-q", *options)
        report = json.loads(self.expect(0, "solve", "--factor", self.factor, "--out", self.y, "--threads", "3", "--json", *options).stdout)
        self.assertEqual(self.x.read_text(), self.y.read_text())
        self.assertEqual(report["exit_code"], 0)
        return report

    def test_solves_to_the_same_bits(self):
        a = self.file("A.mtx", coordinate(N, second_difference(N), "symmetric"))
        report = self.same([a])
        self.assertEqual((report["matrix"]["rows"], report["kind"]), (N, "llt"))
        self.assertLess(report["backward_error"]["normwise"], 1e-14)
        b = self.file("b.mtx", "%%MatrixMarket matrix array real general\n20 2\n" + "1\n2\n" * 20)
        self.same([a], "--rhs", b)
        self.same(["--generate", "kkt 6 4 3 3"])
        self.same(["--generate", "gyroscopic 6"])
        c = self.file("C.mtx", "%%MatrixMarket matrix coordinate complex hermitian\n2 2 3\n1 1 2 0\n2 1 0 -1\n2 2 2 0\n")
        self.assertEqual(self.same([c])["matrix"]["rows"], 2)

    def test_goes_on(self):
        a = self.file("A.mtx", coordinate(N, second_difference(N), "symmetric"))
        self.same([a])
        second = self.folder / "second.factor"
        self.expect(0, "solve", "--factor", self.factor, "--save-factor", second, "--refactor", "2", "--condition", "-q")
        self.expect(0, "solve", "--factor", second, "--out", self.x, "-q")
        self.assertEqual(self.x.read_text(), self.y.read_text())
        self.expect(0, "solve", a, "--factor", self.factor, "-q")  # it is of this matrix

    def test_what_cannot_be(self):
        a = self.file("A.mtx", coordinate(N, second_difference(N), "symmetric"))
        other = self.file("B.mtx", coordinate(N, [(i, j, 2 * v) for i, j, v in second_difference(N)], "symmetric"))
        self.expect(0, "solve", a, "--save-factor", self.factor, "-q")
        good = self.factor.read_bytes()
        self.assertIn("another matrix", self.expect(2, "solve", other, "--factor", self.factor).stderr)
        self.assertIn("--analysis", self.expect(2, "solve", "--factor", self.factor, "--analysis", a).stderr)
        self.expect(2, "solve", "--factor", self.factor, "--save-factor", self.factor)
        self.expect(2, "solve", "--factor", self.folder / "none")
        self.expect(2, "solve", a, "--save-factor", self.folder / "none" / "f")
        self.assertIn("not a saved factor", self.expect(2, "solve", "--factor", a).stderr)
        self.assertEqual(self.factor.read_bytes(), good)
        self.factor.write_bytes(good[:-9])
        self.assertIn("cut off", self.expect(2, "solve", "--factor", self.factor).stderr)
        self.factor.write_bytes(good[:200] + b"?" + good[201:])
        self.assertIn("damaged", self.expect(2, "solve", "--factor", self.factor).stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
