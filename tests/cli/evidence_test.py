#!/usr/bin/env python3
"""Black-box tests of `espalier bench`, `espalier report` and `espalier fetch-matrix`.

Truths: a plug-in that misbehaves on request (bench/rivals/faulty.cpp), the equilibrium of generated systems, the
document's own schema, a local web server, and a browser."""

import gzip
import hashlib
import http.server
import io
import json
import os
import pathlib
import re
import shutil
import subprocess
import tarfile
import threading
import unittest
from html.parser import HTMLParser

from cli_test import Cli

ROOT = pathlib.Path(__file__).resolve().parents[2]
RESULTS = sorted(str(path) for path in (ROOT / "bench" / "results").glob("*.json"))


class Bench(Cli):
    def bench(self, *arguments, code=0):
        out = self.folder / "results.json"
        result = self.run_cli("bench", *arguments, "--out", out, "--threads", 2, "--analyses", 1, "-k", 2)
        self.assertEqual(result.returncode, code, result.stdout + result.stderr)
        return json.loads(out.read_text())

    def rivals_are_built(self):
        document = self.bench("peers", "--system", "poisson 3", "--rivals", "faulty", "--no-ceilings")
        if document["rows"][0]["outcome"] == "missing":
            self.skipTest("this build has no rivals (ESPALIER_BENCH=OFF)")

    def test_every_row_has_what_the_schema_promises(self):
        self.rivals_are_built()
        document = self.bench("peers", "--system", "elasticity 3", "--rivals", "espalier,espalier:precision=mixed")
        self.assertEqual(document["schema"], "espalier-bench/1")
        for key in ("experiment", "command", "date", "commit", "version", "machine", "settings", "ceilings"):
            self.assertTrue(document[key], key)
        self.assertGreater(document["ceilings"]["gemm_flops_per_second"], 0)
        self.assertGreater(document["ceilings"]["memory"]["read_bytes_per_second"]["best"], 0)
        self.assertEqual(len(document["rows"]), 2)
        for row in document["rows"]:
            self.assertEqual(row["outcome"], "ok", row["message"])
            self.assertEqual(row["unknowns"], 3 * 4 * 4 * 3)  # 4^3 nodes, one face of 4 x 4 clamped
            for phase in ("analysis", "refactorization", "solve_one", "solve_many"):
                samples = row[phase]["seconds"]
                self.assertEqual(len(samples), 1 if phase == "analysis" else 2)
                self.assertEqual(row[phase]["least"], min(samples))
                self.assertGreaterEqual(row[phase]["median"], min(samples))
            self.assertLess(row["backward_error"]["normwise"], 1e-13)
            self.assertGreater(row["memory"]["peak_bytes"], 0)

    def test_whatever_a_rival_does_is_a_row(self):
        self.rivals_are_built()
        tricks = {"crash": "crashed", "exit": "crashed", "missing": "missing", "wrong": "wrong answer",
                  "memory": "out of memory", "refuse": "failed"}
        diagonal = "%%MatrixMarket matrix coordinate real symmetric\n3 3 3\n1 1 2\n2 2 3\n3 3 4\n"
        system = self.file("diagonal.mtx", diagonal)
        rivals = ",".join(f"faulty:{trick}" for trick in tricks) + ",nobody,espalier"
        document = self.bench("peers", "--system", system, "--system", "no such generator", "--rivals", rivals,
                              "--no-ceilings", code=2)
        rows = {(row["system"], row["rival"]): row for row in document["rows"]}
        for trick, outcome in tricks.items():
            self.assertEqual(rows[system, f"faulty:{trick}"]["outcome"], outcome)
            self.assertTrue(rows[system, f"faulty:{trick}"]["message"])
        self.assertEqual(rows[system, "nobody"]["outcome"], "missing")
        self.assertEqual(rows[system, "espalier"]["outcome"], "ok")
        self.assertEqual(rows["no such generator", "espalier"]["outcome"], "failed")

    def test_a_folder_is_its_matrices(self):
        self.rivals_are_built()
        folder = self.folder / "matrices"
        folder.mkdir()
        for name in ("b.mtx", "a.esp", "c.mtx.gz"):
            self.expect(0, "generate", "poisson", 3, "--out", folder / name)
        (folder / "notes.txt").write_text("no matrix")
        document = self.bench("peers", "--system", folder, "--rivals", "espalier", "--no-ceilings")
        self.assertEqual([pathlib.Path(row["system"]).name for row in document["rows"]], ["a.esp", "b.mtx", "c.mtx.gz"])
        self.assertTrue(all(row["outcome"] == "ok" for row in document["rows"]))

    def test_growth_fits_what_it_measured(self):
        self.rivals_are_built()
        document = self.bench("growth", "--system", "plate 8", "--system", "plate 16", "--system", "plate 32",
                              "--no-ceilings")
        fits = {fit["quantity"]: fit for fit in document["fits"]}
        rows = document["rows"]
        self.assertEqual(fits["flops"]["points"], 3)
        # The law passes between its points: at the middle one it is within the worst of the three deviations.
        law = lambda n: fits["flops"]["factor"] * n ** fits["flops"]["exponent"]
        self.assertLess(max(abs(law(row["unknowns"]) / row["flops"] - 1) for row in rows), 0.3)
        self.assertGreater(fits["flops"]["exponent"], 1.2)
        self.assertLess(fits["flops"]["exponent"], 2.0)

    def test_scaling_and_ablation_tell_idle_time(self):
        self.rivals_are_built()
        scaling = self.bench("scaling", "--system", "elasticity 5", "--points", "host:1,1", "host:2,1", "--no-ceilings")
        self.assertEqual([row["outcome"] for row in scaling["rows"]], ["ok", "ok"], scaling["rows"])
        self.assertEqual(scaling["rows"][0]["speed_up"], 1)
        self.assertEqual(len(scaling["timelines"]), 2)
        for timeline in scaling["timelines"]:
            for track in timeline["tracks"]:
                ends = [0] + [x for pair in track["busy"] for x in pair]
                self.assertEqual(ends, sorted(ends))
                self.assertLessEqual(ends[-1], timeline["seconds"] * (1 + 1e-9))
                self.assertEqual(len(track["waiting"]), len(track["busy"]))
                for (begin, end), waited in zip(track["busy"], track["waiting"]):
                    self.assertGreaterEqual(waited, 0)
                    self.assertLessEqual(waited, (end - begin) * (1 + 1e-6) + 1e-6)
        ablation = self.bench("ablation", "--system", "elasticity 5", "--points", "host:2,1", "--no-ceilings")
        outcomes = {row["parameters"]["step"][:3]: row["outcome"] for row in ablation["rows"]}
        self.assertEqual(outcomes, {"(a)": "ok", "(b)": "not offered", "(c)": "ok", "(d)": "ok", "(e)": "ok"})

    def test_a_folder_is_a_sequence_of_newton_matrices(self):
        self.rivals_are_built()
        folder = self.folder / "newton"
        folder.mkdir()
        self.expect(0, "generate", "poisson", "3", "--out", folder / "newton_0002.mtx")
        self.expect(0, "generate", "poisson", "2", "--out", folder / "newton_0001.mtx")  # another pattern
        (folder / "newton_0002_rhs.mtx").write_text("%%MatrixMarket matrix array real general\n1 1\n1\n")
        lines = (folder / "newton_0002.mtx").read_text().splitlines()
        head = next(k for k, line in enumerate(lines) if not line.startswith("%")) + 1
        entries = [line.split() for line in lines[head:]]
        scaled = [f"{i} {j} {2 * float(v)!r}" for i, j, v in entries]
        (folder / "newton_0003.mtx").write_text("\n".join(lines[:head] + scaled) + "\n")
        document = self.bench("refactor", "--system", folder, "--rivals", "espalier", "--no-ceilings")
        self.assertEqual([row["outcome"] for row in document["rows"]], ["ok"], document["rows"])
        row = document["rows"][0]
        self.assertEqual((row["unknowns"], row["parameters"]["matrices"]), (27, 2))
        self.assertLess(row["backward_error"]["normwise"], 1e-14)

    def test_a_system_may_name_its_kind(self):
        self.rivals_are_built()
        document = self.bench("peers", "--system", "poisson 3 as ldlt", "poisson 3", "--rivals", "espalier", "--no-ceilings")
        self.assertEqual([row["kind"] for row in document["rows"]], ["ldlt", "llt"])

    def test_memory_sweep_names_the_need(self):
        self.rivals_are_built()
        document = self.bench("memory", "--system", "elasticity 5", "--points", "1.1", "0.001")
        enough, none = document["rows"][1:]
        self.assertEqual(enough["outcome"], "ok", enough["message"])
        self.assertLessEqual(max(d["peak_bytes"] for d in enough["devices"]), enough["parameters"]["budget_bytes"])
        self.assertEqual(none["outcome"], "out of memory")
        self.assertRegex(none["message"], r"\d")
        self.assertGreater(document["bounds"][0]["link_seconds"], 0)


class Page(HTMLParser):
    """Collects what the tests ask of a page: tags that are open, links, drawings."""

    def __init__(self, text):
        super().__init__()
        self.outside, self.ids, self.targets, self.marks, self.tables = [], set(), set(), 0, 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.ids.add(attributes.get("id"))
        self.marks += attributes.get("class") in ("mark", "busy", "curve")
        self.tables += tag == "table"
        for name in ("href", "src"):
            value = attributes.get(name, "")
            if value.startswith("#"):
                self.targets.add(value[1:])
            elif value and value != "data:,":
                self.outside.append(value)


class Report(Cli):
    def page(self):
        out = self.folder / "report.html"
        self.expect(0, "report", *RESULTS, "--out", out)
        return out

    def test_page_stands_alone(self):
        text = self.page().read_text()
        page = Page(text)
        self.assertEqual(page.outside, [])
        self.assertNotRegex(text, r"@import|url\(|fetch\(|XMLHttp")
        self.assertLessEqual(page.targets, page.ids)
        self.assertGreaterEqual(page.tables, len(RESULTS))
        self.assertGreater(page.marks, 50)
        self.assertNotIn("{{", text)
        self.assertNotIn("nan", re.sub(r"<[^>]*>", "", text).lower().replace("nano", ""))

    def test_figures_are_those_of_the_file(self):
        document = json.loads(pathlib.Path(RESULTS[0]).read_text())
        row = next(row for row in document["rows"] if row["outcome"] == "ok")
        text = self.page().read_text()
        self.assertIn(f'data-v="{row["refactorization"]["median"]:.9g}"', text)
        self.assertIn(row["system"], text)

    def test_docs_are_up_to_date(self):
        self.expect(0, "report", "--markdown", *RESULTS, "--check", ROOT / "docs" / "notebook" / "results.md")

    def test_stale_docs_are_noticed(self):
        stale = self.file("stale.md", (ROOT / "docs" / "notebook" / "results.md").read_text().replace("ms", "s", 1))
        self.expect(2, "report", "--markdown", *RESULTS, "--check", stale, says="does not show these results")

    def test_claims_of_the_readme_have_their_rows(self):
        anchors = set(re.findall(r'<a id="([^"]+)">', (ROOT / "docs" / "notebook" / "results.md").read_text()))
        claims = re.findall(r"docs/notebook/results\.md#([\w-]+)", (ROOT / "README.md").read_text())
        self.assertTrue(claims)
        self.assertLessEqual(set(claims), anchors)

    def test_the_figures_of_the_pages_are_those_of_the_results(self):
        result = self.run_cli("evidence", "--source", ROOT)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assertIn("are those of their results", result.stdout)
        self.expect(2, "evidence", "--source", self.folder, says="no scripts/figures.py there")

    def test_text_in_results_cannot_break_the_page(self):
        document = json.loads(pathlib.Path(RESULTS[0]).read_text())
        document["rows"][0]["system"] = '<script>alert("x")</script>'
        out = self.folder / "report.html"
        self.expect(0, "report", self.file("evil.json", json.dumps(document)), "--out", out)
        self.assertNotIn("<script>alert", out.read_text())

    def test_other_files_are_refused(self):
        self.expect(2, "report", self.file("a.json", "{}"), says="schema")
        self.expect(2, "report", self.file("b.json", "no json"), says="not a JSON object")
        self.expect(2, "report", self.folder / "absent.json", says="No such file")
        self.expect(2, "report", self.folder, says="directory")
        rows = {"schema": "espalier-bench/1", "experiment": "peers", "date": "", "machine": {}, "rows": [{}]}
        self.expect(2, "report", self.file("c.json", json.dumps(rows)), says="row without system")
        for change in ({"experiment": 3}, {"subject": []}, {"machine": {"gpus": [1]}},
                       {"rows": [{"system": None, "outcome": "ok"}]}, {"command": {}}):
            wrong = self.file("d.json", json.dumps({**json.loads(pathlib.Path(RESULTS[0]).read_text()), **change}))
            for form in ([], ["--markdown"]):
                result = self.run_cli("report", wrong, "--out", self.folder / "out", *form)
                self.assertIn(result.returncode, (0, 2), (change, result.stderr))
                if result.returncode == 2:
                    self.assertIn("d.json: a field has not the type", result.stderr)
            if "experiment" in change:
                self.assertEqual(result.returncode, 2)

    def test_browser_shows_it(self):
        """Loads, logs nothing, draws: in a real browser, in both themes; the screenshots are kept."""
        browser = shutil.which("chromium") or shutil.which("chromium-browser")
        if browser is None:
            self.skipTest("chromium is not installed")
        kept = ROOT / "build" / "report"
        kept.mkdir(parents=True, exist_ok=True)
        source = self.page().read_text()
        # The page tells about itself through its title once everything ran: sizes of the drawings and a sorted column.
        probe = """<script>addEventListener("load", () => {
          const drawn = [...document.querySelectorAll("figure > svg")].map(s => s.getBoundingClientRect());
          const head = [...document.querySelectorAll("th")].find(h => h.textContent === "refactorization");
          head.firstElementChild.click();
          const column = [...head.closest("table").tBodies[0].rows].map(r => Number(r.cells[head.cellIndex].dataset.v)).filter(v => v === v);
          const sorted = column.every((v, k) => k === 0 || column[k - 1] <= v);
          document.getElementById("theme").click();
          document.title = JSON.stringify({plots: drawn.length, flat: drawn.filter(r => r.width < 100 || r.height < 40).length,
            sorted: sorted && column.length > 1, wide: document.documentElement.scrollWidth > innerWidth,
            theme: document.documentElement.dataset.theme});
        });</script></body>"""
        probed = self.file("probed.html", source.replace("</body>", probe))
        common = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--enable-logging=stderr",
                  "--window-size=1280,4000", "--virtual-time-budget=4000"]
        profile = lambda name: f"--user-data-dir={self.folder}/{name}"  # of its own: the theme is kept in it
        result = subprocess.run([*common, profile("probe"), "--dump-dom", f"file://{probed}"], capture_output=True, text=True, timeout=120)
        console = [line for line in result.stderr.splitlines() if "CONSOLE" in line]
        self.assertEqual(console, [])
        found = json.loads(re.search(r"<title>(\{.*?\})</title>", result.stdout).group(1))
        self.assertGreater(found["plots"], 3)
        self.assertEqual(found["flat"], 0)
        self.assertTrue(found["sorted"])
        self.assertFalse(found["wide"], "the page itself must not scroll sideways")
        self.assertEqual(found["theme"], "dark")
        plain = self.file("plain.html", source)
        for theme, more in (("light", []), ("dark", ["--blink-settings=preferredColorScheme=0"])):
            picture = kept / f"report-{theme}.png"
            picture.unlink(missing_ok=True)
            subprocess.run([*common, *more, profile(theme), f"--screenshot={picture}", f"file://{plain}"], capture_output=True, timeout=120)
            self.assertGreater(picture.stat().st_size, 50000)


class Server(http.server.SimpleHTTPRequestHandler):
    """Files of a folder; "cut" in the path: half of the file under the length of the whole."""

    def log_message(self, *_):
        pass

    def do_GET(self):
        if not self.path.startswith("/cut"):
            return super().do_GET()
        content = pathlib.Path(self.translate_path(self.path[len("/cut"):])).read_bytes()
        self.send_response(200)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content[: len(content) // 2])


class FetchMatrix(Cli):
    NAME, GROUP, ROWS = "nd6k", "ND", 18000

    def setUp(self):
        super().setUp()
        if shutil.which("curl") is None:
            self.skipTest("curl is not installed")
        self.web, self.cache = self.folder / "web", self.folder / "cache"
        (self.web / "MM" / self.GROUP).mkdir(parents=True)
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), lambda *a: Server(*a, directory=str(self.web)))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)
        self.url = f"http://127.0.0.1:{server.server_port}"

    def publish(self, rows, inside=None):
        """A diagonal matrix in an archive like the collection's; returns its SHA-256."""
        text = f"%%MatrixMarket matrix coordinate real symmetric\n% a comment\n{rows} {rows} {rows}\n"
        content = (text + "".join(f"{i} {i} 2.0\n" for i in range(1, rows + 1))).encode()
        member = tarfile.TarInfo(inside or f"{self.NAME}/{self.NAME}.mtx")
        member.size = len(content)
        archive = io.BytesIO()
        with tarfile.open(fileobj=archive, mode="w:gz") as tar:
            tar.addfile(member, io.BytesIO(content))
        (self.web / "MM" / self.GROUP / f"{self.NAME}.tar.gz").write_bytes(archive.getvalue())
        return hashlib.sha256(archive.getvalue()).hexdigest()

    def fetch(self, code, *arguments, url=None, says=()):
        os.environ["ESPALIER_CACHE"] = str(self.cache)
        self.addCleanup(os.environ.pop, "ESPALIER_CACHE", None)
        return self.expect(code, "fetch-matrix", self.NAME, "--url", url or self.url, *arguments, says=says)

    def nothing_kept(self):
        kept = [path.name for path in self.cache.glob("*")] if self.cache.exists() else []
        self.assertEqual([name for name in kept if name != f"{self.NAME}.sha256"], [])

    def test_fetched_matrix_is_solved(self):
        self.publish(self.ROWS)
        path = self.fetch(0).stdout.strip()
        self.assertEqual(path, str(self.cache / f"{self.NAME}.mtx"))
        report = json.loads(self.expect(0, "solve", path, "--json").stdout)
        self.assertEqual(report["matrix"]["rows"], self.ROWS)
        self.assertEqual(sorted(p.name for p in self.cache.iterdir()), [f"{self.NAME}.mtx", f"{self.NAME}.sha256"])
        shutil.rmtree(self.web)
        self.assertEqual(self.fetch(0).stdout.strip(), path)  # from the cache, without a server

    def test_checksums(self):
        right = self.publish(self.ROWS)
        self.fetch(2, "--sha256", "0" * 64, says="nothing was kept")
        self.nothing_kept()
        self.fetch(0, "--sha256", right)
        self.assertTrue((self.cache / f"{self.NAME}.sha256").read_text().startswith(right))
        archive = self.web / "MM" / self.GROUP / f"{self.NAME}.tar.gz"
        archive.write_bytes(gzip.compress(gzip.decompress(archive.read_bytes()), 1, mtime=1))
        self.fetch(2, "--force", says="first download")

    def test_trouble_is_said_and_nothing_is_kept(self):
        self.fetch(2, says="does not have it")
        self.publish(self.ROWS)
        self.fetch(2, url=self.url + "/cut", says="broke off")
        archive = self.web / "MM" / self.GROUP / f"{self.NAME}.tar.gz"
        archive.write_bytes(archive.read_bytes()[:-200])
        self.fetch(2, says="damaged")
        self.publish(self.ROWS - 1)
        self.fetch(2, says="the collection says 18000")
        self.publish(self.ROWS, inside="other/other.mtx")
        self.fetch(2, says="has no")
        self.fetch(2, url="http://127.0.0.1:9", says="is there a network?")
        self.nothing_kept()

    def test_names(self):
        listed = self.expect(0, "fetch-matrix", "--list").stdout
        for name in ("Serena", "audikw_1", "Flan_1565", "Geo_1438", "Queen_4147", "nlpkkt80"):
            self.assertIn(name, listed)
        self.expect(2, "fetch-matrix", "Sereno", says="--list")
        self.expect(2, "fetch-matrix", says="name a matrix")


if __name__ == "__main__":
    unittest.main(verbosity=2)
