#!/usr/bin/env bash
# How long a stranger waits: a fresh clone of a commit, then ./run and, with --test, ./test. Packages are installed before
# the clock starts. Prints seconds from the start until the first system was solved, until ./run ended, until ./test ended,
# and the processor time of each.
#   .ci/first_result.sh [--test] [COMMIT...]     default: HEAD; several commits are taken in turns
set -euo pipefail
cd "$(dirname "$0")/.."
with_test=
[[ ${1:-} != --test ]] || { with_test=yes; shift; }
[[ $# -gt 0 ]] || set -- HEAD
(source scripts/bootstrap.sh; need_packages build ${with_test:+test})
unset CMAKE_CXX_COMPILER_LAUNCHER CMAKE_C_COMPILER_LAUNCHER  # a compiler cache would hide what is measured
echo "$(nproc) processors, $(sed -nE 's/^model name\s*: //p' /proc/cpuinfo | head -1), load $(cut -d' ' -f1 /proc/loadavg)"
printf '%-12s %-10s %10s %14s\n' commit until seconds "processor s"

# Seconds of all processes that this shell has waited for.
processor_seconds() { awk '{print ($16 + $17) / 100}' "/proc/$$/stat"; }

for commit; do
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"' EXIT
  git clone -q --no-local . "$folder/espalier"
  git -C "$folder/espalier" checkout -q --detach "$(git rev-parse "$commit^{commit}")"
  name=$(git rev-parse --short=8 "$commit^{commit}")
  begin=$(date +%s.%N)
  before=$(processor_seconds)
  since() { awk -v a="$1" -v b="$2" 'BEGIN {printf "%.0f", b - a}'; }
  (cd "$folder/espalier" && ./run </dev/null) >"$folder/run.log" 2>&1 &
  job=$!
  first=
  while kill -0 "$job" 2>/dev/null; do
    if [[ -z $first ]] && grep -q 'backward error' "$folder/run.log"; then
      first=$(since "$begin" "$(date +%s.%N)")
      printf '%-12s %-10s %10s\n' "$name" "1st solve" "$first"
    fi
    sleep 0.5
  done
  wait "$job" || { tail -20 "$folder/run.log"; exit 1; }
  [[ -n $first ]] || { echo "./run has solved nothing"; exit 1; }
  ran=$(processor_seconds)
  printf '%-12s %-10s %10s %14s\n' "$name" "./run" "$(since "$begin" "$(date +%s.%N)")" "$(since "$before" "$ran")"
  if [[ -n $with_test ]]; then
    begin=$(date +%s.%N)
    (cd "$folder/espalier" && ./test </dev/null) >"$folder/test.log" 2>&1 || { tail -20 "$folder/test.log"; exit 1; }
    printf '%-12s %-10s %10s %14s\n' "$name" "./test" "$(since "$begin" "$(date +%s.%N)")" "$(since "$ran" "$(processor_seconds)")"
  fi
  rm -rf "$folder"
done
