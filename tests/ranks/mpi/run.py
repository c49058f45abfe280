#!/usr/bin/env python3
"""Compiles solve.cpp with each MPI that is there and runs it on ranks of this machine: the bits of one process, and clear
statuses where a rank stops or dies. Says what it skips.

    run.py --build build/release [--ranks 2,3,4,8] [--device gpu:all]
"""
import argparse
import os
import shutil
import subprocess
import sys
import tempfile

here = os.path.dirname(os.path.abspath(__file__))
root = os.path.dirname(os.path.dirname(os.path.dirname(here)))

# Compiler, launcher, and what lets more ranks run than there are cores.
MPIS = {
    "Open MPI": (["mpicxx.openmpi", "mpicxx"], ["mpirun.openmpi", "mpirun"], ["--allow-run-as-root", "--oversubscribe"]),
    "MPICH": (["mpicxx.mpich"], ["mpirun.mpich"], []),
    "MPI-5 ABI": (["mpicxx_abi"], ["mpirun.mpich5", "mpiexec_abi"], []),
}


def first_there(names):
    return next((shutil.which(n) for n in names if shutil.which(n)), None)


def compile_program(compiler, build, folder):
    program = os.path.join(folder, "solve")
    libraries = [os.path.join(build, "src", n) for n in sorted(os.listdir(os.path.join(build, "src"))) if n.endswith(".a")]
    command = [compiler, "-std=c++20", "-O1", "-Wall", "-Werror", "-Wno-sign-conversion", f"-I{root}/include", f"-I{root}/src",
               os.path.join(here, "solve.cpp"), "-o", program, "-Wl,--start-group", *libraries, "-Wl,--end-group",
               "-lfmt", "-lhwy", "-lz", "-lpugixml", "-lpthread"]
    subprocess.run(command, check=True)
    return program


def run(launcher, options, ranks, command, timeout=120, **variables):
    env = dict(os.environ, OMPI_MCA_btl_vader_single_copy_mechanism="none", OMPI_ALLOW_RUN_AS_ROOT="1",
               OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1", OMP_NUM_THREADS="1", **variables)
    return subprocess.run([launcher, *options, "-n", str(ranks), *command], capture_output=True, text=True, timeout=timeout,
                          env=env, check=False)


def check(name, launcher, options, program, counts, device):
    bad = 0
    for ranks in counts:
        runs = [[device], [device, "process"]] if device else [[]]
        if device and ranks > 2:
            runs.append([device, "pairs"])
        for words in runs:
            done = run(launcher, options, ranks, [program, *words])
            good = done.returncode == 0 and "the same bits" in done.stdout
            print(f"{name}, {ranks} ranks {' '.join(words)}: {'the same bits' if good else 'FAILED'}", flush=True)
            if not good:
                bad += 1
                print(done.stdout[-2000:], done.stderr[-2000:])
    done = run(launcher, options, 3, [program, "stop", "1", "0"])
    told = [line for line in done.stdout.splitlines() if "from rank 1 on host" in line]
    good = len(told) >= 2
    print(f"{name}, rank 1 of 3 stops: {'told on the others' if good else 'FAILED'}", flush=True)
    if not good:
        bad += 1
        print(done.stdout[-2000:], done.stderr[-2000:])
    return bad


# The model of every run, whose files must be those of one process.
MODEL = """gravity = [0, 0, -9.81]
[bodies.bar]
type = "solid"
mesh = { part = "block", lx = 1, ly = 0.2, lz = 0.1, divisions = [8, 3, 2] }
material = { young = 2e9, poisson = 0.3, density = 7800 }
[joints.hinge]
type = "revolute"
a = { body = "ground", point = [0, 0.1, 0.05], axis = [0, 1, 0] }
b = { body = "bar", face = "x0", axis = [0, 1, 0] }
[integrator]
method = "generalized-alpha"
step = 0.002
end = 0.01
[output]
quantities = ["hinge.force"]
csv_interval = 0
"""


def read(path):
    with open(path, "rb") as file:
        return file.read()


def check_simulate(name, compiler, launcher, options, build, folder, counts):
    """`espalier simulate` under mpirun: the files of one process, one report, and rank 0's code."""
    binary = os.path.join(build, "espalier")
    if not os.path.exists(binary):
        print(f"{name}, simulate: skipped, {binary} is not built")
        return 0
    model, alone, shared, adapter = (os.path.join(folder, n) for n in ("model.toml", "alone", "shared", "adapter.so"))
    subprocess.run([binary, "mpi-adapter", "--cc", compiler.replace("mpicxx", "mpicc"), "--out", adapter], check=True,
                   stdout=subprocess.DEVNULL)
    with open(model, "w", encoding="utf-8") as file:
        file.write(MODEL)
    subprocess.run([binary, "simulate", model, "--out", alone, "--device", "cpu", "--quiet"], check=True)
    bad = 0
    for ranks in counts:
        shutil.rmtree(shared, ignore_errors=True)
        done = run(launcher, options, ranks, [binary, "simulate", model, "--out", shared],
                   ESPALIER_MPI_ADAPTER=adapter)
        good = done.returncode == 0 and done.stdout.count("simulated") == 1
        good = good and all(read(os.path.join(alone, f)) == read(os.path.join(shared, f))
                            for f in ("quantities.csv", "state.restart"))
        print(f"{name}, simulate on {ranks} ranks: {'the same files' if good else 'FAILED'}", flush=True)
        if not good:
            bad += 1
            print(done.stdout[-2000:], done.stderr[-2000:])
    done = run(launcher, options, 2, [binary, "simulate", os.path.join(folder, "absent.toml")],
               ESPALIER_MPI_ADAPTER=adapter)
    good = done.returncode == 2 and done.stderr.count("espalier: error") == 1
    print(f"{name}, simulate without its model: {'code 2 on all' if good else 'FAILED'}", flush=True)
    if not good:
        bad += 1
        print(done.stdout[-2000:], done.stderr[-2000:])
    return bad


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", default=os.path.join(root, "build", "release"))
    parser.add_argument("--ranks", default="2,3,4,8")
    parser.add_argument("--device", default="", help="gpu:all: each rank has a GPU, or shares one; the build needs CUDA")
    arguments = parser.parse_args()
    counts = [int(n) for n in arguments.ranks.split(",")]
    bad = tested = 0
    for name, (compilers, launchers, options) in MPIS.items():
        compiler, launcher = first_there(compilers), first_there(launchers)
        if compiler is None or launcher is None:
            print(f"{name}: skipped, {compilers[0]} or {launchers[0]} is not installed")
            continue
        with tempfile.TemporaryDirectory() as folder:
            build = os.path.abspath(arguments.build)
            bad += check(name, launcher, options, compile_program(compiler, build, folder), counts, arguments.device)
            bad += check_simulate(name, compiler, launcher, options, build, folder, counts)
        tested += 1
    if tested == 0:
        print("skipped: no MPI is installed here")
        return 77
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
