#!/usr/bin/env python3
"""Random cases without end, each judged by a second truth: for the night, on any machine.

    scripts/campaign.sh [--hours H] [--state FOLDER] [--only NAME,...] [--jobs N] [--device gpu:0] [--list]

Campaigns take turns, a share at a time, each from the seed after the last one that was tried; N shares run side by side.
FOLDER (default build/campaign) keeps state.json, which the next call goes on from, page.md, which says what was tried and what
was wrong, and the output of each share in which anything was. Ctrl-C ends it after the shares that run.
Ends with 1 where anything was wrong, by this call or one before.
"""

import argparse
import concurrent.futures
import datetime
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
PROGRAMS = ROOT / "build/release/tests"
PYTHON = ROOT / "build/python-env/bin/python"


class Campaign(NamedTuple):
    name: str
    tries: str  # what, in a word or two
    truth: str
    share: int  # cases of a turn, about half a minute
    command: tuple  # "COUNT" and "SEED" stand for numbers, "DEVICE" for the device
    environment: dict = {}


CAMPAIGNS = (
    Campaign("verdict", "matrices of known rank", "rank and inertia by construction, residuals", 2000,
             ("espalier_verdict", "COUNT", "SEED", "400", "any", "DEVICE")),
    Campaign("exact", "integer matrices", "rank and inertia by elimination in integers", 30000, ("espalier_exact", "COUNT", "SEED")),
    Campaign("exact-real-forms", "complex ones as real ones", "the same", 15000, ("espalier_exact", "COUNT", "SEED"),
             {"ESPALIER_COMPLEX_FORM": "real"}),
    Campaign("patterns", "changed patterns", "analyses and factorizations from nothing", 3000, ("espalier_follow", "COUNT", "SEED")),
    Campaign("values", "changed values and patterns", "the bits of factorizations that make everything", 3000,
             ("espalier_value_changes", "COUNT", "SEED", "DEVICE", "400", "40")),
    Campaign("sequences", "sequences of calls", "residuals, and bits of fresh factors", 2000,
             ("espalier_sequences", "COUNT", "SEED", "40", "ANY_DEVICE")),
    Campaign("sequences-real-forms", "the same, complex systems as real ones", "the same", 2000,
             ("espalier_sequences", "COUNT", "SEED", "40"), {"ESPALIER_COMPLEX_FORM": "real"}),
    Campaign("sequences-c", "sequences of calls from C", "dense algebra", 2000, ("espalier_c_sequences", "COUNT", "SEED")),
    Campaign("mechanisms", "mechanisms with loops", "rank of the constraints in integers, balance of forces", 400,
             ("mechanisms.py", "COUNT", "SEED")),
)


def command_of(campaign, seed, device):
    words = {"COUNT": str(campaign.share), "SEED": str(seed), "DEVICE": device or "cpu", "ANY_DEVICE": device}
    words["DEVICE"] = "host:1" if campaign.name == "verdict" and not device else words["DEVICE"]
    program, *rest = campaign.command
    arguments = [words.get(word, word) for word in rest]
    while arguments and not arguments[-1]:
        arguments.pop()
    if program.endswith(".py"):
        return [str(PYTHON), str(ROOT / "tests/verdict" / program), *arguments]
    return [str(PROGRAMS / program), *arguments]


def wrong_of(output, status):
    """How many cases of a share were wrong: lines that say so, else the end of a program that has failed otherwise."""
    lines = len(re.findall(r"^(?:WRONG|wrong)\b", output, re.MULTILINE))
    return max(lines, 0 if status == 0 else 1)


def run_share(campaign, seed, device, limit):
    command = command_of(campaign, seed, device)
    begin = time.monotonic()
    environment = {**os.environ, **campaign.environment, "PYTHONPATH": str(ROOT / "build/release/python")}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                               env=environment, start_new_session=True)
    try:
        output, status = process.communicate(timeout=limit)[0], process.returncode
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        output = process.communicate()[0] + f"\nstopped after {limit} s: it hangs, or the machine is slow\n"
        status = 124
    return {"name": campaign.name, "seed": seed, "command": command, "status": status, "seconds": time.monotonic() - begin,
            "wrong": wrong_of(output, status), "output": output}


class State:
    """What was tried, on file. The seeds of shares that ran when a call was killed are passed over."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / "state.json"
        self.of = json.loads(self.path.read_text()) if self.path.exists() else {}

    def entry(self, campaign):
        return self.of.setdefault(campaign.name, {"next": 1, "cases": 0, "wrong": 0, "seconds": 0.0, "failures": []})

    def take_seed(self, campaign):
        entry = self.entry(campaign)
        seed = entry["next"]
        entry["next"] += campaign.share
        return seed

    def note(self, campaign, share):
        entry = self.entry(campaign)
        entry["cases"] += campaign.share
        entry["wrong"] += share["wrong"]
        entry["seconds"] += share["seconds"]
        if share["wrong"]:
            log = self.folder / f"{campaign.name}-{share['seed']}.log"
            log.write_text(share["output"])
            entry["failures"].append({"seed": share["seed"], "wrong": share["wrong"], "status": share["status"],
                                      "command": " ".join(share["command"]), "log": log.name})
        self.save()

    def save(self):
        beside = self.path.with_suffix(".new")
        beside.write_text(json.dumps(self.of, indent=1) + "\n")
        beside.replace(self.path)
        (self.folder / "page.md").write_text(self.page())

    def page(self):
        commit = subprocess.run(["git", "-C", str(ROOT), "describe", "--always", "--dirty"], capture_output=True, text=True,
                                check=False).stdout.strip()
        lines = [f"# Campaigns\n\n{datetime.datetime.now(datetime.timezone.utc):%Y-%m-%d %H:%M} UTC, {commit or 'no commit'}\n",
                 "| campaign | cases | wrong | hours of a core | what | truth |", "|---|---|---|---|---|---|"]
        failures = []
        for c in CAMPAIGNS:
            if c.name not in self.of:
                continue
            e = self.of[c.name]
            lines.append(f"| {c.name} | {e['cases']} | {e['wrong']} | {e['seconds'] / 3600:.2f} | {c.tries} | {c.truth} |")
            failures += [f"- `{f['command']}`: {f['wrong']} wrong, ended with {f['status']} ({f['log']})" for f in e["failures"]]
        return "\n".join(lines + (["\nWhat was wrong:\n", *failures] if failures else [])) + "\n"


def missing_of(campaign):
    program = Path(command_of(campaign, 1, "")[0])
    return "" if program.exists() else str(program.relative_to(ROOT))


def run(chosen, state, hours, jobs, device):
    stop = []
    signal.signal(signal.SIGINT, lambda *_: stop.append(True))
    signal.signal(signal.SIGTERM, lambda *_: stop.append(True))
    end = time.monotonic() + 3600 * hours
    turn = 0
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        running = {}
        while running or (not stop and time.monotonic() < end):
            while len(running) < jobs and not stop and time.monotonic() < end:
                campaign = chosen[turn % len(chosen)]
                turn += 1
                running[pool.submit(run_share, campaign, state.take_seed(campaign), device, 1800)] = campaign
            done, _ = concurrent.futures.wait(running, timeout=1, return_when=concurrent.futures.FIRST_COMPLETED)
            for future in done:
                campaign, share = running.pop(future), future.result()
                state.note(campaign, share)
                last = share["output"].strip().rsplit("\n", 1)[-1]
                print(f"{campaign.name} from seed {share['seed']}, {share['seconds']:.0f} s: {last}", flush=True)


def main():
    parser = argparse.ArgumentParser(prog="scripts/campaign.sh", description=__doc__.split("\n\n")[0])
    parser.add_argument("--hours", type=float, default=8, help="no share begins later (default: 8)")
    parser.add_argument("--state", type=Path, default=ROOT / "build/campaign", metavar="FOLDER")
    parser.add_argument("--only", default="", metavar="NAME,...", help="these campaigns")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="shares side by side (default: processors)")
    parser.add_argument("--device", default="", help="where they run, as the solver's option takes it (default: host)")
    parser.add_argument("--list", action="store_true", help="the campaigns and what judges them")
    options = parser.parse_args()
    names = [c.name for c in CAMPAIGNS]
    if options.list:
        print("\n".join(f"{c.name}: {c.tries}; truth: {c.truth}" for c in CAMPAIGNS))
        return 0
    wanted = [name for name in options.only.split(",") if name] or names
    unknown = [name for name in wanted if name not in names]
    if unknown or not options.hours >= 0 or options.jobs < 1:
        wrong = f"no campaign is called {unknown[0]}; known are {', '.join(names)}" if unknown else "--hours and --jobs must be positive"
        parser.error(wrong)
    chosen = [c for c in CAMPAIGNS if c.name in wanted]
    for missing in sorted({m for c in chosen if (m := missing_of(c))}):
        print(f"left out, not built: {missing}", file=sys.stderr)
    chosen = [c for c in chosen if not missing_of(c)]
    if not chosen:
        return 2
    state = State(options.state)
    run(chosen, state, options.hours, options.jobs, options.device)
    state.save()
    print((state.folder / "page.md").read_text())
    return 1 if any(e["wrong"] for e in state.of.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
