#!/usr/bin/env python3
"""`espalier reduce`: the files that it writes, and what it refuses. Numbers are held by python/tests/models/test_reduced.py."""

import json
import sys
import unittest

from cli_test import Cli

ARM = """units = "SI"
[bodies.arm]
type = "solid"
mesh = { part = "block", lx = 0.4, ly = 0.04, lz = 0.03, divisions = [4, 1, 1] }
material = { young = 70e9, poisson = 0.33, density = 2700 }
[bodies.block]
type = "rigid"
mass = 1
box = [1, 1, 1]
[markers]
hub = { body = "arm", face = "x0" }
tip = { body = "arm", face = "x1" }
[joints]
weld = { type = "fixed", a = "block", b = "tip", pull = true }
"""


class Reduce(Cli):
    def setUp(self):
        super().setUp()
        self.model = self.file("arm.toml", ARM)

    def test_files_and_rows(self):
        stem = self.folder / "out"
        said = self.expect(0, "reduce", self.model, "arm", "--at", "hub", "--at", "weld.b", "--modes", 3, "--first-node", 11,
                           "--op4", "--op4-text", "--dmig", "--mtx", "--npz", "--out", stem).stdout
        self.assertIn("15 unknowns of 2 interfaces and 3 modes", said)
        for end in (".op4", "_text.op4", ".bdf", "_k.mtx", "_m.mtx", ".npz", ".json"):
            self.assertTrue(stem.with_name("out" + end).exists(), end)
        self.assertFalse(stem.with_name("out_c.mtx").exists())
        rows = json.loads(stem.with_name("out.json").read_text())
        self.assertEqual([i["node"] for i in rows["interfaces"]], [11, 12])
        self.assertEqual(rows["unknowns"], [[n, c] for n in (11, 12) for c in range(1, 7)] + [[n, 0] for n in (13, 14, 15)])
        self.assertEqual(len(rows["files"]), 6)

    def test_joints_are_interfaces_by_themselves(self):
        self.expect(0, "reduce", self.model, "arm", "--modes", 2, "--npz", "--out", self.folder / "o", "-q")
        rows = json.loads((self.folder / "o.json").read_text())
        self.assertEqual(([i["name"] for i in rows["interfaces"]], rows["size"]), (["tip"], 8))

    def test_what_is_refused(self):
        for arguments, words in ((("arm",), "say which files"), (("block", "--npz"), "rigid"), (("arms", "--npz"), "did you mean 'arm'"),
                                 (("arm", "--npz", "--at", "hubb"), "unknown marker"), (("arm", "--npz", "--modes", "-1"), "--modes"),
                                 (("arm", "--npz", "--set", "bodies.arm.material.density=0"), "density"),
                                 (("arm", "--npz", "--out", "/nowhere/at/all"), "/nowhere")):
            self.expect(2, "reduce", self.model, *arguments, says=words)
        self.expect(2, "reduce", self.folder / "none.toml", "--npz", says="none.toml")


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
