#!/usr/bin/env python3
"""scripts/mutate_sources.py and mutate_pack.py on a small source. Truth: what each mutant computes, by hand. Skipped (77)
without libclang."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
try:
    import mutate_sources

    mutate_sources.Index.create()
except Exception as error:  # no module, or no library behind it
    print(f"skipped: {error}")
    sys.exit(77)

SOURCE = """#include <algorithm>
constexpr int kTwice = 1 + 1;
template <bool kDown> int step(int x) { return kDown ? -x : x; }
int result(int a, int b) {
  int sum = a - b;
  if (a < b || a == 7) sum += 10;
  sum = std::min(sum, 40 + 1);
  if (bool(sum)) sum *= kTwice;
  return sum + step<false>(100);
}
"""
MAIN = """#include <cstdio>
#include <cstdlib>
namespace espalier_mutants { int chosen = 0; unsigned char* reached = nullptr; }
int result(int a, int b);
int main() { espalier_mutants::chosen = std::atoi(std::getenv("ESPALIER_MUTANT")); std::printf("%d", result(7, 4)); }
"""
TEST = """#include <gtest/gtest.h>
int result(int a, int b);
TEST(Small, Result) { EXPECT_EQ(result(7, 4), 126); }
"""
# result(7, 4) is 2 * min(7 - 4 + 10, 41) + 100.
EXPECTED = {
    "": 126,
    "kDown -> !(kDown)": -74,
    "-x -> x": 126,
    "a - b -> a + b": 142,
    "sum += 10 -> nothing": 106,
    "sum += 10 -> sum -= 10": 86,
    "a < b || a == 7 -> !(a < b || a == 7)": 106,
    "a < b || a == 7 -> a < b && a == 7": 106,
    "a < b -> a <= b": 126,
    "a == 7 -> a != 7": 106,
    "sum = std::min(sum, 40 + 1) -> nothing": 126,
    "std::min(sum, 40 + 1) -> std::max(sum, 40 + 1)": 182,
    "40 + 1 -> 40": 126,
    "40 + 1 -> 40 - 1": 126,
    "bool(sum) -> !(bool(sum))": 113,
    "sum *= kTwice -> nothing": 113,
    "sum *= kTwice -> sum /= kTwice": 106,
    "sum + step<false>(100) -> sum - step<false>(100)": -74,
    "100 -> 100 + 1": 127,
}


def compile_into(program, *words):
    subprocess.run(["c++", "-std=c++20", "-w", "-o", str(program), *map(str, words)], check=True)


def what_mutants_compute(folder, source, kept):
    """The mutants that do not compute what EXPECTED says."""
    (folder / "main.cpp").write_text(MAIN)
    compile_into(folder / "small", source, folder / "main.cpp")
    made = {"": 0} | {f"{m.before} -> {m.after}": m.number for m in kept}
    wrong = [f"{name}: {'missing' if name in EXPECTED else 'not expected'}" for name in made.keys() ^ EXPECTED.keys()]
    for name in made.keys() & EXPECTED.keys():
        environment = {**os.environ, "ESPALIER_MUTANT": str(made[name])}
        shown = subprocess.run([str(folder / "small")], env=environment, capture_output=True, text=True, check=True).stdout
        if int(shown) != EXPECTED[name]:
            wrong.append(f"{name or 'no mutant'}: {shown}, not {EXPECTED[name]}")
    return wrong


def what_a_pack_finds(folder, source, kept):
    """A pack is run in an empty environment; each mutant whose result differs is killed, and the state takes that."""
    scripts, state, there = ROOT / "scripts", folder / "state", folder / "there"
    (state / "share").mkdir(parents=True)
    (folder / "test.cpp").write_text(TEST)
    compile_into(state / "share/test_analysis", source, folder / "test.cpp", scripts / "mutate_runtime.cpp", "-lgtest", "-lgtest_main")
    mutants = [m.json() | {"room": "share", "path": "small.cpp"} for m in kept]
    (state / "share/state.json").write_text(json.dumps({"mutants": mutants, "tests": {}, "results": {}}))

    def mutate(*words):
        return subprocess.run([sys.executable, "-B", str(scripts / "mutate.py"), "--state", str(state), *map(str, words)], cwd=folder,
                              env={"PATH": "/usr/bin:/bin"}, check=False, capture_output=True, text=True)

    mutate("--rooms", "share", "--build", folder, "--pack", folder / "pack.tar.xz")
    there.mkdir()
    subprocess.run(["tar", "-xf", str(folder / "pack.tar.xz"), "-C", str(there)], check=True)
    mutate("--packed", there, "--jobs", 1, "--minutes", 2)
    shown = mutate("--rooms", "share", "--merge", there / "results.json")
    found = json.loads((state / "share/state.json").read_text())["results"]
    killed = {m["number"]: found.get(str(m["number"]), shown.stderr).startswith("killed") for m in mutants}
    return [f"{m.before} -> {m.after}: killed {killed[m.number]}" for m in kept
            if killed[m.number] != (EXPECTED[f"{m.before} -> {m.after}"] != EXPECTED[""])]


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        source = folder / "small.cpp"
        source.write_text(SOURCE)
        command = ["c++", "-std=c++20", "-o", "small.o", "-c", str(source)]
        found = mutate_sources.find(source, command)
        for number, mutant in enumerate(found, 1):
            mutant.number = number
        text, kept = mutate_sources.compiled(source, command, found, ROOT / "scripts/mutate_runtime.hpp")
        source.write_text(text)
        wrong = what_mutants_compute(folder, source, kept) or what_a_pack_finds(folder, source, kept)
    print("\n".join(wrong) or f"{len(kept)} mutants do what they say, here and packed")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
