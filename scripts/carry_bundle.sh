#!/bin/sh
# Makes the bundle of a build small enough to be carried to a GPU machine, with the rivals' libraries beside it.
#
#   scripts/carry_bundle.sh BUILD_FOLDER DESTINATION [ARCHITECTURE]
#
# DESTINATION/bundle.txz  the bundle (cmake --build BUILD_FOLDER --target bundle). Its programs contain the same library
#                         each; a dictionary longer than one of them makes that cost little.
# DESTINATION/rivals.tar  from build/rivals (scripts/get_rivals.sh) what MKL PARDISO needs with AVX-512, and cuDSS with
#                         the code of one GPU architecture only (default: 90), each packed by xz. Kept if it is there: it
#                         takes minutes. 55 MB; the bundle for one architecture 7 MB.
#
# There:  tar -xJf bundle.txz; mkdir -p espalier-*/lib/rivals; tar -xf rivals.tar -C espalier-*/lib/rivals
#         ls espalier-*/lib/rivals/*.xz | xargs -n 1 -P 0 xz -d; espalier-*/bin/espalier-evidence --out results
set -eu

build=$1
destination=$2
architecture=${3:-90}
root=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$destination"

mkdir "$work/bundle"
tar -xzf "$(ls "$build"/espalier-*-linux-*.tar.gz | head -1)" -C "$work/bundle"
tar -C "$work/bundle" -cf - --sort=name --owner=0 --group=0 . | xz -T1 --lzma2=preset=6,dict=128MiB >"$work/bundle.txz"
mv "$work/bundle.txz" "$destination/"

if [ ! -f "$destination/rivals.tar" ]; then
  mkdir "$work/rivals"
  for name in libmkl_core.so.3 libmkl_avx512.so.3 libmkl_gnu_thread.so.3 libmkl_intel_lp64.so.3 libcudss_mtlayer_gomp.so.1; do
    cp "$root/build/rivals/lib/$name" "$work/rivals/"
  done
  python3 "$root/scripts/slim_gpu_library.py" "$root/build/rivals/lib/libcudss.so.1" "$work/rivals/libcudss.so.1" "$architecture"
  xz -6 "$work"/rivals/*
  tar -C "$work/rivals" -cf "$work/rivals.tar" --owner=0 --group=0 .
  mv "$work/rivals.tar" "$destination/"
fi
ls -l "$destination"
