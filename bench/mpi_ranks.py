#!/usr/bin/env python3
"""Factorizations on 1, 2 and 4 ranks of MPI beside one process of two threads, and MUMPS (the parallel build of Debian) on
the same ranks: a table of medians.

    apt install libopenmpi-dev libmumps-dev
    cmake --build build/release --target espalier_cli espalier_mpi_adapters
    bench/mpi_ranks.py --build build/release [--rounds 7] [--repeats 5] [--json FILE]

All take turns, each time in new processes, so that other work on the machine meets all of them. A round's time is the
least of its refactorizations; the ratio to one process is formed in each round, and the table has the median of the
rounds. Every answer is checked. What is not installed is left out, and said.
"""
import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
SYSTEMS = {"elasticity 24": "1", "kkt 20": "2"}  # and MUMPS's SYM
# The same MPI for all: Debian's MUMPS is built with Open MPI.
MPIRUN = shutil.which("mpirun.openmpi") or shutil.which("mpirun")
MPICC = shutil.which("mpicc.openmpi") or shutil.which("mpicc")
ENVIRONMENT = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", OMPI_ALLOW_RUN_AS_ROOT="1",
                   OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1", OMPI_MCA_btl_vader_single_copy_mechanism="none")
LARGEST_ERROR = 1e-10


def launched(ranks, command):
    done = subprocess.run([MPIRUN, "--oversubscribe", "--bind-to", "none", "-n", str(ranks), *command],
                          capture_output=True, text=True, env=ENVIRONMENT, timeout=600, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {done.stdout[-500:]} {done.stderr[-500:]}")
    return json.loads(done.stdout)


def espalier(binary, matrix, repeats, ranks, threads):
    command = [binary, "solve", matrix, "--device", "cpu", "--threads", str(threads), "--refactor", str(repeats), "--json"]
    if ranks > 1:
        report = launched(ranks, command)
    else:
        report = json.loads(subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT, timeout=600,
                                           check=True).stdout)
    return report["factor"]["refactor_seconds"], report["backward_error"]["normwise"]


def mumps(program, matrix, sym, repeats, ranks):
    report = launched(ranks, [program, matrix, sym, str(repeats)])
    return min(report["seconds"]), report["error"]


def compile_mumps(folder):
    if MPICC is None:
        print("MUMPS is left out: mpicc is not there", file=sys.stderr)
        return None
    program = os.path.join(folder, "mumps")
    done = subprocess.run([MPICC, "-O2", os.path.join(HERE, "mpi", "mumps.c"), "-o", program, "-ldmumps", "-lm"],
                          capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return program
    print(f"MUMPS is left out (apt install libmumps-dev): {done.stderr.strip().splitlines()[0]}", file=sys.stderr)
    return None


def measure(system, sym, binary, program, rounds, repeats, folder):
    """{who: seconds of each round}; the first is one process of two threads."""
    matrix = os.path.join(folder, "matrix.mtx")
    subprocess.run([binary, "generate", *system.split(), "--out", matrix], check=True, stdout=subprocess.DEVNULL)
    runs = {"one process, 2 threads": lambda: espalier(binary, matrix, repeats, 1, 2),
            "one process, 1 thread": lambda: espalier(binary, matrix, repeats, 1, 1)}
    for ranks in (2, 4):
        runs[f"{ranks} ranks"] = lambda ranks=ranks: espalier(binary, matrix, repeats, ranks, 1)
    if program is not None:
        for ranks in (1, 2, 4):
            runs[f"MUMPS, {ranks} rank{'s' if ranks > 1 else ''}"] = lambda ranks=ranks: mumps(program, matrix, sym, repeats,
                                                                                             ranks)
    found = {who: [] for who in runs}
    for _ in range(rounds):
        for who, run in runs.items():
            seconds, error = run()
            if not error < LARGEST_ERROR:
                raise RuntimeError(f"{system}, {who}: backward error {error}")
            found[who].append(seconds)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default=os.path.join(os.path.dirname(HERE), "build", "release"))
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", help="all rounds, into this file")
    arguments = parser.parse_args()
    binary = os.path.join(os.path.abspath(arguments.build), "espalier")
    if not os.path.exists(binary):
        sys.exit(f"{binary} is not there: cmake --build {arguments.build} --target espalier_cli espalier_mpi_adapters")
    if MPIRUN is None:
        sys.exit("mpirun is not there: apt install libopenmpi-dev")
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        program = compile_mumps(folder)
        for system, sym in SYSTEMS.items():
            results[system] = measure(system, sym, binary, program, arguments.rounds, arguments.repeats, folder)
            base = next(iter(results[system].values()))
            print(f"\n| {system} | ms | to one process, 2 threads |\n|---|---|---|")
            for who, seconds in results[system].items():
                ratio = statistics.median(s / b for s, b in zip(seconds, base, strict=True))
                print(f"| {who} | {1e3 * statistics.median(seconds):.1f} | {ratio:.2f} |", flush=True)
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump({"command": " ".join(sys.argv), "load": os.getloadavg(), "seconds": results}, file, indent=1)


if __name__ == "__main__":
    main()
