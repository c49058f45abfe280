#!/usr/bin/env python3
"""What `precision` mixed and auto cost and give by condition number, beside fp64, as a table in Markdown.

    bench/precision_table.py [--program build/release/espalier] [--threads 2] [SYSTEM ...]

Each system is one of `espalier generate`, or the file of a matrix, factorized three times more and solved for one right-hand side of ones on the host.
Times are wall times in milliseconds, of the best refactorization and of the one refined solve. `condition` is the estimate in the
1-norm, of the matrix as it is given. A system whose backward error is above that of fp64 (and above 4e-16), or whose inertia,
rank or status differs, is marked WORSE, and the exit code is 1.
"""
import argparse
import json
import pathlib
import subprocess
import sys

SYSTEMS = ["poisson 12", "elasticity 8", "poisson 30", "elasticity 20", "gyroscopic 14", "elasticity 30 10 10", "elasticity 44 14 14",
           "elasticity 36 4 4", "plate 12", "elasticity 120 4 4", "plate 60", "shell 40", "plate 150", "elasticity 1000 2 2",
           "kkt 3 6 4 4", "kkt 20 8 4 4", "kkt-scaled 6 12 6 6", "kkt-redundant 2 3 6 4 4"]
PRECISIONS = ["fp64", "mixed", "auto"]
ROUNDING = 4e-16


def solved(program, system, precision, threads):
    matrix = [system] if pathlib.Path(system).is_file() else ["--generate", system]
    words = [program, "solve", *matrix, "--device", "cpu", "--threads", str(threads), "--precision", precision,
             "--refactor", "3", "--json", "-v"] + (["--condition"] if precision == "fp64" else [])
    run = subprocess.run(words, capture_output=True, text=True)
    try:
        report = json.loads(run.stdout)
    except json.JSONDecodeError:
        sys.exit(f"{' '.join(words)}: {run.stderr.strip() or 'no report'}")
    report["went_back"] = "going on in FP64" in run.stderr
    return report


def verdict(report):
    return report["status"], report.get("rank"), report.get("inertia")


def error(report):
    return (report.get("backward_error") or {}).get("normwise")


def is_worse(report, truth):
    if verdict(report) != verdict(truth):
        return True
    if error(truth) is None:
        return False
    return error(report) is None or not error(report) <= max(ROUNDING, error(truth))


def cell(report, truth):
    if report["status"] != "ok":
        text = report["status"]
    else:
        text = (f"{1e3 * report['factor']['refactor_seconds']:.1f} + {1e3 * report['solve']['seconds']:.1f} "
                f"({report['solve']['refinement_steps']}), {error(report):.0e}")
    return text + (", back to FP64" if report["went_back"] else "") + (" WORSE" if is_worse(report, truth) else "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/release/espalier")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("systems", nargs="*", default=SYSTEMS)
    arguments = parser.parse_args()
    rows = []
    for system in arguments.systems:
        reports = [solved(arguments.program, system, p, arguments.threads) for p in PRECISIONS]
        rows.append((reports[0].get("condition_estimate") or float("inf"), system, reports))
    print("| system | unknowns | condition | fp64: refactorization + solve (steps), backward error | mixed | auto |\n|---|---|---|---|---|---|")
    for condition, system, reports in sorted(rows, key=lambda row: row[:2]):
        print(f"| {system} | {reports[0]['matrix']['rows']} | {condition:.0e} | " +
              " | ".join(cell(r, reports[0]) for r in reports) + " |")
    return int(any(is_worse(r, reports[0]) for _, _, reports in rows for r in reports[1:]))


if __name__ == "__main__":
    sys.exit(main())
