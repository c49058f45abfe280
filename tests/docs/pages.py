#!/usr/bin/env python3
"""Holds the documentation against the sources: what can be checked without building the site.

    python3 tests/docs/pages.py [--binary build/release/espalier]

- links between pages, to headings and to files of the repository lead somewhere; the README of a folder names all its pages;
- every key that a model may have is in the guide (docs/site/model_keys.py), every option of the solver on the page of the command
  line or of the library (docs/site/option_names.py);
- signatures of Python and tables of keys that are made from the readers of models are not stale (docs/site/model_parts.py);
- every public name of the Python package is in its reference (docs/site/python.rst);
- the names in the last columns of docs/coming_from/*.md are in the public headers, in the Python package or in a model;
- with the program: every option of --help is on the page of the command line, and every option there is in --help;
- pictures of docs/images are used, and every model of models/ has one in the gallery.
"""
import argparse
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs/site"))
import model_keys  # noqa: E402
import model_parts  # noqa: E402
import option_names  # noqa: E402

# Made when the site is built.
GENERATED = {"docs/reference/options.md", "docs/reference/model_keys.md", "docs/reference/help.md", "docs/reference/python.rst"}
complaints = []


def complain(text):
    complaints.append(text)


def pages():
    return sorted(p for p in [ROOT / "README.md", *ROOT.glob("docs/**/*.md")] if "site" not in p.relative_to(ROOT).parts[:2])


def without_code(text):
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^(`{3,}|~{3,})(?!\{grid|\{toctree).*?^\1\s*$", "", text, flags=re.M | re.S))


def slug(heading):
    """As GitHub and MyST make it."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")


def anchors(page):
    text = re.sub(r"^(`{3,}).*?^\1\s*$", "", page.read_text(), flags=re.M | re.S)
    return {slug(h) for h in re.findall(r"^#+ (.*)$", text, re.M)} | set(re.findall(r'<a (?:id|name)="([^"]+)"', text))


def check_links():
    count, known = 0, {}
    for page in pages():
        name = page.relative_to(ROOT)
        for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text())):
            if re.match(r"[a-z]+:", target):
                continue
            count += 1
            path, _, anchor = target.partition("#")
            file = (page.parent / path).resolve() if path else page
            relative = file.relative_to(ROOT).as_posix() if file.is_relative_to(ROOT) else str(file)
            if relative in GENERATED or relative.startswith("docs/reference/headers/"):
                continue
            if not file.exists():
                complain(f"{name}: {target} leads nowhere")
            elif anchor and file.suffix == ".md" and anchor not in known.setdefault(file, anchors(file)):
                complain(f"{name}: {target}: there is no such heading")
    return count


def check_folders():
    for readme in sorted(ROOT.glob("docs/*/README.md")):
        text = readme.read_text()
        for page in sorted(readme.parent.glob("*.md")):
            if page != readme and f"({page.name}" not in text:
                complain(f"{readme.relative_to(ROOT)} does not name {page.name}")


def check_images():
    used = "\n".join(p.read_text() for p in pages())
    for image in sorted((ROOT / "docs/images").iterdir()):
        if image.suffix in (".png", ".svg", ".webp") and image.name not in used:
            complain(f"docs/images/{image.name} is on no page")


def check_gallery():
    """Every model has its place and its picture."""
    parts = re.split(r"^### ", (ROOT / "docs/gallery.md").read_text(), flags=re.M)
    for model in sorted(ROOT.glob("models/**/*.toml")):
        place = next((p for p in parts if f"(../{model.relative_to(ROOT).as_posix()})" in p), None)
        if place is None or "![" not in place:
            complain(f"docs/gallery.md has no picture of {model.relative_to(ROOT)}")


def check_keys():
    sections, wrong = model_keys.collect()
    complaints.extend(wrong)
    complaints.extend(c for c in model_parts.stale() if c not in wrong)
    return sum(len(lines) for _, _, lines in sections)


def check_python():
    """The reference of Python has every public name and module."""
    text = (ROOT / "docs/site/python.rst").read_text()
    listed = re.search(r"__all__ = \[(.*?)\]", (ROOT / "python/espalier/__init__.py").read_text(), re.S)[1]
    for name in re.findall(r'"(\w+)"', listed):
        if not name.startswith("__") and f":: espalier.{name}\n" not in text:
            complain(f"docs/site/python.rst has no espalier.{name}")
    for module in sorted((ROOT / "python/espalier").glob("[a-z]*.py")):
        if f"automodule:: espalier.{module.stem}\n" not in text:
            complain(f"docs/site/python.rst has no module espalier.{module.stem}")


def check_names():
    """Names of ours in the tables for those who come from elsewhere."""
    headers = "\n".join(f.read_text() for f in sorted((ROOT / "include/espalier").iterdir()))
    python = "\n".join(f.read_text() for f in sorted((ROOT / "python/espalier").rglob("*.py")))
    guide = "\n".join((ROOT / "docs/guide" / f).read_text() for f in (*model_keys.GUIDE, "stresses.md"))
    words = set(re.findall(r"\w+", " ".join(re.findall(r"`([^`\n]+)`", guide))))  # of models, which model_keys checks
    known = set(re.findall(r"\w+", headers + python)) | set(option_names.names()) | {"auto", "gpu", "mixed"} | words
    count = 0
    for page in sorted((ROOT / "docs/coming_from").glob("[!R]*.md")):
        for number, line in enumerate(page.read_text().splitlines(), 1):
            if not line.startswith("|") or set(line) <= set("|- "):
                continue
            for words in re.findall(r"`([^`]+)`", model_keys.cells(line)[-1]):
                if words.startswith("espalier ") or words.startswith("--"):
                    continue
                for word in re.findall(r"[A-Za-z_]\w{2,}", re.sub(r'"[^"]*"', "", words)):
                    count += 1
                    if word not in known:
                        complain(f"{page.relative_to(ROOT)}:{number}: '{word}' is neither in include/espalier nor in python/espalier, nor a word of models")
    return count


def check_help(binary):
    text = (ROOT / "docs/guide/command_line.md").read_text() + (ROOT / "docs/guide/measure.md").read_text() \
        + (ROOT / "docs/guide/hosts.md").read_text()
    commands, options, todo = [], set(), [()]
    told_by_help = set()  # of experiments: the guide refers to --help
    while todo:  # commands have commands
        command = todo.pop()
        said = subprocess.run([binary, *command, "--help"], capture_output=True, text=True, check=True).stdout
        (told_by_help if command[:1] == ("bench",) else options).update(re.findall(r"^  (?:-\w,)?(--[a-z][\w-]*)", said, re.M))
        if "ubcommands:" in said:
            listed = said[said.index("ubcommands:"):].partition("\n\n")[0]
            todo += [(*command, name) for name in re.findall(r"^  ([a-z][\w-]*) ", listed, re.M)]
        if command:
            commands.append(command)
            if not re.search(rf"\b{command[-1]}\b", text):
                complain(f"the guide does not know the command {' '.join(command)}")
    for option in sorted(options - {"--help", "--version"}):
        if not re.search(rf"{option}\b", text):
            complain(f"the guide says nothing of {option}")
    if ("bench", "peers") not in commands:  # a build without it: its options are not there
        return len(commands), len(options)
    for option in sorted(set(re.findall(r"`(--[a-z][\w-]*)", (ROOT / "docs/guide/command_line.md").read_text()))):
        if option not in options | told_by_help and option not in ("--help", "--version"):
            complain(f"docs/guide/command_line.md names {option}, which no command has")
    return len(commands), len(options)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--binary", help="the program espalier")
    a = p.parse_args()
    print(f"{check_links()} links, {check_keys()} keys of models, {check_names()} names in tables, {len(option_names.names())} options")
    option_names.page()
    check_folders()
    check_images()
    check_gallery()
    check_python()
    if a.binary:
        print("%d commands, %d options of the program" % check_help(a.binary))
    print("\n".join(complaints))
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
