#!/usr/bin/env python3
"""Takes the rows of later runs into a file of results, where a machine was lent too briefly for one run.

    scripts/merge_results.py FILE LATER.json...

A row replaces that of the same system and contestant, or stands behind the last row of its system, and says in `run` of
which commit, date and command it is; the report marks such rows. Runs are merged only where machine and experiment agree."""

import json
import sys


def same(a, b):
    return a["system"] == b["system"] and a["rival"] == b["rival"] and a["parameters"] == b["parameters"]


def place(rows, row):
    """Where `row` goes: (index, how many it replaces)."""
    for k, old in enumerate(rows):
        if same(old, row):
            return k, 1
    of_system = [k for k, old in enumerate(rows) if old["system"] == row["system"]]
    return (of_system[-1] + 1 if of_system else len(rows)), 0


def merge(into, later, name):
    for key in ("processor", "cores", "gpus"):
        if into["machine"][key] != later["machine"][key]:
            sys.exit(f"{name}: another machine ({key}: {later['machine'][key]})")
    if into["experiment"] != later["experiment"]:
        sys.exit(f"{name}: another experiment")
    for row in later["rows"]:
        at, replaced = place(into["rows"], row)
        run = row.get("run", {key: later[key] for key in ("commit", "date", "command")})
        into["rows"][at:at + replaced] = [{**row, "run": run}]


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    path, *others = sys.argv[1:]
    with open(path, encoding="utf-8") as file:
        into = json.load(file)
    for other in others:
        with open(other, encoding="utf-8") as file:
            merge(into, json.load(file), other)
    with open(path, "w", encoding="utf-8") as file:
        file.write(json.dumps(into, indent=1, ensure_ascii=False, sort_keys=True) + "\n")


main()
