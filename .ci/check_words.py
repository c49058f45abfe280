#!/usr/bin/env python3
"""Whether names and comments keep docs/design/words.md, as far as a program can tell: functions that do not say what they
do to what; types that use a word in a second meaning; comments that begin without their noun; names that belong to
values by their order alone. Says where, and fails."""

import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDERS = ["apps", "bench", "hosts", "include", "python", "src", "tests"]
CODE = (".c", ".cpp", ".cu", ".cuh", ".h", ".hpp", ".py")

VAGUE = re.compile(r"\b(?:see|take_up|put|look|there)(?:<[\w:]+>)?(?:\((?![^()]*char)| = \[)")
NO_NOUN = re.compile(r"^\s*(?://+<?|/\*\*?<?|\*|#)\s*(?:Of|Those of|Likewise)\b")
TYPE = re.compile(r"^\s*(?:struct|class|enum class|enum)\s+(?:\[\[\w+\]\]\s*)?(\w*?(Part|Range|Lane|Link|Search|Workshop|Shape|Unit)s?)\b(?!.*;)")
BY_ORDER = re.compile(r"static_cast<(?:\w+::)*[A-Z]\w*>\(\w+\.choice\(|\bk\w*Names\[(?:static_cast|at\()")
# What has a word in the one meaning of docs/design/words.md. Ranges are intervals everywhere.
TYPES = {
    "Part": {"MeshedPart", "PlainPart", "HostParts", "ComplexParts", "Parts"},
    "Lane": {"Lane", "Lanes", "ScalarLane"},
    "Link": {"Link", "LinkShape"},
    "Search": {"Search", "DeviceSearch", "QuadraticSearch", "BucklingSearch", "SimulationSearch"},
    "Workshop": {"Workshop"},
    "Shape": {"BlockShape", "BoxShape", "CapsuleShape", "CardShape", "CellShape", "CrankShape", "CylinderShape", "ElementShape",
              "FaceShape", "GearShape", "GmshShape", "GuideShape", "HalfShape", "IShape", "LineShape", "LinkShape", "MeshShape",
              "PlacedShape", "PlaneShape", "RodShape", "RollingShape", "RotorShape", "SaddleShape", "SameShape", "Shape",
              "SphereShape", "SprocketShape", "TyreShape", "WormShape"},
    "Unit": {"AxisUnit", "NamedPhysicalUnit", "PhysicalUnit", "Unit", "Units"},
}


def findings(name):
    before = ""
    for number, line in enumerate((ROOT / name).read_text(errors="replace").splitlines(), 1):
        comment = line.lstrip().startswith(("//", "*", "/*", "#"))
        goes_on = before.startswith(("//", "*", "/*", "#")) and not before.endswith((".", ":"))
        if NO_NOUN.match(line) and not goes_on:
            yield number, "a comment that begins without its noun"
        if not comment and name.endswith(CODE[:-1]) and VAGUE.search(line.split('"')[0].split("//")[0]):
            yield number, "a function that does not say what it does"
        if name.startswith(("src/", "apps/")) and BY_ORDER.search(line):
            yield number, "an enumerator and its name that agree by their order; give both in rows of base::Named"
        if (found := TYPE.match(line)) and found[2] != "Range" and found[1] not in TYPES[found[2]]:
            yield number, f"{found[1]}: \"{found[2].lower()}\" has one meaning (docs/design/words.md); if it is this one, add the type here"
        before = line.strip()


def main():
    listed = subprocess.run(["git", "ls-files", *FOLDERS], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    lines = [f"{name}:{number}: {what}" for name in listed.split() if name.endswith(CODE) for number, what in findings(name)]
    print("\n".join(lines) or "names and comments keep docs/design/words.md")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
