"""Mutants on a machine without compilers: what a run needs in one archive, and its results back (mutate.py --pack, --packed, --merge)."""

import hashlib
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

SYSTEM = ("linux-vdso", "libc.so", "libm.so", "libstdc++", "libgcc_s")  # every machine has its own
COSTS = "Testing/Temporary/CTestCostData.txt"


def digest(group):
    """Of the list of mutants: results of another list are not taken."""
    return hashlib.sha256(json.dumps(group.of["mutants"], sort_keys=True).encode()).hexdigest()


def libraries(program):
    """The shared libraries of a program that another machine may lack."""
    shown = subprocess.run(["ldd", str(program)], check=True, capture_output=True, text=True)
    words = [line.split() for line in shown.stdout.splitlines() if "=>" in line]
    return [Path(w[2]) for w in words if not w[0].startswith(SYSTEM)]


def pack(groups, target):
    """Per group its mutants, results and stripped programs; the libraries of all programs in lib."""
    with tempfile.TemporaryDirectory() as stage:
        stage = Path(stage)
        for group in groups:
            folder = stage / group.folder.name
            folder.mkdir()
            for program in group.programs:
                subprocess.run(["strip", "-o", str(folder / program), str(group.folder / program)], check=True)
                for library in libraries(group.folder / program):
                    (stage / "lib").mkdir(exist_ok=True)
                    shutil.copy(library, stage / "lib" / library.name)
            # What each test comes past is asked anew on the other machine, and with that, which tests pass there.
            known = {"mutants": group.of["mutants"], "results": group.of["results"], "tests": {}}
            (folder / "state.json").write_text(json.dumps(known))
            if (group.build / COSTS).exists():
                (stage / COSTS).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(group.build / COSTS, stage / COSTS)
        subprocess.run(["tar", "-cJf", str(target), *sorted(os.listdir(stage))], cwd=stage, check=True)


def write_results(groups, target):
    of = {group.folder.name: {"mutants": digest(group), "results": group.of["results"]} for group in groups}
    target.write_text(json.dumps(of, indent=0))


def merge(groups, source):
    """Takes the results of mutants that have none here, and kills of those that survived here."""
    given = json.loads(source.read_text())
    for group in groups:
        theirs = given.get(group.folder.name)
        if theirs is None or theirs["mutants"] != digest(group):
            print(f"{group.folder.name}: {'no results' if theirs is None else 'results of other mutants'} in {source}")
            continue
        ours, taken = group.of["results"], 0
        for number, result in theirs["results"].items():
            if number not in ours or (result.startswith("killed") and not ours[number].startswith("killed")):
                ours[number] = result
                taken += 1
        group.save()
        print(f"{group.folder.name}: {taken} results taken")
