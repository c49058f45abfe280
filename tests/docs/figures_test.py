#!/usr/bin/env python3
"""scripts/figures.py against pages and results that are wrong on purpose. Truth: the figure that was changed is the one that it names.

    python3 tests/docs/figures_test.py --binary build/release/espalier
"""
import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KEPT = ("README.md", "bench/figures.toml", "bench/results", "docs/guide/performance.md", "docs/notebook")


def said(folder, *words):
    done = subprocess.run([sys.executable, ROOT / "scripts/figures.py", "--source", folder, *words], capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def expect(folder, code, says, *words):
    got, text = said(folder, *words)
    assert got == code and all(one in text for one in says), f"{words}: {got} in place of {code}, {says} in:\n{text}"


def changed(folder, name, old, new):
    """Has the file changed, and gives back what it was."""
    text = (folder / name).read_text()
    assert text.count(old) >= 1, f"{name} has no '{old}'"
    (folder / name).write_text(text.replace(old, new, 1))
    return text


def counted_otherwise(folder):
    """A small system under the record of a large one: the page is that of the record, the machine counts others."""
    for name in ("bench/results/NVIDIA-H200-peers-2026-11-29.json", "bench/figures.toml"):
        (folder / name).write_text((folder / name).read_text().replace("gyroscopic 48", "gyroscopic 4"))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--binary", required=True)
    binary = parser.parse_args().binary
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for kept in KEPT:
            (folder / kept).parent.mkdir(parents=True, exist_ok=True)
            (shutil.copytree if (ROOT / kept).is_dir() else shutil.copy)(ROOT / kept, folder / kept)
        expect(folder, 0, ["are those of their results"])
        for page, old, new, says in [
                ("README.md", "1.9 to 7.5 times", "1.9 to 7.9 times", "'**1.9 to 7.5 times as fast**' stands there 0 times"),
                ("README.md", "\nStatus:", "\nIt is 40 times as fast. Status:", "a number without a figure"),
                ("bench/figures.toml", '"elasticity 96: four.unknowns", ', "", "has 2 numbers, its values are 1"),
                ("docs/notebook/README.md", "5.89 ms", "5.98 ms", "does not stand in"),
                ("bench/results/cpu-2-cores-2026-11-21.json", '"outcome": "ok"', '"outcome": "wrong answer"', "wrong answer"),
                ("bench/results/cpu-2-cores-2026-11-21.json", '"commit": "', '"commits": "', "has no commit")]:
            text = changed(folder, page, old, new)
            expect(folder, 1, [says])
            (folder / page).write_text(text)
        # A figure of the page and of the table that is not that of the record.
        texts = [(page, changed(folder, page, "in **0.99 s**", "in **0.89 s**")) for page in ("README.md", "bench/figures.toml")]
        expect(folder, 1, ["0.89 is 0.985826", "four.refactorization"])
        for page, text in texts:
            (folder / page).write_text(text)
        counts = ("--verify", "--only", "count", "--binary", binary)
        expect(folder, 2, ["without time"], *counts, "--share", "1", "--seconds", "0.001")
        counted_otherwise(folder)
        expect(folder, 6, ["MOVED: docs/guide/performance.md: '346,000'", "without time"], *counts, "--share", "1", "--seconds", "2")
    print("ok")


if __name__ == "__main__":
    main()
