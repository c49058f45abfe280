#!/usr/bin/env python3
"""Mutants of the CUDA kernels, on a machine with a GPU: what scripts/mutate.py does for the host.

    scripts/mutate_kernels.py make TREE --most 250 [--seed 1]            # rewrites the kernels of a copy of the sources
    scripts/mutate_kernels.py run TESTS --list TREE/kernel_mutants.json --out results.json [--jobs 8] [--minutes 8]

`make` puts all mutants into the sources at once, each behind a number: `a - b` becomes `a - sign(17) * b`, `a < b` becomes
`a < one(17) + b`, `if (c)` becomes `if (flip(17, c))`. Build the test programs of that tree with CUDA; `run` starts them with
ESPALIER_MUTANT=17 in the environment. First each program runs without a mutant and writes down which ones it comes past. A
failure, a crash or five times the usual time is a kill."""

import argparse
import concurrent.futures
import json
import os
import pathlib
import random
import re
import subprocess
import sys
import tempfile
import time

HEADER = """#pragma once
#include <cuda_runtime_api.h>

#include <cstdio>
#include <cstdlib>
#include <vector>

namespace espalier_mutants {
constexpr int kMost = 4096;
struct Source {
  void (*choose)(int number);
  void (*reached)(unsigned char* flags);
};
inline std::vector<Source>& sources() {
  static std::vector<Source> all;
  return all;
}
inline void write_reached() {
  std::vector<unsigned char> flags(kMost), all(kMost);
  for (const Source& s : sources()) {
    s.reached(flags.data());
    for (int k = 0; k < kMost; ++k) all[k] |= flags[k];
  }
  if (std::FILE* f = std::fopen(std::getenv("ESPALIER_REACHED"), "w")) {
    for (int k = 0; k < kMost; ++k)
      if (all[k]) std::fprintf(f, "%d\\n", k);
    std::fclose(f);
  }
}
// Before the first call of the CUDA runtime that the library counts.
inline void choose() {
  static const bool once = [] {
    const bool records = std::getenv("ESPALIER_REACHED") != nullptr;
    const char* number = std::getenv("ESPALIER_MUTANT");
    if (!records && number == nullptr) return true;
    if (cudaFree(nullptr) != cudaSuccess) return true;
    for (const Source& s : sources()) s.choose(records ? -1 : std::atoi(number));
    if (records) std::atexit(write_reached);
    return true;
  }();
  (void)once;
}
}  // namespace espalier_mutants

#ifdef __CUDACC__
namespace espalier_mutants {
static __device__ int chosen;  // -1: write down what is reached
static __device__ unsigned char reached[kMost];
static __host__ __device__ inline bool on(int k) {
#ifdef __CUDA_ARCH__
  if (chosen == -1) reached[k] = 1;
  return chosen == k;
#else
  return (void)k, false;
#endif
}
static __host__ __device__ inline int sign(int k) { return on(k) ? -1 : 1; }
static __host__ __device__ inline int one(int k) { return on(k) ? 1 : 0; }
static __host__ __device__ inline bool flip(int k, bool condition) { return condition != on(k); }
static void choose_here(int number) { (void)cudaMemcpyToSymbol(chosen, &number, sizeof number); }
static void reached_here(unsigned char* flags) { (void)cudaMemcpyFromSymbol(flags, reached, kMost); }
static const bool listed = (sources().push_back({choose_here, reached_here}), true);
}  // namespace espalier_mutants
#endif
"""
COUNTED = "src/device/cuda/runtime/cuda_faults.hpp"  # every call of the CUDA runtime comes past
PLACE = "src/device/cuda/runtime/kernel_mutants.hpp"
BODY = re.compile(r"__(device|global)__[^;{}]*\{")
SKIPPED = re.compile(r"^\s*(#|//)|constexpr|static_assert|template|using |asm|case |__launch_bounds__|\"|unroll")
RULES = (("sign", re.compile(r"(?<=[\w)\]]) ([+-]) (?=[\w(*])"), " {0} espalier_mutants::sign({n}) * "),
         ("comparison", re.compile(r"(?<=[\w)\]]) (<|>|<=|>=|==|!=) (?=(?!nullptr|[A-Z]\w*::)[\w(])"), " {0} espalier_mutants::one({n}) + "),
         ("update", re.compile(r"(?<=[\w)\]]) ([+-]=) ([^;,(){}]+(?:\([^;(){}]*\)[^;,(){}]*)*);"), " {0} espalier_mutants::sign({n}) * ({1});"))
PROGRAMS = {"dynamics": ["test_dynamics_device"],
            "device": ["test_device", "test_inverse", "test_changes", "test_out_of_core", "test_batch", "test_solver", "test_schur", "test_modes"]}
FILTER = "*gpu*:*Gpu*:*GPU*:*Cuda*:*cuda*:*Device*-GpuFaults*:*Faults*"


def bodies(text):
    """Ranges of the bodies of functions that run on a device."""
    for match in BODY.finditer(text):
        if "constexpr" in match.group() or "consteval" in match.group():
            continue
        depth, k = 1, match.end()
        while depth and k < len(text):
            depth += {"{": 1, "}": -1}.get(text[k], 0)
            k += 1
        yield match.end(), k


def conditions(line):
    """Ranges of what stands in `if (...)` on one line."""
    for match in re.finditer(r"\bif \(", line):
        depth, k = 1, match.end()
        while depth and k < len(line):
            depth += {"(": 1, ")": -1}.get(line[k], 0)
            k += 1
        if not depth and "=" not in re.sub(r"[=!<>]=", "", line[match.end():k]) and ";" not in line[match.end():k]:
            yield match.end(), k - 1


def find(path, text):
    """All mutants of a source: {path, line, rule, begin, end, form}. They do not overlap."""
    found = []
    inside = [r for r in bodies(text)]
    start, unrolled = 0, False
    for number, line in enumerate(text.split("\n"), 1):
        code = line.split("//")[0]
        if any(a <= start < b for a, b in inside) and not SKIPPED.search(code) and not unrolled:
            taken = []
            for a, b in conditions(code):
                found.append(dict(path=path, line=number, rule="condition", begin=start + a, end=start + b,
                                  form="espalier_mutants::flip({n}, " + code[a:b].replace("{", "{{").replace("}", "}}") + ")"))
                taken.append((a, b))
            for rule, pattern, form in RULES:
                for match in pattern.finditer(code):
                    if any(a < match.end() and match.start() < b for a, b in taken):
                        continue
                    taken.append(match.span())
                    parts = [g.replace("{", "{{").replace("}", "}}") for g in match.groups()]
                    found.append(dict(path=path, line=number, rule=rule, begin=start + match.start(), end=start + match.end(),
                                      form=form.replace("{0}", parts[0]).replace("{1}", parts[-1])))
        unrolled = "#pragma unroll" in line
        start += len(line) + 1
    return found


def make(arguments):
    tree = pathlib.Path(arguments.tree)
    sources = sorted(p for folder in ("src/device/cuda", "src/dynamics/cuda") for p in (tree / folder).rglob("*.cu*"))
    every = []
    for source in sources:
        if "bench" not in source.name:
            every += find(str(source.relative_to(tree)), source.read_text())
    if arguments.only:
        every = [m for m in every if re.search(arguments.only, m["path"])]
    chosen = random.Random(arguments.seed).sample(every, min(arguments.most, len(every)))
    chosen.sort(key=lambda m: (m["path"], m["begin"]))
    for number, mutant in enumerate(chosen, 1):
        mutant["number"] = number
    for path in {m["path"] for m in chosen}:
        text = (tree / path).read_text()
        for mutant in reversed([m for m in chosen if m["path"] == path]):
            mutant["before"] = text[mutant["begin"]:mutant["end"]]
            text = text[:mutant["begin"]] + mutant["form"].replace("{n}", str(mutant["number"])).replace("{{", "{").replace("}}", "}") + text[mutant["end"]:]
        at = text.index("#pragma once") + len("#pragma once") if "#pragma once" in text else 0
        (tree / path).write_text(text[:at] + f'\n#include "{PLACE[4:]}"\n' + text[at:])
    (tree / PLACE).write_text(HEADER)
    counted = (tree / COUNTED).read_text()
    counted = counted.replace("#include <atomic>", f'#include "{PLACE[4:]}"\n#include <atomic>')
    counted = counted.replace("bool refuses(const char* name) {", "bool refuses(const char* name) {\n    espalier_mutants::choose();")
    (tree / COUNTED).write_text(counted)
    (tree / "kernel_mutants.json").write_text(json.dumps(chosen, indent=1))
    print(f"{len(chosen)} of {len(every)} mutants in {len({m['path'] for m in chosen})} sources")


def run_program(tests, program, seconds, **environment):
    """@returns the status (-1: too long), the seconds, and the first test that failed"""
    begin = time.monotonic()
    try:
        result = subprocess.run([tests / program, f"--gtest_filter={FILTER}", "--gtest_brief=1", "--gtest_fail_fast"], cwd=tests, timeout=seconds,
                                env={**os.environ, **environment}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
    except subprocess.TimeoutExpired:
        return -1, time.monotonic() - begin, "too long"
    failed = re.search(r"\[  FAILED  \] (\S+)", result.stdout)
    return result.returncode, time.monotonic() - begin, failed.group(1) if failed else ""


def run(arguments):
    tests, end = pathlib.Path(arguments.tests).resolve(), time.monotonic() + 60 * arguments.minutes
    mutants = json.loads(pathlib.Path(arguments.list).read_text())
    folder = pathlib.Path(tempfile.mkdtemp())
    reached, usual = {}, {}

    def look(program):
        status, seconds, failed = run_program(tests, program, 300, ESPALIER_REACHED=str(folder / program))
        listed = (folder / program).read_text().split() if (folder / program).exists() else []
        print(f"{program}: status {status}, {seconds:.1f} s, {failed}, past {len(listed)} mutants", flush=True)
        return program, seconds, set(map(int, listed)) if status == 0 else set()

    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for program, seconds, listed in pool.map(look, [p for room in PROGRAMS.values() for p in room if (tests / p).exists() and p not in arguments.without]):
            usual[program], reached[program] = seconds, listed

        def judge(mutant):
            past = sorted((p for p in reached if mutant["number"] in reached[p]), key=usual.get)
            mutant["outcome"] = "survived" if past else "not reached"
            for program in past:
                if time.monotonic() > end:
                    mutant["outcome"] = "not run to its end"
                    break
                status, seconds, failed = run_program(tests, program, 10 + 4 * usual[program], ESPALIER_MUTANT=str(mutant["number"]))
                if status:
                    mutant.update(outcome="killed", by=f"{program} {failed or status}")
                    break
            return mutant

        done = list(pool.map(judge, mutants))
    pathlib.Path(arguments.out).write_text(json.dumps(done, indent=1))
    count = {o: sum(m["outcome"] == o for m in done) for o in ("killed", "survived", "not reached", "not run to its end")}
    print(count)
    for m in done:
        if m["outcome"] != "killed":
            print(f"{m['outcome']}: {m['path']}:{m['line']} {m['rule']} {m['before']!r} ({m['number']})")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(required=True)
    verb = verbs.add_parser("make")
    verb.add_argument("tree")
    verb.add_argument("--most", type=int, default=250)
    verb.add_argument("--seed", type=int, default=1)
    verb.add_argument("--only", default="", help="expression for paths")
    verb.set_defaults(do=make)
    verb = verbs.add_parser("run")
    verb.add_argument("tests")
    verb.add_argument("--list", required=True)
    verb.add_argument("--out", required=True)
    verb.add_argument("--jobs", type=int, default=8)
    verb.add_argument("--minutes", type=float, default=8)
    verb.add_argument("--without", nargs="*", default=[], metavar="PROGRAM", help="test programs that take too long")
    verb.set_defaults(do=run)
    arguments = parser.parse_args()
    arguments.do(arguments)


if __name__ == "__main__":
    sys.exit(main())
