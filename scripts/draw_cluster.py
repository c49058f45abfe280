#!/usr/bin/env python3
"""Simulates elasticity on cubes on 8 to 1,024 H200s in machines of eight, prints the table and draws it.

    scripts/draw_cluster.py --build build/release [--cubes 96,128,160] --out docs/images/cluster.png

Takes about two minutes and 5 GB. Needs matplotlib (the group "pictures" of scripts/packages.txt), and
cmake --build BUILD --target espalier_cluster_plan.
"""
import argparse
import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

COUNTS = [8, 16, 32, 64, 128, 256, 512, 1024]


def simulate(program, cubes, *more):
    """{cube: {GPUs: (seconds, check)}}"""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "cluster.json"
        subprocess.run([program, *map(str, cubes), "--counts", ",".join(map(str, COUNTS)), "--out", out, *more],
                       check=True, stdout=subprocess.DEVNULL)
        found = defaultdict(dict)
        for row in json.loads(out.read_text())["rows"]:
            seconds = row["refactorization"]["least"]
            found[int(row["system"].split()[1])][row["parameters"]["devices"]] = (seconds, row["check"])
        return found


def print_table(direct, relayed):
    print("| GPUs | " + " | ".join(f"{cube}^3 | relayed | work, chain, network" for cube in direct) + " |")
    print("|---|" + "---|---|---|" * len(direct))
    for count in COUNTS:
        cells = []
        for cube, points in direct.items():
            seconds, check = points[count]
            bounds = ", ".join(f"{check[key]:.3f}" for key in ("work", "chain", "network"))
            cells.append(f"{seconds:.3f} | {relayed[cube][count][0]:.3f} | {bounds}")
        print(f"| {count} | " + " | ".join(cells) + " |")


def draw(direct, relayed, out):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.6), dpi=120)
    for k, cube in enumerate(direct):
        colour = f"C{k}"
        axes.plot(COUNTS, [direct[cube][c][0] for c in COUNTS], "-", color=colour, label=f"{cube}^3, maker sends to each machine")
        axes.plot(COUNTS, [relayed[cube][c][0] for c in COUNTS], "--", color=colour, label=f"{cube}^3, machines relay")
        axes.plot(COUNTS, [direct[cube][c][1]["work"] for c in COUNTS], ":", color=colour, linewidth=1)
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.set_xticks(COUNTS, [str(c) for c in COUNTS])
    axes.set_xlabel("H200s in machines of eight, 400 Gb/s each (dotted: work alone)")
    axes.set_title("refactorization, s (simulated)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=Path("build/release"))
    parser.add_argument("--cubes", default="96,128,160")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    program = arguments.build / "bench" / "espalier_cluster_plan"
    if not program.exists():
        sys.exit(f"{program} is not there: cmake --build {arguments.build} --target espalier_cluster_plan")
    cubes = [int(word) for word in arguments.cubes.split(",")]
    direct, relayed = simulate(program, cubes), simulate(program, cubes, "--relay")
    print_table(direct, relayed)
    if arguments.out:
        draw(direct, relayed, arguments.out)


if __name__ == "__main__":
    main()
