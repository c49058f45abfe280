#!/usr/bin/env python3
"""How far a command is: the line on a terminal, and --json-progress."""

import fcntl
import json
import math
import os
import pty
import re
import signal
import struct
import subprocess
import termios
import time
import unittest

from cli_test import BINARY, Cli, coordinate, second_difference
from simulate_test import PENDULUM

FIELDS = {"what", "state", "phase", "done", "total", "unit", "seconds", "seconds_left", "inside", "elapsed"}


class JsonProgress(Cli):
    def lines(self, *arguments, code=0, what=None):
        """Of a command, checked: each parses, has all fields, and the last one alone says how it ended."""
        path = self.folder / "progress.jsonl"
        path.unlink(missing_ok=True)
        self.expect(code, *arguments, f"--json-progress={path}")
        text = path.read_text()
        self.assertTrue(text.endswith("\n"))
        lines = [json.loads(line) for line in text.splitlines()]
        self.check(lines, code, what or arguments[0])
        return lines

    def check(self, lines, code, what):
        done, last = {}, -1.0
        for line in lines:
            self.assertLessEqual(FIELDS, set(line))
            self.assertEqual(line["what"], what)
            self.assertGreaterEqual(line["elapsed"], last)
            last = line["elapsed"]
            if line["done"] is not None:
                self.assertGreaterEqual(line["done"], done.get(line["phase"], 0))
                done[line["phase"]] = line["done"]
                self.assertLessEqual(line["done"], line["total"] or math.inf)
        self.assertEqual([line["state"] for line in lines[:-1]], ["running"] * (len(lines) - 1))
        self.assertEqual(lines[-1]["state"], {0: "done", 130: "stopped"}.get(code, "failed"))
        self.assertEqual(lines[-1]["exit_code"], code)
        self.assertEqual(lines[-1]["message"] == "", code == 0)
        # At most five a second, but for the first and the last one.
        self.assertLessEqual(len(lines), 3 + 5 * lines[-1]["elapsed"])

    def pencil(self, n=40):
        return (self.file("K.mtx", coordinate(n, second_difference(n), "symmetric")),
                self.file("M.mtx", coordinate(n, [(i, i, 1.0) for i in range(1, n + 1)], "symmetric")))

    def test_every_command_that_computes(self):
        k, m = self.pencil()
        model = self.file("m.toml", PENDULUM)
        for arguments in (["solve", "--generate", "elasticity 4 4 4"], ["analyze", "--generate", "elasticity 4 4 4"],
                          ["condense", k, "--unknowns", "0"], ["modes", k, m, "--count", 3],
                          ["harmonic", k, m, "--at", 0, "--from", 0.01, "--to", 0.02, "--points", 3],
                          ["modes", model, "--over", "gravity.2=-9.81:-9.80:0.01"], ["simulate", model]):
            with self.subTest(arguments=arguments):
                self.assertGreaterEqual(len(self.lines(*arguments)), 2)

    def test_of_a_simulation(self):
        lines = self.lines("simulate", self.file("m.toml", PENDULUM))
        self.assertEqual((lines[-1]["phase"], lines[-1]["unit"]), ("motion", "time"))
        self.assertGreater(lines[-1]["steps"], 0)
        self.assertGreater(lines[-1]["newton"], 0)
        self.assertGreater(lines[-1]["time"], 0)

    def test_of_a_factorization_that_is_stopped(self):
        # As long as the reader likes: he stops it when a factorization has told how far it is.
        to_read, to_write = os.pipe()
        process = subprocess.Popen([BINARY, "solve", "--generate", "elasticity 20 20 20", "--refactor", "1000000", "--threads", "1", "-q",
                                    f"--json-progress-fd={to_write}"], pass_fds=[to_write], stdin=subprocess.DEVNULL,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        os.close(to_write)
        lines, asked = [], False  # once: a second signal ends the process at once
        with os.fdopen(to_read) as pipe:
            for text in pipe:
                lines.append(json.loads(text))
                line = lines[-1]
                if not asked and line["phase"] == "factorization" and line["total"] and 0 < line["done"] < line["total"]:
                    process.send_signal(signal.SIGINT)
                    asked = True
        out, err = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, err)
        self.assertEqual((lines[-1]["state"], lines[-1]["exit_code"]), ("stopped", 130))
        told = [line for line in lines if line["phase"] == "factorization" and line["total"]]
        self.assertTrue(told)
        self.assertEqual({line["unit"] for line in told}, {"flops"})
        for line in told:
            self.assertTrue(line["seconds_left"] is None or line["seconds_left"] >= 0)

    def test_errors_end_with_a_line(self):
        singular = self.file("s.mtx", coordinate(2, [(1, 1, 1.0)], "symmetric"))
        lines = self.lines("solve", singular, "--kind", "ldlt", code=3)
        self.assertIn("singular", lines[-1]["message"])
        empty = self.file("e.mtx", coordinate(0, []))
        self.lines("solve", empty, code=2)
        nan = self.file("n.mtx", coordinate(1, [(1, 1, "nan")]))
        self.lines("solve", nan, code=2)
        model = self.file("m.toml", PENDULUM.replace('type = "', 'type = "x', 1))
        self.lines("simulate", model, code=2)

    def test_where_it_cannot_be_written(self):
        solve = ["solve", "--generate", "elasticity 3 3 3"]
        self.expect(2, *solve, "--json-progress=/proc/none/a", says="--json-progress")
        self.expect(2, *solve, "--json-progress-fd=77", says="not open for writing")
        self.expect(2, *solve, "--json-progress-fd=2", "--json-progress", says="give one of them")
        self.expect(0, *solve, "--json-progress=/dev/full")  # nobody reads along, and the work is none the worse
        result = self.expect(0, *solve, "-q", "--json-progress")
        self.assertEqual(result.stdout, "")
        self.check([json.loads(line) for line in result.stderr.splitlines()], 0, "solve")
        to_read, to_write = os.pipe()
        os.close(to_read)
        self.expect(0, *solve, f"--json-progress-fd={to_write}", pass_fds=[to_write])
        os.close(to_write)


class ProgressLine(Cli):
    def start(self, *arguments, **env):
        leader, follower = pty.openpty()
        fcntl.ioctl(leader, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
        process = subprocess.Popen([BINARY, "solve", "--generate", "elasticity 14 14 14", "--refactor", "1000000", *arguments],
                                   stdout=subprocess.DEVNULL, stderr=follower, stdin=subprocess.DEVNULL,
                                   env={**os.environ, "TERM": "xterm", "NO_COLOR": "", **env})
        os.close(follower)
        self.addCleanup(os.close, leader)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return leader, process

    @staticmethod
    def read_until(leader, wanted, seconds):
        text, end = "", time.monotonic() + seconds
        while not wanted(text) and time.monotonic() < end:
            text += os.read(leader, 65536).decode()
        return text

    def test_a_line_that_is_rewritten(self):
        leader, process = self.start()
        painted = re.compile(r"\r\x1b\[K(factorization  \[[= ]{20}\] +\d+ %  [^\r\n]*)")
        text = self.read_until(leader, painted.search, 60)
        self.assertRegex(text, painted)
        self.assertIn("to go", painted.search(text)[1])
        fcntl.ioctl(leader, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 20, 0, 0))  # a resize in the middle
        process.send_signal(signal.SIGWINCH)
        narrow = re.compile(r"\r\x1b\[K([^\r\n\x1b]{1,19})(?=\r)")
        text = self.read_until(leader, lambda t: len(narrow.findall(t)) > 3, 60)
        self.assertGreater(len(narrow.findall(text)), 3)
        self.assertIsNone(process.poll())

    def test_where_nobody_wants_it(self):
        processes = [self.start("-q")[:2], self.start(TERM="dumb")[:2]]
        time.sleep(2.5)
        for leader, process in processes:
            process.kill()
            text = ""
            try:
                while piece := os.read(leader, 65536).decode():
                    text += piece
            except OSError:  # nobody writes any more
                pass
            self.assertNotIn("\x1b", text)
            self.assertNotIn("%", text)


if __name__ == "__main__":
    unittest.main()
