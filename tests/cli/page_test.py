#!/usr/bin/env python3
"""The page of a run in a real browser, and `espalier view`. What it shows is held against quantities.csv."""

import base64
import csv
import gzip
import json
import math
import os
import pathlib
import re
import signal
import stat
import subprocess
import time
import unittest

from browser import Browser, chromium
from cli_test import BINARY, Cli
from simulate_test import PENDULUM

ROOT = pathlib.Path(__file__).resolve().parents[2]
PICTURES = ROOT / "build" / "pages"

# A rigid crank and a flexible rod that swings on it, with a title that would like to be a script; the motor and the
# bearing are redundant.
CRANK = r'''title = "</script><script>window.broken = 1</script> & \"quotes\" <img src=x onerror='window.broken = 2'>"
gravity = [0, 0, -9.81]
[bodies.crank]
type = "rigid"
mass = 1
inertia = [1e-3, 1e-3, 1e-3]
box = [0.12, 0.03, 0.03]
[bodies.rod]
type = "solid"
mesh = { part = "block", lx = 0.4, ly = 0.03, lz = 0.03, divisions = [8, 1, 1], element = "hex20" }
material = { young = 2e9, poisson = 0.3, density = 2000 }
damping = { stiffness = 1e-4 }
position = [0.05, -0.015, -0.015]
[markers]
eye = { body = "rod", face = "x0" }
[joints.motor]
type = "rotation-motor"
a = { body = "ground", axis = [0, 1, 0] }
b = { body = "crank", axis = [0, 1, 0] }
motion = "6*ramp(t, 0, 0.2)"
[joints.bearing]
type = "revolute"
bodies = ["ground", "crank"]
at = [0, 0, 0]
axis = [0, 1, 0]
[joints.pin]
type = "revolute"
a = { body = "crank", point = [0.05, 0, 0], axis = [0, 1, 0] }
b = { body = "rod", face = "x0", axis = [0, 1, 0] }
[events.quarter]
when = "t > 0.125"
[integrator]
max_order = 2
relative = 1e-4
absolute = 1e-6
absolute_velocity = 1e-3
end = 0.5
[output]
quantities = ["eye.position", "crank.position", "crank.angular_velocity.y", "pin.force"]
'''


def rows_of(path):
    with open(path, encoding="utf-8") as file:
        rows = list(csv.reader(file))
    return rows[0], [[float(x) for x in row] for row in rows[1:]]


class PageInBrowser(Cli):
    @classmethod
    def setUpClass(cls):
        if chromium() is None:
            raise unittest.SkipTest("chromium is not installed: pages were not looked at")
        cls.browser = Browser(chromium())
        cls.addClassCleanup(cls.browser.close)

    def simulated(self, text, *options):
        model = self.file("model.toml", text)
        self.expect(0, "simulate", model, "--out", self.folder / "out", "-q", *options)
        return self.folder / "out" / "index.html"

    def no_problems(self):
        self.assertEqual(self.browser.problems, [])
        self.assertEqual(self.browser.run("window.espalier.errors"), [])

    def test_motion(self):
        page, b = self.simulated(CRANK), self.browser
        b.open(page)
        self.no_problems()
        self.assertIsNone(b.run("window.broken === undefined ? null : window.broken"))
        self.assertIn("</script><script>", b.run("document.getElementById('title').textContent"))
        names = b.run("espalier.bodies")
        self.assertEqual(names, ["crank", "rod"])
        drawn = b.run("espalier.pixels()")
        self.assertGreater(drawn["drawn"], 0.01 * drawn["width"] * drawn["height"])
        self.assertGreater(drawn["colours"], 50)
        # Plots have the numbers of the CSV file, all of them.
        head, rows = rows_of(page.parent / "quantities.csv")
        self.assertEqual(b.run("espalier.quantities"), head[1:])
        for k, name in enumerate(head[1:], 1):
            shown = b.run(f"espalier.quantity({json.dumps(name)})")
            self.assertEqual(shown["t"], [row[0] for row in rows])
            self.assertEqual(shown["values"], [row[k] for row in rows], name)
        # The slider moves the bodies to where the CSV file says that they are: 16 bits over the scene, and what lies
        # between two pictures.
        places = [head.index(f"crank.position.{i}") for i in "xyz"]
        eyes = [head.index(f"eye.position.{i}") for i in "xyz"]
        node_at_eye = b.run("""(() => { const name = espalier.bodies[1], nodes = espalier.nodes(name).filter(n => n > 0);
          return nodes.filter(n => Math.abs(espalier.position(name, n)[0] - 0.05) < 1e-6); })()""")
        self.assertGreaterEqual(len(node_at_eye), 4)
        moved = 0
        for row in rows[:: max(1, len(rows) // 12)]:
            b.run(f"""(async () => {{ const s = document.getElementById('slider'); s.value = {row[0]!r};
              s.dispatchEvent(new Event('input')); await espalier.setTime({row[0]!r}); }})()""")
            at = b.run("espalier.position('crank')")
            self.assertLess(math.dist(at, [row[k] for k in places]), 1e-5)
            corners = b.run(f"{json.dumps(node_at_eye)}.map(n => espalier.position(espalier.bodies[1], n))")
            mean = [sum(c[i] for c in corners) / len(corners) for i in range(3)]
            self.assertLess(math.dist(mean, [row[k] for k in eyes]), 2e-4)
            moved = max(moved, math.dist(at, [rows[0][k] for k in places]), math.dist(mean, [rows[0][k] for k in eyes]))
        self.assertGreater(moved, 0.03)
        self.assertIn("von Mises", b.run(f"espalier.pick(espalier.bodies[1], {node_at_eye[0]})"))
        # Pictures of all fields differ, and so does each time.
        seen = set()
        for field in ("bodies", "displacement", "deformation", "speed", "von_mises", "principal"):
            b.run(f"espalier.select('field', '{field}')")
            seen.add(b.run("(espalier.pixels(), document.getElementById('canvas').toDataURL())"))  # pixels() draws
        self.assertEqual(len(seen), 6)
        self.no_problems()

    def test_plot_click_moves_the_scene_and_events_are_there(self):
        page, b = self.simulated(CRANK), self.browser
        b.open(page)
        self.assertEqual(b.run("[...document.querySelectorAll('#summary td, #summary th')].filter(x => x.textContent === 'quarter').length"), 1)
        x, y = b.run("(() => { const r = document.querySelector('.plot .chart').getBoundingClientRect(); return [r.left + 0.6 * r.width, r.top + 60]; })()")
        before = b.run("espalier.time()")
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            b.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="none" if kind == "mouseMoved" else "left", clickCount=1)
        deadline = time.monotonic() + 5
        while b.run("espalier.time()") == before and time.monotonic() < deadline:
            time.sleep(0.05)
        self.assertTrue(0.1 < b.run("espalier.time()") < 0.45)
        b.run("[...document.querySelectorAll('#summary td button')].find(x => true).click()")
        self.no_problems()

    def test_sizes_and_themes(self):
        page, b = self.simulated(CRANK), self.browser
        PICTURES.mkdir(parents=True, exist_ok=True)
        colours = set()
        for width, height in ((1440, 900), (390, 844)):
            for dark in (False, True):
                b.open(page, width, height, dark)
                b.run("espalier.setTime(0.3)")
                self.assertEqual(b.run("document.documentElement.dataset.theme"), "dark" if dark else "light")
                self.assertLessEqual(b.run("document.documentElement.scrollWidth"), width, "the page must not scroll sideways")
                self.assertGreater(b.run("espalier.pixels().colours"), 50)
                self.assertTrue(all(b.run("[...document.querySelectorAll('[role=img]')].map(x => (x.getAttribute('aria-label') || '').length > 20)")))
                colours.add(b.run("getComputedStyle(document.body).backgroundColor"))
                b.picture(PICTURES / f"crank-{width}-{'dark' if dark else 'light'}.png")
                self.no_problems()
        self.assertEqual(len(colours), 2)

    def test_keys(self):
        page, b = self.simulated(CRANK), self.browser
        b.open(page)
        press = lambda key: b.run(f"document.body.dispatchEvent(new KeyboardEvent('keydown', {{key: '{key}', bubbles: true}}))")
        press("End")
        self.assertAlmostEqual(b.run("espalier.time()"), 0.5)
        press("ArrowLeft")
        self.assertLess(b.run("espalier.time()"), 0.5)
        press("Home")
        self.assertEqual(b.run("espalier.time()"), 0)
        press("g")
        self.assertTrue(b.run("document.getElementById('show-ghost').checked"))
        press("d")
        self.assertEqual(b.run("document.documentElement.dataset.theme"), "dark")
        self.no_problems()

    def test_modes_are_animated(self):
        page, b = self.simulated(CRANK.replace("[integrator]", "[initial]\nmodes = 3\n[integrator]")), self.browser
        b.open(page)
        self.assertEqual(b.run("document.getElementById('motion').options.length"), 4)
        b.run("espalier.select('motion', '2')")
        pictures = set()
        for _ in range(4):
            time.sleep(0.15)
            pictures.add(b.run("document.getElementById('canvas').toDataURL()"))
        self.assertGreater(len(pictures), 1)
        self.no_problems()

    def test_response_is_plotted_and_animated(self):
        text = """[bodies.bar]
type = "beam"
start = [0, 0, 0]
end = [1, 0, 0]
elements = 4
height = 0.05
width = 0.03
material = { young = 2e11, poisson = 0.3, density = 7800 }
damping = { stiffness = 1e-5 }
[joints.wall]
type = "fixed"
a = { body = "ground" }
b = { body = "bar", node = 1 }
[forces.push]
type = "load"
a = { body = "bar", node = -1 }
force = [0, 0, 1]
factor = 0
[harmonic]
loads = ["push"]
quantities = ["bar.position.z"]
from = 1
to = 200
points = 50
shapes = [24]
[integrator]
end = 1e-3
"""
        page, b = self.simulated(text), self.browser
        b.open(page)
        data = b.run("JSON.parse(document.getElementById('data').textContent).response")
        with open(page.parent / "harmonic.csv", encoding="utf-8") as file:
            table = list(csv.DictReader(file))
        self.assertEqual(data["frequencies"], [float(row["frequency"]) for row in table])
        for k, row in enumerate(table):
            self.assertAlmostEqual(data["columns"][k] / float(row["amplitude_bar.position.z_push"]), 1, 9)
        self.assertIn("amplitude of bar.position.z (push)", b.run("document.querySelector('.plot .chart').getAttribute('aria-label')"))
        self.assertEqual(b.run("document.getElementById('motion').options.length"), 2)
        b.run("espalier.select('motion', '0')")
        self.assertGreater(b.run("espalier.pixels().colours"), 50)
        self.no_problems()

    def test_statics_shows_the_loads(self):
        text = CRANK.replace("[integrator]\nmax_order = 2\nrelative = 1e-4\nabsolute = 1e-6\nabsolute_velocity = 1e-3\nend = 0.5\n", "[statics]\n")
        text = re.sub(r"\[events.quarter\]\n.*\n", "", text)
        text = re.sub(r'\[joints.pin\][^\[]*type = "revolute"', '[joints.pin]\ntype = "fixed"', text)
        page, b = self.simulated(text), self.browser
        b.open(page)
        self.assertEqual(b.run("espalier.times[0]"), 0)
        self.assertEqual(b.run("espalier.times[espalier.times.length - 1]"), 1)
        self.no_problems()

    def test_odd_models(self):
        """One picture, no quantities, point masses alone, a cable, a beam, a shell, 400 bodies."""
        material = "{ young = 2e9, poisson = 0.3, density = 2000 }"
        many = "".join(f'[bodies.b{k}]\ntype = "rigid"\nmass = 1\ninertia = [0.1, 0.1, 0.1]\nposition = [{k % 20}, {k // 20}, 0]\n' for k in range(400))
        bodies = {
            "points": '[bodies.a]\ntype = "point"\nmass = 1\n[bodies.b]\ntype = "point"\nmass = 1\nposition = [1, 0, 0]\n',
            "cable": f'[bodies.a]\ntype = "cable"\nstart = [0, 0, 0]\nend = [1, 0, 0]\nelements = 4\nradius = 0.01\nmaterial = {material}\n',
            "beam": f'[bodies.a]\ntype = "beam"\nstart = [0, 0, 0]\nend = [1, 0, 0]\ny = [0, 1, 0]\nelements = 2\nheight = 0.05\nwidth = 0.03\nmaterial = {material}\n',
            "many": many,
        }
        for name, text in bodies.items():
            with self.subTest(name):
                page = self.simulated(f"gravity = [0, 0, -9.81]\n{text}[integrator]\nend = 1e-3\n[output]\nenergies = false\nconstraints = false\n")
                self.browser.open(page)
                self.assertGreater(self.browser.run("espalier.pixels().drawn"), 100)
                self.no_problems()

    def test_2000_bodies(self):
        many = "".join(f'[bodies.b{k}]\ntype = "rigid"\nmass = 1\ninertia = [0.1, 0.1, 0.1]\nposition = [{k % 50}, {k // 50}, 0]\n' for k in range(2000))
        page = self.simulated(f"gravity = [0, 0, -9.81]\n{many}[integrator]\nend = 1e-3\n[output]\nenergies = false\nconstraints = false\n")
        self.browser.open(page)
        self.assertGreater(self.browser.run("espalier.pixels().drawn"), 1000)
        self.assertEqual(self.browser.run("espalier.bodies.length"), 2000)
        self.no_problems()

    def test_pages_without_frames_with_one_and_without_numbers(self):
        text, b = self.simulated(CRANK).read_text(encoding="utf-8"), self.browser
        data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.S).group(1))
        frames = data["scene"]["frames"]

        def page(name, scene, change=lambda text: text):
            changed = json.dumps({**data, "scene": {**data["scene"], **scene}}).replace("<", "\\u003c")
            head, rest = text.split('id="data">', 1)
            path = self.folder / name
            path.write_text(change(head + 'id="data">' + changed + rest[rest.index("</script>"):]), encoding="utf-8")
            return path

        def no_number(text):  # 65535 in all places of all frames
            for piece in {frame["piece"] for frame in frames}:
                start = text.index(f'id="piece{piece}">') + len(f'id="piece{piece}">')
                end = text.index("</script>", start)
                size = len(gzip.decompress(base64.b64decode(text[start:end])))
                text = text[:start] + base64.b64encode(gzip.compress(b"\xff" * size)).decode() + text[end:]
            return text

        for name, path in (("none", page("none.html", {"frames": []})), ("one", page("one.html", {"frames": frames[:1]})),
                           ("nan", page("nan.html", {}, no_number))):
            with self.subTest(name):
                b.open(path)
                for field in ("bodies", "displacement", "von_mises"):
                    b.run(f"espalier.select('field', '{field}')")
                b.run("espalier.setTime(0.2)")
                b.run("document.body.dispatchEvent(new KeyboardEvent('keydown', {key: 'End', bubbles: true}))")
                self.assertEqual(b.run("espalier.times.length"), {"none": 0, "one": 1}.get(name, len(frames)))
                if name != "nan":
                    self.assertGreater(b.run("espalier.pixels().drawn"), 1000)
                self.assertTrue(b.run("document.getElementById('trouble').hidden"))
                self.no_problems()

    def test_supports_and_pressures_have_marks(self):
        text = """[bodies.bar]
type = "solid"
mesh = { part = "block", lx = 0.4, ly = 0.04, lz = 0.05, divisions = [8, 1, 1], element = "hex20" }
material = { young = 2e11, poisson = 0.3, density = 7800 }
[supports.wall]
body = "bar"
face = "x0"
hold = "all"
[forces.wind]
type = "pressure"
body = "bar"
face = "z1"
pressure = 1e4
[statics]
[output]
quantities = ["wall.force", "wall.moment"]
"""
        page, b = self.simulated(text), self.browser
        b.open(page)
        marks = b.run("JSON.parse(document.getElementById('data').textContent).scene.marks")
        self.assertEqual([(m["name"], m["what"], m["kind"], m["between"]) for m in marks],
                         [("wind", "force", "pressure", ["bar"]), ("wall", "support", "support", ["bar"])])
        b.run("espalier.setTime(1)")
        force = [b.run(f"espalier.mark('{name}').force") for name in ("wind", "wall")]
        head, rows = rows_of(page.parent / "quantities.csv")
        at = head.index("wall.force.x")
        for i, truth in enumerate((0, 0, -1e4 * 0.4 * 0.04)):  # p A, downwards
            self.assertAlmostEqual(force[0][i], truth, delta=0.2)
            self.assertAlmostEqual(force[1][i], rows[-1][at + i], delta=0.2)
            self.assertAlmostEqual(force[1][i], -truth, delta=0.2)
        for i, (wind, wall) in enumerate(zip((0.2, 0.02, 0.05), (0, 0.02, 0.025))):
            self.assertAlmostEqual(b.run("espalier.mark('wind').at")[i], wind, delta=1e-3)
            self.assertAlmostEqual(b.run("espalier.mark('wall').at")[i], wall, delta=1e-3)
        self.assertGreater(b.run("espalier.pixels().colours"), 50)
        self.no_problems()

    def test_failed_run_has_a_page(self):
        model = self.file("model.toml", CRANK.replace("end = 0.5", "end = 0.5\nmin_step = 0.01\ninitial_step = 0.01"))
        result = self.run_cli("simulate", model, "--out", self.folder / "out", "-q")
        self.assertEqual(result.returncode, 6, result.stderr)
        self.browser.open(self.folder / "out" / "index.html")
        self.assertEqual(self.browser.run("document.getElementById('trouble').hidden"), False)
        self.assertIn(result.stderr.split("error: ")[1][:30], self.browser.run("document.getElementById('trouble').textContent"))
        self.assertGreater(self.browser.run("espalier.pixels().drawn"), 100)
        self.no_problems()

    def test_follows_a_run(self):
        text = PENDULUM.replace("end = 1", "end = 1e6\nmax_step = 1e-3").replace("vtu_interval = 0.25\n", "csv_interval = 0.1\n")
        process = subprocess.Popen([BINARY, "simulate", self.file("model.toml", text), "--out", str(self.folder / "out"), "-q"], stderr=subprocess.DEVNULL)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        page = self.folder / "out" / "index.html"
        deadline = time.monotonic() + 100

        def until(holds):
            while not holds():
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.2)

        def last_time():
            try:
                return self.browser.run("window.espalier && espalier.times ? espalier.times[espalier.times.length - 1] : 0") or 0
            except RuntimeError:  # between two pages
                return 0

        until(page.exists)
        process.send_signal(signal.SIGSTOP)  # the browser gets the machine for itself
        self.browser.open(page)
        self.assertEqual(self.browser.run("document.getElementById('state').textContent"), "running")
        self.browser.run("espalier.select('field', 'speed')")
        first, written = last_time(), page.stat().st_mtime_ns
        process.send_signal(signal.SIGCONT)
        until(lambda: page.stat().st_mtime_ns != written)
        process.send_signal(signal.SIGSTOP)
        until(lambda: last_time() > first)  # it has loaded itself again, and shows what it showed before
        self.assertEqual(self.browser.run("espalier.ready.then(() => document.getElementById('field').value)"), "speed")
        process.send_signal(signal.SIGCONT)
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(timeout=60), 130)
        self.browser.open(page)
        self.assertEqual(self.browser.run("document.getElementById('state').textContent"), "stopped")
        self.no_problems()


class PageFile(Cli):
    def test_no_page(self):
        model = self.file("model.toml", PENDULUM)
        for option, text in ((["--no-page"], PENDULUM), ([], PENDULUM + "page = false\n")):
            model = self.file("model.toml", text)
            self.expect(0, "simulate", model, "--out", self.folder / "out", "-q", *option)
            self.assertFalse((self.folder / "out" / "index.html").exists())
        self.expect(0, "simulate", self.file("model.toml", PENDULUM), "--out", self.folder / "out", "-q")
        self.assertTrue((self.folder / "out" / "index.html").exists())

    def test_what_is_in_it(self):
        self.expect(0, "simulate", self.file("model.toml", PENDULUM.replace("a pendulum", "<b>&amp;</script>")), "--out", self.folder / "out", "-q")
        text = (self.folder / "out" / "index.html").read_text(encoding="utf-8")
        self.assertLess(len(text), 2_000_000)
        self.assertIn("default-src 'none'", text)
        data = re.search(r'id="data">(.*?)</script>', text, re.S).group(1)
        self.assertNotIn("<", data)
        summary = json.loads(data)["summary"]
        self.assertEqual(summary["title"], "<b>&amp;</script>")
        self.assertEqual(json.loads(data)["model"]["text"], PENDULUM.replace("a pendulum", "<b>&amp;</script>"))
        for address in re.findall(r"(?:src|href)=\"(https?:[^\"]*)", text):
            self.fail(f"it asks the network for {address}")
        report = json.loads((self.folder / "out" / "summary.json").read_text())
        self.assertEqual(pathlib.Path(report["files"][-1]).name, "index.html")

    def test_folder_that_cannot_hold_it(self):
        out = self.folder / "out"
        (out / "index.html").mkdir(parents=True)
        result = self.expect(0, "simulate", self.file("model.toml", PENDULUM), "--out", out)
        self.assertIn("the page of the run was not written", result.stdout)
        self.assertTrue((out / "quantities.csv").exists())

    def test_view(self):
        model = self.file("model.toml", PENDULUM)
        out = self.folder / "a folder #1"
        self.expect(0, "simulate", model, "--out", out, "-q")
        for what in (out, out / "index.html"):
            shown = self.expect(0, "view", "--no-browser", what).stdout.strip()
            self.assertEqual(shown, (out / "index.html").resolve().as_uri())
        opened = self.folder / "opened"
        browser = self.folder / "browser"
        browser.write_text(f'#!/bin/sh\necho "$1" > "{opened}"\n')
        browser.chmod(browser.stat().st_mode | stat.S_IXUSR)
        self.expect(0, "view", out, env={"BROWSER": f"/no/such/program:{browser}"})
        self.assertEqual(opened.read_text().strip(), (out / "index.html").resolve().as_uri())
        none = self.expect(0, "view", out, env={"BROWSER": "", "PATH": "/nowhere"})
        self.assertIn("no browser", none.stderr)
        self.expect(2, "view", self.folder / "nothing", says="there is no page")
        self.expect(2, "view", self.folder, says="espalier simulate MODEL --out DIR")

    def test_view_of_a_model(self):
        before = self.expect(0, "view", "--no-browser", self.file("pendulum.toml", PENDULUM), env={"TMPDIR": str(self.folder)}).stdout.strip()
        self.assertTrue(before.startswith("file://"))
        data = json.loads(re.search(r'id="data">(.*?)</script>', pathlib.Path(before[7:]).read_text(), re.S).group(1))
        self.assertEqual([len(data["scene"]["frames"]), data["scene"]["bodies"][0]["name"]], [1, "bob"])
        self.expect(2, "view", "--no-browser", self.file("wrong.toml", PENDULUM.replace("mass", "mas")), says="wrong.toml")


if __name__ == "__main__":
    unittest.main()
