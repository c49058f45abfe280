#!/bin/sh
# Makes the bundle of a build small enough to be carried to a GPU machine, with the rivals' libraries beside it.
#
#   scripts/carry_bundle.sh BUILD_FOLDER DESTINATION [ARCHITECTURE]
#
# DESTINATION/bundle.txz  the bundle (cmake --build BUILD_FOLDER --target bundle). Its programs contain the same library
#                         each; a dictionary longer than one of them makes that cost little.
# DESTINATION/rivals.txz  from build/rivals (scripts/get_rivals.sh) what MKL PARDISO needs with AVX-512, and cuDSS with
#                         the code of one GPU architecture only (default: 90). Kept if it is there: it takes minutes.
#
# There:  tar -xJf bundle.txz && tar -xJf rivals.txz -C espalier-*/ && espalier-*/bin/espalier-evidence --out results
set -eu

build=$1
destination=$2
architecture=${3:-90}
root=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$destination"

pack() { # ARCHIVE FOLDER NAMES...
  archive=$1
  folder=$2
  shift 2
  tar -C "$folder" -cf - --sort=name --owner=0 --group=0 "$@" | xz -T1 --lzma2=preset=6,dict=128MiB >"$archive.part"
  mv "$archive.part" "$archive"
}

mkdir "$work/bundle"
tar -xzf "$(ls "$build"/espalier-*-linux-*.tar.gz | head -1)" -C "$work/bundle"
pack "$destination/bundle.txz" "$work/bundle" .

if [ ! -f "$destination/rivals.txz" ]; then
  mkdir -p "$work/lib/rivals"
  for name in libmkl_core.so.3 libmkl_avx512.so.3 libmkl_gnu_thread.so.3 libmkl_intel_lp64.so.3 libcudss_mtlayer_gomp.so.1; do
    cp "$root/build/rivals/lib/$name" "$work/lib/rivals/"
  done
  python3 "$root/scripts/slim_gpu_library.py" "$root/build/rivals/lib/libcudss.so.1" "$work/lib/rivals/libcudss.so.1" "$architecture"
  pack "$destination/rivals.txz" "$work" lib
fi
ls -l "$destination"
