#!/usr/bin/env python3
"""The solver's options by name, from src/solver/options/option_text.cpp, with the words and defaults of include/espalier/solver.hpp.

    python3 docs/site/option_names.py            writes the page to stdout
    python3 docs/site/option_names.py --names    the names, one a line
"""
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Fields of Options whose name is not that of the text.
FIELDS = {"device_memory": "device_memory_bytes", "host_memory": "host_memory_bytes", "pinned_memory": "pinned_memory_bytes"}


def tables():
    """Table of named values -> {value: name}."""
    text = "".join((ROOT / "src/solver/options" / f).read_text() for f in ("option_text.hpp", "option_text.cpp"))
    return {m[1]: {value: name for name, value in re.findall(r'\{"(\w+)", ([\w:]+)\}', m[2])}
            for m in re.finditer(r"base::Named<\w+> (k\w+)\[\] = \{(.*?)\};", text, re.S)}


def names():
    text = (ROOT / "src/solver/options/option_text.cpp").read_text()
    table = text[text.index("kOptions{{"):]
    found = re.findall(r'^    \{"(\w+)",', table[:table.index("\n}};")], re.M)
    count = int(re.search(r"std::array<OptionText, (\d+)>", text)[1])
    if len(found) != count:
        sys.exit(f"option_names.py: {len(found)} of {count} options of option_text.cpp were found")
    return found


def values():
    """Name of an option -> what it takes, as its messages say it."""
    text = (ROOT / "src/solver/options/option_text.cpp").read_text()
    lists = tables()
    found = {}
    for entry in re.split(r'\n    (?=\{")', text[text.index("kOptions{{"):text.index("\n}};")])[1:]:
        name = re.match(r'\{"(\w+)"', entry)[1]
        if m := re.search(r"parse_name\(k, v, (k\w+)\)", entry):
            found[name] = [f"`{w}`" for w in lists[m[1]].values()]
        elif "parse_switch" in entry:
            found[name] = ["`on`", "`off`"]
        elif "parse_budget" in entry:
            found[name] = ["a size: `4096`, `512M`, `2GiB`"]
        elif m := re.search(r'"(an? [^"]+)"', entry):
            found[name] = [m[1]]
    return found


def fields():
    """Field of Options -> (default, what its comment says)."""
    text = (ROOT / "include/espalier/solver.hpp").read_text()
    body = text[text.index("struct Options {"):]
    body = body[:body.index("\n};")]
    found, before = {}, []
    lines = body.splitlines()[1:]
    for k, line in enumerate(lines):
        if m := re.match(r"\s*///\s?(?!<)(.*)", line):
            before.append(m[1])
            continue
        m = re.match(r"\s*[\w:<>() ]+?\b(\w+)(?: = ([^;]+))?;(?:\s*///<\s*(.*))?", line)
        if m is None:  # the default stands on the next line
            joined = line + (lines[k + 1].strip() if k + 1 < len(lines) else "")
            m = re.match(r"\s*[\w:<>() ]+?\b(\w+) =\s*([^;]+);(?:\s*///<\s*(.*))?", joined)
        if m and m[1]:
            words = [m[3]] if m[3] else before
            after = k + 1 + (m[3] is not None and ";" not in line)
            while m[3] and after < len(lines) and (more := re.match(r"\s*///<\s*(.*)", lines[after])):
                words.append(more[1])
                after += 1
            found[m[1]] = ((m[2] or "").strip(), " ".join(words))
        before = [] if m else before
    for name, (default, words) in found.items():  # an enumeration says it itself
        if not words and (m := re.match(r"(\w+)::", default)):
            found[name] = (default, enumeration(text, m[1]))
    return found


def enumeration(text, name):
    """The comments of an enumeration and of its members as one sentence."""
    before, body = re.search(rf"((?:///[^\n]*\n)+)enum class {name} \{{(.*?)\}};", text, re.S).groups()
    words = " ".join(re.findall(r"///\s?(.*)", before))
    for member in re.finditer(r"((?:\s*///(?!<)[^\n]*\n)*)\s*(\w+),((?:\s*///<[^\n]*\n?)*)", body):
        comment = " ".join(re.findall(r"///<?\s*(.*)", member[1] + member[3]))
        words += f" `{member[2]}`: {comment}"
    return words


def page():
    known, words = fields(), values()
    named = {value: name for rows in tables().values() for value, name in rows.items()}
    out = ["# Options by name", "",
           "One set of names for all: the command line (`--device-memory 2GiB`), the `[solver]` section of a model, keywords in",
           "Python (`esp.Solver(A, device=\"cpu\")`), `espalier_set_option` in C, and the environment for programs that know",
           "nothing of us: `ESPALIER_OPTIONS=\"device=gpu:0;threads=8\"`. In C++ they are fields of `espalier::Options`.",
           "This page is made from [option_text.cpp](../../src/solver/options/option_text.cpp) and",
           "[solver.hpp](../../include/espalier/solver.hpp) when the site is built.", "",
           "| name | default | values | meaning |", "|---|---|---|---|"]
    for name in names():
        field = FIELDS.get(name, name)
        if field not in known:
            sys.exit(f"option_names.py: Options has no field '{field}'")
        default, meaning = known[field]
        default = named.get(default, default).strip('"')
        default = {"false": "off", "true": "on"}.get(default, default)
        cells = (f"`{name}`", f"`{default}`" if default else "", ", ".join(words.get(name, ())), meaning)
        out.append("| " + " | ".join(c.replace("|", "\\|").replace("<", "&lt;") for c in cells) + " |")
    return "\n".join(out) + "\n"


if __name__ == "__main__":
    print("\n".join(names()) if "--names" in sys.argv else page())
