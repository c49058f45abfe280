#!/usr/bin/env python3
"""Makes docs/notebook/step_errors.md and docs/images/step_errors.png: error against step on six mechanisms.

    python3 scripts/draw_step_errors.py --program build/release/bench/espalier_bench_step_errors \\
      --exudyn VENV/bin/python                       # measures (some minutes), then writes both
    python3 scripts/draw_step_errors.py              # writes both anew from docs/notebook/step_errors.json

--exudyn names a Python that has exudyn (pip install exudyn); without it that part of the file stays as it was.
Needs matplotlib (the group "pictures" of scripts/packages.txt).
"""
import argparse
import json
import math
import subprocess
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT / "docs/notebook/step_errors.json"
PAGE = ROOT / "docs/notebook/step_errors.md"
PICTURE = ROOT / "docs/images/step_errors.png"
METHODS = {"alpha": "generalized-alpha", "hht": "HHT", "bdf1": "BDF 1", "bdf2": "BDF 2", "bdf3": "BDF 3",
           "bdf4": "BDF 4", "bdf5": "BDF 5"}
ORDER = {"alpha": 2, "hht": 2, "bdf1": 1, "bdf2": 2, "bdf3": 3, "bdf4": 4, "bdf5": 5}
KINDS = {"q": "positions", "v": "velocities", "a": "accelerations", "lambda": "multipliers"}


def measure(program, exudyn, document):
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for methods, smallest in ((["alpha", "hht"], 1e-5), (["bdf1", "bdf2"], 1e-4), (["bdf3", "bdf4", "bdf5"], 2e-4)):
            file = Path(folder) / "rows.json"
            subprocess.run([program, "--methods", *methods, "--largest", "5e-3", "--smallest", str(smallest), "--json",
                            str(file)], check=True)
            rows += json.loads(file.read_text())
        keep = ("case", "title", "method", "h", "q", "v", "a", "lambda", "steps", "iterations", "factorizations",
                "rounded", "rounding", "failed")
        document["rows"] = [{k: shorter(r[k]) for k in keep if k in r} for r in rows]
        if exudyn:
            file = Path(folder) / "exudyn.json"
            subprocess.run([exudyn, str(ROOT / "bench/dynamics/exudyn_steps.py"), program, "--json", str(file)], check=True)
            document["exudyn"] = [{k: shorter(v) for k, v in r.items()} for r in json.loads(file.read_text())]


def shorter(value):
    if isinstance(value, float):
        return float(f"{value:.3g}")
    return [shorter(x) for x in value] if isinstance(value, list) else value


def by_case(rows):
    cases = {}
    for row in rows:
        if "failed" not in row:
            cases.setdefault((row["case"], row["title"]), {}).setdefault(row["method"], []).append(row)
    return cases


def slope(points, kind, floor):
    """Median of the slopes between neighbours a factor of 4 to 11 apart, among the errors from 0.3 down to the least one."""
    end = best_error(points, kind)["h"]
    good = [p for p in points if floor <= p[kind] < 0.3 and p["h"] >= end]
    slopes = sorted(math.log(a[kind] / b[kind]) / math.log(a["h"] / b["h"]) for a in good for b in good
                    if 3.9 * b["h"] < a["h"] < 11 * b["h"])
    return slopes[len(slopes) // 2] if slopes else None


def draw(cases):
    figure, axes = plt.subplots(len(cases), 4, figsize=(13, 2.5 * len(cases)), dpi=90, sharey=True)
    for line, ((_, title), methods) in zip(axes, cases.items()):
        for axis, (kind, word) in zip(line, KINDS.items()):
            for k, (method, points) in enumerate(methods.items()):
                axis.loglog([p["h"] for p in points], [max(p[kind], 1e-17) for p in points], ".-", markersize=4,
                            linewidth=1, color=f"C{k}", label=METHODS[method])
            axis.grid(alpha=0.3)
            axis.set_ylim(1e-16, 10)
            axis.set_title(f"{title}: {word}", fontsize=8)
            axis.tick_params(labelsize=7)
    axes[0][0].legend(fontsize=6, loc="lower right")
    for axis in axes[-1]:
        axis.set_xlabel("step, s", fontsize=8)
    figure.tight_layout()
    figure.savefig(PICTURE)


def number(x):
    return f"{x:.0e}".replace("e-0", "e-").replace("e+00", "")


def best_error(points, kind):
    return min(points, key=lambda p: p[kind])


def summary_table(cases):
    lines = ["| mechanism | method | order seen: q, v, a, multipliers | least error of q (at h) | of v | of a | of multipliers |",
             "|---|---|---|---|---|---|---|"]
    for (_, title), methods in cases.items():
        for method, points in methods.items():
            seen = [slope(points, kind, max(best_error(points, kind)[kind], 1e-13)) for kind in KINDS]
            least = [best_error(points, kind) for kind in KINDS]
            lines.append(f"| {title} | {METHODS[method]} | " + ", ".join("-" if s is None else f"{s:.1f}" for s in seen) + " | " +
                         " | ".join(f"{number(p[k])} ({number(p['h'])})" for p, k in zip(least, KINDS)) + " |")
    return lines


def full_tables(cases):
    lines = []
    for (_, title), methods in cases.items():
        lines += ["", f"### {title}", "", "| h | " + " | ".join(METHODS[m] for m in methods) + " |",
                  "|---|" + "---|" * len(methods)]
        steps = sorted({p["h"] for points in methods.values() for p in points}, reverse=True)
        for h in steps:
            cells = []
            for points in methods.values():
                found = [p for p in points if p["h"] == h]
                cells.append(" ".join(number(found[0][k]) for k in KINDS) if found else "")
            lines.append(f"| {number(h)} | " + " | ".join(cells) + " |")
    return lines


def exudyn_table(rows):
    lines = ["| mechanism | h | Espalier: q, v, a | Exudyn: q, v, a | Espalier, s | Exudyn, s | times as fast |",
             "|---|---|---|---|---|---|---|"]
    for r in rows:
        lines.append(f"| {r['title']} | {number(r['h'])} | " + " ".join(number(x) for x in r["espalier"]) + " | " +
                     " ".join(number(x) for x in r["exudyn"]) + f" | {r['espalier_seconds']:.3g} | {r['exudyn_seconds']:.3g} | "
                     f"{r['exudyn_seconds'] / r['espalier_seconds']:.1f} |")
    return lines


def write(document):
    cases = by_case(document["rows"])
    draw(cases)
    text = ["# Error against step", "",
            "Made by `scripts/draw_step_errors.py` from [step_errors.json](step_errors.json), which",
            "`scripts/draw_step_errors.py --program build/release/bench/espalier_bench_step_errors --exudyn PYTHON` measures. Errors",
            "at the end of the motion, each the largest difference from the truth over the largest number of its kind: of the",
            "coordinates q, velocities v, accelerations a and multipliers. The truth comes from another integrator",
            "(`tests/dynamics/integrators/step_cases.hpp`). All options are the defaults: spectral radius 0.8, HHT with alpha -0.1, BDF with",
            "constant step and order, from exact starting points. How the methods end Newton's iteration:",
            "[simulate.md](../guide/simulate.md#constant-steps). Measured on 2026-11-22 on two cores that did other work as well: times",
            "are rough. Accelerations and multipliers of generalized-alpha and HHT meet rounding, which grows with 1 / h^2, at",
            "1e-6 to 1e-8. Errors of the car axis begin where its steps resolve the springs, and the axial vibrations of the flexible",
            "pendulum spoil the order of its accelerations until its steps resolve them.", "", "![error against step](../images/step_errors.png)", "",
            "## What each method reaches", "", *summary_table(cases), "", "## Beside Exudyn", "",
            "`bench/dynamics/exudyn_steps.py`, `--repeats 1`, both programs in turn on one thread of a busy machine; Exudyn 1.13 with its",
            "defaults but for the spectral radius 0.8 and index 3. q, v, a: of the bodies' centres (of the nodes). On the spatial crank",
            "and the flexible pendulum both have the same errors down to rounding. The heavy top shows what coordinates do: in axes that",
            "turn with the body whatever is slow outside oscillates with its speed of 150 rad/s, in Exudyn's quaternion with half of it.",
            "In body axes our errors were 3.5 times Exudyn's; velocities and accelerations are integrated in axes that do not turn now,",
            "and errors are 0.7 times Exudyn's.", "",
            *exudyn_table(document.get("exudyn", [])), "", "## All errors", "",
            "Each cell: errors of q, v, a, multipliers."]
    text += full_tables(cases)
    PAGE.write_text("\n".join(text) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", help="espalier_bench_step_errors: measure anew")
    parser.add_argument("--exudyn", help="a Python with exudyn: measure that anew, too")
    arguments = parser.parse_args()
    document = json.loads(DATA.read_text()) if DATA.exists() else {}
    if arguments.program:
        measure(arguments.program, arguments.exudyn, document)
        rows = ",\n  ".join(json.dumps(r) for r in document["rows"])
        other = ",\n  ".join(json.dumps(r) for r in document.get("exudyn", []))
        DATA.write_text(f'{{\n "rows": [\n  {rows}\n ],\n "exudyn": [\n  {other}\n ]\n}}\n')
    write(document)


if __name__ == "__main__":
    main()
