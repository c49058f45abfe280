#!/usr/bin/env python3
"""The pages of solve, modes and harmonic (--page) in a real browser: they show the numbers of the report."""

import json
import math
import os
import re
import stat
import subprocess
import unittest

from browser import Browser, chromium
from cli_test import Cli, coordinate, second_difference
from page_test import PICTURES

EVIL = "</script><script>window.broken = 1<script> & 'q'"


class Sheets(Cli):
    @classmethod
    def setUpClass(cls):
        if chromium() is None:
            raise unittest.SkipTest("chromium is not installed: pages were not looked at")
        cls.browser = Browser(chromium())
        cls.addClassCleanup(cls.browser.close)

    def pencil(self, n=40, first="K.mtx"):
        return (self.file(first, coordinate(n, second_difference(n), "symmetric")),
                self.file("M.mtx", coordinate(n, [(i, i, 1.0) for i in range(1, n + 1)], "symmetric")))

    def opened(self, code, *arguments, **size):
        """The report of a command whose page was opened, which shows the same one."""
        page, report = self.folder / "page.html", self.folder / "report.json"
        result = self.expect(code, *arguments, f"--page={page}", "--report", report)
        self.assertIn(f"page: {page}", result.stderr)
        self.browser.open(page, **size)
        self.assertEqual(self.browser.problems, [])
        self.assertEqual(self.browser.run("espalier.errors"), [])
        self.assertIsNone(self.browser.run("window.broken === undefined ? null : window.broken"))
        report = json.loads(report.read_text())
        shown = self.browser.run("espalier.report")
        self.assertEqual({key: shown[key] for key in report}, report)
        self.assertLessEqual(self.browser.run("document.documentElement.scrollWidth"), size.get("width", 1440))
        return report

    def cells(self, title):
        """The rows of the table below a heading, as texts."""
        return self.browser.run(f"""[...document.querySelectorAll('.card')].find(c => c.querySelector('h3').textContent === {json.dumps(title)})
            .querySelectorAll('tbody tr, table:not(:has(tbody)) tr').values().toArray().map(r => [...r.cells].map(c => c.textContent))""")

    def picture(self, name):
        PICTURES.mkdir(parents=True, exist_ok=True)
        self.browser.picture(PICTURES / f"{name}.png")

    def test_of_a_solve(self):
        trace = self.folder / "trace.json"
        report = self.opened(0, "solve", "--generate", "elasticity 6 6 6", "--trace", trace)
        analysis = dict(row[:2] for row in self.cells("analysis"))
        self.assertEqual(analysis["nonzeros factor"].replace(",", ""), str(report["analysis"]["nonzeros_factor"]))
        self.assertEqual(dict(self.cells("inertia"))["positive"].replace(",", ""), str(report["matrix"]["rows"]))
        # Both pictures have the matrix' entries, each in its own places.
        n = report["matrix"]["rows"]
        pictures = self.browser.run("espalier.pictures")
        self.assertEqual([p["size"] for p in pictures], [240, 240])
        said = [int(re.search(r", ([\d,]+) entries", p["said"])[1].replace(",", "")) for p in pictures]
        self.assertEqual(said, [2 * report["matrix"]["nonzeros"] - n] * 2)
        self.assertNotEqual(pictures[0]["cells"], pictures[1]["cells"])
        drawn = self.browser.run("""[...document.querySelectorAll('.spy')].map(c => {
            const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = 0;
            for (let k = 3; k < d.length; k += 4) n += d[k] > 0; return n; })""")
        for count in drawn:
            self.assertGreater(count, 240)
        # The work of the tiers is that of the analysis.
        flops = next(p for p in self.browser.run("espalier.plots") if "work" in p["title"])["series"][0]["y"]
        self.assertAlmostEqual(sum(flops), report["analysis"]["flops"], delta=1e-9 * sum(flops))
        tracks = self.browser.run("espalier.timeline")["tracks"]
        events = [e for e in json.loads(trace.read_text())["traceEvents"] if e["ph"] == "X"]
        end = max(e["ts"] + e["dur"] for e in events)
        self.assertAlmostEqual(sum(t["share"] for t in tracks), sum(e["dur"] for e in events) / end, delta=0.02)
        self.picture("solve")
        self.opened(0, "solve", "--generate", "elasticity 6 6 6", width=390, dark=True)
        self.picture("solve_phone")

    def test_small_and_failed_systems(self):
        one = self.file(EVIL.replace("/", "_") + ".mtx", coordinate(1, [(1, 1, 2.0)], "symmetric"))
        self.opened(0, "solve", one)
        self.assertEqual(self.browser.run("document.getElementById('title').textContent"), os.path.basename(one))
        self.assertEqual(self.browser.run("espalier.pictures")[0]["size"], 1)
        singular = self.file("s.mtx", coordinate(3, [(1, 1, 1.0), (2, 2, 1.0), (3, 3, 0.0)], "symmetric"))
        report = self.opened(3, "solve", singular, "--kind", "ldlt")
        self.assertEqual(self.browser.run("document.getElementById('trouble').textContent"), report["message"])
        self.assertEqual(self.browser.run("document.getElementById('state').textContent"), "failed")
        self.opened(2, "solve", self.file("e.mtx", coordinate(0, [])))
        self.opened(2, "solve", self.file("n.mtx", coordinate(2, [(1, 1, "nan"), (2, 2, 1.0)])))
        self.opened(0, "solve", self.file("c.mtx", coordinate(2, [(1, 1, "1.0 2.0"), (2, 2, "1.0 0.5")], field="complex")))
        unsymmetric = self.file("u.mtx", coordinate(3, [(1, 2, 1.0), (2, 3, 1.0), (3, 1, 1.0)]))
        self.opened(0, "solve", unsymmetric)  # a matching brings all entries to the diagonal
        cells = self.browser.run("[...atob(espalier.pictures[1].cells)].map(c => c.charCodeAt(0))")
        self.assertEqual([c > 0 for c in cells], [True, False, False, False, True, False, False, False, True])

    def test_of_modes(self):
        k, m = self.pencil()
        report = self.opened(0, "modes", k, m, "--count", 5)
        plot = self.browser.run("espalier.plots[0].series[0]")
        self.assertEqual(plot["y"], [mode["frequency"] for mode in report["modes"]])
        for row, mode in zip(self.cells("modes"), report["modes"], strict=True):
            self.assertAlmostEqual(float(row[0].replace("e\u2212", "e-").replace("\u2212", "-")), mode["eigenvalue"], delta=1e-5 * mode["eigenvalue"])
        points = [y for p in self.browser.run("espalier.plots") for s in p["series"] for y in s["y"] if y > 0]  # no zeros on log axes
        self.assertEqual(self.browser.run("document.querySelectorAll('svg circle').length"), len(points))
        self.picture("modes")
        c = self.file("C.mtx", coordinate(40, [(i, i, 0.01) for i in range(1, 41)], "symmetric"))
        report = self.opened(0, "modes", k, m, "--damping", c, "--count", 3)
        self.assertEqual(self.browser.run("espalier.plots[0].series[0].y"), [mode["imaginary"] for mode in report["modes"]])
        self.opened(0, "modes", k, m, "--buckling", "--count", 2)

    def test_of_a_frequency_response(self):
        k, m = self.pencil()
        csv = self.folder / "r.csv"
        report = self.opened(0, "harmonic", k, m, "--loss-factor", 0.02, "--at", 0, "--observe", "0,39", "--from", 0.01, "--to", 0.1, "--csv", csv)
        rows = [[float(x) if x else math.nan for x in line.split(",")] for line in csv.read_text().splitlines()[1:]]
        head = csv.read_text().splitlines()[0].split(",")
        amplitudes = self.browser.run("espalier.plots[0]")
        self.assertEqual(len(report["points"]), 101)
        for curve in amplitudes["series"]:
            column = head.index(f"amplitude_{curve['name'].split()[1]}_0")
            self.assertEqual(curve["x"], [row[0] for row in rows])
            for mine, true in zip(curve["y"], rows, strict=True):
                self.assertAlmostEqual(mine, true[column], delta=1e-14 * abs(true[column]))
        # What is under the pointer is told.
        self.browser.run("document.querySelector('svg').dispatchEvent(new PointerEvent('pointermove', {clientX: 400}))")
        self.assertRegex(self.browser.run("document.querySelector('.card .values').textContent"), r"frequency 0\.\d+ .*unknown 0: \d")
        self.picture("harmonic")
        self.browser.run("document.getElementById('theme').click()")
        self.picture("harmonic_dark")

    def test_view_opens_them(self):
        k, m = self.pencil(4)
        self.expect(0, "modes", k, m, "--count", 1, "--page", cwd=self.folder)
        self.assertIn("modes.html", self.expect(0, "view", "modes.html", "--no-browser", cwd=self.folder).stdout)


class SheetsUnwritten(Cli):
    def test_where_a_page_cannot_be_written(self):
        solve = ["solve", "--generate", "elasticity 3 3 3"]
        self.expect(2, *solve, "--page=/proc/none/p.html", says="--page")
        matrix = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        self.expect(2, "solve", matrix, f"--page={matrix}", says="would replace")
        folder = self.folder / "closed"
        folder.mkdir()
        folder.chmod(stat.S_IRUSR | stat.S_IXUSR)
        if os.getuid() != 0:
            self.expect(2, *solve, f"--page={folder}/p.html", says="--page")

    def test_a_full_disk(self):
        # A limit on the size of files is met as a full disk is; the page that was there stays.
        page = self.file("p.html", "before")
        result = subprocess.run(["/bin/bash", "-c", 'ulimit -f 4; exec "$0" "$@"', os.environ.get("ESPALIER_BINARY", "build/release/espalier"), "solve",
                                 "--generate", "elasticity 3 3 3", f"--page={page}"], capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("the page could not be written", result.stderr)
        self.assertIn("solved", result.stdout)
        self.assertEqual((self.folder / "p.html").read_text(), "before")
        self.assertEqual(os.listdir(self.folder), ["p.html"])


if __name__ == "__main__":
    unittest.main()
