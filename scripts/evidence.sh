#!/usr/bin/env bash
# Runs every GPU test and benchmark of this bundle on the machine at hand, prints a short table and writes results.
#
#   espalier-evidence [--out DIR] [--seconds N] [--only NAME,...] [--data DIR] [--list]
#
# --out DIR      where results go (default: evidence-<date>): NAME.json in the schema espalier-bench/1, NAME.txt with
#                what the step printed, results.md and report.html of all of them, summary.txt
# --seconds N    no step is begun later, and none runs on after it (default: 3600)
# --only A,B     these steps, or all of a group: tests, tables, sweeps (default: all)
# --data DIR     a folder of matrices for the step `collection`
# --list         the steps, in the order in which they run, with their limits in seconds
#
# MKL and cuDSS are taken from lib/rivals of the bundle, $ESPALIER_RIVALS_DIR, or the loader's path; a rival that is not
# there is a row that says so. Without a GPU the steps say so and end. Ends with 1 when a step failed.
set -uo pipefail

root=$(cd "$(dirname "$(readlink -f "$0")")/.." && pwd)
programs=$root/libexec/espalier
espalier=$root/bin/espalier

out=evidence-$(date -u +%Y-%m-%d)
seconds=3600
only=tests,tables,sweeps
data=
list=no
while (($# > 0)); do
  case $1 in
    --out) shift; out=$1 ;;
    --seconds) shift; seconds=$1 ;;
    --only) shift; only=$1 ;;
    --data) shift; data=$1 ;;
    --list) list=yes ;;
    -h | --help) sed -n '2,17p' "$0"; exit 0 ;;
    *) echo "espalier-evidence: $1 is not an option; see --help" >&2; exit 2 ;;
  esac
  shift
done

gpus=$(nvidia-smi --list-gpus 2>/dev/null | grep -c '^GPU')
devices=$(seq -s, 0 $((gpus > 0 ? gpus - 1 : 0)))
counts=$(for n in 1 2 4 8 16; do ((n <= gpus)) && echo "$n"; done | paste -sd,)
first_list=gpu:0
points=$first_list
for n in 2 4 8 16; do ((n <= gpus)) && points+=" gpu:$(seq -s, 0 $((n - 1)))"; done
threads=$(nproc)
hosts="host:1,1"
for ((n = 2; n <= threads && n <= 16; n *= 2)); do hosts+=" host:$n,1"; done

summary=()
failed=0
begun=$SECONDS

wanted() { [[ ,$only, == *,$1,* || ,$only, == *,$2,* ]]; }

# step GROUP NAME LIMIT_SECONDS COMMAND...: its output goes to NAME.txt and its end to the screen.
step() {
  local group=$1 name=$2 limit=$3 result code start=$SECONDS left
  shift 3
  wanted "$group" "$name" || return 0
  if [[ $list == yes ]]; then
    printf '%-8s %-18s %5d s\n' "$group" "$name" "$limit"
    return 0
  fi
  if [[ $1 == */* && ! -x $1 ]]; then
    summary+=("$(printf '%-18s %6s  %s' "$name" - "left out: this build has no ${1##*/}")")
    return 0
  fi
  left=$((seconds - (SECONDS - begun)))
  if ((left < 5)); then
    summary+=("$(printf '%-18s %6s  %s' "$name" - "left out: $seconds s are gone")")
    return 0
  fi
  echo "== $name (at $((SECONDS - begun)) s)"
  timeout --kill-after=5 $((limit < left ? limit : left)) "$@" >"$out/$name.txt" 2>&1 </dev/null
  code=$?
  case $code in
    0) result=ok ;;
    77) result=$(tail -1 "$out/$name.txt") ;;
    124 | 137) result="cut off after $((SECONDS - start)) s; what was measured is kept" ;;
    *) result="FAILED ($code)"; failed=1 ;;
  esac
  tail -"${shown:-12}" "$out/$name.txt"
  summary+=("$(printf '%-18s %4d s  %s' "$name" $((SECONDS - start)) "$result")")
}

bench() { # GROUP NAME LIMIT EXPERIMENT ARGUMENTS...: a step of `espalier bench` whose results are NAME.json
  local group=$1 name=$2 limit=$3 experiment=$4 left
  shift 4
  left=$((seconds - (SECONDS - begun)))
  ((left = left < limit ? left : limit, left = left > 10 ? left : 10))
  shown=80 step "$group" "$name" "$limit" "$espalier" bench "$experiment" --threads "$threads" --out "$out/$name.json" \
    --time $((left - 5)) --timeout $((left / 4 + 10)) "$@"
}

[[ $list == yes ]] || mkdir -p "$out"

# Correctness first: a fast wrong answer is none.
step tests test_device 120 "$programs/test_device" --gtest_brief=1 --gtest_filter='*uda*:*Gpu*:*gpu*'
step tests test_solver 300 "$programs/test_solver" --gtest_brief=1
step tests small 120 "$programs/espalier_gpu_check" --small --out "$out/small.json"
step tests small-fp32 120 "$programs/espalier_gpu_check" --small --fp32 --out "$out/small-fp32.json"
step tests memory-curve-small 120 "$programs/espalier_memory_curve" --small
[[ -x $programs/espalier_pivot_check ]] && step tests pivots 60 "$programs/espalier_pivot_check"
[[ -n $data ]] && step tests collection 300 "$programs/espalier_collection" "$data" --device gpu:0
((gpus > 1)) && step tests small-several 240 "$programs/espalier_gpu_check" --small --devices "$devices" --counts "$counts" --out "$out/small-several.json"

# The tables of docs/notebook/gpu.md, several_gpus.md and out_of_core.md.
step tables gpu-check 300 "$programs/espalier_gpu_check" --repeat 7 --out "$out/gpu-check.json"
((gpus > 1)) && step tables gpus-check 300 "$programs/espalier_gpu_check" --repeat 7 --devices "$devices" --counts "$counts" \
  --out "$out/gpus-check.json"
bench tables peers-gpu 3000 peers --set gpu
((gpus > 1)) && bench tables peers-gpus 900 peers --set gpus
step tables memory-curve 300 "$programs/espalier_memory_curve" --repeat 2 --out "$out/memory-curve.json" \
  "elasticity 64" 16384 8192 4096 2048 1024 512 256 64

# Sweeps.
bench sweeps ceilings 60 ceilings
bench sweeps overhead 120 overhead
bench sweeps refactor 300 refactor
# Newton matrices of a simulation in the order in which it met them.
step sweeps dump 60 "$espalier" simulate "$root/share/espalier/models/chain.toml" --until 0.02 --out "$out/dump" \
  --dump-matrices "$out/newton" --dump-count 8
bench sweeps newton 60 refactor --system "$out/newton"
# Which fronts have tiles of 32 columns on the GPU, which 64: the kernels have these two widths.
for rows in 0 512 1024 2048 1000000; do
  step sweeps "tiles-$rows" 60 "$programs/espalier_gpu_check" --narrow "$rows" --repeat 3 --out "$out/tiles-$rows.json" \
    "elasticity 40" "plate 600" "kkt 20"
done
bench sweeps block-size 300 block-size --rhs 1 --analyses 1 -k 3 \
  --system "elasticity 28" --system "plate 200" --system "kkt 20"
# shellcheck disable=SC2086 # a list
((gpus > 1)) && bench sweeps scaling-gpu 300 scaling --points $points --rhs 1 --analyses 1
# shellcheck disable=SC2086
bench sweeps scaling 300 scaling --points $hosts --rhs 1 --analyses 1 -k 3 \
  --system "elasticity 24" --system "plate 200" --system "kkt 20"
bench sweeps ablation 300 ablation --rhs 1 --analyses 1 -k 3 --system "elasticity 24" --system "plate 200" --system "kkt 20"
bench sweeps growth 300 growth --system "plate 50" --system "plate 100" --system "plate 200" --system "plate 400" \
  --system "elasticity 10" --system "elasticity 16" --system "elasticity 24" --system "elasticity 36"

[[ $list == yes ]] && exit 0

shopt -s nullglob
results=("$out"/*.json)
if ((${#results[@]} > 0)); then
  "$espalier" report --markdown "${results[@]}" --out "$out/results.md" >/dev/null
  "$espalier" report "${results[@]}" --out "$out/report.html" >/dev/null
fi
{
  printf '\n%s, %s GPUs, %s threads, %s s:\n' "$("$espalier" --version | head -1)" "$gpus" "$threads" $((SECONDS - begun))
  printf '  %s\n' "${summary[@]}"
} | tee "$out/summary.txt"
exit $failed
