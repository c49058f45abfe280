#!/usr/bin/env python3
"""The keys of a model's text, from the functions that read them, with what the guide says of each.

    python3 docs/site/model_keys.py            writes the page to stdout
    python3 docs/site/model_keys.py --check    says what the sources read and the guide does not know; exit code 1

Every key is read by a call such as s.positive("young") in the read_*.cpp below src/dynamics/model: type and default stand there, the
default often as a field of a struct. This module finds those calls. A literal in these files that it cannot place is an
error, so that a new way of reading cannot go unnoticed. The meaning is that of the tables of docs/guide/simulate.md,
forces.md, contact.md and fmi.md; a key of the sources without a word there is an error too.
"""
import re
import sys
from dataclasses import dataclass
from pathlib import Path

from model_keys_sections import SECTIONS

ROOT = Path(__file__).resolve().parents[2]
MODEL = ROOT / "src/dynamics/model"
GUIDE = ("simulate.md", "forces.md", "contact.md", "joints.md", "fmi.md")

TYPES = {"number": "number", "positive": "number > 0", "integer": "whole number", "flag": "true or false", "text": "text",
         "choice": "one of", "row": "one of", "one_of": "one of", "texts": "list of texts", "numbers": "list of numbers", "vector": "list of three numbers",
         "vectors": "list of points", "matrix": "three numbers, or a 3 x 3 matrix", "rotation": "rotation",
         "function": "function of time", "state_function": "expression", "value": "", "table": "table",
         "named": "tables by name", "not_negative": "number >= 0", "number_from_zero": "number >= 0", "lever": "number > 0", "inertia": "number > 0", "read_measure": 'number, or "initial"',
         "read_interval": "time, 0 or false", "read_surface_axes": "list of three numbers", "read_elements": "whole number", "read_components": "three numbers or expressions",
         "plain_values": "names and values", "read_frame": "a marker's name or a table"}
METHODS = [t for t in TYPES if not t.startswith(("not_", "number_", "lever", "inertia", "read_", "plain_"))]
HELPERS = [t for t in TYPES if t not in METHODS]
NO_DEFAULT = {"value", "table", "named", "plain_values", "texts", "read_components", "lever", "rotation", "read_measure", "read_surface_axes"}

# Literals of these files that are no keys: reserved names, the words of an option, a guess in a message.
OTHER_WORDS = {"ground", "energy", "constraints", "step", "time", "true", "false", "initial", "keys", "bodies",
               "statics", "linear", "x", "y", "z", "xyz", "m"}


@dataclass
class Key:
    name: str
    kind: str
    default: str  # "needed" where there is none
    line: int


def body_of(text, name):
    """(offset, text) of the body of the function or class called `name`."""
    start = rf"\b{name}\b(?: final)?" if " " in name else rf"\b{name}\([^;{{}}]*\)(?: const| try)?"
    for m in re.finditer(start + r"\s*\{", text):
        at = m.end() - 1
        depth, k, quoted = 0, at, False
        while True:
            c = text[k]
            if c == "\\" and quoted:
                k += 2
                continue
            if c == '"':
                quoted = not quoted
            if not quoted and c in "{}":
                depth += 1 if c == "{" else -1
                if depth == 0:
                    return at, text[at:k + 1]
            k += 1
    raise SystemExit(f"model_keys.py: there is no function '{name}' any more; mend model_keys_sections.py")


def arguments(text, at):
    """The arguments of a call whose bracket opens at `at`, and where it closes."""
    depth, start, parts, k, quoted = 0, at + 1, [], at, False
    while True:
        c = text[k]
        if c == '"':
            quoted = not quoted
        if not quoted:
            if c in "([{":
                depth += 1
            elif c in ")]}":
                depth -= 1
                if depth == 0:
                    parts.append(text[start:k].strip())
                    return parts, k
            elif c == "," and depth == 1:
                parts.append(text[start:k].strip())
                start = k + 1
        k += 1


def members():
    """(struct, field) -> initial value, over the headers of the dynamics."""
    found = {}
    for header in sorted((ROOT / "src/dynamics").rglob("*.hpp")):
        text = header.read_text()
        for m in re.finditer(r"\bstruct (\w+) \{", text):
            _, body = body_of(text[m.start():], "struct " + m[1])
            body = re.sub(r"///.*", "", body)
            for f in re.finditer(r"\b(\w+)\s*=\s*([^;,{}]+?)(?=[;,])", body):
                found.setdefault((m[1], f[1]), " ".join(f[2].split()))
    return found


WORDS = {"std::numeric_limits<double>::infinity()": "any", "Vec3::Zero()": "[0, 0, 0]", "Vec3::UnitZ()": "[0, 0, 1]",
         '""': '""', "1e300": "any"}


def default_of(kind, args, structs, fields):
    """The default as it is written in a text of a model."""
    if kind == "row":
        return list(name_lists()[args[1]])[0] if args[2:] == ["true"] else "needed"
    if kind == "one_of":
        if len(args) < 3:
            return "needed"
        member = args[2].split(".")[-1]
        value = next((fields[s, member] for s in structs if (s, member) in fields), args[2])
        return next((name for name, of in name_lists()[args[1]].items() if of == value), "by the file" if "(" in value else "")
    if kind == "choice":
        names = re.findall(r'"([\w-]+)"', args[1])
        if len(args) < 3:
            return "needed"
        return names[int(args[2])] if names and args[2].isdigit() else "by the file"
    if kind in NO_DEFAULT:
        return ""
    given = args[2:] if kind in ("integer",) else args[1:]
    if not given:
        return "needed"
    word = re.sub(r'in_units\([\w.]+, (.*), "[^"]*"\)', r"\1", given[0])
    if m := re.fullmatch(r"(?:\w+\.)+(\w+)", word.lstrip("&")):
        for struct in structs:
            if (struct, m[1]) in fields:
                word = fields[struct, m[1]]
                break
        else:
            return ""
    word = "false" if (kind, word) == ("read_interval", "-1") else WORDS.get(word, word)
    if word in ("0", "0.0") and kind == "positive":
        return ""
    return word if re.fullmatch(r"[\w.+\-\[\], ]+", word) else ""


NAMES = {}
TABLE = re.compile(r"constexpr (?:\w+Row|base::Named<.*?>) (\w+)\[\] = \{(.*?)\};", re.S)
KINDS = {"joint_kinds": "joints", "force_kinds": "forces"}  # rooms of rows, and the sections that they read


def name_lists():
    """Functions that return lists of names, for choice(), and tables of rows with what they stand for, for row() and one_of()."""
    if not NAMES:
        for file in sorted(MODEL.rglob("read_*.cpp")):
            text = file.read_text()
            for m in re.finditer(r"(\w+)\(\) \{\s*static const std::vector<std::string> names = \{([^}]*)\}", text):
                NAMES[m[1] + "()"] = re.findall(r'"([\w-]+)"', m[2])
            for m in re.finditer(r"const std::vector<std::string> (\w+) = \{([^}]*)\}", text):
                NAMES.setdefault(m[1], re.findall(r'"([\w-]+)"', m[2]))
        for file in sorted((ROOT / "src/dynamics").rglob("*pp")):
            for m in TABLE.finditer(file.read_text()):  # a row a kind, its name first
                NAMES[m[1]] = dict(re.findall(r'\{"([\w-]+)",\s*([^,}]*)', m[2]))
        for room in KINDS:  # a row a kind in files of its own
            rows = "".join(f.read_text() for f in sorted(MODEL.glob(f"{room}/*.cpp")))
            names = dict(re.findall(r'const \w+Kind (\w+) = \{[^"]*?\.name = "([\w-]+)"', rows))
            table, listed = re.search(r"(k\w+Kinds)\[\] = \{([^}]*)\}", (MODEL / room / "kind.hpp").read_text()).groups()
            NAMES[table] = {names[row]: row for row in re.findall(r"&(\w+)", listed)}
    return NAMES


def keys_of(text, function, structs, fields, seen):
    """The keys that a function reads. `seen` gets the offsets of literals that are understood."""
    start, body = body_of(text, function)
    found = {}

    def add(name, kind, default, at):
        seen.add(at)
        line = text.count("\n", 0, at) + 1
        old = found.get(name)
        if old is None or (old.default == "needed" and default not in ("needed", "")) or not old.kind:
            found[name] = Key(name, kind, default, line)

    calls = re.compile(r"(?:(?:\.|->)(" + "|".join(METHODS) + r")|\b(" + "|".join(HELPERS) + r"))\(")
    for m in calls.finditer(body):
        kind = m[1] or m[2]
        args, _ = arguments(body, m.end() - 1)
        if m[2]:
            args = args[1:]  # the section comes first
        written = list(re.finditer(r'"([a-z_][a-z0-9_]*)"', args[0])) if args else []  # slides ? "viscous" : "friction"
        if not written or not re.fullmatch(r'(?:\w+ \? )?"\w+"(?: : "\w+")?', args[0]):
            continue
        word = TYPES[kind]
        if kind in ("choice", "row", "one_of"):
            names = name_lists().get(args[1]) or re.findall(r'"([\w-]+)"', args[1])
            word = "one of " + ", ".join(f"`{n}`" for n in names)
            for n in re.finditer(r'"([\w-]+)"', args[1]):
                seen.add(start + body.index(args[1], m.end()) + n.start())
        place = start + body.index(args[0], m.end() - 1)
        default = default_of(kind, args, structs, fields)
        if kind == "choice" and default == "by the file" and args[2] == "0" and name_lists().get(args[1]):
            default = name_lists()[args[1]][0]
        if default == "needed" and re.search(rf'has\("{written[0][1]}"\)', body):
            default = ""
        for name in written:
            add(name[1], word, default, place + name.start())
    # {"lx", &b.shape.lx}: lengths with the defaults of a struct, or numbers that are needed.
    for m in re.finditer(r'\{("([a-z_][a-z0-9_]*)"), &([\w.]+)\}', body):
        member = m[3].split(".")[-1]
        default = next((fields[s, member] for s in structs if (s, member) in fields), "needed")
        add(m[2], "number > 0", default, start + m.start(1))
    # Frames, and lists of keys that a function looks for.
    for m in re.finditer(r'static const char\* const kKeys\[\] = \{([^}]*)\}', body):
        for n in re.finditer(r'"([a-z])"', m[1]):
            add(n[1], TYPES["read_frame"], "needed", start + m.start(1) + n.start())
    for m in re.finditer(r'(?:has|place)\("([a-z_][a-z0-9_]*)"\)|for \(const char\* \w+ : \{([^}]*)\}', body):
        for n in re.finditer(r'"([a-z_][a-z0-9_]*)"', m[0]):
            seen.add(start + m.start() + n.start())
    return sorted(found.values(), key=lambda k: k.line)


def unknown_literals(text, seen):
    """Literals that look like keys and were not understood."""
    lists = [m.span() for m in (*re.finditer(r"std::vector<std::string>>? \w+ = \{[^}]*\}", text), *TABLE.finditer(text))]
    for m in re.finditer(r'"([a-z_][a-z0-9_]*)"', text):
        line_start = text.rfind("\n", 0, m.start()) + 1
        line = text[line_start:text.find("\n", m.start())]
        inside = m.start() - line_start
        if m.start() in seen or m[1] in OTHER_WORDS or line.lstrip().startswith(("//", "#include")):
            continue
        if any(a <= m.start() < b for a, b in lists) or line[:inside].endswith(("== ", ".name = ")):
            continue
        if line[:inside].count('"') % 2 == 1:  # inside another literal
            continue
        yield text.count("\n", 0, m.start()) + 1, m[1]


# The guide ----------------------------------------------------------------------------------------------------------

def cells(line):
    return [c.strip().replace("\\|", "|") for c in re.split(r"(?<!\\)\|", line.strip().strip("|"))]


def guide_rows():
    """(page, heading, first header cell, words of the first cell, meaning, default) of every row of the tables."""
    rows = []
    for page in GUIDE:
        heading, header, fenced = "", None, False
        for line in (ROOT / "docs/guide" / page).read_text().splitlines():
            if line.startswith("```"):
                fenced = not fenced
            if not fenced and line.startswith("#"):
                heading, header = line.lstrip("# "), None
            elif not fenced and line.startswith("|"):
                c = cells(line)
                if header is None:
                    header = c
                elif not set("".join(c)) <= set("-: "):
                    words = re.findall(r"[\w-]+", " ".join(re.findall(r"`([^`]+)`", c[0])))
                    meaning = c[1 + (header[1:2] == ["of"])] if len(c) > 1 else ""
                    default = c[2] if len(header) > 2 and len(c) > 2 and header[2].startswith("default") else ""
                    rows.append((page, heading, header[0].strip("` "), words, meaning, default, c))
            else:
                header = None if not line.startswith("|") else header
    return rows


def meaning_of(key, tables, rows):
    """What the guide says of a key in the tables of its section: (meaning, page), or nothing."""
    for heading, header in tables:
        for page, h, first, words, meaning, _, row in rows:
            if not h.startswith(heading) or not re.search(header or ".*", first):
                continue
            if key in words and header not in ("type", "part"):
                return meaning, page
    return None


def mentioned(key, text):
    return re.search(rf"`[^`\n]*\b{re.escape(key)}\b[^`\n]*`|^\s*{re.escape(key)} = |[{{,] *{re.escape(key)} = ", text, re.M)


# Sections of a model that the functions of a source read, for the rows of units/key_dimensions.cpp; "": the top.
READS = {**{f"read_{f}.cpp": "bodies materials" for f in ("bodies", "materials", "rigid_bodies", "body_damping", "solids", "meshers", "thin_bodies")},
         "read_joints.cpp": "markers joints forces supports", "read_supports.cpp": "supports",
         "read_equations.cpp": "equations ties", "read_contacts.cpp": "joints", "read_surfaces.cpp": "surfaces contacts", "read_events.cpp": "events inputs",
         "read_splines.cpp": "splines", **{f"{room}/{f.name}": section for room, section in KINDS.items() for f in sorted(MODEL.glob(f"{room}/*.cpp"))}, "read_harmonic.cpp": "harmonic", "read_model.cpp": " integrator statics initial output"}
NUMBERS = ("number", "list of numbers", "list of three", "list of points", "three numbers", "rotation", "function", "expression", "time")


def measured_keys():
    """{section: keys} of the numbers whose dimension is known."""
    text = (MODEL / "units/key_dimensions.cpp").read_text()
    names = dict(re.findall(r'(k\w+) = "([^"]*)"', text))
    found = {}
    for tables, keys in re.findall(r'\{("[^"]*"|k\w+),\s*"[^"]*",\s*"([^"]*)",\s*"[^"]*"\}', text):
        tables = names.get(tables, tables.strip('"'))
        for section in tables.split(".")[0].split("|"):
            found.setdefault(section, set()).update(keys.split())
    return found


def unmeasured(file, key, measured):
    """A number that units/key_dimensions.cpp does not know."""
    if not key.kind.startswith(NUMBERS) or key.kind == "function" or file not in READS:
        return False
    return not any({key.name, "*"} & measured.get(section, set()) for section in READS[file].split(" "))


def collect():
    """(sections with their keys, complaints)."""
    measured = measured_keys()
    fields, complaints, sections = members(), [], []
    rows = guide_rows()
    text_of_guide = "\n".join((ROOT / "docs/guide" / p).read_text() for p in GUIDE)
    readers = [*((f.name, f) for f in MODEL.rglob("read_*.cpp")), *((f"{room}/{f.name}", f) for room in KINDS for f in MODEL.glob(f"{room}/*.cpp"))]
    sources = {name: f.read_text() for name, f in sorted(readers)}
    seen = {name: set() for name in sources}
    for title, file, function, structs, tables in SECTIONS:
        keys = keys_of(sources[file], function, structs, fields, seen[file])
        lines = []
        for key in keys:
            if not mentioned(key.name, text_of_guide):
                complaints.append(f"src/dynamics/model/{file}:{key.line}: the guide says nothing of '{key.name}' ({title})")
            if unmeasured(file, key, measured):
                complaints.append(f"src/dynamics/model/{file}:{key.line}: '{key.name}' has no row in units/key_dimensions.cpp ({title})")
            lines.append((key, meaning_of(key.name, tables, rows)))
        sections.append((title, file, lines))
    for name, text in sources.items():
        for line, word in unknown_literals(text, seen[name]):
            complaints.append(f"src/dynamics/model/{name}:{line}: '{word}' is read in a way that model_keys.py does not know")
    return sections, complaints


def row_texts(lines):
    out = []
    for key, said in lines:
        meaning = re.sub(r"\]\((?!\w+://)([\w.]*)(#[^)]*)?\)", lambda m: f"](../guide/{m[1] or said[1]}{m[2] or ''})",
                         said[0]) if said else ""
        meaning = "[guide](../guide/simulate.md)" if meaning == "below" else meaning
        default = key.default if key.default == "" else "*needed*" if key.default == "needed" else f"`{key.default}`"
        out.append("| " + " | ".join(c.replace("|", "\\|") for c in (f"`{key.name}`", key.kind, default, meaning)) + " |")
    return out


def page(sections):
    out = ["# Keys of a model", "",
           "Made from the `read_*.cpp` below `src/dynamics/model` when this site is built: the key, what is read there, and its default; the",
           "words are those of the [guide](../guide/simulate.md). *needed* means that a model without the key is an error.", ""]
    for title, file, lines in sections:
        if not lines:
            continue
        if not title:  # goes on with the table before
            out.pop()
            out += [row for row in row_texts(lines) if row not in out[start:]] + [""]
            continue
        name = re.sub(r"(\[[\w.]+\])", r"`\1`", title)
        start = len(out)
        out += [f"## {name}", "", "| key | is | default | meaning |", "|---|---|---|---|"]
        out += row_texts(lines) + [""]
    return "\n".join(out)


def main():
    sections, complaints = collect()
    if "--check" in sys.argv:
        print(f"{sum(len(lines) for _, _, lines in sections)} keys in {len(sections)} sections")
    else:
        print(page(sections))
    for c in complaints:
        print(c, file=sys.stderr)
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
