#!/usr/bin/env python3
"""The tests with one thing changed or turned off at a time: instruction sets, threads, forms, devices, language, time zone, umask.

    tests/switches/switches.py [--build build/release] [--share] [SWITCH ...]

--share: a fast subset (.ci/run). SWITCH: those whose names contain one of the words. --list names them. Each is a row of a
table: what ran, the outcome, the seconds. Bits are compared where they are promised: for any number of threads, and for all
that is no part of the arithmetic. What is printed stands in docs/notebook/with_and_without.md for the machines it was run on.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Left out: what takes long of code that other tests run as well, and what measures time or memory.
SLOW = ("ContactGears*:StaticsSweep*:BeamReference*:Allocation*:*TheLowestFrequencyIsSingular:*CapstanEquation*:StaticsTurns*:*RollsUpToAFullCircle*"
        ":IftommA02*:*HundredsOfModes*:HostMemory*:StaticsBranches*:*Interrupt*:MachinePrediction*:*WhereverTheGpuFails*:HeldSteps*:*RopeSlides*"
        ":DocsExamples*:*IntegratorsGiveTheSameBits*:ContactHertz*:ScratchFolder*:PartialOnDisk*:Erosion.*")
NUMERICAL = {name: "*" for name in ("device", "out_of_core", "solve", "solver", "modes", "harmonic", "dynamics")}
OTHERS = {name: "*" for name in ("base", "matrix", "analysis", "plan", "schur", "inverse", "changes", "batch", "fmi")}
SHARE = {"base": "*", "matrix": "*", "solve": "*", "schur": "*", "harmonic": "*", "fmi": "*", "solver": "Collection*:*FactorFile*:Trace*:OptionText*",
         "dynamics": "ModelRestart*:ModelRun*:ModelUnits*:ModelKinds*:Mesh*:Expression*:Csv*:Contact*Stl*:Robot*"}
SOLVE = [["solve", "--generate", system, "--kind", kind, "-q", "--out", "{}/x.mtx"]
         for system, kind in (("elasticity 9", "llt"), ("kkt 6", "ldlt"), ("gyroscopic 8", "lu"))]
COMMANDS = [*SOLVE,
            ["modes", "--generate", "elasticity 5", "--count", "6", "-q", "--out", "{}/modes"],
            ["simulate", "models/engine.toml", "--set", "parameters.unknowns=2000", "--until", "2e-5", "-q", "--no-page", "--out", "{}/engine"],
            ["simulate", "examples/torn_link.toml", "-q", "--no-page", "--out", "{}/link"]]


class Place:
    """A build, and how its programs are called."""

    def __init__(self, build, environment=None, umask=None, prefix=()):
        self.build, self.umask, self.prefix = build, umask, list(prefix)
        self.environment = {**os.environ, **(environment or {})}

    def run(self, program, *words, seconds=1800):
        call = [*self.prefix, str(self.build / program), *words]
        return subprocess.run(call, cwd=ROOT, env=self.environment, capture_output=True, text=True, errors="replace", timeout=seconds,
                              stdin=subprocess.DEVNULL, preexec_fn=None if self.umask is None else lambda: os.umask(self.umask))

    def tests(self, programs):
        """Says how many tests passed and which failed."""
        passed, failed = 0, []
        for name, wanted in programs.items():
            if not (self.build / f"tests/test_{name}").exists():
                failed.append(f"test_{name} is not built")
                continue
            done = self.run(f"tests/test_{name}", "--gtest_brief=1", f"--gtest_filter={wanted}-{SLOW}")
            passed += int((re.findall(r"\[  PASSED  \] (\d+)", done.stdout) or [0])[-1])
            bad = re.findall(r"^\[  FAILED  \] (\S+) \(", done.stdout, re.M)
            if done.returncode != 0 and not bad:
                bad = [f"test_{name} ended with {done.returncode}: {(done.stderr or done.stdout)[-300:]}"]
            failed += bad
        return f"{passed} tests", failed

    def files(self, threads):
        """What the commands write with so many threads, but for times and paths."""
        result, failed = {}, []
        for words in COMMANDS:
            with tempfile.TemporaryDirectory() as folder:
                done = self.run("espalier", *(w.replace("{}", folder) for w in words), "--threads", str(threads))
                if done.returncode != 0:
                    failed.append(f"{' '.join(words)}: {done.stderr[-300:]}")
                for file in Path(folder).rglob("*"):
                    if file.suffix in (".mtx", ".csv", ".vtu"):
                        result[words[0], words[2], file.relative_to(folder)] = file.read_bytes()
        return result, failed


def of_threads(place, counts):
    truth, failed = place.files(1)
    for threads in counts:
        now, bad = place.files(threads)
        failed += bad + [f"{threads} threads: {' '.join(map(str, name))} differs" for name in truth if now.get(name) != truth[name]]
    return f"{len(truth)} files, {' and '.join(map(str, counts))} threads beside 1", failed


def same_bits(place, plain, *words):
    """The program of bits, beside that of a plain run. Words: cases whose names contain one of them."""
    here, there = (p.run("tests/espalier_bits", *words).stdout.splitlines() for p in (place, plain))
    return f"{len(here)} lines of bits", [] if here and here == there else ["espalier_bits prints other bits"]


def judged(place, *words):
    """A program that compares by itself."""
    done = place.run(*words)
    return " ".join(words).removeprefix("tests/"), [] if done.returncode == 0 else [done.stdout[-500:] + done.stderr[-500:]]


def joined(*parts):
    return "; ".join(text for text, _ in parts), [bad for _, failed in parts for bad in failed]


def comma(build, folder):
    """A language whose numbers have commas and points at the thousands; messages of the system stay English."""
    subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", f"{folder}/de_DE.UTF-8"], capture_output=True)
    if not Path(f"{folder}/de_DE.UTF-8").exists():
        return None
    german = {f"LC_{what}": "de_DE.UTF-8" for what in ("NUMERIC", "TIME", "MONETARY", "COLLATE", "CTYPE")}
    return Place(build, {"LC_ALL": "", "LOCPATH": folder, **german, "LD_PRELOAD": str(build / "tests/espalier_locale.so")})


def switches(build, share):
    plain, tests = Place(build), SHARE if share else {**NUMERICAL, **OTHERS}
    flags, words = Path("/proc/cpuinfo").read_text(), ["kkt 6"] if share else []

    def language():
        with tempfile.TemporaryDirectory() as folder:
            place = comma(build, folder)
            return ("left out: no localedef, or no package 'locales'", []) if place is None else joined(place.tests(tests), same_bits(place, plain, *words))

    def in_place(**how):
        place = Place(build, **how)
        return joined(place.tests(tests), same_bits(place, plain, *words))

    rows = {"threads": lambda: of_threads(plain, [7] if share else [2, 3, 7]),
            "language with commas": language,
            "time zone +14": lambda: in_place(environment={"TZ": "XXX-14"}),
            "umask 077": lambda: in_place(umask=0o077)}
    if share:
        return rows
    rows = {"nothing": lambda: plain.tests(tests), **rows}
    for name in ("avx2", "baseline"):
        if name == "baseline" or "avx512f" in flags:
            rows[f"instructions: {name}"] = lambda name=name: Place(build, {"ESPALIER_INSTRUCTIONS": name}).tests(NUMERICAL)
    one = Place(build, prefix=["taskset", "-c", "0"])
    rows["one core"] = lambda: joined(one.tests(NUMERICAL), same_bits(one, plain))
    real = Place(build, {"ESPALIER_COMPLEX_FORM": "real"})
    rows["complex systems as real ones"] = lambda: judged(real, "tests/espalier_sequences", "200", "1", "60")
    rows["numbers that are kept, beside whole factors"] = lambda: judged(plain, "tests/espalier_value_changes", "300", "1", "cpu", "200", "40")
    rows["patterns that are followed, beside new analyses"] = lambda: judged(plain, "tests/espalier_follow", "200", "1", "150")
    rows["a lane at a time, beside vectors"] = lambda: plain.tests({"dynamics": "*Block*:*Lanes*"})
    rows["factors that are turned, beside new ones"] = lambda: plain.tests({"dynamics": "TurnedFactor*"})
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", metavar="SWITCH")
    parser.add_argument("--build", default="build/release")
    parser.add_argument("--share", action="store_true")
    parser.add_argument("--list", action="store_true")
    given = parser.parse_args()
    rows, wrong = switches((ROOT / given.build).resolve(), given.share), 0
    print("| changed or turned off | what ran | outcome | seconds |\n|---|---|---|---|")
    for name, run in rows.items():
        if given.words and not any(word in name for word in given.words):
            continue
        if given.list:
            print(f"| {name} | | | |")
            continue
        start = time.monotonic()
        what, failed = run()
        print(f"| {name} | {what} | {'right' if not failed else f'{len(failed)} wrong'} | {time.monotonic() - start:.0f} |", flush=True)
        for bad in failed:
            print(f"wrong with {name}: {bad}", file=sys.stderr, flush=True)
        wrong += len(failed)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
