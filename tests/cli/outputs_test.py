#!/usr/bin/env python3
"""Black-box tests of what the binary writes: outputs that cannot be, full disks, names given twice. The truth is what
lies in the folder afterwards."""

import json
import os
import pathlib
import resource
import signal
import subprocess
import unittest

from cli_test import BINARY, Cli, coordinate, second_difference


class Outputs(Cli):
    def test_outputs_that_cannot_be_written(self):
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        for option in ("--out", "--report", "--trace"):
            self.expect(2, "solve", matrix, option, self.folder / "no" / "such.file", says="such.file")

    def test_outputs_are_tried_before_the_work(self):
        for command in (["solve", "--out"], ["analyze", "--save"], ["analyze", "--report"], ["simulate", "--report"]):
            result = self.expect(2, command[0], "absent", command[1], self.folder / "no" / "x", says=(command[1], "no/x"))
            self.assertNotIn("absent", result.stderr)
        bench = self.expect(2, "bench", "peers", "--out", self.folder / "no" / "x.json", says="--out")
        self.assertEqual(bench.stdout, "")
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_outputs_must_not_replace_inputs_or_each_other(self):
        text = coordinate(1, [(1, 1, 1.0)])
        matrix = self.file("a.mtx", text)
        os.symlink(matrix, self.folder / "link.mtx")
        rhs = self.file("b.mtx", "%%MatrixMarket matrix array real general\n1 1\n1\n")
        for arguments in ((matrix, "--out", matrix), (matrix, "--out", self.folder / "." / "a.mtx"),
                          (matrix, "--report", self.folder / "link.mtx"), (matrix, "--rhs", rhs, "--out", rhs),
                          (matrix, "--out", self.folder / "x", "--report", self.folder / "x")):
            with self.subTest(arguments=arguments):
                self.expect(2, "solve", *arguments, says="give another name")
        self.assertEqual(pathlib.Path(matrix).read_text(), text)
        self.expect(0, "solve", matrix, "--out", "/dev/null", "--report", "/dev/null")

    def test_empty_names_are_not_none(self):
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        for option in ("--out", "--rhs", "--report", "--trace", "--analysis"):
            self.expect(2, "solve", matrix, option, "", says=(option, "name is empty"))

    def test_results_are_shown_even_if_the_report_cannot_be_written(self):
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        result = self.expect(2, "solve", matrix, "--json", "--report", "/dev/full", says="No space left")
        self.assertEqual(json.loads(result.stdout)["status"], "ok")

    def test_a_closed_pipe_does_not_take_the_report_along(self):
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        report = self.folder / "r.json"
        reader, writer = os.pipe()
        os.close(reader)
        with os.fdopen(writer, "w") as closed:
            subprocess.run([BINARY, "solve", matrix, "--report", report], stdout=closed, stderr=subprocess.DEVNULL,
                           timeout=60, check=False)
        self.assertEqual(json.loads(report.read_text())["status"], "ok")

    def test_a_file_that_breaks_off_leaves_the_one_before(self):
        # A limit on the size of files stands for a disk that is full.
        def limit():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (128, 128))
        matrix = self.file("a.mtx", coordinate(999, second_difference(999)))
        for command, option in (("solve", "--out"), ("solve", "--trace"), ("analyze", "--save")):
            with self.subTest(option=option):
                target = self.file("kept", "what was there before")
                result = self.run_cli(command, matrix, option, target, preexec_fn=limit)
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertIn("File too large", result.stderr)
                self.assertEqual(pathlib.Path(target).read_text(), "what was there before")
                self.assertEqual({p.name for p in self.folder.iterdir()}, {"a.mtx", "kept"})

    def test_full_standard_output(self):
        for arguments in (["info", "--json"], ["--help"], ["--version"], ["solve", "--help"]):
            with open("/dev/full", "w") as full:
                result = subprocess.run([BINARY, *arguments], stdout=full, stderr=subprocess.PIPE, text=True,
                                        timeout=60, check=False)
            self.assertEqual(result.returncode, 2)
            self.assertIn("standard output", result.stderr)


if __name__ == "__main__":
    unittest.main()
