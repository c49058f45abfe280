#!/usr/bin/env python3
"""Writes what clang-tidy reads into a folder: compile_commands.json, the commands of a build without GCC's precompiled
headers; the files that the build compiles several sources in, as they are but for a note that this is meant; and
units.txt, a line for each source: the source, a blank and the file that clang-tidy is to be given for it.

    tidy_database.py build/release/compile_commands.json build/tidy

A file of several sources takes clang-tidy hardly longer than one of them: most of its time goes into the headers.
"""
import json
import os
import re
import sys


def sources_of(file):
    """The sources that a file of the build includes, if it has nothing else."""
    with open(file, encoding="utf-8") as text:
        lines = text.read().split("\n")
    found = [re.fullmatch(r'#include "(/.*\.cpp)"', line) for line in lines if line]
    return [match.group(1) for match in found] if found and all(found) else []


def main():
    folder, root = os.path.abspath(sys.argv[2]), os.getcwd()
    with open(sys.argv[1], encoding="utf-8") as text:
        commands = json.load(text)
    os.makedirs(folder, exist_ok=True)
    units = {}
    for entry in commands:
        entry["command"] = re.sub(r" --param=[^ ]*", "", entry["command"])  # of GCC alone
        entry["command"] = re.sub(r"-Winvalid-pch -include [^ ]*cmake_pch\.hxx", "", entry["command"])
        file, sources = entry["file"], [entry["file"]]
        if "/build/" in file and (together := sources_of(file)):
            sources = together
            entry["file"] = os.path.join(folder, os.path.basename(file))
            entry["command"] = entry["command"].replace(file, entry["file"])
            with open(entry["file"], "w", encoding="utf-8") as text:
                text.writelines(f'#include "{source}"  // NOLINT(bugprone-suspicious-include)\n' for source in sources)
        for source in sources:
            units.setdefault(os.path.relpath(source, root), os.path.relpath(entry["file"], root))
    with open(os.path.join(folder, "compile_commands.json"), "w", encoding="utf-8") as text:
        json.dump(commands, text, indent=1)
    with open(os.path.join(folder, "units.txt"), "w", encoding="utf-8") as text:
        text.writelines(f"{source} {unit}\n" for source, unit in units.items())


main()
