#!/usr/bin/env python3
"""Draws how the refactorization scales with the number of GPUs: simulated times as lines, measured ones as dots.

    build/release/bench/espalier_gpu_check --plan --devices 0 --counts 1,2,4,8,16,64 --out simulated.json "elasticity 64" ...
    python3 scripts/draw_scaling.py bench/results/simulated-*.json bench/results/NVIDIA-H200x2-2026-11-22.json \\
      --out docs/images/scaling.png

Needs matplotlib (the group "pictures" of scripts/packages.txt).
"""
import argparse
import json
from collections import defaultdict
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def times(document):
    """{system: {GPUs: seconds}} of a file of results."""
    found = defaultdict(dict)
    for row in document["rows"]:
        if row["outcome"] == "ok" and row["refactorization"]:
            found[row["system"]][row["parameters"]["devices"]] = row["refactorization"]["least"]
    return found


def draw(simulated, measured, out):
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.4), dpi=120)
    for k, (system, points) in enumerate(sorted(simulated.items(), key=lambda item: -item[1][1])):
        counts = sorted(points)
        colour = f"C{k}"
        left.plot(counts, [1e3 * points[c] for c in counts], "-", color=colour, label=system)
        right.plot(counts, [points[1] / points[c] for c in counts], "-", color=colour, label=system)
        dots = measured.get(system, {})
        left.plot(sorted(dots), [1e3 * dots[c] for c in sorted(dots)], "o", color=colour, markersize=5)
        if 1 in dots:
            right.plot(sorted(dots), [dots[1] / dots[c] for c in sorted(dots)], "o", color=colour, markersize=5)
    most = max(c for points in simulated.values() for c in points)
    right.plot([1, most], [1, most], ":", color="grey", linewidth=1)
    for axes, title in ((left, "refactorization, ms"), (right, "times as fast as one GPU")):
        axes.set_xscale("log", base=2)
        axes.set_yscale("log", base=10 if axes is left else 2)
        axes.set_xlabel("H200s (lines simulated, dots measured)")
        axes.set_title(title)
        axes.grid(alpha=0.3)
        axes.set_xticks([1, 2, 4, 8, 16, 32, 64], ["1", "2", "4", "8", "16", "32", "64"])
    right.set_yticks([1, 2, 4, 8, 16, 32, 64], ["1", "2", "4", "8", "16", "32", "64"])
    right.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", nargs="+", type=Path, help="files of espalier_gpu_check, with --plan and without")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    simulated, measured = defaultdict(dict), defaultdict(dict)
    for path in arguments.results:
        document = json.loads(path.read_text())
        into = simulated if document["experiment"] == "simulated" else measured
        for system, points in times(document).items():
            into[system].update(points)
    draw(simulated, measured, arguments.out)


if __name__ == "__main__":
    main()
