#!/usr/bin/env python3
"""Same source, same bits: hashes of factors and solutions against .ci/bits.json.

    .ci/check_bits.py [--program build/release/tests/espalier_bits] [--gpu] [--update]

The program tests/bits/bits.cpp factorizes a table of systems (kinds, precisions, threads, host devices, out of core) and prints a
hash of the bits of the solutions, without refinement, with the determinant and the counts of pivots. The hashes were made
before the backends were rebuilt (commit 98f6ff2). They hold for one compiler and one set of vector instructions; for others
the file has no hashes until --update writes them, and the check says so and passes. Cases that must agree with each
other (any number of threads and of host devices in core) are compared on every machine. --gpu: the same on the first GPU.
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys

FILE = pathlib.Path(__file__).with_name("bits.json")


def gpu_key():
    listed = subprocess.run(["nvidia-smi", "--query-gpu=name", "--format=csv,noheader"], capture_output=True, text=True)
    return listed.stdout.splitlines()[0].strip() if listed.stdout else "no GPU"


def machine_key():
    flags = re.search(r"^flags\s*:(.*)$", pathlib.Path("/proc/cpuinfo").read_text(), re.M)
    flags = set(flags.group(1).split()) if flags else set()
    simd = next((name for name in ("avx512_bf16", "avx512_vnni", "avx512f", "avx2", "sse4_2") if name in flags), "other")
    version = subprocess.run(["c++", "-dumpfullversion"], capture_output=True, text=True).stdout.strip()
    return f"{simd}, c++ {version}"


def measured(program, words):
    out = subprocess.run([program, *words], capture_output=True, text=True, check=True).stdout
    return dict(line.split("\t") for line in out.splitlines())


def disagreements(hashes):
    """In core, neither threads nor host devices change a bit."""
    groups = {}
    for name, value in hashes.items():
        system, kind, precision, place = name.split("; ")
        if not place.endswith("out of core"):
            groups.setdefault((system, kind, precision), set()).add(value)
    return [f"{', '.join(group)}: {len(values)} different results in core" for group, values in groups.items() if len(values) > 1]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", default="build/release/tests/espalier_bits")
    parser.add_argument("--gpu", action="store_true")
    parser.add_argument("--update", action="store_true")
    arguments = parser.parse_args()
    hashes = measured(arguments.program, ["--gpu"] if arguments.gpu else [])
    known = json.loads(FILE.read_text()) if FILE.exists() else {}
    key = gpu_key() if arguments.gpu else machine_key()
    found = [f"{name}: {value}" for name, value in hashes.items() if not re.fullmatch(r"[0-9a-f]{16}", value)]
    found += disagreements(hashes)
    if arguments.update:
        known[key] = hashes
        FILE.write_text(json.dumps(known, indent=1) + "\n")
    elif key in known:
        found += [f"{name}: {hashes.get(name, 'missing')}, was {value}" for name, value in known[key].items()
                  if hashes.get(name) != value]
    else:
        print(f"no hashes for this machine ({key}): only cases that must agree with each other were compared")
    print("\n".join(found) if found else f"{len(hashes)} cases, all bits as they were")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
