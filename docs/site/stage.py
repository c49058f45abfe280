#!/usr/bin/env python3
"""Puts the source folder of the site together: docs/ as it is, and the pages that are made from the sources.

    python3 docs/site/stage.py STAGE --binary build/release/espalier

Made here: the reference of the command line (from --help of every command), of model keys (model_keys.py), of options by
name, of C and C++ (pages with the classes and functions that Doxygen found). Files whose text has not changed keep their
time, so that Sphinx reads only what has.
"""
import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import model_keys  # noqa: E402
import notebooks  # noqa: E402
import option_names  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
LARGEST_SCENE = 3_000_000  # bytes
# All public headers but the one that includes the others.
HEADERS = sorted(h.name for h in (ROOT / "include/espalier").iterdir() if h.name != "espalier.hpp")


def put(path, text, kept):
    kept.add(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


def with_rows(text):
    """A page with `<!-- rows: HOST -->` gets the rows of that host from the table of hosts.md, which a program has measured."""
    guide = (ROOT / "docs/guide/hosts.md").read_text()
    table = guide[guide.index("table.py: begin"):guide.index("table.py: end")]
    head = [line for line in table.splitlines() if line.startswith("|")][:2]

    def rows(match):
        found = [line for line in table.splitlines() if line.startswith(f"| {match[1]}")]
        if not found:
            sys.exit(f"docs/guide/hosts.md has no rows of {match[1]}")
        words = " ".join(line for line in table.splitlines()[1:] if line and not line.startswith(("|", "<")))
        return "\n".join([words, "", *head, *found])

    return re.sub(r"^<!-- rows: (.*?) -->$", rows, text, flags=re.M)


def copy_tree(stage, kept, binary):
    """docs/ without the machinery of the site."""
    for source in sorted((ROOT / "docs").rglob("*")):
        relative = source.relative_to(ROOT / "docs")
        if source.is_dir() or relative.parts[0] == "site" or "__pycache__" in relative.parts:
            continue
        target = stage / relative
        kept.add(target)
        if source.suffix == ".md" and notebooks.is_notebook(text := source.read_text()):
            put(target, notebooks.with_download(text, source.stem), kept)
            put(stage / "downloads" / f"{source.stem}.ipynb", notebooks.to_ipynb(text), kept)
            continue
        if relative.name == "gallery.md":
            put(target, with_scenes(source.read_text(), binary, stage), kept)
            continue
        if relative.parts[0] == "use":
            put(target, with_rows(source.read_text()), kept)
        elif not target.exists() or target.read_bytes() != source.read_bytes():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


def help_of(binary, *command):
    return subprocess.run([binary, *command, "--help"], check=True, capture_output=True, text=True).stdout.rstrip()


def commands_of(binary):
    """The commands and their commands, as the program's own help names them."""
    found, todo = [], [()]
    while todo:
        command = todo.pop(0)
        if command:
            found.append(command)
        text = help_of(binary, *command)
        if m := re.search(r"^Subcommands:", text, re.M):
            todo = [(*command, name) for name in re.findall(r"^  ([a-z][\w-]*)\s", text[m.end():].partition("\n\n")[0], re.M)] + todo
    return found


def command_line(binary):
    out = ["# Help of every command", "", "What `espalier --help` says; written by the program that this site was built with. With words around it:",
           "[the command line](../guide/command_line.md).", "", "```text", help_of(binary), "```", ""]
    for command in commands_of(binary):
        out += [f"{'#' * (1 + len(command))} espalier {' '.join(command)}", "", "```text", help_of(binary, *command), "```", ""]
    return "\n".join(out)


def text_of(element):
    return "" if element is None else "".join(element.itertext()).strip()


def cpp_page(xml, header):
    """Everything in one public header: its words, then classes, functions and enumerations."""
    index = ET.parse(xml / "index.xml").getroot()
    file_id = next(c.get("refid") for c in index if c.get("kind") == "file" and text_of(c.find("name")) == header)
    file = ET.parse(xml / f"{file_id}.xml").getroot().find("compounddef")
    title = f"espalier/{header}"
    out = [title, "=" * len(title), "", text_of(file.find("briefdescription")), ""]
    c_header = header.endswith(".h")
    classes = [text_of(c) for c in file.findall("innerclass")]
    for name in classes:
        if not c_header and name.count("::") > 1 or name.rpartition("::")[2] in ("Impl",) or name.startswith("std"):
            continue
        kind = next((c.get("kind") for c in index if text_of(c.find("name")) == name), "struct")
        out += [f".. doxygen{kind}:: {name}", "   :members:", "   :undoc-members:", ""]
    # Free functions, enumerations and names for types stand in the file (C) or in its namespace (C++).
    sections = [file]
    for inner in file.findall("innernamespace"):
        if text_of(inner) == "espalier":
            sections.append(ET.parse(xml / f"{inner.get('refid')}.xml").getroot().find("compounddef"))
    names = set()
    for section in sections:
        for member in section.iter("memberdef"):
            location = member.find("location")
            kind, name = member.get("kind"), text_of(member.find("name"))
            if location is None or not location.get("file", "").endswith("/" + header) or not name:
                continue
            if kind not in ("function", "enum", "typedef") or (kind, name) in names or name.startswith("@"):
                continue
            if kind == "typedef" and c_header and (name in classes or text_of(member.find("type")).startswith("enum ")):
                continue  # the structure or enumeration of that name says it all
            names.add((kind, name))
            qualified = name if c_header else "espalier::" + name
            arguments = text_of(member.find("argsstring")) if kind == "function" and not c_header else ""
            out += [f".. doxygen{kind}:: {qualified}{arguments if kind == 'function' and not c_header else ''}", ""]
    return "\n".join(out)


def with_scenes(text, binary, stage):
    """`<!-- scene: MODEL OPTIONS -->` becomes the moving scene of that run: its page, made where model, options or program
    have changed, in a frame that is loaded when it comes into view."""
    folder = stage.parent / "extra" / "scenes"
    folder.mkdir(parents=True, exist_ok=True)

    def scene(match):
        model, *options = match[1].split()
        name = Path(model).stem
        page, stamp = folder / f"{name}.html", stage.parent / "scenes" / f"{name}.txt"
        program = Path(binary).stat()
        wanted = f"{(ROOT / model).read_text()}\n{options}\n{program.st_size} {program.st_mtime_ns}"
        if not page.exists() or not stamp.exists() or stamp.read_text() != wanted:
            with tempfile.TemporaryDirectory() as out:
                run = subprocess.run([binary, "simulate", ROOT / model, *options, "--quiet", "--out", out], capture_output=True, text=True)
                made = Path(out) / "index.html"
                if run.returncode != 0 or not made.exists():
                    sys.exit(f"the scene of {model} was not made: {run.stderr.strip() or 'no index.html'}")
                if made.stat().st_size > LARGEST_SCENE:
                    sys.exit(f"the scene of {model} has {made.stat().st_size} bytes: give docs/gallery.md a coarser mesh or a shorter time")
                shutil.copyfile(made, page)
            stamp.parent.mkdir(exist_ok=True)
            stamp.write_text(wanted)
        return (f'```{{raw}} html\n<iframe src="scenes/{name}.html" title="The moving scene of {model}" loading="lazy" allowfullscreen '
                f'style="width:100%;height:620px;border:1px solid #8886;border-radius:8px"></iframe>\n'
                f'<p><a href="scenes/{name}.html">This scene alone</a></p>\n```')

    return re.sub(r"^<!-- scene: (.*?) -->$", scene, text, flags=re.M)


def report(binary, stage, kept):
    """Every committed measurement as one page with drawings, by `espalier report`; a link to it in the notebook."""
    extra = stage.parent / "extra"
    extra.mkdir(exist_ok=True)
    results = sorted((ROOT / "bench/results").glob("*.json"))
    run = subprocess.run([binary, "report", *results, "--out", extra / "report.html"], capture_output=True, text=True)
    if run.returncode != 0:
        print(f"left out: the page of results, since `espalier report` says: {run.stderr.strip()}")
        (extra / "report.html").unlink(missing_ok=True)
        return
    readme = (ROOT / "docs/notebook/README.md").read_text()
    link = '<p><a class="reference internal" href="../report.html">Every committed measurement, with drawings and tables that sort</a></p>'
    put(stage / "notebook/README.md", readme.replace("\n\n", f"\n\n{link}\n\n", 1), kept)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("stage", type=Path)
    p.add_argument("--binary", required=True, help="the program espalier")
    p.add_argument("--doxygen", type=Path, required=True, help="folder of Doxygen's XML")
    a = p.parse_args()
    kept = set()
    copy_tree(a.stage, kept, a.binary)
    report(a.binary, a.stage, kept)
    sections, complaints = model_keys.collect()
    if complaints:
        sys.exit("\n".join(complaints))
    put(a.stage / "reference/model_keys.md", model_keys.page(sections), kept)
    put(a.stage / "reference/help.md", command_line(a.binary), kept)
    put(a.stage / "reference/options.md", option_names.page(), kept)
    put(a.stage / "reference/python.rst", (ROOT / "docs/site/python.rst").read_text(), kept)
    for header in HEADERS:
        put(a.stage / "reference" / "headers" / (header.replace(".", "_") + ".rst"), cpp_page(a.doxygen, header), kept)
    for path in sorted(a.stage.rglob("*"), reverse=True):
        if path.is_file() and path not in kept:
            path.unlink()


if __name__ == "__main__":
    main()
