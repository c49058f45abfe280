#!/usr/bin/env python3
"""Writes the commands that clang-tidy reads: those of a build, without GCC's precompiled headers, and of each source that
the build compiles together with others a command of its own.

    tidy_database.py build/release/compile_commands.json build/tidy/compile_commands.json
"""
import json
import re
import sys


def sources_of(file):
    """The sources that a file of the build includes, if it has nothing else."""
    with open(file, encoding="utf-8") as text:
        lines = text.read().split("\n")
    found = [re.fullmatch(r'#include "(/.*\.cpp)"', line) for line in lines if line]
    return [match.group(1) for match in found] if found and all(found) else []


def main():
    with open(sys.argv[1], encoding="utf-8") as text:
        commands = json.load(text)
    out = []
    for entry in commands:
        entry["command"] = re.sub(r"-Winvalid-pch -include [^ ]*cmake_pch\.hxx", "", entry["command"])
        together = sources_of(entry["file"]) if "/build/" in entry["file"] else []
        out += [{**entry, "file": source, "command": entry["command"].replace(entry["file"], source)} for source in together]
        if not together:
            out.append(entry)
    with open(sys.argv[2], "w", encoding="utf-8") as text:
        json.dump(out, text, indent=1)


main()
