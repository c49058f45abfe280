#!/usr/bin/env python3
"""Real hosts on our libraries and on their own solvers, as a table in docs/guide/hosts.md. One command:

    python3 -m venv env && env/bin/pip install casadi clarabel
    env/bin/python tests/hosts/table.py [--libraries build/release/hosts] [--repeat 2] [--quick]

Where a host is not installed, the table says so. Fails where answers differ; the table is written in any case.
"""
import argparse
import datetime
import importlib.util
import json
import os
import pathlib
import subprocess
import sys
import tempfile

FOLDER = pathlib.Path(__file__).resolve().parent
GUIDE = FOLDER.parents[1] / "docs" / "guide" / "hosts.md"
BEGIN, END = "<!-- tests/hosts/table.py: begin -->", "<!-- tests/hosts/table.py: end -->"
# Small systems, where a call counts, and large ones, where arithmetic does.
SHOWN = ["hs071", "redundant", "complementarity", "arm_50", "rosenbrock_600", "control_2d_30", "control_3d_10", "obstacle_60",
         "rosenbrock_5000", "arm_1000", "control_3d_16", "control_2d_80", "control_3d_24"]


def run(script, *arguments):
    """The results of a script of this folder, and whether all answers agreed."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "out.json"
        code = subprocess.run([sys.executable, FOLDER / script, "--out", out, *map(str, arguments)], stdout=sys.stderr).returncode
        return (json.loads(out.read_text()) if out.exists() else None), code == 0


def row(host, system, rows, ours, own, own_name, verdict):
    return (f"| {host} | {system} | {rows:,} | {own_name} | {own['seconds']:.3f} ({own['cpu_seconds']:.3f}) | "
            f"{ours['seconds']:.3f} ({ours['cpu_seconds']:.3f}) | {own['seconds'] / ours['seconds']:.2f} | {verdict} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--libraries", type=pathlib.Path, default=FOLDER.parents[1] / "build" / "release" / "hosts")
    parser.add_argument("--repeat", type=int, default=2, help="the best time counts")
    parser.add_argument("--quick", action="store_true", help="a share for CI")
    parser.add_argument("--print", action="store_true", help="leave the guide as it is")
    arguments = parser.parse_args()
    lines, skipped, good = [], [], True

    if importlib.util.find_spec("casadi") is None:
        skipped.append("Ipopt (casadi is not installed)")
    else:
        results, same = run("ipopt.py", "--library", arguments.libraries / "libespalier_hsl.so", "--repeat", arguments.repeat,
                            *(["--quick"] if arguments.quick else []))
        good = good and same and bool(results)
        for name in [name for name in SHOWN if name in (results or {})]:
            own, ours = results[name]["mumps"], results[name]["ma97"]
            verdict = ours["wrong"] or f"same, {ours['iterations']} / {own['iterations']} iterations"
            lines.append(row("Ipopt, ma97", name, own["unknowns"], ours, own, "MUMPS", verdict))
        lines.append(f"| Ipopt, ma97 | all {len(results or {})} | | | | | | "
                     f"{sum(bool(r['ma97']['wrong']) for r in (results or {}).values())} differ |")

    if importlib.util.find_spec("clarabel") is None:
        skipped.append("Clarabel (clarabel is not installed)")
    else:
        results, same = run("clarabel_qp.py", "--library", arguments.libraries / "libespalier_mkl_pardiso.so", "--repeat", arguments.repeat,
                            "--sizes", *(["8"] if arguments.quick else ["8", "12", "16", "22"]), "--own", "faer")
        good = good and same and bool(results)
        for ours, own in results or []:
            lines.append(row("Clarabel, mkl", "control with bounds", own["rows"], ours, own, "faer",
                             f"{ours['iterations']} / {own['iterations']} iterations"))

    load = os.getloadavg()
    text = [BEGIN, "", f"Seconds, the best of {arguments.repeat}; in brackets those of all cores together. {os.cpu_count()} cores, load {load[2]:.1f} over the "
            f"last quarter of an hour (above the number of cores, compare the brackets), {datetime.date.today()}.", "",
            "| host, interface | system | unknowns | its own solver | own | ours | own / ours | answers |", "|---|---|---|---|---|---|---|---|",
            *lines, "", *(f"Left out: {what}." for what in skipped), *([""] if skipped else []), END]
    if not arguments.print:
        guide = GUIDE.read_text(encoding="utf-8")
        before, after = guide.split(BEGIN)[0], guide.split(END)[1]
        GUIDE.write_text(before + "\n".join(text) + after, encoding="utf-8")
    print("\n".join(text))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
