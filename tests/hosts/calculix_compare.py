#!/usr/bin/env python3
"""Compares what calculix.sh has left: numbers of the .dat and .frd files, deck by deck. Fails where they differ."""
import pathlib
import re
import sys

# For modes with one frequency (bending of a beam in both directions) any pair will do, and these follow the pair.
FOLLOWS_THE_PAIR = re.compile(r"P A R T I C I P A T I O N|E F F E C T I V E")
HEADING = re.compile(r"(?:[A-Z] ){4}")
# Zero eigenvalues, and stresses of a mode that is one of such a pair: both libraries are right.
UNDEFINED = {"segment", "simplebeampipe3"}
SAME = 5e-3  # CalculiX ends its own Newton iterations at residuals of half a percent
ROUNDING = 1e-9  # of the largest number of a file: a block that is smaller as a whole is zero
NUMBER = re.compile(r"[-+]?\d+\.\d+(?:[EeDd][-+]?\d+)?")


def numbers(folder, name):
    """The numbers of each block of lines; a block ends with an empty line (.dat) or with -3 (.frd)."""
    blocks, skip = [], False
    for path in (folder / f"{name}.dat", folder / f"{name}.frd"):
        text = path.read_text(errors="replace") if path.exists() else ""
        for block in re.split(r"\n\s*\n|\n -3 *\n", text):
            if HEADING.search(block):
                skip = bool(FOLLOWS_THE_PAIR.search(block))
            if not skip:
                blocks.append([float(n.replace("D", "E").replace("d", "e")) for n in NUMBER.findall(block)])
    return [block for block in blocks if block]


def difference(ours, own):
    """The largest difference, relative to the largest number of its block; infinite where the files are of other shapes."""
    if [len(block) for block in ours] != [len(block) for block in own]:
        return float("inf")
    worst, least = 0.0, ROUNDING * max((abs(x) for block in own for x in block), default=0)
    for mine, theirs in zip(ours, own):
        scale = max(map(abs, theirs))
        if scale > least:
            worst = max(worst, max(abs(x - y) for x, y in zip(mine, theirs)) / scale)
    return worst


def main():
    work = pathlib.Path(sys.argv[1])
    decks, wrong, factorized, compared, seconds = 0, 0, 0, 0, [0.0, 0.0]
    for line in (work / "times").read_text().splitlines():
        name, own, ours, count = line.split()
        if own == "failed":
            continue  # a deck that CalculiX does not run as it stands
        decks += 1
        factorized += int(count)
        folder = work / "runs" / name
        theirs = numbers(folder / "SPOOLES", name)
        worst = difference(numbers(folder / "PARDISO", name), theirs)
        compared += sum(map(len, theirs))
        verdict = "failed" if ours == "failed" else "same" if worst < SAME else "undefined" if name in UNDEFINED else f"differs by {worst:.1e}"
        wrong += verdict not in ("same", "undefined")
        if ours != "failed":
            seconds[0] += float(own)
            seconds[1] += float(ours)
        print(f"{name:24} SPOOLES {own:>7} s   ours {ours:>7} s   {count:>4} factorizations   {worst:.1e}   {verdict}")
    print(f"{decks} decks, {factorized} factorizations of ours, {compared} numbers compared, {wrong} differences; SPOOLES {seconds[0]:.1f} s, ours {seconds[1]:.1f} s")
    return 1 if wrong or not factorized or not compared else 0


if __name__ == "__main__":
    sys.exit(main())
