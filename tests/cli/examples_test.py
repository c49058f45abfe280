#!/usr/bin/env python3
"""Black-box tests of `espalier examples`. ESPALIER_BINARY: the program."""
import pathlib
import shutil
import subprocess
import unittest

from cli_test import BINARY, Cli

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Examples(Cli):
    """The models that belong to the binary: of the source folder, or of the folder that it was put into."""

    def test_all_are_listed_with_what_they_are(self):
        lines = self.expect(0, "examples").stdout
        for model in [*ROOT.glob("models/*.toml"), *ROOT.glob("examples/*.toml")]:
            self.assertRegex(lines, rf"(?m)^ +{model.stem} +\w.{{20}}")
        self.assertNotIn("wheelset", lines)  # its mesh is not there

    def test_the_path_of_one_can_be_simulated(self):
        path = self.expect(0, "examples", "pendulum").stdout.strip()
        self.assertEqual(pathlib.Path(path), ROOT / "examples/pendulum.toml")
        self.expect(0, "simulate", path, "--until", "0.01", "--quiet")

    def test_copies_replace_nothing(self):
        folder = self.folder / "new" / "er"
        self.expect(0, "examples", "engine", "--copy", folder)
        self.assertEqual((folder / "engine.toml").read_bytes(), (ROOT / "models/engine.toml").read_bytes())
        (folder / "engine.toml").write_text("mine")
        self.expect(2, "examples", "engine", "--copy", folder, says="is there already and is not replaced")
        self.assertEqual((folder / "engine.toml").read_text(), "mine")
        everything = self.folder / "all"
        self.expect(0, "examples", "--copy", everything)
        self.assertGreater(len(list(everything.glob("*.toml"))), 9)
        self.expect(2, "examples", "engine", "--copy", self.folder / "all" / "engine.toml", says="engine.toml")

    def test_an_unknown_name(self):
        self.expect(2, "examples", "engin", says="did you mean 'engine'?")
        self.expect(2, "examples", "../models/engine", says="there is no example")
        self.expect(2, "examples", "engine", "--copy", "", says="--copy")

    def test_wherever_the_binary_is_put(self):
        for folder in ("models", "share/espalier/models"):  # a Python package, an installation
            place = self.folder / folder.replace("/", "_")
            (place / "bin").mkdir(parents=True)
            (place / folder).mkdir(parents=True)
            shutil.copy(BINARY, place / "bin" / "espalier")
            (place / folder / "engine.toml").write_text("# Not the engine. Another one.\n")
            (place / folder / "two.toml").write_text("title = 'no comment'\n")
            done = subprocess.run([place / "bin" / "espalier", "examples"], capture_output=True, text=True)
            self.assertEqual([line.split() for line in done.stdout.splitlines()[:2]], [["engine", "Not", "the", "engine"], ["two"]])
        (self.folder / "alone").mkdir()
        shutil.copy(BINARY, self.folder / "alone" / "espalier")
        done = subprocess.run([self.folder / "alone" / "espalier", "examples"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn("are not beside it", done.stderr)


if __name__ == "__main__":
    unittest.main()
