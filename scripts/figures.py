#!/usr/bin/env python3
"""Holds the figures of the pages against the results that they come from, and makes a share of them again.

    scripts/figures.py                                each number of the pages is that of its results (bench/figures.toml)
    scripts/figures.py --list                         and where each comes from: command, machine, date, versions
    scripts/figures.py --verify                       makes a tenth of those that this machine can again, within ten minutes
    scripts/figures.py --verify --share 1 --only count   all counts: CI does so, since no clock moves them

Only ratios and counts are made again; seconds belong to the machine that the results name, and so do ratios of GPUs where there
are none. Both are named, and are neither good nor bad. Ends with 0; with 1 where a page or the table is wrong; with 2 for wrong usage,
or where nothing could be made again; with 6 where a figure has moved by more than its share (5 %).
"""
import argparse
import datetime
import json
import math
import os
import random
import re
import shlex
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
UNITS = {"ms": 1e-3, "million": 1e6, "GB": 1e9, "MiB": 2**20, "GiB": 2**30}
NUMBER = re.compile(r"(?<![\w^.])(\d[\d,]*\d|\d)(\.\d+)?(e[+-]?\d+)?(?![\w^])(?: (ms|million|GB|MiB|GiB)\b)?")
WRONG, USAGE, MOVED = 1, 2, 6


class Row:
    """A row of results, whose keys are attributes; a time is its median."""

    def __init__(self, data):
        self._data = data

    def __getattr__(self, key):
        value = self._data[key]
        if isinstance(value, dict):
            return value["median"] if "median" in value else Row(value)
        return value


def flat(text):
    return " ".join(text.split())


def prose(text):
    """The words of a page: no code, no comments, no targets of links."""
    text = re.sub(r"<!--.*?-->|^(`{3,}).*?^\1\s*$", "", text, flags=re.S | re.M)
    text = re.sub(r"^ {4}.*$", "", text, flags=re.M)
    return flat(re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`\n]*`", "", text)))


class Results:
    """A file of bench/results, or one made now."""

    def __init__(self, path, names):
        self.data, self.names, self.path = json.loads(path.read_text()), names, path
        for key in ("command", "date", "commit", "machine", "version"):
            if not self.data.get(key):
                raise ValueError(f"{path.name} has no {key}")

    def row(self, name, system):
        def fits(row):
            for key, wanted in self.names[name].items():
                value = row
                for part in key.split("."):
                    value = (value.get(part) if isinstance(value, dict) else None)
                if value != wanted:
                    return False
            return row["system"] == system
        found = [row for row in self.data["rows"] if fits(row)]
        if len(found) != 1:
            raise ValueError(f"{self.path.name}: {len(found)} rows of {name} for {system}")
        if found[0]["outcome"] != "ok" or not found[0].get("version"):
            raise ValueError(f"{self.path.name}: {name}, {system}: {found[0]['outcome']}, version {found[0].get('version')}")
        return Row(found[0])

    def at(self, expression, system):
        names = {name: self.row(name, system) for name in self.names if re.search(rf"\b{name}\.", expression)}
        names |= {"log2": math.log2, "settings": Row(self.data.get("settings", {}))}
        return float(eval(expression, {"__builtins__": {}}, names))  # of our own file

    def systems(self):
        return list(dict.fromkeys(row["system"] for row in self.data["rows"]))

    def value(self, text):
        place, expression = text.split(": ", 1)
        if place not in ("least", "most"):
            return self.at(expression, place)
        return {"least": min, "most": max}[place](self.at(expression, system) for system in self.systems())

    def rivals(self, values):
        """Contestants of these values."""
        used = [name for name in self.names if any(re.search(rf"\b{name}\.", value) for value in values)]
        return [self.names[name]["rival"] for name in used if "rival" in self.names[name]]


class Table:
    def __init__(self, root):
        content, self.root = tomllib.loads((root / "bench/figures.toml").read_text()), root
        self.pages, self.linked, self.names, self.figures = (content[k] for k in ("pages", "linked", "rows", "figures"))
        self.results = {f["results"]: Results(root / "bench/results" / f["results"], self.names)
                        for f in self.figures if "results" in f}

    def recorded(self, figure, value):
        if value in ("first day", "last day", "year"):
            used = {f["results"] for f in self.figures if f["page"] == figure["page"] and "results" in f}
            days = sorted(datetime.date.fromisoformat(self.results[name].data["date"][:10]) for name in used)
            return float({"first day": days[0].day, "last day": days[-1].day, "year": days[-1].year}[value])
        return self.results[figure["results"]].value(value)


def numbers(text):
    """The numbers of a text: as printed, in the unit of the results, and half of the last printed place."""
    for match in NUMBER.finditer(text):
        whole, fraction, power, unit = match.groups()
        scale = UNITS.get(unit, 1.0) * 10.0 ** int(power[1:] if power else 0)
        zeros = len(whole) - len(whole.rstrip("0,")) - whole[len(whole.rstrip("0,")):].count(",") if "," in whole else 0
        place = 10.0 ** (zeros - (len(fraction) - 1 if fraction else 0))
        yield match.group(0), float(whole.replace(",", "") + (fraction or "")) * scale, 0.5 * place * scale * (1 + 1e-9)


def check_page(table, page, words, complaints):
    """Each number of the page is that of its record."""
    text = prose((table.root / page).read_text())
    for word in words:
        if word not in text:
            complaints.append(f"{page}: '{word}' stands in the table and not on the page")
    for figure in (f for f in table.figures if f["page"] == page):
        if text.count(flat(figure["text"])) != 1:
            complaints.append(f"{page}: '{figure['text']}' stands there {text.count(flat(figure['text']))} times")
            continue
        text = text.replace(flat(figure["text"]), " | ")
        bare = figure["text"]
        for word in words:
            bare = bare.replace(word, " ")
        printed = list(numbers(bare))
        if len(printed) != len(figure["values"]):
            complaints.append(f"{page}: '{figure['text']}' has {len(printed)} numbers, its values are {len(figure['values'])}")
            continue
        for (shown, value, half), source in zip(printed, figure["values"]):
            record = table.recorded(figure, source)
            allowed = max(half, figure.get("about", 0) * abs(record))
            if abs(value - record) > allowed:
                complaints.append(f"{page}: '{figure['text']}': {shown} is {record:.6g} in {figure.get('results', 'the results')} ({source})")
    for word in words:
        text = text.replace(word, " ")
    for match in NUMBER.finditer(text):
        complaints.append(f"{page}: a number without a figure in bench/figures.toml: "
                          f"'...{text[max(0, match.start() - 40):match.end() + 20]}...'")


def slug(heading):
    """As GitHub makes the anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()).replace(" ", "-")


def section(path, anchor):
    """The lines below a heading, up to the next one of its level."""
    lines, level = [], 0
    for line in path.read_text().splitlines():
        heading = re.match(r"(#+) (.*)", line)
        if heading and level and len(heading[1]) <= level:
            break
        if heading and slug(heading[2]) == anchor:
            level = len(heading[1])
        elif level:
            lines.append(line)
    return lines


def check_linked(root, page, heading, complaints):
    """Numbers of a table whose lines link to the section that they come from."""
    count = 0
    for line in section(root / page, slug(heading)):
        link = re.search(r"\]\(([\w.]+)#([\w-]+)\)", line)
        if not link:
            continue
        source = "\n".join(section((root / page).parent / link[1], link[2]))
        if not re.search(r"\b20\d\d-\d\d-\d\d\b", source):
            complaints.append(f"{page}: {link[0][2:-1]} names no date")
        for shown, *_ in numbers(prose(line).split("|")[2]):
            count += 1
            if not re.search(rf"(?<![\d.]){re.escape(shown.split()[0])}(?!\.?\d)", source):
                complaints.append(f"{page}: '{shown}' of '{prose(line)[:60]}...' does not stand in {link[0][2:-1]}")
    if not count:
        complaints.append(f"{page}: no linked numbers in '{heading}'")


def gpus_here():
    try:
        listed = subprocess.run(["nvidia-smi", "-L"], capture_output=True, text=True, timeout=20).stdout
    except (OSError, subprocess.TimeoutExpired):
        return []
    return re.findall(r"^GPU \d+: (.*?) \(UUID", listed, re.M)


def why_not(table, figure, gpus):
    """Why this machine cannot make the figure again, or nothing."""
    if figure["quantity"] in ("time", "date"):
        return "seconds of the machine that the results name" if figure["quantity"] == "time" else "a date"
    results = table.results[figure["results"]]
    if figure["quantity"] == "count":
        rows = [row for row in results.data["rows"] if any(v.startswith(row["system"] + ": ") for v in figure["values"])]
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        # An analysis takes up to a tenth of what the factor would: told from runs up to plate 1200.
        return "its analysis does not fit" if any(row["unknowns"] * 3000 > memory for row in rows) else None
    needed = results.data["machine"].get("gpus", []) if any("gpu" in r or "cudss" in r for r in results.rivals(figure["values"])) else []
    if any(gpus.count(name) < needed.count(name) for name in needed):
        return f"needs {', '.join(needed)}"
    if results.data["experiment"] != "peers":
        return f"made by {shlex.split(results.data['command'])[0].split('/')[-1]}, by hand"
    return None


def largest(table, figure):
    """Unknowns of the largest system of a figure."""
    rows = table.results[figure["results"]].data["rows"]
    return max(row["unknowns"] for row in rows if any(v.split(": ")[0] in (row["system"], "least", "most") for v in figure["values"]))


def run(command, seconds):
    print("  " + shlex.join(str(c) for c in command), flush=True)
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, timeout=max(seconds, 1))
    if done.returncode:
        raise ValueError(f"ended with {done.returncode}: {done.stderr.strip()[-300:]}")
    return done.stdout


def made_again(table, figure, binary, folder, seconds):
    """The values of the figure, made now: pairs of value and what is now; it is kept for the next figure of the same systems."""
    results = table.results[figure["results"]]
    places = [value.split(": ", 1)[0] for value in figure["values"]]
    systems = results.systems() if {"least", "most"} & set(places) else list(dict.fromkeys(places))
    if figure["quantity"] == "count":
        rows = []
        for system in systems:
            path = folder / (re.sub(r"\W+", "-", system) + "-counts.json")
            if not path.exists():
                path.write_text(run([binary, "analyze", "--generate", system, "--device", "cpu", "--json"], seconds))
            counted = json.loads(path.read_text())
            rows += [{**row, **{key: counted["analysis"][key] for key in ("flops", "nonzeros_factor")},
                      "unknowns": counted["matrix"]["rows"]} for row in results.data["rows"] if row["system"] == system]
        path = folder / "counts.json"
        path.write_text(json.dumps({**results.data, "rows": rows}))
    else:
        settings, rivals = results.data["settings"], results.rivals(figure["values"])
        columns = settings["right_hand_sides"] if any("solve_many" in value for value in figure["values"]) else 1
        path = folder / (re.sub(r"\W+", "-", " ".join([figure["results"], *systems, *rivals, str(columns)])) + ".json")
        if not path.exists():
            one = [word for system in systems for word in ("--system", system)]
            run([binary, "bench", "peers", *one, "--rivals", ",".join(rivals), "--rhs", columns,
                 "--threads", settings["threads"], "-k", settings["repetitions"], "--analyses", 1, "--no-ceilings",
                 "--out", path], seconds)
    now = Results(path, table.names)
    return [(value, results.value(value), now.value(value)) for value in figure["values"] if not re.search(r": settings\.\w+$", value)]


def verify(table, arguments):
    gpus, random_ = gpus_here(), random.Random(arguments.seed)
    can, cannot = [], []
    for figure in (f for f in table.figures if arguments.only in (None, f["quantity"])):
        reason = why_not(table, figure, gpus)
        (cannot if reason else can).append((figure, reason))
    random_.shuffle(can)
    chosen = sorted(can[:math.ceil(arguments.share * len(can))], key=lambda pair: largest(table, pair[0]))  # small ones first
    print(f"{len(can)} of {len(can) + len(cannot)} figures can be made again on this machine; {len(chosen)} of them are (seed {arguments.seed}); "
          f"load average {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores")
    begin, good, moved, late = time.monotonic(), 0, [], []
    with tempfile.TemporaryDirectory() as folder:
        for figure, _ in chosen:
            left = arguments.seconds - (time.monotonic() - begin)
            name = f"{figure['page']}: '{figure['text']}'"
            print(name)
            try:
                pairs = made_again(table, figure, arguments.binary, Path(folder), left) if left > 0 else None
            except subprocess.TimeoutExpired:
                pairs = None
            if pairs is None:
                late.append((figure, f"{arguments.seconds:.0f} s are gone"))
                continue
            worst = max(abs(now / then - 1) for _, then, now in pairs)
            for value, then, now in pairs:
                print(f"    {value}: {then:.6g} in the results, {now:.6g} now ({now / then - 1:+.1%})")
            if worst > figure.get("share", 0.05):
                moved.append(f"{name}: {', '.join(f'{now / then - 1:+.1%}' for _, then, now in pairs)}")
            else:
                good += 1
    for figure, reason in cannot + late:
        print(f"not made again: {figure['page']}: '{figure['text']}': {reason}")
    for line in moved:
        print(f"MOVED: {line}")
    print(f"{good} as in the results, {len(moved)} moved, {len(cannot)} not of this machine, {len(late)} without time, "
          f"{len(can) - len(chosen)} not chosen; {time.monotonic() - begin:.0f} s")
    return MOVED if moved else 0 if good else USAGE


def list_figures(table):
    for figure in table.figures:
        print(f"{figure['page']}: '{figure['text']}': {figure['quantity']}")
        if "results" not in figure:
            continue
        data, results = table.results[figure["results"]].data, table.results[figure["results"]]
        outcomes = [row for row in data["rows"] if row["outcome"] == "wrong answer"]
        print(f"    bench/results/{figure['results']}, {data['date'][:10]}, commit {data['commit']}, {data['machine']['cores']} cores, "
              f"{', '.join(data['machine'].get('gpus') or ['no GPU'])}; wrong answers: {len(outcomes)}")
        for row in {row["rival"]: row for row in data["rows"]}.values():
            if row["rival"] in results.rivals(figure["values"]):
                print(f"    {row['rival']}: {row['version']}")
        for value in figure["values"]:
            print(f"    {value} = {results.value(value):.6g}")
        print(f"    {data['command']}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, prog="espalier evidence")
    parser.add_argument("--list", action="store_true", help="where each figure comes from")
    parser.add_argument("--verify", action="store_true", help="make a share of the figures again")
    parser.add_argument("--share", type=float, default=0.1, help="of those that this machine can make (default: 0.1)")
    parser.add_argument("--seed", type=int, default=1, help="which of them (default: 1)")
    parser.add_argument("--seconds", type=float, default=600, help="none is begun or goes on after (default: 600)")
    parser.add_argument("--only", choices=("ratio", "count"), help="figures of this quantity alone")
    parser.add_argument("--binary", type=Path, default=ROOT / "build/release/espalier")
    parser.add_argument("--source", type=Path, default=ROOT, help="source folder (default: this one)")
    arguments = parser.parse_args()
    if not 0 < arguments.share <= 1:
        parser.error("--share must lie above 0 and not above 1")
    complaints = []
    try:
        table = Table(arguments.source)
        for page, words in table.pages.items():
            check_page(table, page, words, complaints)
        for page, heading in table.linked.items():
            check_linked(table.root, page, heading, complaints)
        if not complaints and arguments.list:
            list_figures(table)
    except (ValueError, KeyError, OSError) as error:
        complaints.append(f"bench/figures.toml: {error}")
    print("\n".join(complaints) if complaints else f"{len(table.figures)} figures of {len(table.pages)} pages are those of their results")
    if complaints:
        return WRONG
    try:
        return verify(table, arguments) if arguments.verify else 0
    except (ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return USAGE


if __name__ == "__main__":
    sys.exit(main())
