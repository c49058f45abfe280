#!/usr/bin/env python3
"""Black-box tests of `espalier inverse`: a string of springs, whose inverse is known: min(i, j) (n + 1 - max(i, j)) / (n + 1)."""

import json
import sys
import unittest

from cli_test import Cli, coordinate, second_difference

N = 20


def truth(i, j):
    return min(i, j) * (N + 1 - max(i, j)) / (N + 1)


class Inverse(Cli):
    def setUp(self):
        super().setUp()
        self.a = self.file("A.mtx", coordinate(N, second_difference(N), "symmetric"))

    def entries(self, path):
        lines = [line.split() for line in path.read_text().splitlines() if not line.startswith("%")]
        return [int(v) for v in lines[0]], [[float(v) for v in line] for line in lines[1:]]

    def test_diagonal_entries_and_traces(self):
        diagonal, out = self.folder / "d.mtx", self.folder / "X.mtx"
        report = json.loads(self.expect(0, "inverse", self.a, "--diagonal", diagonal, "--out", out, "--trace", self.a,
                                        "--json").stdout)
        size, values = self.entries(diagonal)
        self.assertEqual(size, [N, 1])
        for i, (v,) in enumerate(values, 1):
            self.assertAlmostEqual(v, truth(i, i), delta=1e-12)
        size, values = self.entries(out)
        self.assertEqual(size, [N, N, 2 * N - 1])
        self.assertIn("symmetric", out.read_text().splitlines()[0])
        for i, j, v in values:
            self.assertAlmostEqual(v, truth(i, j), delta=1e-12)
        self.assertAlmostEqual(report["trace"]["value"], N, delta=1e-11)
        self.assertAlmostEqual(report["diagonal"]["sum"], sum(truth(i, i) for i in range(1, N + 1)), delta=1e-11)
        self.assertLess(report["entries"]["error"], 1e-13)
        self.assertIn(report["entries"]["checked_columns"], (6, 7, 8))
        self.assertEqual(report["exit_code"], 0)

    def test_other_entries(self):
        pattern = self.file("P.mtx", coordinate(N, [(1, 20, 1.0), (20, 1, 1.0), (3, 7, 1.0)], "general"))
        out = self.folder / "X.mtx"
        line = self.expect(0, "inverse", self.a, "--pattern", pattern, "--out", out).stdout
        self.assertIn("3 entries", line)
        for i, j, v in self.entries(out)[1]:
            self.assertAlmostEqual(v, truth(i, j), delta=1e-12)
        self.assertIn(f"trace {N * (N + 2) / 6:.9f}"[:14], self.expect(0, "inverse", self.a).stdout)

    def test_unsymmetric_and_complex(self):
        out = self.folder / "X.mtx"
        a = self.file("B.mtx", coordinate(2, [(1, 1, 2.0), (1, 2, 1.0), (2, 2, 4.0)], "general"))
        self.expect(0, "inverse", a, "--out", out, "-q")
        found = {(i, j): v for i, j, v in self.entries(out)[1]}  # where the transpose has entries
        self.assertEqual(found, {(1, 1): 0.5, (2, 1): 0.0, (2, 2): 0.25})
        c = self.file("C.mtx", "%%MatrixMarket matrix coordinate complex hermitian\n2 2 3\n1 1 2 0\n2 1 0 -1\n2 2 2 0\n")
        diagonal = self.folder / "d.mtx"
        report = json.loads(self.expect(0, "inverse", c, "--out", out, "--diagonal", diagonal, "--trace", a, "--json").stdout)
        self.assertIn("hermitian", out.read_text().splitlines()[0])
        for (i, j, real, imaginary), true in zip(self.entries(out)[1], [(1, 1, 2, 0), (2, 1, 0, 1), (2, 2, 2, 0)], strict=True):
            self.assertEqual((i, j), true[:2])
            self.assertAlmostEqual(3 * real, true[2], delta=1e-14)
            self.assertAlmostEqual(3 * imaginary, true[3], delta=1e-14)
        self.assertAlmostEqual(report["trace"]["value"]["real"], 4, delta=1e-14)
        self.assertAlmostEqual(report["trace"]["value"]["imaginary"], 1 / 3, delta=1e-14)

    def test_says_what_is_wrong(self):
        self.expect(2, "inverse", self.a, "--pattern", self.a, says="--out")
        self.expect(2, "inverse", self.a, "--out", self.a)
        small = self.file("S.mtx", coordinate(3, [(1, 1, 1.0)], "general"))
        self.expect(2, "inverse", self.a, "--trace", small, says="B has 3 rows and 3 columns")
        c = self.file("C.mtx", "%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 2 1\n")
        self.expect(2, "inverse", small, "--trace", c, says="complex")
        free = self.file("F.mtx", coordinate(3, [(1, 1, 1.0), (2, 1, -1.0), (2, 2, 1.0), (3, 3, 1.0)], "symmetric"))
        for words in ([], ["--singular", "report"]):
            self.expect(3, "inverse", free, *words, says="rank is 2 of 3")


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
