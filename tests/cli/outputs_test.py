#!/usr/bin/env python3
"""Black-box tests of what the binary writes: outputs that cannot be, full disks, names given twice. The truth is what
lies in the folder afterwards."""

import fcntl
import json
import os
import pathlib
import resource
import signal
import stat
import subprocess
import threading
import time
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
        for name in ("n" * 256, "n" * 5000):  # longer than file systems take; temporary names are shorter
            result = self.expect(2, "solve", "absent", "--out", self.folder / name, says="File name too long")
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

    def test_links_stay_links(self):
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        (self.folder / "far").mkdir()
        for name in ("there", "new"):
            link = self.folder / f"to_{name}"
            os.symlink(pathlib.Path("far") / name, link)
            self.expect(0, "solve", matrix, "--out", link)
            self.assertTrue(link.is_symlink())
            self.assertIn("\n1 1\n1\n", (self.folder / "far" / name).read_text())

    def test_standard_output_by_its_name(self):
        # Through a link of our own: where the old program renamed a file over /dev/stdout, it is this link that goes.
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        link = self.folder / "stdout"
        os.symlink("/proc/self/fd/1", link)
        piped = self.expect(0, "solve", matrix, "--out", link)
        self.assertTrue(link.is_symlink())
        self.assertTrue(piped.stdout.startswith("%%MatrixMarket"), piped.stdout)
        self.assertIn("solved", piped.stdout)
        log = self.folder / "log"
        with open(log, "w") as file:
            file.write("before\n")
            file.flush()
            subprocess.run([BINARY, "solve", matrix, "--out", link], stdout=file, stderr=subprocess.DEVNULL, timeout=60,
                           check=True)
        text = log.read_text()
        self.assertTrue(text.startswith("before\n%%MatrixMarket"), text)
        self.assertIn("solved", text)

    def test_pipes_and_devices(self):
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        pipe = self.folder / "pipe"
        os.mkfifo(pipe)
        received = []
        reader = threading.Thread(target=lambda: received.append(pipe.read_text()))
        reader.start()
        self.expect(0, "solve", matrix, "--out", pipe)
        reader.join(timeout=30)
        self.assertIn("\n1 1\n1\n", received[0])
        self.assertTrue(stat.S_ISFIFO(os.lstat(pipe).st_mode))
        full = self.folder / "full"
        os.symlink("/dev/full", full)
        self.expect(2, "solve", matrix, "--out", full, says="No space left")
        self.assertTrue(full.is_symlink())

    def test_one_file_under_two_names_that_is_not_there_yet(self):
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        os.symlink("o.x", self.folder / "l")
        (self.folder / "d").mkdir()
        for first, second in (("o.x", "./o.x"), ("o.x", self.folder / "o.x"), ("d/../o.x", "o.x"), ("l", "o.x")):
            with self.subTest(first=first, second=second):
                result = self.run_cli("solve", matrix, "--out", first, "--report", second, cwd=self.folder)
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertIn("give another name", result.stderr)
        self.assertEqual({p.name for p in self.folder.iterdir()}, {"a.mtx", "l", "d"})

    def test_folders_are_no_files(self):
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        for option in ("--out", "--report"):
            self.expect(2, "solve", matrix, option, self.folder, says=(option, "irectory"))

    def test_progress_that_cannot_be_written_ends_nothing(self):
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        out = self.folder / "x.mtx"
        reader, writer = os.pipe()
        os.close(reader)
        streams = (os.open("/dev/full", os.O_WRONLY), writer)
        for stderr in streams:
            for more in ([], ["-v"]):
                subprocess.run([BINARY, "solve", matrix, "--out", out, *more], stdout=subprocess.DEVNULL, stderr=stderr,
                               timeout=60, check=True)
                self.assertIn("\n1 1\n1\n", out.read_text())
                out.unlink()
        for stream in streams:
            os.close(stream)
        # Closed: its number must not go to the next file that is opened.
        for closed, code in ((2, 0), (1, 2), (0, 0)):
            result = subprocess.run(f"exec {BINARY} solve {matrix} -v --out {out} {closed}>&-", shell=True, timeout=60,
                                    capture_output=True, check=False)
            self.assertEqual(result.returncode, code, result.stderr)
            self.assertRegex(out.read_text(), r"(?s)^%%MatrixMarket[^\n]*\n%[^\n]*\n1 1\n1\n$")
            out.unlink()

    def test_a_reader_that_goes_away(self):
        for arguments in (["info", "--json"], ["--help"], ["fetch-matrix", "--list"]):
            reader, writer = os.pipe()
            os.close(reader)
            result = subprocess.run([BINARY, *arguments], stdout=writer, stderr=subprocess.PIPE, text=True, timeout=60,
                                    check=False)
            os.close(writer)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn("standard output: Broken pipe", result.stderr)

    def test_what_a_killed_run_left_is_cleaned_up(self):
        target = self.folder / "big.mtx"
        process = subprocess.Popen([BINARY, "generate", "poisson", "60", "60", "60", "--out", target],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        part = self.folder / "big.mtx.espalier.part"
        for _ in range(3000):
            if part.exists() and part.stat().st_size > 0 or process.poll() is not None:
                break
            time.sleep(0.002)
        process.kill()
        process.wait()
        if not part.exists():
            part.write_text("the machine was faster than this test")
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        with open(part) as file:  # somebody writes it: stays
            fcntl.flock(file, fcntl.LOCK_EX)
            self.expect(0, "solve", matrix, "--out", target)
            self.assertTrue(part.exists())
        self.expect(0, "solve", matrix, "--out", target)
        self.assertIn("\n1 1\n1\n", target.read_text())
        self.assertEqual({p.name for p in self.folder.iterdir()}, {"a.mtx", "big.mtx"})

    def test_full_standard_output(self):
        for arguments in (["info", "--json"], ["--help"], ["--version"], ["solve", "--help"]):
            with open("/dev/full", "w") as full:
                result = subprocess.run([BINARY, *arguments], stdout=full, stderr=subprocess.PIPE, text=True,
                                        timeout=60, check=False)
            self.assertEqual(result.returncode, 2)
            self.assertIn("standard output", result.stderr)


if __name__ == "__main__":
    unittest.main()
