#!/usr/bin/env python3
"""Every file operation and start of a thread of a command fails once, in turn. Truth: the run in which none does.

    python3 tests/faults/faults.py [--shim build/release/tests/espalier_faults.so] [--share 1] [CASE ...]
    python3 tests/faults/faults.py --one once 17 solve        shows one fault

The calls are counted by tests/faults/shim.c; allocations as well (`memory`), in most cases a part of them, evenly spread. After each fault:
the exit code is a documented one, and not that of a bug; the message names the file that failed, where it is one of the user's; what has its name is whole, old or new; nothing lies in the scratch folder, and no
temporary file beside the results. Where the exit code is 0, the results are those of the truth.

Each block of 4096 bytes of what is read again (a factor, an analysis, a restart file) is cut off and set to zeros, as after a power cut: it is
refused, or its answer is right. ESPALIER_BINARY names the program."""

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

BINARY = os.environ.get("ESPALIER_BINARY", "build/release/espalier")
SECONDS = 20
MODEL = """gravity = [0, 0, -10]
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.2, lz = 0.2, divisions = [2, 1, 1] }
material = { young = 1e6, poisson = 0.3, density = 1000 }
[joints.weld]
type = "fixed"
a = { body = "block", face = "x0" }
b = { body = "ground" }
[integrator]
max_step = 1e-2
end = 0.04
[output]
vtu_interval = 0.02
restart_interval = 0.01
quantities = ["block.position"]
"""
# Reading these may fail: something is known less well then.
OF_THE_MACHINE = re.compile(r"^/(proc|sys|etc|usr|lib|dev)/|^(socket|pipe|anon_inode):|^/work/|^$")
KINDS = {"once": "fails", "on": "fails, and all that write later", "short": "does half", "cut": "ends at a block, and the process dies",
         "memory": "every allocation instead"}


@dataclass
class Case:
    words: list  # of the command; {} is its folder
    before: list = field(default_factory=list)  # commands that make what it reads
    results: list = field(default_factory=list)  # files that are those of the truth, or not there, or as before, after any end
    loads: list = field(default_factory=list)  # (file, command that reads it, its result)
    scratch: str = None


SOLVE = ["solve", "{}/A.mtx", "--threads", "1", "-q"]
MAKE = ["generate", "elasticity", "4", "--out", "{}/A.mtx"]
SIMULATE = ["simulate", "{}/model.toml", "--threads", "1", "-q", "--out", "{}/out"]
GO_ON = [*SIMULATE, "--restart", "{}/out/state.restart", "--until"]
CASES = {
    "generate": Case(MAKE, results=["A.mtx"]),
    "packed": Case([*MAKE[:-1], "{}/A.mtx.gz"], results=["A.mtx.gz"]),
    "solve": Case([*SOLVE, "--out", "{}/x.mtx", "--report", "{}/r.json"], [MAKE], ["x.mtx"]),
    "analysis": Case(["analyze", "{}/A.mtx", "-q", "--save", "{}/A.analysis"], [MAKE], ["A.analysis"],
                  [("A.analysis", [*SOLVE, "--analysis", "{}/A.analysis", "--out", "{}/y.mtx"], "y.mtx")]),
    "pages": Case([*SOLVE, "--out", "{}/x.mtx", "--page={}/solve.html", "--trace", "{}/t.json"], [MAKE], ["x.mtx"]),
    "threads": Case(["solve", "{}/A.mtx", "--threads", "4", "-q", "--out", "{}/x.mtx"], [["generate", "elasticity", "8", "--out", "{}/A.mtx"]], ["x.mtx"]),
    "devices": Case(["solve", "{}/A.mtx", "--device", "host:1,1", "-q", "--out", "{}/x.mtx"], [MAKE], ["x.mtx"]),
    "factor": Case([*SOLVE, "--save-factor", "{}/A.factor"], [MAKE], ["A.factor"],
                   [("A.factor", ["solve", "--factor", "{}/A.factor", "-q", "--out", "{}/y.mtx"], "y.mtx")]),
    "loaded": Case(["solve", "--factor", "{}/A.factor", "-q", "--out", "{}/y.mtx"], [MAKE, [*SOLVE, "--save-factor", "{}/A.factor"]], ["y.mtx"]),
    "disk": Case(["solve", "{}/A.mtx", "--threads", "1", "-q", "--host-memory", "11.2MiB", "--scratch", "{}/scratch", "--out", "{}/x.mtx"],
                 [["generate", "elasticity", "10", "--out", "{}/A.mtx"]], ["x.mtx"], scratch="scratch"),
    "simulate": Case(SIMULATE, [], [], [("out/state.restart", [*GO_ON, "0.04"], "out/quantities.csv")]),
    "restart": Case([*GO_ON, "0.06"], [SIMULATE], [], [("out/state.restart", [*GO_ON, "0.06"], "out/quantities.csv")]),
    "modes": Case(["modes", "--generate", "elasticity 4 4 4", "--count", "2", "--threads", "1", "-q", "--out", "{}/modes"], [], []),
    "report": Case(["report", "{}/r.json", "--out", "{}/page.html"], [], ["page.html"]),
}


class Run:
    """One run in a folder of its own."""

    def __init__(self, case, prepared, shim, how="once", at=0):
        self.case, self.folder = case, Path(tempfile.mkdtemp())
        shutil.copytree(prepared, self.folder, dirs_exist_ok=True)
        if case.scratch:
            (self.folder / case.scratch).mkdir(exist_ok=True)
        self.log = Path(str(self.folder) + ".log")
        self.environment = {**os.environ, "LD_PRELOAD": str(shim), "FAULT_AT": str(at), "FAULT_HOW": how, "FAULT_LOG": str(self.log),
                            "TMPDIR": str(self.folder)}
        self.code, self.errors = self.call(case.words, self.environment)
        self.calls = self.log.read_text().splitlines() if self.log.exists() else []

    def call(self, words, environment=None):
        command = [BINARY, *(word.replace("{}", str(self.folder)) for word in words)]
        try:
            done = subprocess.run(command, capture_output=True, timeout=SECONDS, env=environment, stdin=subprocess.DEVNULL)
        except subprocess.TimeoutExpired:
            return "hangs", ""
        return done.returncode, done.stderr.decode(errors="replace")

    def files(self):
        """Each file but the truth's own, and what it has; the folder's name is the same in all."""
        return {str(p.relative_to(self.folder)): p.read_bytes().replace(str(self.folder).encode(), b"FOLDER")
                for p in self.folder.rglob("*") if p.is_file()}

    def bytes(self, name):
        path = self.folder / name
        return path.read_bytes() if path.is_file() else None

    def end(self):
        shutil.rmtree(self.folder, ignore_errors=True)
        self.log.unlink(missing_ok=True)


def alike(now, truth, name):
    """The same bytes. Of a history the same end, and no gap: a run that was ended between two restart files goes on by other steps."""
    if now == truth or not name.endswith(".csv") or now is None:
        return now == truth
    rows, wanted = ([[float(x) for x in line.split(",")] for line in text.decode().splitlines()[1:]] for text in (now, truth))
    steps, usual = ([b[0] - a[0] for a, b in zip(lines, lines[1:])] for lines in (rows, wanted))
    return (rows[0][0] == wanted[0][0] and all(0 < step <= 1.5 * max(usual) for step in steps) and
            all(abs(a - b) <= 1e-6 * max(map(abs, wanted[-1])) for a, b in zip(rows[-1], wanted[-1])))


def near(now, truth):
    """The same numbers but for rounding: an order of elimination that found no memory is replaced by another."""
    words = [text.decode(errors="replace").split() for text in (now, truth)]
    try:
        numbers = [[float(word) for word in text if re.match(r"[-+.\d]", word)] for text in words]
    except ValueError:
        return False
    return len(words[0]) == len(words[1]) and all(abs(a - b) <= 1e-9 * max(map(abs, numbers[1])) for a, b in zip(*numbers))


def complaints(run, truth, always, answers, old, how):
    """What is wrong after a fault."""
    case, found = run.case, []
    call, _, path = (run.calls[0] if run.calls and how != "memory" else "nothing").partition(" ")
    if how == "cut":
        if run.code not in (-signal.SIGKILL, 0):
            found.append(f"ended with {run.code}")
    elif run.code not in (0, 2, 4, 5, 6):
        found.append(f"ended with {run.code}: {run.errors.strip()[-300:]}")
    elif run.code:
        if not re.search(r"error: \S", run.errors):
            found.append(f"no message: {run.errors!r}")
        name = Path(path.split(" (deleted)")[0]).name
        own = path.startswith(str(run.folder)) and call != "pthread_create"
        plain = re.sub(r"(\.\d+-\d+)?\.espalier\.part$|\.part$|\.written$", "", name)
        inside = case.scratch and path.startswith(str(run.folder / case.scratch))
        # On a full disk the message may be about what comes later: a run does not fail for want of its page.
        if own and not inside and plain not in run.errors and not (how == "on" and str(run.folder) in run.errors):
            found.append(f"the message does not name {plain}: {run.errors.strip()}")
    files = run.files()
    said = run.errors + files.get("out/summary.json", b"").decode()  # the page of a run may fail: a notice says so
    if not run.code and how != "cut":
        for name in sorted(always | files.keys()):
            good = name in files and name in truth.files()
            good = good and (name not in always or files[name] == truth.files()[name] or how == "memory" and near(files[name], truth.files()[name]))
            if not good:
                if Path(name).name.removesuffix(".espalier.part") not in said:
                    found.append(f"ended with 0, and {name} is {'another' if name in files else 'not there'}")
    for name in case.results:
        now = run.bytes(name)
        if now is not None and now != truth.bytes(name) and now != old(name):
            found.append(f"{name} is neither whole nor old ({len(now)} bytes)")
    if case.scratch and any((run.folder / case.scratch).iterdir()):
        found.append("left in scratch: " + ", ".join(p.name for p in (run.folder / case.scratch).iterdir()))
    if how not in ("cut", "on"):
        for part in run.folder.rglob("*.part"):
            if part.name not in said:
                found.append(f"left: {part.relative_to(run.folder)}")
    for name, words, result in case.loads:
        if run.bytes(name) is None:
            continue
        code, errors = run.call(words)
        if code not in (0, 2):
            found.append(f"reading {name} then ends with {code}: {errors.strip()[-200:]}")
        if code == 0 and not alike(run.bytes(result), answers[result], result):
            found.append(f"reading {name} then gives another {result}")
    return found


def prepare(case, folder, report):
    (folder / "model.toml").write_text(MODEL)
    shutil.copy(report, folder / "r.json")
    for words in case.before:
        subprocess.run([BINARY, *(word.replace("{}", str(folder)) for word in words)], check=True, capture_output=True)


def check_case(name, case, arguments):
    found, tried = 0, 0
    with tempfile.TemporaryDirectory() as prepared:
        prepare(case, Path(prepared), arguments.report)
        truth = Run(case, prepared, arguments.shim)
        if truth.code:
            return [f"{name}: ends with {truth.code} without a fault: {truth.errors}"], 0
        old = lambda file: (Path(prepared) / file).read_bytes() if (Path(prepared) / file).is_file() else None  # noqa: E731
        second = Run(case, prepared, arguments.shim)  # what differs by itself has seconds in it
        always = {name for name, content in truth.files().items() if second.files().get(name) == content}
        answers = {}
        for _, words, result in case.loads:
            second.call(words)
            answers[result] = second.bytes(result)
        second.end()
        wrong = []
        for how in arguments.how:
            count = len(truth.calls)
            if how == "memory":
                counted = Run(case, prepared, arguments.shim, how)
                count = int(counted.calls[-1].split()[1])
                counted.end()
            for at in range(1, count + 1, max(1, count // arguments.most) if how == "memory" else 1):
                if at > arguments.first and (at * 7919) % 1000 >= 1000 * arguments.share:
                    continue
                if how in ("on", "cut") and not re.match("f?open|write|pwrite|rename|fsync|ftruncate|mkdir", truth.calls[at - 1]):
                    continue
                if how == "short" and not re.match("p?(read|write)v?", truth.calls[at - 1]):
                    continue
                run = Run(case, prepared, arguments.shim, how, at)
                tried += 1
                for text in complaints(run, truth, always, answers, old, how):
                    wrong.append(f"{name} {how} {at} ({run.calls[0] if run.calls else '?'}): {text}")
                run.end()
        if "cut" in arguments.how:
            blocks, more = check_blocks(name, case, truth, arguments.share)
            tried += blocks
            wrong += more
        truth.end()
    print(f"{name}: {len(truth.calls)} calls, {tried} faults, {len(wrong)} wrong", flush=True)
    return wrong, tried


def check_blocks(name, case, truth, share):
    """Each block of a file that is read again is missing, with all behind it, or zeros."""
    wrong, tried = [], 0
    for file, words, result in case.loads:
        path = truth.folder / file
        whole = path.read_bytes()
        truth.call(words)
        right = truth.bytes(result)
        path.write_bytes(whole)
        for begin in range(0, len(whole), 4096):
            if share < 1 and (begin // 4096) % max(1, round(1 / share)):
                continue
            zeros = bytes(min(4096, len(whole) - begin))
            for kind, content in (("cut off", whole[:begin]), ("zeros", whole[:begin] + zeros + whole[begin + len(zeros):])):
                if content == whole:
                    continue
                path.write_bytes(content)
                (truth.folder / result).unlink(missing_ok=True) if result != file else None
                code, errors = truth.call(words)
                tried += 1
                if code == 0 and truth.bytes(result) != right or code not in (0, 2):
                    wrong.append(f"{name}: {file} {kind} from {begin}: ends with {code}, {errors.strip()[-200:]}")
                path.write_bytes(whole)
    return tried, wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", choices=[*CASES, []])
    parser.add_argument("--shim", type=Path, default=Path(BINARY).parent / "tests/espalier_faults.so")
    parser.add_argument("--share", type=float, default=1.0, help="of the calls (default: 1)")
    parser.add_argument("--most", type=int, default=2000, help="allocations of a case, evenly spread where it has more")
    parser.add_argument("--first", type=int, default=0, help="so many of the first calls, which read, whatever the share")
    parser.add_argument("--how", type=lambda words: words.split(","), default=list(KINDS), help="some of " + ",".join(KINDS))
    parser.add_argument("--report", type=Path, default=Path(__file__).resolve().parents[2] / "bench/results/cpu-2-cores-2026-11-21.json")
    parser.add_argument("--one", nargs=3, metavar=("HOW", "AT", "CASE"))
    arguments = parser.parse_args()
    arguments.shim = arguments.shim.resolve()
    if arguments.one:
        how, at, name = arguments.one
        with tempfile.TemporaryDirectory() as prepared:
            prepare(CASES[name], Path(prepared), arguments.report)
            run = Run(CASES[name], prepared, arguments.shim, how, int(at))
            print(run.code, run.errors, run.calls, sorted(str(p.relative_to(run.folder)) for p in run.folder.rglob("*")), sep="\n")
            run.end()
        return 0
    wrong = []
    for name in arguments.cases or CASES:
        wrong += check_case(name, CASES[name], arguments)[0]
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
