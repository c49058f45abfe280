#!/usr/bin/env python3
"""Runs that are killed, restarted, or given restart files that do not fit. The truth is an undisturbed run: the same
bytes in every file of results."""

import json
import os
import pathlib
import random
import re
import resource
import shutil
import signal
import subprocess
import time
import unittest

from cli_test import BINARY, Cli

ENGINE = pathlib.Path(__file__).resolve().parents[2] / "models/engine.toml"

# Two bodies, a flexible one with pictures among them; some 600 steps, a restart file every 20 or so.
MODEL = """title = "a block on a pendulum"
gravity = [0, 0, -10]
[bodies.bob]
type = "rigid"
mass = 2
inertia = [1e-2, 1e-2, 1e-2]
position = [-0.5, 0, 0]
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.2, lz = 0.2, divisions = [4, 1, 1] }
material = { young = 1e6, poisson = 0.3, density = 1000 }
damping = { stiffness = 0.01 }
[joints.hinge]
type = "revolute"
axis = [0, 1, 0]
bodies = ["ground", "bob"]
at = [-1, 0, 0]
[joints.weld]
type = "fixed"
a = { body = "bob", point = [0.5, 0, 0] }
b = { body = "block", face = "x0" }
[integrator]
max_order = 2
relative = 1e-3
absolute = 1e-5
max_step = 1e-3
end = 0.6
[output]
vtu_interval = 0.05
restart_interval = 0.02
quantities = ["block.position", "bob.velocity.z"]
"""


class Restart(Cli):
    def setUp(self):
        super().setUp()
        self.model = self.file("model.toml", MODEL)
        self.out = self.folder / "out"

    def simulate(self, *arguments, code=0, says=()):
        return self.expect(code, "simulate", self.model, "--threads", 1, *arguments, says=says)

    def go_on(self, *arguments, **more):
        return self.simulate("--out", self.out, "--restart", self.out / "state.restart", *arguments, **more)

    def kill_after(self, seconds, *arguments, steps=0):
        """Starts a run and kills it (kill -9) after a time, or after so many steps; returns whether it was running."""
        process = subprocess.Popen([BINARY, "simulate", self.model, "--threads", "1", "--out", self.out, "-v",
                                    *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if steps:
            for line in process.stderr:
                if re.match(rf"\s*[0-9]+\s+[0-9.e-]+\s", line):
                    steps -= 1
                if steps == 0:
                    break
        else:
            time.sleep(seconds)
        running = process.poll() is None
        if not running:
            self.assertEqual(process.returncode, 0)
        process.send_signal(signal.SIGKILL)
        process.stderr.close()
        process.wait()
        return running

    def results(self, folder):
        """All files of a run by name; of the summary, what does not tell the time of day."""
        files = {p.name: p.read_bytes() for p in folder.iterdir()}
        summary = json.loads(files.pop("summary.json"))
        files.pop("index.html", None)  # tells the time of day, and begins where the run was restarted
        files["values"] = json.dumps([summary["values"], summary["energy"]["end"], summary["integrator"]])
        return files

    def expect_results(self, expected):
        results = self.results(self.out)
        self.assertEqual(sorted(results), sorted(expected))
        for name, content in results.items():
            self.assertEqual(content, expected[name], name)

    def test_killed_at_any_time_and_restarted_is_the_undisturbed_run(self):
        for style in ("vtkhdf", "vtu"):
            with self.subTest(format=style):
                self.model = self.file(f"{style}.toml", MODEL + f'format = "{style}"\n')
                self.out = self.folder / style
                self.killed_and_restarted(self.folder / f"whole_{style}", {"vtkhdf": "results.vtkhdf", "vtu": "motion_0_000005.vtu"}[style])

    def killed_and_restarted(self, whole, pictures):
        started = time.monotonic()
        self.simulate("--out", whole)
        duration = time.monotonic() - started
        expected = self.results(whole)
        self.assertIn(pictures, expected)
        rng = random.Random(15)
        kills = int(os.environ.get("ESPALIER_KILLS", "4"))
        killed = ended = 0
        while killed < kills and ended <= kills:
            restart = ["--restart", self.out / "state.restart"] if (self.out / "state.restart").exists() else []
            if self.kill_after(rng.uniform(0, 0.4 * duration), *restart):
                killed += 1
            else:  # it was faster and reached the end: the next one begins anew
                ended += 1
                self.expect_results(expected)
                shutil.rmtree(self.out)
        self.assertEqual(killed, kills, f"{ended} runs ended before they could be killed")
        if not (self.out / "state.restart").exists():
            self.kill_after(0, steps=100)
        self.go_on()
        self.expect_results(expected)

    def test_an_engine_that_began_in_equilibrium_goes_on_with_the_same_bytes(self):
        # The undisturbed run analysed its first matrix in the search for the equilibrium, the restarted one did not.
        self.model = ENGINE
        arguments = ["--until", 0.006, "--set", "output.restart_interval=0.001", "--set", "parameters.unknowns=500"]
        whole = self.folder / "whole"
        self.simulate("--out", whole, *arguments)
        while not (self.out / "state.restart").exists():
            self.kill_after(0, *arguments, steps=60)
        self.go_on(*arguments)
        self.expect_results(self.results(whole))

    def test_a_restart_that_dies_early_keeps_the_history(self):
        for style, name in (("vtkhdf", "results.vtkhdf"), ("vtu", "motion.pvd")):
            with self.subTest(format=style):
                self.model = self.file(f"{style}.toml", MODEL + f'format = "{style}"\n')
                self.out = self.folder / style
                self.dies_early(name)

    def dies_early(self, pictures):
        self.simulate("--out", self.out, "--until", 0.2)
        shutil.copy(self.out / "state.restart", self.folder / "early.restart")
        self.go_on()
        csv = (self.out / "quantities.csv").read_text()
        series = (self.out / pictures).read_bytes()
        self.kill_after(0, "--restart", self.folder / "early.restart", steps=3)
        self.assertEqual((self.out / "quantities.csv").read_text(), csv)
        self.assertEqual((self.out / pictures).read_bytes(), series)
        self.kill_after(0, "--restart", self.folder / "early.restart", steps=50)
        times = [float(line.split(",")[0]) for line in (self.out / "quantities.csv").read_text().splitlines()[1:]]
        self.assertEqual(times, sorted(set(times)))
        self.assertEqual(len(times), len(csv.splitlines()) - 1)
        self.assertGreater((self.out / pictures).stat().st_size, 0.9 * len(series))  # the later ones are in it
        self.go_on()
        self.assertEqual((self.out / "quantities.csv").read_text(), csv)
        self.assertEqual((self.out / pictures).read_bytes(), series)

    def test_a_line_that_was_cut_off_is_no_row(self):
        self.simulate("--out", self.out, "--until", 0.1)
        csv = self.out / "quantities.csv"
        rows = csv.read_text()
        for tail in ("0.3", "0.3,1,2", "\0\0\0\0"):
            csv.write_text(rows + tail)
            self.go_on("--until", 0.1)
            self.assertEqual(csv.read_text(), rows)

    def test_killed_after_the_last_restart_file(self):
        self.simulate("--out", self.out)
        expected = self.results(self.out)
        (self.out / "summary.json").unlink()
        self.go_on()
        self.assertEqual(self.results(self.out), expected)
        self.go_on("--until", 0.5, code=2, says="later --until")

    def test_changes_of_the_model_are_listed(self):
        self.simulate("--out", self.out, "--until", 0.05)
        changed = ["--set", "bodies.bob.mass=3", "--set", "bodies.block.material.young=2e6", "--until", 0.06]
        refused = self.go_on(*changed, code=2, says=("bodies.bob.mass: 2 then, 3 now", "material.young: 1000000 then"))
        self.assertNotIn("poisson", refused.stderr)
        accepted = self.go_on(*changed, "--accept-changes", "--json")
        self.assertIn("accepted: bodies.bob.mass: 2 then, 3 now", json.loads(accepted.stdout)["system"]["notices"])
        # What is written, and until when, is not the model.
        self.go_on("--set", "bodies.bob.mass=3", "--set", "bodies.block.material.young=2e6", "--until", 0.07,
                   "--set", "output.vtu_interval=0.01", "--set", "title=other")

    def test_flipped_bits_are_seen(self):
        self.simulate("--out", self.out, "--until", 0.01)
        state = self.out / "state.restart"
        content = state.read_bytes()
        rng = random.Random(300)
        for _ in range(40):
            bit = rng.randrange(8 * len(content))
            damaged = bytearray(content)
            damaged[bit // 8] ^= 1 << bit % 8
            state.write_bytes(damaged)
            self.go_on("--until", 0.02, code=2, says="state.restart")

    def test_progress_that_cannot_be_written_ends_nothing(self):
        reader, writer = os.pipe()
        os.close(reader)
        with open("/dev/full", "w") as full, os.fdopen(writer, "w") as closed:
            for stderr in (full, closed):
                subprocess.run([BINARY, "simulate", self.model, "-v", "--until", "0.02", "--out", self.out],
                               stdout=subprocess.DEVNULL, stderr=stderr, timeout=60, check=True)
                self.assertEqual(json.loads((self.out / "summary.json").read_text())["status"], "ok")

    def test_the_report_must_not_replace_results(self):
        self.simulate("--out", self.out, "--until", 0.01)
        for name in ("quantities.csv", "state.restart", "results.vtkhdf", "motion.pvd"):
            self.simulate("--out", self.out, "--report", self.out / name, code=2, says=("--report", name))

    def test_a_folder_that_cannot_be_written(self):
        self.out.mkdir()
        os.symlink("/dev/full", self.out / "state.restart")
        self.simulate("--out", self.out, "--until", 0.01, code=2, says="No space left")
        self.assertTrue((self.out / "state.restart").is_symlink())

    def test_a_full_disk_promises_no_restart_file_that_is_not_there(self):
        # A limit on the size of files stands for a disk that is full: of the table's first kilobytes, of anything.
        def limit():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
        result = self.run_cli("simulate", self.model, "--threads", 1, "--out", self.out, "--set",
                              "output.vtu_interval=false", "--set", "output.restart_interval=false", preexec_fn=limit)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("quantities.csv: writing failed", result.stderr)
        self.assertNotIn("state.restart", result.stderr)
        self.assertEqual({p.name for p in self.out.iterdir()}, {"quantities.csv"})

    def test_a_folder_that_goes_away(self):
        process = subprocess.Popen([BINARY, "simulate", self.model, "--threads", "1", "--out", self.out, "-v"],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        steps = 0
        for line in process.stderr:
            steps += bool(re.match(r"\s*[0-9]+\s+[0-9.e-]+\s", line))
            if steps == 20:
                break
        self.out.rename(self.folder / "elsewhere")
        said = process.stderr.read()
        process.stderr.close()
        self.assertEqual(process.wait(), 2, said)
        self.assertIn("No such file or directory", said)
        for promise in ("the last state is in", "its content is in"):
            self.assertNotIn(promise, said)


if __name__ == "__main__":
    unittest.main()
