#!/usr/bin/env python3
"""Black-box tests of `espalier simulate`: exit codes, files that other programs read, Ctrl-C, restart."""

import csv
import json
import math
import pathlib
import re
import resource
import signal
import struct
import subprocess
import time
import unittest
import xml.etree.ElementTree as xml

from cli_test import BINARY, Cli

ROOT = pathlib.Path(__file__).resolve().parents[2]

PENDULUM = """title = "a pendulum"
gravity = [0, -10, 0]
[parameters]
length = 1
[bodies.bob]
type = "rigid"
mass = 2
inertia = [1e-3, 1e-3, 1e-3]
position = ["length", 0, 0]
[joints.hinge]
type = "revolute"
bodies = ["ground", "bob"]
at = [0, 0, 0]
axis = [0, 0, 1]
[integrator]
end = 1
[output]
quantities = ["bob.position", "hinge.force.y"]
vtu_interval = 0.25
"""

# A flexible block that hangs on one face, and swings.
BLOCK = """gravity = [0, 0, -10]
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.2, lz = 0.2, divisions = [6, 2, 2] }
material = { young = 1e6, poisson = 0.3, density = 1000 }
damping = { stiffness = 0.01 }
[joints.wall]
type = "fixed"
a = { body = "ground", point = [0, 0.1, 0.1] }
b = { body = "block", face = "x0" }
[integrator]
max_order = 2
relative = 1e-3
absolute = 1e-5
end = 0.2
[output]
vtu_interval = 0.05
quantities = ["block.position.z", "wall.force.z"]
"""


def read_vtu(path):
    """The arrays of one of our .vtu files by name: raw appended data with 64-bit sizes."""
    data = path.read_bytes()
    head, tail = data.split(b'<AppendedData encoding="raw">\n_', 1)
    tree = xml.fromstring(head + b"</VTKFile>")
    arrays = {}
    for array in tree.iter("DataArray"):
        offset = int(array.get("offset"))
        size = struct.unpack_from("<Q", tail, offset)[0]
        code = {"Float64": "d", "Int64": "q", "UInt8": "B"}[array.get("type")]
        count = size // struct.calcsize(code)
        arrays[array.get("Name")] = struct.unpack_from(f"<{count}{code}", tail, offset + 8)
    piece = tree.find(".//Piece")
    return int(piece.get("NumberOfPoints")), int(piece.get("NumberOfCells")), arrays


class Simulate(Cli):
    def model(self, text, name="model.toml"):
        return self.file(name, text)

    def report(self, text, *arguments, code=0):
        result = self.expect(code, "simulate", self.model(text), "--json", *arguments)
        return json.loads(result.stdout)

    def rows(self, folder):
        with open(folder / "quantities.csv", newline="") as file:
            return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]

    def test_report_has_the_documented_fields(self):
        report = self.report(PENDULUM)
        for path in ("espalier", "status", "message", "exit_code", "model", "title", "system.bodies", "system.joints",
                     "system.forces", "system.velocities", "system.constraints", "system.degrees_of_freedom",
                     "system.redundant", "initial.position_change", "initial.velocity_change",
                     "initial.statics_iterations", "initial.modes", "time.begin", "time.end", "integrator.method",
                     "integrator.steps", "integrator.newton_iterations", "integrator.error_failures",
                     "integrator.newton_failures", "integrator.crossings", "counts.residuals", "counts.tangents",
                     "counts.analyses", "counts.factorizations", "counts.solves", "counts.refactor_first",
                     "counts.refactor_step", "counts.refactor_rate", "counts.refactor_failed", "seconds.setup",
                     "seconds.assembly", "seconds.analysis", "seconds.factorization", "seconds.solve", "seconds.output",
                     "seconds.other", "seconds.total", "constraints.position", "constraints.velocity",
                     "constraints.acceleration", "energy.begin.kinetic", "energy.end.potential", "energy.end.total",
                     "solver.kind", "solver.precision", "solver.device", "solver.nonzeros_factor", "solver.flops",
                     "solver.predicted_bytes", "solver.peak_bytes", "values", "files", "matrices_written"):
            value = report
            for key in path.split("."):
                self.assertIn(key, value, path)
                value = value[key]
        self.assertEqual(report["status"], "ok")
        self.assertEqual(report["time"], {"begin": 0, "end": 1})
        self.assertEqual(report["system"]["degrees_of_freedom"], 1)
        self.assertLess(report["constraints"]["position"], 1e-10)
        seconds = report["seconds"]
        parts = sum(value for key, value in seconds.items() if key != "total")
        self.assertAlmostEqual(parts, seconds["total"], delta=0.05 * seconds["total"] + 1e-3)

    def test_units_stand_in_the_results(self):
        folder = self.folder / "measured"
        report = self.report(PENDULUM, "--set", "units=SI", "--set", "bodies.bob.mass=3000 g", "--set", "parameters.length=20 cm",
                             "--set", "integrator.end=2 ms", "--out", str(folder))
        self.assertEqual(report["units"], "SI")
        self.assertAlmostEqual(report["energy"]["begin"]["potential"], 0)
        self.assertAlmostEqual(report["time"]["end"], 2e-3)
        self.assertAlmostEqual(self.rows(folder)[0]["bob.position.x"], 0.2)
        self.assertEqual(json.loads((folder / "summary.json").read_text())["units"], "SI")
        data = (folder / "results.vtkhdf").read_bytes()
        self.assertIn(b"Units", data)
        self.assertNotIn("units", self.report(PENDULUM))
        wrong = self.report(PENDULUM, "--set", "units=SI", "--set", "bodies.bob.mass=3 mm", code=2)
        self.assertIn("mass is expected, for instance in kg", wrong["message"])

    def test_statics_runs_without_an_end_and_writes_its_load_steps(self):
        text = PENDULUM.replace("[integrator]\nend = 1\n", "[statics]\nload = 2\n")
        out = self.folder / "statics"
        report = self.report(text, "--out", out)
        self.assertEqual(report["time"], {"begin": 0, "end": 2})
        self.assertEqual(report["integrator"]["method"], "statics")
        self.assertGreater(report["statics"]["steps"], 0)
        self.assertEqual(report["statics"]["critical"], [])
        self.assertEqual([pathlib.Path(name).name for name in report["files"]], ["quantities.csv", "results.vtkhdf", "index.html"])
        rows = self.rows(out)
        self.assertEqual([rows[0]["time"], rows[-1]["time"]], [0, 2])
        self.assertAlmostEqual(rows[-1]["bob.position.y"], -1, delta=1e-9)

    def test_csv_holds_the_motion(self):
        out = self.folder / "out"
        report = self.report(PENDULUM, "--out", out)
        rows = self.rows(out)
        self.assertEqual(rows[0]["time"], 0)
        self.assertEqual(rows[-1]["time"], 1)
        for row in rows:  # on the circle, which the joint holds to 1e-10
            self.assertAlmostEqual(math.hypot(row["bob.position.x"], row["bob.position.y"]), 1, delta=1e-9)
            self.assertEqual(row["energy.total"], row["energy.kinetic"] + row["energy.potential"])
        self.assertEqual(report["values"]["bob.position.x"], rows[-1]["bob.position.x"])
        self.assertEqual(json.loads((out / "summary.json").read_text())["values"], report["values"])
        self.assertEqual({pathlib.Path(f).name for f in report["files"]}, {"quantities.csv", "results.vtkhdf", "state.restart", "index.html"})

    def test_set_and_until(self):
        report = self.report(PENDULUM, "--set", "parameters.length=4", "--until", 0.5, "--set=output.quantities=[\"bob.position\"]")
        self.assertEqual(report["time"]["end"], 0.5)
        self.assertAlmostEqual(math.hypot(report["values"]["bob.position.x"], report["values"]["bob.position.y"]), 4, delta=1e-9)

    def test_series_for_paraview(self):
        out = self.folder / "out"
        self.report(BLOCK, "--out", out, "--set", "output.format=vtu")
        entries = list(xml.parse(out / "motion.pvd").getroot().iter("DataSet"))
        times = [float(entry.get("timestep")) for entry in entries]
        self.assertEqual(times[0], 0)
        self.assertEqual(times[-1], 0.2)
        self.assertGreaterEqual(len(times), 4)
        points, cells, arrays = read_vtu(out / entries[-1].get("file"))
        self.assertEqual((points, cells), (7 * 3 * 3, 6 * 2 * 2))
        self.assertEqual(len(arrays["displacement"]), 3 * points)
        self.assertEqual(len(arrays["velocity"]), 3 * points)
        self.assertEqual(set(arrays["types"]), {12})
        self.assertEqual(len(arrays["connectivity"]), 8 * cells)
        # It bends down: the free end more than the middle, and the stress is largest at the wall.
        tip = max(range(points), key=lambda k: arrays["Points"][3 * k])
        self.assertLess(arrays["displacement"][3 * tip + 2], -1e-3)
        worst = max(range(cells), key=lambda k: arrays["von_mises"][k])
        nodes = arrays["connectivity"][8 * worst:8 * worst + 8]
        self.assertLess(max(arrays["Points"][3 * k] for k in nodes), 0.4)

    def test_solver_options_reach_through(self):
        report = self.report(BLOCK, "--device", "host:2", "--threads", 2, "--precision", "mixed", "--until", 0.01)
        self.assertEqual(report["solver"]["precision"], "mixed")
        self.assertIn("host", report["solver"]["device"])
        self.assertEqual(report["solver"]["kind"], "lu")
        self.assertGreater(report["solver"]["nonzeros_factor"], 0)
        self.expect(4, "simulate", self.model(BLOCK), "--host-memory", "10k", says="needs")
        self.expect(5, "simulate", self.model(BLOCK), "--device", "gpu:7")

    def test_dumped_matrices_solve(self):
        dump = self.folder / "dump"
        report = self.report(BLOCK, "--dump-matrices", dump, "--dump-count", 3, "--until", 0.02)
        self.assertEqual(report["matrices_written"], 3)
        for number in (1, 3):
            a, b = dump / f"newton_{number:04}.mtx", dump / f"newton_{number:04}_rhs.mtx"
            solved = json.loads(self.expect(0, "solve", a, "--rhs", b, "--json").stdout)
            self.assertEqual(solved["matrix"]["rows"], report["system"]["velocities"] + report["system"]["constraints"])
            self.assertLess(solved["backward_error"]["normwise"], 1e-12)

    def test_restart_continues(self):
        whole, broken = self.folder / "whole", self.folder / "broken"
        text = PENDULUM + "restart_interval = 0.1\nformat = \"vtu\"\n"
        one = self.report(text, "--out", whole)
        self.report(text, "--out", broken, "--until", 0.6)
        two = self.report(text, "--out", broken, "--restart", broken / "state.restart")
        # The step that ends at 0.6 differs, so the same to the tolerance of the integrator, not to the bit.
        self.assertAlmostEqual(two["values"]["bob.position.x"], one["values"]["bob.position.x"], delta=1e-4)
        times = [row["time"] for row in self.rows(broken)]
        self.assertEqual(times, sorted(set(times)))
        self.assertIn(0.6, times)
        self.assertEqual(times[-1], 1)
        stamps = [float(e.get("timestep")) for e in xml.parse(broken / "motion.pvd").getroot().iter("DataSet")]
        self.assertEqual(stamps, sorted(set(stamps)))

    def test_ctrl_c_and_sigterm_stop_cleanly(self):
        for sent in (signal.SIGINT, signal.SIGTERM):
            with self.subTest(signal=sent):
                self.stop_cleanly(sent, self.folder / sent.name)

    def stop_cleanly(self, sent, out):
        text = PENDULUM.replace("end = 1", "end = 1e6\nmax_step = 1e-3").replace("vtu_interval = 0.25", "csv_interval = 10")
        process = subprocess.Popen([BINARY, "simulate", self.model(text), "--out", out], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        for _ in range(200):  # until the run has begun
            time.sleep(0.05)
            if (out / "quantities.csv").exists():
                break
        time.sleep(0.3)
        self.expect(2, "simulate", self.model(PENDULUM, "other.toml"), "--out", out, says="another run is writing")
        process.send_signal(sent)
        stdout, stderr = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, stderr)
        self.assertIn("stopped at t = ", stderr)
        summary = json.loads((out / "summary.json").read_text())
        self.assertEqual((summary["status"], summary["exit_code"]), ("interrupted", 130))
        self.assertGreater(summary["time"]["end"], 0)
        until = summary["time"]["end"] + 0.1
        again = self.report(text, "--out", out, "--restart", out / "state.restart", "--until", until)
        self.assertEqual(again["time"], {"begin": summary["time"]["end"], "end": until})

    def test_mistakes_are_2_and_say_where(self):
        for old, new, says in (("mass = 2", "mass = 0", ("model.toml:7", "greater than 0")),
                               ('"revolute"', '"revolt"', ("model.toml:11", "did you mean 'revolute'")),
                               ("end = 1", "end = nan", ("model.toml:16", "finite")),
                               ("at = [0, 0, 0]", "att = [0, 0, 0]", ("att", "did you mean 'at'")),
                               ("title = ", "title ", ("model.toml:1",))):
            with self.subTest(new=new):
                self.expect(2, "simulate", self.model(PENDULUM.replace(old, new)), says=says)
        self.expect(2, "simulate", self.folder / "none.toml", says="none.toml")
        self.expect(2, "simulate", self.model(PENDULUM), "--set", "parameters.lenght=2,", says="--set")
        self.expect(2, "simulate", self.model(PENDULUM), "--restart", self.folder / "none", says="none: cannot be read")
        for until in (-1, 0, "nan", "inf"):
            self.expect(2, "simulate", self.model(PENDULUM), "--until", until, says="later than the start")
        self.expect(2, "simulate", self.model(PENDULUM), "--until", "soon", says=("--until", "'soon' is not a number"))
        self.expect(2, "simulate", self.model(PENDULUM), "--patience", "soon", says=("--patience", "'soon' is not a number above 0"))
        self.expect(2, "simulate", self.folder, says="directory")
        self.expect(2, "simulate", self.model(PENDULUM), "--out", self.file("a file", "x"), says="folder")

    def test_failure_on_the_way_names_time_and_keeps_the_state(self):
        # A bar is pulled beyond its length: the constraints can no longer be met.
        text = PENDULUM.replace("[integrator]", """[joints.pull]
type = "prescribed"
direction = "x"
a = { body = "ground" }
b = { body = "bob" }
motion = "cos(1) + t - 0.5403023058681398 + 0.2"
[integrator]""").replace('position = ["length", 0, 0]', 'position = [0.2, -0.9797958971132712, 0]')
        out = self.folder / "out"
        result = self.expect(6, "simulate", self.model(text), "--out", out)
        self.assertRegex(result.stderr, r"t = 0\.[78]")
        self.assertTrue((out / "state.restart").exists())
        self.assertEqual(json.loads((out / "summary.json").read_text())["exit_code"], 6)

    def test_a_full_disk_keeps_the_state(self):
        # A limit on the size of files stands for the disk: the table of results grows beyond it, the state does not.
        def limit():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))
        text = PENDULUM.replace("vtu_interval = 0.25", "").replace("end = 1", "end = 1\nmax_step = 1e-3")
        out = self.folder / "out"
        result = self.run_cli("simulate", self.model(text), "--out", out, preexec_fn=limit)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("is the disk full?", result.stderr)
        self.assertEqual({p.name for p in out.iterdir()}, {"quantities.csv", "state.restart", "summary.json"})
        self.assertEqual(self.report(text, "--restart", out / "state.restart", "--until", 0.5)["time"]["end"], 0.5)

    def test_steps_are_shown(self):
        result = self.expect(0, "simulate", self.model(PENDULUM), "-v")
        lines = result.stderr.splitlines()
        head = next(k for k, line in enumerate(lines) if re.match(r"\s+step\s+time\s+h\s+order\s+newton", line))
        steps = [line.split() for line in lines[head + 1:]]
        self.assertEqual([int(s[0]) for s in steps], list(range(1, len(steps) + 1)))
        self.assertEqual(float(steps[-1][1]), 1)
        for word in ("degree of freedom", "assembly", "factorization", "simulated", "bob.position.x"):
            self.assertIn(word, result.stdout)
        quiet = self.expect(0, "simulate", self.model(PENDULUM), "-q")
        self.assertEqual((quiet.stdout, quiet.stderr), ("", ""))

    def test_a_trace_has_the_steps(self):
        trace = self.folder / "trace.json"
        report = self.report(PENDULUM, "--trace", trace)
        names = [e["name"] for e in json.loads(trace.read_text())["traceEvents"] if e["ph"] == "X"]
        self.assertEqual(names.count("step"), report["integrator"]["steps"])
        self.assertEqual(names.count("forces"), report["counts"]["residuals"])
        broken = self.run_cli("simulate", self.model(PENDULUM), "--trace", self.folder / "none" / "trace.json")
        self.assertEqual(broken.returncode, 2)
        self.assertIn("trace.json", broken.stderr)

    def test_derivatives_of_a_motion_by_both_methods(self):
        model = self.model(PENDULUM)
        rows = {}
        for name, flags in (("forward", []), ("adjoint", ["--adjoint"])):
            out = self.folder / name
            self.expect(0, "simulate", model, "--derivative", "parameters.length", "--out", out, "-q", *flags)
            with open(out / "derivatives.csv", newline="") as f:
                rows[name] = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(f)]
        self.assertEqual(len(rows["adjoint"]), 1)
        for key, value in rows["adjoint"][0].items():
            self.assertAlmostEqual(value, rows["forward"][-1][key], delta=1e-6)
        self.expect(2, "simulate", model, "--adjoint")

    def test_the_example_of_the_documentation_runs(self):
        page = (ROOT / "docs" / "guide" / "simulate.md").read_text()
        example = next(block for block in re.findall(r"```toml\n(.*?)```", page, re.S) if "[integrator]" in block)
        report = self.report(example, "--until", 0.02)
        self.assertEqual(report["title"], "flexible pendulum")
        self.assertEqual(report["system"]["bodies"], 2)

    def test_models_of_the_repository_run(self):
        for name, until in (("engine", 5e-4), ("chain", 2e-3), ("rotor", 2e-3)):
            with self.subTest(model=name):
                result = self.expect(0, "simulate", ROOT / "models" / f"{name}.toml", "--until", until, "--json")
                report = json.loads(result.stdout)
                self.assertGreater(report["system"]["velocities"], 1000)
                self.assertEqual(report["system"]["redundant"], [])
                self.assertLess(report["constraints"]["position"], 1e-6)

    def test_gears_turn_against_their_brake(self):
        out = self.folder / "gears"
        pairs = ("flank=3", "across=2", "friction=0", "torque=1.2")
        arguments = [word for pair in pairs for word in ("--set", f"parameters.{pair}")]
        self.expect(0, "simulate", ROOT / "models" / "gears.toml", "--out", out, "-q", "--until", 1.2e-3, *arguments,
                    "--set", "output.vtu_interval=false")
        rows = self.rows(out)
        base = 0.001 * 27 * math.cos(math.radians(20))
        # At rest: torque over base radius, and torques in the ratio of the teeth. The mesh is coarse.
        self.assertAlmostEqual(rows[0]["teeth.normal_force"] * base / 1.2, 1, delta=0.05)
        self.assertAlmostEqual(rows[0]["motor.moment.z"] / (1.2 * 18 / 27), 1, delta=0.05)
        # The gear follows the pinion the other way round; the teeth give way by some micrometres.
        turned = [row["motor.angle"] - rows[0]["motor.angle"] for row in rows]
        followed = [row["gear_bearing.angle"] - rows[0]["gear_bearing.angle"] for row in rows]
        self.assertGreater(turned[-1], 5e-3)
        self.assertAlmostEqual(followed[-1], -18 / 27 * turned[-1], delta=3e-5 / base)

    def test_a_mesh_beyond_the_memory_is_4_before_it_is_taken(self):
        hex20, many = 'element = "hex20", divisions = [10000, 100, 90]', "unknowns = 1e13"
        meshes = ['part = "block", ' + hex20, 'part = "block", element = "hex20", divisions = [90000000, 1, 1]',
                  'part = "spur-gear", teeth = 20, element = "hex20", divisions = [10000, 20, 20]', 'part = "tyre", ' + hex20]
        meshes += [f'part = "{part}", {many}'
                   for part in ("block", "connecting-rod", "chain-link", "crank", "guide", "bladed-rotor", "spur-gear", "tyre")]
        for mesh in meshes:
            with self.subTest(mesh=mesh):
                text = re.sub("mesh = .*", f"mesh = {{ {mesh} }}", BLOCK)
                self.expect(4, "simulate", self.model(text),
                            says=("bodies.block", "elements with", "unknowns", "this machine has", "fewer divisions"))

    def tyre(self, out, *settings):
        pairs = ("parameters.around=24", "parameters.across=8", "output.vtu_interval=0") + settings
        arguments = [word for pair in pairs for word in ("--set", pair)]
        self.expect(0, "simulate", ROOT / "models" / "tyre.toml", "--out", out, "-q", *arguments)
        return self.rows(out)

    def test_a_tyre_at_rest_carries_its_load(self):
        row = self.tyre(self.folder / "rest", "gravity=[0,0,0]", "parameters.step=1e-6", "parameters.end=1e-6")[0]
        self.assertAlmostEqual(row["road.force.z"], -4000, delta=0.4)
        self.assertAlmostEqual(row["tow.force.x"], 0, delta=0.4)
        # A carcass without stiffness has the area load over inflation.
        self.assertAlmostEqual(row["road.area"] * 1e5, 4000, delta=1200)

    def test_a_tyre_rolls_over_a_kerb(self):
        rows = self.tyre(self.folder / "roll", "parameters.run=0.3", "parameters.run_up=0.2", "parameters.wide=0.1",
                         "parameters.step=5e-3", "parameters.end=0.4")
        axle = [row["rim.position.z"] for row in rows]
        self.assertGreater(max(axle), axle[0] + 0.015)  # the kerb is 0.05 high, and the tyre gives way
        self.assertLess(max(axle), axle[0] + 0.06)
        for row in rows:
            self.assertLess(row["road.pressure"], 3e7 * row["road.penetration"] * 1.000001)
        # It rolls: about the speed over the radius when it has its speed, and before the kerb.
        before = next(row for row in rows if row["time"] > 0.15)
        self.assertAlmostEqual(before["rim.angular_velocity.y"], before["rim.velocity.x"] / 0.36, delta=1)
        work = sum(0.5 * (b["time"] - a["time"]) * (a["tow.force.x"] * a["rim.velocity.x"] +
                                                    b["tow.force.x"] * b["rim.velocity.x"]) for a, b in zip(rows, rows[1:]))
        gain = rows[-1]["energy.total"] - rows[0]["energy.total"]
        self.assertGreater(work, gain)  # the difference is lost in rubber and on the road


if __name__ == "__main__":
    unittest.main()
