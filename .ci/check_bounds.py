#!/usr/bin/env python3
"""The regression gate that no clock can disturb: work counted, not timed.

    .ci/check_bounds.py [--binary build/release/espalier] [--update]

For fixed systems it compares with .ci/bounds.json: flops, entries of the factor and number of fronts of the ordering;
predicted and peak memory; instructions of a whole `espalier analyze` and `espalier solve` on one thread, counted by
callgrind (which offers every machine the same instruction set). For larger systems, whose separators behave otherwise than
small ones', the ordering alone. A figure above its bound by more than the tolerance of
its quantity fails (fractions of a percent for what a run repeats exactly, 3 % for instructions, which another minor version of
the compiler moves); one far below it is told. --update writes what is measured as the new bounds. Without valgrind the instructions are skipped,
and said to be."""

import argparse
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

BOUNDS = pathlib.Path(__file__).with_name("bounds.json")


def run(command):
    result = subprocess.run(command, capture_output=True, text=True, timeout=300)
    if result.returncode != 0:
        sys.exit(f"{' '.join(command)} ended with {result.returncode}: {result.stderr.strip()[-500:]}")
    return result


def counters(binary, system):
    """What the solver itself counts; the same in every run."""
    report = json.loads(run([binary, "solve", "--generate", system, "--device", "cpu", "--threads", "1", "--json"]).stdout)
    return {
        "flops": report["analysis"]["flops"],
        "nonzeros_factor": report["analysis"]["nonzeros_factor"],
        "fronts": report["analysis"]["fronts"],
        "predicted_bytes": report["memory"]["predicted_bytes"],
        "peak_host_bytes": report["memory"]["peak_host_bytes"],
    }


def instructions(binary, verb, system):
    with tempfile.TemporaryDirectory() as folder:
        # From main() on: before it, the loader works, and libhwy measures a clock, which takes as long as it takes.
        result = run(["valgrind", "--tool=callgrind", "--toggle-collect=main", f"--callgrind-out-file={folder}/out", binary,
                      verb, "--generate", system, "--device", "cpu", "--threads", "1", "--json"])
    return int(re.search(r"Collected : (\d+)", result.stderr).group(1))


def fill(binary, system):
    report = json.loads(run([binary, "analyze", "--generate", system, "--device", "cpu", "--json"]).stdout)
    return {name: report["analysis"][name] for name in ("flops", "nonzeros_factor")}


def measure(binary, system, ordering_alone, count_instructions):
    if ordering_alone:
        return fill(binary, system)
    figures = counters(binary, system)
    if count_instructions:
        for verb in ("analyze", "solve"):
            figures[f"{verb}_instructions"] = instructions(binary, verb, system)
    return figures


def violations(system, measured, bounds, tolerance):
    """Figures above their bound. A bound without a figure is a violation, too, unless it counts instructions."""
    found = []
    for name, bound in bounds.items():
        kind = "instructions" if name.endswith("_instructions") else name
        if name not in measured:
            if kind != "instructions":
                found.append(f"{system}: {name} was not measured")
            continue
        limit = bound * (1 + tolerance[kind])
        if measured[name] > limit:
            found.append(f"{system}: {name} is {measured[name]:,.0f}, {measured[name] / bound - 1:+.1%} of its bound "
                         f"{bound:,.0f} (allowed {tolerance[kind]:+.0%})")
    return found


def loose(system, measured, bounds, tolerance):
    """Bounds so far above their figures that a loss could hide below them."""
    for name, value in measured.items():
        kind = "instructions" if name.endswith("_instructions") else name
        if name in bounds and value < bounds[name] * (1 - 2 * tolerance[kind]):
            yield f"{system}: {name} is {1 - value / bounds[name]:.1%} below its bound; --update tightens it"


def self_test(bounds, tolerance):
    """The gate must close: every figure 5 % higher is found, none at its bound is."""
    for system, figures in bounds.items():
        worse = {name: 1.05 * value for name, value in figures.items()}
        assert len(violations(system, worse, figures, tolerance)) == len(figures), system
        assert not violations(system, figures, figures, tolerance), system
        assert len(list(loose(system, {name: 0.5 * value for name, value in figures.items()}, figures, tolerance))) == len(figures)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--binary", default="build/release/espalier")
    parser.add_argument("--update", action="store_true")
    arguments = parser.parse_args()
    content = json.loads(BOUNDS.read_text())
    self_test(content["systems"], content["tolerance"])
    with_valgrind = shutil.which("valgrind") is not None
    if not with_valgrind:
        print("valgrind is not installed: instructions are not counted")
    found, hints = [], []
    for system, bounds in content["systems"].items():
        measured = measure(arguments.binary, system, set(bounds) <= {"flops", "nonzeros_factor"}, with_valgrind)
        print(system + ": " + ", ".join(f"{name} {value:,.0f}" for name, value in measured.items()))
        found += violations(system, measured, bounds, content["tolerance"])
        hints += loose(system, measured, bounds, content["tolerance"])
        if arguments.update:
            content["systems"][system] = {**bounds, **measured}
    if arguments.update:
        BOUNDS.write_text(json.dumps(content, indent=2) + "\n")
        return 0
    print("\n".join(hints), end="\n" if hints else "")
    print("\n".join(found) if found else "all figures are within their bounds")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
