#!/usr/bin/env python3
"""What the sources weigh, against "weight" in .ci/bounds.json: CI says what has grown, and by how much.

    .ci/check_weight.py [--times build/compile_times.txt] [--update]

Lines in src, files above 400 lines, folders above 40 files. With the file that .ci/timed_compiler has written in a build
from nothing: processor time of the library and the command line, of the tests, and of the dearest source, each over that of
.ci/yardstick.cpp, so that no machine's speed is in it. A figure above its bound by more than its tolerance fails; the
reason for a larger bound belongs into the commit."""

import argparse
import collections
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
BOUNDS = ROOT / ".ci" / "bounds.json"
TOLERANCE = {"lines_in_src": 0.005, "files_above_400_lines": 0, "folders_above_40_files": 0, "library_times_yardstick": 0.25,
             "tests_times_yardstick": 0.25, "dearest_source_times_yardstick": 0.35}


def sources():
    listed = subprocess.run(["git", "ls-files", "src"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.split():
        if pathlib.Path(name).suffix in (".cpp", ".hpp", ".h", ".cu", ".cuh", ".js", ".css"):
            yield pathlib.Path(name), len((ROOT / name).read_text(errors="replace").splitlines())


def count():
    lines = dict(sources())
    folders = collections.Counter(path.parent for path in lines)
    long = sorted((n, str(path)) for path, n in lines.items() if n > 400)
    full = sorted((n, str(path)) for path, n in folders.items() if n > 40)
    for n, path in long[::-1] + full[::-1]:
        print(f"{n:6d} {path}")
    return {"lines_in_src": sum(lines.values()), "files_above_400_lines": len(long), "folders_above_40_files": len(full)}


def yardstick():
    """Processor seconds of the yardstick, with all processors at work, as in a build."""
    copies = os.cpu_count() or 1
    with tempfile.TemporaryDirectory() as folder:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        compilers = [subprocess.Popen(["c++", "-std=c++20", "-O1", "-isystem", "/usr/include/eigen3", "-c", ROOT / ".ci/yardstick.cpp",
                                       "-o", f"{folder}/{k}.o"]) for k in range(copies)]
        if any([compiler.wait() for compiler in compilers]):
            sys.exit("the yardstick does not compile")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / copies


def compile_times(path):
    unit = yardstick()
    times = {}
    for line in path.read_text().splitlines():
        user, system, target = line.split(maxsplit=2)
        times[target] = float(user) + float(system)
    if not times:
        sys.exit(f"{path} is empty: build with CMAKE_CXX_COMPILER_LAUNCHER=.ci/timed_compiler and ESPALIER_COMPILE_TIMES")
    tests = sum(t for target, t in times.items() if target.startswith("tests/"))
    library = sum(t for target, t in times.items() if target.startswith(("src/", "apps/", "hosts/")))
    print(f"yardstick {unit:.2f} s; processor seconds: library and command line {library:.0f}, tests {tests:.0f}, all "
          f"{sum(times.values()):.0f}; the dearest:")
    for target, t in sorted(times.items(), key=lambda item: -item[1])[:10]:
        print(f"{t:6.1f} s {target}")
    return {"library_times_yardstick": library / unit, "tests_times_yardstick": tests / unit,
            "dearest_source_times_yardstick": max(times.values()) / unit}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=pathlib.Path)
    parser.add_argument("--update", action="store_true")
    arguments = parser.parse_args()
    measured = count()
    if arguments.times is not None:
        measured.update(compile_times(arguments.times))
    content = json.loads(BOUNDS.read_text())
    bounds = content.setdefault("weight", {})
    failed = False
    for name, value in measured.items():
        bound = bounds.get(name)
        print(f"{name}: {value:,.1f}" + ("" if bound is None else f" (bound {bound:,.1f}, {value / bound - 1 if bound else 0:+.1%})"))
        if bound is not None and value > bound * (1 + TOLERANCE[name]):
            print(f"  has grown by more than {TOLERANCE[name]:.1%}: make it lighter, or give the reason and --update")
            failed = not arguments.update or failed
    if arguments.update:
        bounds.update({name: round(value, 1) for name, value in measured.items()})
        BOUNDS.write_text(json.dumps(content, indent=2) + "\n")
        return 0
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
