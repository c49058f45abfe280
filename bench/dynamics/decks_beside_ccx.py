#!/usr/bin/env python3
"""Decks of CalculiX run by one line, beside CalculiX itself: all displacements and frequencies.

  bench/dynamics/decks_beside_ccx.py [build/release/espalier] [--keep FOLDER] [--numbers]

The largest difference of each deck, relative to the largest displacement or to each frequency. CalculiX prints seven digits. Needs `ccx`
(Debian: calculix-ccx); without it nothing is compared. --numbers prints what tests/cli/deck_test.py holds.
"""
import argparse
import csv
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/cli"))
import decks  # noqa: E402


def of_ccx(folder, name, deck):
    """Node -> displacement, or frequencies."""
    (folder / f"{name}.inp").write_text(deck)
    run = subprocess.run(["ccx", name], cwd=folder, capture_output=True, text=True)
    if "Job finished" not in run.stdout:
        raise SystemExit(run.stdout[-2000:])
    lines = (folder / f"{name}.dat").read_text().splitlines()
    if "FREQUENCY" in deck:
        start = next(k for k, line in enumerate(lines) if "RAD/TIME" in line) + 2
        return [float(line.split()[3]) for line in lines[start:start + 6]]
    words = [line.split() for line in lines[3:]]
    return {int(w[0]): [float(x) for x in w[1:4]] for w in words if len(w) == 4}


def of_espalier(program, folder, name, deck, labels):
    path = folder / f"{name}.inp"
    path.write_text(deck)
    if "FREQUENCY" in deck:
        run = subprocess.run([program, "simulate", str(path), "--json"], capture_output=True, text=True)
        if run.returncode != 0:
            raise SystemExit(run.stderr)
        return [mode["frequency"] for mode in json.loads(run.stdout)["initial"]["modes"]]
    model = folder / f"{name}.toml"
    markers = "".join(f"n{label} = {{ body = \"part\", node = {label} }}\n" for label in labels)
    quantities = ", ".join(f'"n{label}.position"' for label in labels)
    model.write_text(f'bodies.part = {{ type = "solid", mesh = {{ file = "{name}.inp", take = "all" }} }}\n[markers]\n{markers}[output]\nquantities = [{quantities}]\n')
    run = subprocess.run([program, "simulate", str(model), "--no-page", "--out", str(folder / name)], capture_output=True, text=True)
    if run.returncode != 0:
        raise SystemExit(run.stderr)
    with open(folder / name / "quantities.csv") as file:
        row = list(csv.DictReader(file))[-1]
    places = decks.places_of(deck)
    return {label: [float(row[f"n{label}.position.{d}"]) - places[label][k] for k, d in enumerate("xyz")] for label in labels}


def difference(ours, theirs):
    if isinstance(theirs, list):
        return max(abs(a / b - 1) for a, b in zip(ours, theirs))
    size = max(abs(x) for u in theirs.values() for x in u)
    return max(abs(a - b) for label, u in theirs.items() if label in ours for a, b in zip(ours[label], u)) / size


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", nargs="?", default=str(ROOT / "build/release/espalier"))
    parser.add_argument("--keep")
    parser.add_argument("--numbers", action="store_true")
    parser.add_argument("--only", default="")
    args = parser.parse_args()
    if shutil.which("ccx") is None:
        print("ccx was not found (apt-get install calculix-ccx): nothing is compared")
        return
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(args.keep or scratch)
        folder.mkdir(exist_ok=True)
        for name, make in decks.DECKS.items():
            if args.only not in name:
                continue
            deck, file = make(), name.replace(" ", "_").lower()
            theirs = of_ccx(folder, file, deck)
            if args.numbers:
                if not isinstance(theirs, list):
                    labels = sorted(theirs, key=lambda label: -max(map(abs, theirs[label])))[:3]
                    theirs = {label: theirs[label] for label in labels}
                print(f"    {name!r}: {theirs},")
                continue
            labels = [label for label in decks.labels_of(deck)]
            ours = of_espalier(args.program, folder, file, deck, labels)
            print(f"{name:24} {difference(ours, theirs):8.1e}", flush=True)


if __name__ == "__main__":
    main()
