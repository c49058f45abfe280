#!/usr/bin/env python3
"""Motions of decks beside CalculiX: with shorter and shorter steps the two come together, or it is said why they do not.

  bench/dynamics/motions_beside_ccx.py [build/release/espalier] [--keep FOLDER]

Each line: steps, the end of the motion in CalculiX and here, and their difference over the motion. CalculiX's implicit steps (*DYNAMIC,
DIRECT) are those of HHT with alpha = -0.05, ours too. Decks of the package calculix-ccx-test are read where they are installed; `led` and `shaken`
are one motion, seen from outside and from the support: CalculiX leaves out the masses that led nodes share with free ones, and differs from itself.
"""
import argparse
import csv
import gzip
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/cli"))
import deck_motion_test as motions  # noqa: E402

TESTS = pathlib.Path("/usr/share/doc/calculix-ccx-test/examples/test")


def of_ccx(folder, name, deck, node):
    (folder / f"{name}.inp").write_text(re.sub(r"\*(NODE|EL) PRINT[^*]*", "", deck).replace(
        "*END STEP", f"*NODE PRINT, NSET=SEEN\nU\n*END STEP", 1).replace("*STEP", f"*NSET, NSET=SEEN\n{node}\n*STEP", 1))
    run = subprocess.run(["ccx", name], cwd=folder, capture_output=True, text=True)
    if "Job finished" not in run.stdout:
        raise SystemExit(run.stdout[-1000:])
    rows = [line.split() for line in (folder / f"{name}.dat").read_text().splitlines()]
    return [float(x) for x in [r for r in rows if len(r) == 4 and r[0] == str(node)][-1][1:]]


def of_espalier(program, folder, name, deck, node):
    (folder / f"{name}.inp").write_text(deck)
    model = folder / f"{name}.toml"
    model.write_text(f'bodies.part = {{ type = "solid", mesh = {{ file = "{name}.inp", take = "all" }} }}\nmarkers.seen = {{ body = "part", node = {node} }}\n'
                     '[output]\nquantities = ["seen.position"]\n')
    out = folder / f"{name}.out"
    shutil.rmtree(out, ignore_errors=True)
    run = subprocess.run([program, "simulate", str(model), "--no-page", "--out", str(out)], capture_output=True, text=True)
    if run.returncode != 0:
        raise SystemExit(run.stderr)
    with open(out / "quantities.csv") as file:
        rows = list(csv.DictReader(file))
    return [float(rows[-1][f"seen.position.{d}"]) - float(rows[0][f"seen.position.{d}"]) for d in "xyz"]


def of_package(name):
    """The first step of a deck, as implicit steps of a given length; none where the package is not there."""
    packed, plain = TESTS / f"{name}.inp.gz", TESTS / f"{name}.inp"  # short files are not packed
    if not packed.exists() and not plain.exists():
        return None
    text = (gzip.open(packed, "rt").read() if packed.exists() else plain.read_text()).replace("EXPLICIT", "DIRECT")
    first = text.index("*STEP")
    text = text[:text.find("*END STEP", first) + len("*END STEP")] + "\n"
    period = re.search(r"\*DYNAMIC.*\n[^,]*,([^,\n]*)", text).group(1)
    return lambda n: re.sub(r"(\*DYNAMIC.*\n)[^,]*,[^\n]*", lambda m: f"{m[1]}{float(period) / n:.9e}, {period}", text)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", nargs="?", default=str(ROOT / "build/release/espalier"))
    parser.add_argument("--keep")
    args = parser.parse_args()
    if shutil.which("ccx") is None:
        print("ccx was not found (apt-get install calculix-ccx calculix-ccx-test): nothing is compared")
        return
    cases = [("pushed", lambda n: motions.pushed(motions.by_steps(n)), motions.TIP, (50, 200, 800)),
             ("shaken", lambda n: motions.shaken(motions.by_steps(n)), motions.TIP, (100, 400, 1600)),
             ("led", lambda n: motions.led(motions.by_steps(n)), motions.TIP, (100, 400, 1600)),
             ("beamnldy", of_package("beamnldy"), 100, (1, 2, 8, 32)), ("beamnldye", of_package("beamnldye"), 100, (1, 4, 16)),
             ("equrem1", of_package("equrem1"), 15, (20, 40, 80))]
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(args.keep or scratch)
        folder.mkdir(exist_ok=True)
        for name, make, node, steps in cases:
            if make is None:
                print(f"{name}: the package calculix-ccx-test is not installed")
                continue
            for n in steps:
                deck = make(n).replace("*STEP", "*STEP, INC=1000000", 1)
                theirs, ours = of_ccx(folder, name, deck, node), of_espalier(args.program, folder, f"{name}-{n}", deck, node)
                size = max(map(abs, theirs))
                apart = max(abs(a - b) for a, b in zip(ours, theirs)) / size
                largest = max(range(3), key=lambda d: abs(theirs[d]))
                print(f"{name:10} {n:6} steps  {theirs[largest]:14.6e} {ours[largest]:14.6e}  {apart:8.1e}", flush=True)


if __name__ == "__main__":
    main()
