#!/usr/bin/env python3
"""How many single faults the tests find: mutants of the sources, each run against the tests that come past it.

    scripts/mutate.py --rooms analysis,plan [--most 300] [--seed 1] [--build build/release] [--state FOLDER]
                      [--jobs 2] [--seconds 20] [--minutes 600] [--again] [--share]
    scripts/mutate.py --table
    scripts/mutate.py --rooms analysis,plan --again --pack FILE  # what a run needs elsewhere, with new tests
    scripts/mutate.py --packed FOLDER --jobs 16 --minutes 8  # there, in a checkout: FILE's content; writes FOLDER/results.json
    scripts/mutate.py --rooms analysis,plan --merge FOLDER/results.json

Needs a finished build with tests and libclang: `pip install clang==14.0`, `apt-get install libclang1-14 libclang-common-14-dev`.
The rooms of a call are one group; `;` parts several. Their sources are compiled once with all their mutants
(mutate_sources.py) and linked before the libraries of the build. Every test program then says which mutants each test
comes past; a mutant runs against those tests, the fastest first, up to SECONDS of them. A failure, a crash or five times
the usual time is a kill. FOLDER/<rooms>/state.json keeps what is known: a call that was cut goes on. --again links anew and
tries what is left, after tests were added; --anew PATTERN asks tests again that have changed. --share: 20 mutants of one
source.
scripts/mutants.txt gives reasons why some need no test. Ends with 1 where mutants are left without one.
"""

import argparse
import concurrent.futures
import fnmatch
import itertools
import json
import os
import random
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mutate_pack
from mutate_table import has_reason, reasons, table

ROOT = Path(__file__).resolve().parent.parent
HEADER = ROOT / "scripts/mutate_runtime.hpp"
BITS = "espalier_bits"  # not a test program: what it prints must stay as it is
BITS_CASES = ["; cpu 1"]
SHARES = 8  # a test program is asked in that many processes, more with more jobs
FIRST_SECONDS = 4  # of tests, where the time is limited
MEMORY = 12_000_000_000  # bytes of addresses of a test program
# Sources, then test programs, the room's own first, with the tests that are asked.
ROOMS = {
    "matrix": ("src/matrix/*", ["test_matrix", "test_solve", "test_solver"]),
    "analysis": ("src/analysis/*", ["test_analysis", "test_plan", "test_schur", "test_solver", BITS]),
    "plan": ("src/plan/*", ["test_plan", "test_schur", "test_device", "test_solver", BITS]),
    "kernels": ("src/device/host/kernels/*", ["test_device", "test_solver", BITS]),
    "host": ("src/device/host/*.cpp", ["test_device", "test_solver", BITS]),
    "solve": ("src/solve/*", ["test_solve", "test_solver", "test_ranks", BITS]),
    "solver": ("src/solver/*", ["test_solver", "test_schur", "test_batch", "test_out_of_core", BITS]),
    "changes": ("src/changes/*", ["test_changes"]),
    "elements": ("src/dynamics/elements/*", ["test_dynamics"]),
    "joints": ("src/dynamics/joints/*", ["test_dynamics"]),
    "integrators": ("src/dynamics/integrators/*", ["test_dynamics"]),
    "dae": ("src/dynamics/dae/*", ["test_dynamics"]),
    "contact": ("src/dynamics/contact/*", ["test_dynamics"]),
    "forces": ("src/dynamics/forces/*", ["test_dynamics"]),
    "bodies": ("src/dynamics/bodies/*", ["test_dynamics"]),
    "readers": ("src/dynamics/mesh/read/*", ["test_dynamics"]),
    "share": ("src/analysis/elimination_tree.cpp", ["test_analysis"]),
}


def originals(entry):
    """The sources that a compiler's command compiles: its file, or what that includes where several are compiled together."""
    file = Path(entry["file"])
    if "/build/" not in str(file) or not file.exists():
        return [file]
    return [Path(p) for p in re.findall(r'^#include "(/.*\.cpp)"', file.read_text(), re.MULTILINE)]


def workers(jobs):
    """Threads whose processes see two processors each, as the pools of the tests' own threads then do."""
    places, free = itertools.count(), sorted(os.sched_getaffinity(0))
    pairs = [free[k:k + 2] for k in range(0, len(free) - 1, 2)] or [free]
    return concurrent.futures.ThreadPoolExecutor(
        jobs, initializer=lambda: os.sched_setaffinity(0, pairs[next(places) % len(pairs)]))


class Group:
    """Rooms whose sources are linked together, so that a test program is asked once for all of them."""

    def __init__(self, names, options):
        self.names, self.options, self.build = names, options, options.build
        self.programs = list(dict.fromkeys(program for name in names for program in ROOMS[name][1]))
        self.folder = options.state / "-".join(names)
        self.path = self.folder / "state.json"
        self.of = json.loads(self.path.read_text()) if self.path.exists() else {"mutants": [], "tests": {}, "results": {}}

    def save(self):
        self.folder.mkdir(parents=True, exist_ok=True)
        beside = self.path.with_suffix(".new")
        beside.write_text(json.dumps(self.of, indent=0))
        beside.replace(self.path)

    def make(self):
        """Chooses the mutants and compiles the sources with them."""
        import mutate_sources

        entries = json.loads((self.build / "compile_commands.json").read_text())
        entries = [e for e in entries if re.search(r"/src/[^ ]*\.o -c", e["command"]) or " -o src/" in e["command"]]
        pieces, chosen = {}, []
        for name in self.names:
            found = []
            for entry in entries:
                for source in originals(entry):
                    if source.suffix != ".cpp" or not fnmatch.fnmatch(str(source), f"{ROOT}/{ROOMS[name][0]}"):
                        continue
                    if any(source in known for _, known in pieces.values()):
                        continue  # the library that is installed compiles it again
                    pieces.setdefault(entry["file"], (entry, []))[1].append(source)
                    found += mutate_sources.find(source, shlex.split(entry["command"]))
            picked = sorted(random.Random(self.options.seed).sample(range(len(found)), min(self.options.most, len(found))))
            for k in picked:
                found[k].room = name
            chosen += [found[k] for k in picked]
            print(f"{name}: {len(found)} mutants, {len(picked)} of them chosen", flush=True)
        for number, mutant in enumerate(chosen, 1):
            mutant.number = number
        self.folder.mkdir(parents=True, exist_ok=True)
        kept, objects = [], []
        with concurrent.futures.ThreadPoolExecutor(self.options.jobs) as pool:
            for mutants, obj in pool.map(lambda p: self.piece(*p, chosen), pieces.values()):
                kept += mutants
                objects += obj
        print(f"{len(chosen) - len(kept)} that no compiler takes were left out", flush=True)
        mutants = [m.json() | {"path": str(Path(m.path).relative_to(ROOT))} for m in kept]
        self.of |= {"objects": objects, "seed": self.options.seed, "mutants": mutants}
        self.save()

    def piece(self, entry, sources, chosen):
        import mutate_sources

        command, kept, file = shlex.split(entry["command"]), [], Path(entry["file"])
        text = mutate_sources.read(file)
        for source in sources:
            mutants = [m for m in chosen if m.path == str(source)]
            if not mutants:
                continue
            target = self.folder / "-".join(source.relative_to(ROOT).parts)
            new, mutants = mutate_sources.compiled(source, command, mutants, HEADER)
            new = re.sub(r'(#define HWY_TARGET_INCLUDE) ".*"', rf'\1 "{target}"', new)
            target.write_bytes(new.encode("latin-1"))
            kept += mutants
            text = new if source == file else text.replace(f'"{source}"', f'"{target}"')
        if not kept:
            return [], []
        target = self.folder / f"{entry['file'].removeprefix(str(ROOT)).replace('/', '-').lstrip('-')}"
        target.write_bytes(text.replace(f'"{file}"', f'"{target}"').encode("latin-1"))
        obj = target.with_suffix(".o")
        at = command.index("-o")
        command = command[:at] + ["-w", "-O1", *(f"-I{s.parent}" for s in sources), "-o", str(obj), "-c", str(target)]
        subprocess.run(command, cwd=entry["directory"], check=True)
        return kept, [(str(obj), re.search(r"CMakeFiles/(\w+)\.dir", entry["command"])[1])]

    def link(self):
        """The test programs with the mutants; their objects stand before the libraries, which then are not asked for these."""
        runtime = self.folder / "runtime.o"
        subprocess.run(["c++", "-std=c++20", "-O1", "-c", str(HEADER.with_suffix(".cpp")), "-o", str(runtime)], check=True)
        for program in self.programs:
            shown = subprocess.run(["ninja", "-t", "commands", program], cwd=self.build, capture_output=True, text=True, check=True)
            command = [c for c in shown.stdout.splitlines() if f" -o tests/{program} " in c][-1].split("&&")[1]
            words = shlex.split(command)
            at = words.index("-o")
            objects = [obj for obj, library in self.of["objects"] if f"src/lib{library}.a" in words]
            words = words[:at] + ["-o", str(self.folder / program), *objects, str(runtime)] + words[at + 2:]
            subprocess.run(words + ["-lgtest"], cwd=self.build, check=True)
        self.of["bits"] = self.bits(0)

    def bits(self, number):
        """What the program of the bits prints, with a mutant."""
        if BITS not in self.programs:
            return ""
        try:
            command = ["prlimit", f"--as={MEMORY}", str(self.folder / BITS), *BITS_CASES]
            environment = {**os.environ, "ESPALIER_MUTANT": str(number)}
            return subprocess.run(command, capture_output=True, env=environment, timeout=60, check=False).stdout.decode("latin-1")
        except subprocess.TimeoutExpired:
            return "time"

    def command(self, program, chosen):
        words = ["prlimit", f"--as={MEMORY}", str(self.folder / program), f"--gtest_filter={chosen}"]
        return words + ["--gtest_fail_fast", "--gtest_brief=1"]

    def run_program(self, program, chosen, environment, limit):
        """Its exit code, or "time"."""
        with tempfile.TemporaryDirectory() as here:
            command = self.command(program, chosen)
            if "ESPALIER_MUTANTS_REACHED" in environment:
                command.remove("--gtest_fail_fast")
            process = subprocess.Popen(command, cwd=here, env={**os.environ, "TMPDIR": here, **environment}, start_new_session=True,
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            try:
                return process.wait(timeout=limit)
            except subprocess.TimeoutExpired:
                return "time"
            finally:
                try:
                    os.killpg(process.pid, signal.SIGKILL)
                except ProcessLookupError:
                    pass
                process.wait()

    def new_tests(self, program):
        """The tests of a program that have not told yet what they come past."""
        shown = subprocess.run([str(self.folder / program), "--gtest_list_tests"], check=True, capture_output=True, text=True)
        costs = self.build / mutate_pack.COSTS
        slow = {line.split()[0] for line in costs.read_text().split("---")[0].splitlines()
                if float(line.split()[-1]) > self.options.slowest} if costs.exists() else set()
        names, suite = [], ""
        for line in shown.stdout.splitlines():
            word = line.split("#")[0].strip()
            suite = suite if line.startswith(" ") else word
            if line.startswith(" ") and suite + word not in {**self.of["tests"].get(program, {}), **dict.fromkeys(slow)}:
                names.append(suite + word)
        return names

    def cover(self):
        """Which mutants each new test comes past. Tests that fail without a mutant, and those that skip, are left out."""
        def one(job):
            name, share, tests = job
            lines = self.folder / f"{name}.{share}.reached"
            lines.unlink(missing_ok=True)
            if self.run_program(name, ":".join(tests), {"ESPALIER_MUTANTS_REACHED": str(lines)}, self.options.cover_seconds):
                print(f"{name}, share {share}: a test fails without a mutant, or they take too long", flush=True)
            return name, tests, lines.read_text().splitlines() if lines.exists() else []

        for tests in self.of["tests"].values() if self.options.anew else []:
            for test in fnmatch.filter(list(tests), self.options.anew):
                del tests[test]
        jobs = []
        asked = [p for name in self.options.only or self.names for p in ROOMS[name][1]]
        shares = max(SHARES, 2 * self.options.jobs)
        for program in (p for p in self.programs if p != BITS and p in asked):
            tests = self.new_tests(program)
            jobs += [(program, share, tests[share::shares]) for share in range(shares) if tests[share::shares]]
        with workers(self.options.jobs) as pool:
            for name, tests, lines in pool.map(one, jobs):
                of_program = self.of["tests"].setdefault(name, {})
                of_program.update({test: [-1, []] for test in tests})  # failed or skipped, unless it says more
                for line in lines:
                    test, passed, ms, *numbers = line.split()
                    if passed == "1":
                        of_program[test] = [int(ms), [int(n) for n in numbers]]
        self.save()

    def portions(self, number, seconds):
        """The tests of a mutant in portions (program, tests, ms) of growing length, in all up to `seconds`."""
        room = next(m["room"] for m in self.of["mutants"] if m["number"] == number)
        own = ROOMS[room][1]  # its own programs first
        asked = sorted(self.of["tests"].items(), key=lambda item: own.index(item[0]) if item[0] in own else len(own))
        past = {program: [test for test in tests if number in self.past[program, test]] for program, tests in asked}
        lists = list(past.items())
        if sum(map(len, past.values())) <= 3 * SHARES:  # perhaps what a process computes once, for the first test that wants it
            lists += [(program, [test for test, (ms, _) in tests.items() if ms >= 0 and test not in past[program]])
                      for program, tests in asked]
        used = 0
        for program, names in lists:
            portion, took, size = [], 0, 200
            for ms, test in sorted((self.of["tests"][program][test][0], test) for test in names):
                if used + ms > 1000 * seconds and used > 0:
                    break
                used += ms
                portion.append(test)
                took += ms
                if took > size or len(portion) >= 200:
                    yield program, portion, took
                    portion, took, size = [], 0, 4 * size
            if portion:
                yield program, portion, took

    def judge(self, number, seconds):
        """What the tests say of a mutant; none where the time of this run has ended."""
        for program, tests, ms in self.portions(number, seconds):
            limit = 5 + 5 * ms / 1000
            if time.monotonic() + 3 * limit > self.options.end:
                return None
            status = self.run_program(program, ":".join(tests), {"ESPALIER_MUTANT": str(number)}, limit)
            if status == "time":  # others may have had the processors
                status = self.run_program(program, ":".join(tests), {"ESPALIER_MUTANT": str(number)}, 2 * limit)
            if status:
                return f"killed: {program} {status}"
        if self.of["bits"] and self.bits(number) != self.of["bits"]:
            return f"killed: {BITS}"
        return "survived" if any(number in numbers for numbers in self.past.values()) else "not reached"

    def run(self, seconds):
        results = self.of["results"]
        self.past = {(p, t): set(numbers) for p, tests in self.of["tests"].items() for t, (_, numbers) in tests.items()}
        known, only = reasons(), self.options.only or self.names
        open_ones = [m["number"] for m in self.of["mutants"] if m["room"] in only and (str(m["number"]) not in results or (
            self.options.again and not results[str(m["number"])].startswith("killed") and not has_reason(m, known)))]
        saved = time.monotonic()
        with workers(self.options.jobs) as pool:
            jobs = {pool.submit(self.judge, n, seconds): n for n in open_ones}
            try:
                for job in concurrent.futures.as_completed(jobs):
                    if job.result():
                        results[str(jobs[job])] = job.result()
                    if time.monotonic() - saved > 10:
                        self.save()
                        saved = time.monotonic()
            except KeyboardInterrupt:
                pool.shutdown(cancel_futures=True)
                raise
            finally:
                self.save()


def run_here(groups):
    for group in groups:
        if not group.of["mutants"]:
            group.make()
        if not group.of["tests"] or group.options.again:
            group.link()
            group.cover()
        group.run(group.options.seconds)


def run_packed(groups):
    """All mutants meet the fastest tests before any of them meets the slow ones: the time may end."""
    for group in groups:
        group.of["bits"] = group.bits(0)
        group.cover()
    for seconds in (FIRST_SECONDS, groups[0].options.seconds):
        for group in groups:
            group.run(seconds)
            mutate_pack.write_results(groups, group.options.state / "results.json")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", default="")
    parser.add_argument("--most", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--build", type=Path, default=ROOT / "build/release")
    parser.add_argument("--state", type=Path, default=ROOT / "build/mutants")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=20, help="of tests that a mutant is run against")
    parser.add_argument("--cover-seconds", type=float, default=300, help="limit of an eighth of a test program")
    parser.add_argument("--slowest", type=float, default=2, help="seconds of a test that is asked, as ctest knows them")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--anew", default="")
    parser.add_argument("--only", type=lambda text: text.split(","), help="of the rooms")
    parser.add_argument("--share", action="store_true")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--minutes", type=float, default=600)
    parser.add_argument("--pack", type=Path)
    parser.add_argument("--packed", type=Path)
    parser.add_argument("--merge", type=Path)
    options = parser.parse_args()
    options.end = time.monotonic() + 60 * options.minutes
    options.build, options.state = options.build.resolve(), options.state.resolve()
    if options.packed:
        options.build = options.state = options.packed.resolve()
        options.again = True
        os.environ["LD_LIBRARY_PATH"] = str(options.packed.resolve() / "lib")
    if options.share:
        options.rooms, options.most = "share", 20
    names = [rooms.split(",") for rooms in options.rooms.split(";") if rooms]
    if options.table or options.packed:
        names = names or [p.parent.name.split("-") for p in sorted(options.state.glob("*/state.json"))]
    groups = [Group(n, options) for n in names]
    if options.pack:
        for group in groups if options.again else []:
            group.link()
        mutate_pack.pack(groups, options.pack.resolve())
    elif options.merge:
        mutate_pack.merge(groups, options.merge)
    elif options.packed:
        run_packed(groups)
    elif not options.table:
        run_here(groups)
    return 1 if table(groups, reasons()) else 0


if __name__ == "__main__":
    sys.exit(main())
