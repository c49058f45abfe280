#!/usr/bin/env python3
"""scripts/mutate_sources.py on a small source. Truth: what each mutant computes, by hand. Skipped (77) without libclang."""

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


def main():
    with tempfile.TemporaryDirectory() as folder:
        source, program = Path(folder) / "small.cpp", Path(folder) / "small"
        source.write_text(SOURCE)
        command = ["c++", "-std=c++20", "-o", "small.o", "-c", str(source)]
        found = mutate_sources.find(source, command)
        for number, mutant in enumerate(found, 1):
            mutant.number = number
        text, kept = mutate_sources.compiled(source, command, found, ROOT / "scripts/mutate_runtime.hpp")
        source.write_text(text)
        (Path(folder) / "main.cpp").write_text(MAIN)
        subprocess.run(["c++", "-std=c++20", "-w", str(source), str(Path(folder) / "main.cpp"), "-o", str(program)], check=True)
        made = {"": 0} | {f"{m.before} -> {m.after}": m.number for m in kept}
        wrong = [f"{name}: {'missing' if name in EXPECTED else 'not expected'}" for name in made.keys() ^ EXPECTED.keys()]
        for name in made.keys() & EXPECTED.keys():
            shown = subprocess.run([str(program)], env={**os.environ, "ESPALIER_MUTANT": str(made[name])}, capture_output=True, text=True, check=True)
            if int(shown.stdout) != EXPECTED[name]:
                wrong.append(f"{name or 'no mutant'}: {shown.stdout}, not {EXPECTED[name]}")
    print("\n".join(wrong) or f"{len(made) - 1} mutants do what they say")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
