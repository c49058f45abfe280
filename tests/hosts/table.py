#!/usr/bin/env python3
"""Real hosts on our libraries and on their own solvers, as a table in docs/guide/hosts.md. One command:

    apt-get install octave coinor-libipopt1v5 python3-getfem python3-petsc4py python3-slepc4py python3-dolfinx
    python3 -m venv env && env/bin/pip install casadi clarabel scipy
    env/bin/python tests/hosts/table.py [--libraries build/release/hosts] [--repeat 2] [--quick]

Where a host is not installed, the table says so. Fails where answers differ; the table is written in any case.
"""
import argparse
import datetime
import importlib.util
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

FOLDER = pathlib.Path(__file__).resolve().parent
GUIDE = FOLDER.parents[1] / "docs" / "guide" / "hosts.md"
BEGIN, END = "<!-- tests/hosts/table.py: begin -->", "<!-- tests/hosts/table.py: end -->"
# Small systems, where a call counts, and large ones, where arithmetic does.
SHOWN = ["hs071", "redundant", "complementarity", "arm_50", "rosenbrock_600", "control_2d_30", "control_3d_10", "obstacle_60",
         "rosenbrock_5000", "arm_1000", "control_3d_16", "control_2d_80", "control_3d_24"]


SHOWN_OF_OCTAVE = ["wind_2d_20", "wind_2d_100", "wind_2d_400", "wind_3d_12", "wind_3d_24", "poisson_2d_100", "poisson_2d_500", "poisson_3d_30", "near_17"]
SYSTEM_PYTHON = "/usr/bin/python3"  # for what apt installs


def run(script, *arguments, python=sys.executable):
    """The results of a script of this folder, and whether all answers agreed."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "out.json"
        code = subprocess.run([python, FOLDER / script, "--out", out, *map(str, arguments)], stdout=sys.stderr).returncode
        return (json.loads(out.read_text()) if out.exists() else None), code == 0


def row(host, system, rows, ours, own, own_name, verdict):
    def time(result):
        return f"{result['seconds']:.3f}" + (f" ({result['cpu_seconds']:.3f})" if "cpu_seconds" in result else "")

    return f"| {host} | {system} | {rows:,} | {own_name} | {time(own)} | {time(ours)} | {own['seconds'] / ours['seconds']:.2f} | {verdict} |"


def iterations(ours, own):
    return ours["wrong"] or f"same, {ours['iterations']} / {own['iterations']} iterations"


def summary(host, results):
    return f"| {host} | all {len(results)} | | | | | | {sum(bool(r['wrong']) for r in results)} differ |"


def casadi_ipopt(arguments):
    if importlib.util.find_spec("casadi") is None:
        return [], True, "Ipopt of CasADi (casadi is not installed)"
    results, same = run("ipopt.py", "--library", arguments.libraries / "libespalier_hsl.so", "--repeat", arguments.repeat, *arguments.share)
    found = results or {}
    lines = [row("Ipopt of CasADi, ma97", name, r["mumps"]["unknowns"], r["ma97"], r["mumps"], "MUMPS", iterations(r["ma97"], r["mumps"]))
             for name, r in found.items() if name in SHOWN]
    return [*lines, summary("Ipopt of CasADi, ma97", [r["ma97"] for r in found.values()])], same and bool(found), ""


def debian_ipopt(arguments):
    library = arguments.libraries / "libespalier_mumps.so"
    if importlib.util.find_spec("casadi") is None or not library.exists() or not pathlib.Path("/usr/lib/libipopt.so.1").exists():
        return [], True, "Ipopt of Debian (coinor-libipopt1v5, casadi and libespalier_mumps.so are not all there)"
    results, same = run("debian_ipopt.py", "--library", library, "--repeat", arguments.repeat, *arguments.share)
    found = results or {}
    lines = [row("Ipopt of Debian, mumps", name, r["own"]["unknowns"], r["ours"], r["own"], "MUMPS", iterations(r["ours"], r["own"]))
             for name, r in found.items() if name in SHOWN]
    return [*lines, summary("Ipopt of Debian, mumps", [r["ours"] for r in found.values()])], same and bool(found), ""


def clarabel(arguments):
    if importlib.util.find_spec("clarabel") is None:
        return [], True, "Clarabel (clarabel is not installed)"
    results, same = run("clarabel_qp.py", "--library", arguments.libraries / "libespalier_mkl_pardiso.so", "--repeat", arguments.repeat,
                        "--sizes", *(["8"] if arguments.quick else ["8", "12", "16", "22"]), "--own", "faer")
    lines = [row("Clarabel, mkl", "control with bounds", own["rows"], ours, own, "faer", f"{ours['iterations']} / {own['iterations']} iterations")
             for ours, own in results or []]
    return lines, same and bool(results), ""


def octave(arguments):
    if shutil.which("octave-cli") is None or importlib.util.find_spec("scipy") is None:
        return [], True, "Octave (octave, or scipy to hand it matrices, is not installed)"
    data = ["--data", arguments.data] if arguments.data else []
    results, same = run("octave.py", "--libraries", arguments.libraries, "--repeat", arguments.repeat, *arguments.share, *data)
    found = results or {}
    lines = [row("Octave", name, found[name]["own"]["unknowns"], found[name]["ours"], found[name]["own"],
                 "CHOLMOD" if name.startswith("poisson") else "UMFPACK", found[name]["ours"]["wrong"] or "same digits, same warning")
             for name in SHOWN_OF_OCTAVE if name in found]
    return [*lines, summary("Octave", [r["ours"] for r in found.values()])], same and bool(found), ""


def of_system_python(module):
    return subprocess.run([SYSTEM_PYTHON, "-c", f"import {module}"], capture_output=True).returncode == 0


def getfem(arguments):
    library = arguments.libraries / "libespalier_mumps.so"
    if not library.exists() or not of_system_python("getfem"):
        return [], True, "GetFEM (python3-getfem or libespalier_mumps.so is not there)"
    results, same = run("getfem_mumps.py", "--library", library, *(["--sizes", "8"] if arguments.quick else []), python=SYSTEM_PYTHON)
    lines = [row("GetFEM", r["system"], r["own"]["unknowns"], r["ours"], r["own"], "MUMPS", r["ours"]["wrong"] or "same") for r in results or []]
    return lines, same and bool(results), ""


def petsc(arguments):
    library = arguments.libraries / "libespalier_petsc.so"
    if not library.exists() or not of_system_python("petsc4py"):
        return [], True, "PETSc, SLEPc and dolfinx (python3-petsc4py or libespalier_petsc.so is not there)"
    results, same = run("petsc.py", "--library", library, *(["--quick"] if arguments.quick else []), python=SYSTEM_PYTHON)
    lines = [row("PETSc" if r["processes"] == 1 else f"PETSc, {r['processes']} processes", r["system"], r["own"]["unknowns"], r["ours"], r["own"],
                 "MUMPS", r["ours"]["wrong"] or "same") for r in results or []]
    return lines, same and bool(results), ""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--libraries", type=pathlib.Path, default=FOLDER.parents[1] / "build" / "release" / "hosts")
    parser.add_argument("--repeat", type=int, default=2, help="the best time counts")
    parser.add_argument("--data", type=pathlib.Path, help="a folder of Matrix Market files, for Octave")
    parser.add_argument("--hosts", nargs="+", choices=HOSTS, default=list(HOSTS), help="these alone")
    parser.add_argument("--quick", action="store_true", help="a share for CI")
    parser.add_argument("--print", action="store_true", help="leave the guide as it is")
    arguments = parser.parse_args()
    arguments.share = ["--quick"] if arguments.quick else []
    lines, skipped, good = [], [], True
    for name in arguments.hosts:
        more, same, why = HOSTS[name](arguments)
        lines += more
        good = good and same
        skipped += [why] if why else []

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


HOSTS = {"casadi": casadi_ipopt, "debian_ipopt": debian_ipopt, "clarabel": clarabel, "octave": octave, "getfem": getfem, "petsc": petsc}

if __name__ == "__main__":
    sys.exit(main())
