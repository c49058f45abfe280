#!/usr/bin/env bash
# CalculiX 2.20, built from Debian's source with its PARDISO path on our library: its own test decks, solved with
# SOLVER=PARDISO and with SOLVER=SPOOLES, and their .dat files compared. CalculiX is under the GPL, version 2: it is
# fetched and built in a folder outside of the repository, and nothing of it is kept or handed on.
#
#   apt-get install dpkg-dev gfortran libspooles-dev libarpack2-dev liblapack-dev calculix-ccx-test
#   tests/hosts/calculix.sh [--libraries build/release/hosts] [--work FOLDER] [--decks N]
#
# Building takes some 15 minutes of two cores (FLAGS=-O0: 4); a second call with the same folder does not build again.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
libraries=$here/../../build/release/hosts work=${TMPDIR:-/tmp}/espalier-calculix decks=1000
while [[ $# -gt 0 ]]; do
  case $1 in
    --libraries) libraries=$2 ;;
    --work) work=$2 ;;
    --decks) decks=$2 ;;
    *) sed -n '2,/^set/p' "$0" | grep '^#' >&2; exit 2 ;;
  esac
  shift 2
done
libraries=$(cd "$libraries" && pwd)
[[ -f $libraries/libespalier_mkl_pardiso.so ]] || { echo "no libespalier_mkl_pardiso.so in $libraries" >&2; exit 2; }
examples=/usr/share/doc/calculix-ccx-test/examples/test
[[ -d $examples ]] || { echo "skipped: calculix-ccx-test is not installed"; exit 0; }
mkdir -p "$work/lists" "$work/stubs" "$work/runs"
cd "$work"

ccx=$work/CalculiX/ccx_2.20/src/ccx_2.20
if [[ ! -x $ccx ]]; then
  if [[ ! -d CalculiX ]]; then
    echo "deb-src http://deb.debian.org/debian bookworm main" >sources.list
    apt=(-o "Dir::Etc::sourcelist=$work/sources.list" -o Dir::Etc::sourceparts=- -o "Dir::State::lists=$work/lists")
    apt-get "${apt[@]}" update -q >fetch.log 2>&1
    apt-get "${apt[@]}" source --download-only -q calculix-ccx=2.20-1 >>fetch.log 2>&1
    tar xf calculix-ccx_2.20.orig.tar.bz2
    tar xf calculix-ccx_2.20-1.debian.tar.xz
    while read -r patch; do (cd CalculiX && patch -s -p1 <"../debian/patches/$patch"); done <debian/patches/series
  fi
  # What it wants of MKL's header: one number, of MKL's documentation.
  echo "#define MKL_DOMAIN_PARDISO 4" >stubs/mkl_service.h
  echo "building CalculiX in $work ..."
  make -s -j"$(nproc)" -C CalculiX/ccx_2.20/src ccx_2.20 \
    CFLAGS="-w ${FLAGS:--O2} -I/usr/include/spooles -I$work/stubs -DARCH=Linux -DSPOOLES -DARPACK -DMATRIXSTORAGE -DUSE_MT=1 -DPARDISO" \
    FFLAGS="-w ${FLAGS:--O2} -fallow-argument-mismatch" \
    LIBS="-lspooles -lpthread -larpack -llapack -lblas -L$libraries -lespalier_mkl_pardiso -Wl,-rpath,$libraries -lm -lc" >build.log 2>&1 ||
    { tail -20 build.log >&2; exit 1; }
fi

# run DECK SOLVER: solves it and prints the seconds.
run() {
  local folder=$work/runs/$1/$2 file=$examples/$1.inp
  rm -rf "$folder" && mkdir -p "$folder" && cd "$folder"
  { if [[ -f $file ]]; then cat "$file"; else zcat "$file.gz"; fi; } |
    sed -E "s/^(\*(STATIC|FREQUENCY|BUCKLE|DYNAMIC|HEAT TRANSFER|MODAL DYNAMIC|COUPLED TEMPERATURE-DISPLACEMENT|STEADY STATE DYNAMICS|VISCO)\b[^\r]*)/\1,SOLVER=$2/I" >"$1.inp"
  local begin=$EPOCHREALTIME
  ESPALIER_LOG=$folder/log timeout 120 "$ccx" -i "$1" >out 2>&1 || { echo failed; return; }
  awk -v a="$begin" -v b="$EPOCHREALTIME" 'BEGIN { printf "%.2f\n", b - a }'
}

names=$(cd "$examples" && ls | sed -nE 's/\.inp(\.gz)?$//p' | grep -vE '^(input_distributed|segment_)' | head -n "$decks")
for name in $names; do
  grep -qiE '^\*(STATIC|FREQUENCY|BUCKLE|DYNAMIC|HEAT TRANSFER|VISCO)' < <(cat "$examples/$name.inp" 2>/dev/null || zcat "$examples/$name.inp.gz") || continue
  own=$(run "$name" SPOOLES)
  ours=$(run "$name" PARDISO)
  count=$(grep -c . "$work/runs/$name/PARDISO/log" 2>/dev/null || true)
  echo "$name $own $ours ${count:-0}"
done >"$work/times"
python3 "$here/calculix_compare.py" "$work"
