#!/bin/sh
# Brings the rivals of bench/ onto this machine: Debian packages (CHOLMOD, MUMPS, Eigen) and, from PyPI, Intel MKL and
# NVIDIA cuDSS, unpacked into build/rivals (or the folder given). Nothing is linked into the library. Names what is
# missing where there is no network, and ends with 1 then.
#
#   scripts/get_rivals.sh [--no-apt] [--wheels FOLDER] [DESTINATION]
#
# --no-apt          leave Debian packages alone
# --wheels FOLDER   take wheels from this folder before asking PyPI
set -eu

root=$(cd "$(dirname "$0")/.." && pwd)
destination=$root/build/rivals
wheels=
apt=yes
while [ $# -gt 0 ]; do
  case $1 in
    --no-apt) apt=no ;;
    --wheels) shift; wheels=$1 ;;
    -h | --help) sed -n '2,9p' "$0"; exit 0 ;;
    *) destination=$1 ;;
  esac
  shift
done

debian="libsuitesparse-dev libmumps-seq-dev libmetis-dev libeigen3-dev libopenblas-pthread-dev"
missing=

if [ $apt = yes ]; then
  absent=
  for package in $debian; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || absent="$absent $package"
  done
  if [ -n "$absent" ]; then
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive apt-get install -y -q $absent || missing="$missing$absent"
  fi
fi

mkdir -p "$destination/lib" "$destination/include" "$destination/wheels"

# wheel NAME==VERSION PATTERN: finds the wheel in --wheels, in the destination, or on PyPI; prints its path.
wheel() {
  for folder in "$wheels" "$destination/wheels"; do
    [ -n "$folder" ] || continue
    for file in "$folder"/$2; do
      [ -f "$file" ] && { echo "$file"; return 0; }
    done
  done
  python3 -m pip download -q --no-deps --only-binary=:all: -d "$destination/wheels" "$1" >&2 || return 1
  for file in "$destination"/wheels/$2; do
    [ -f "$file" ] && { echo "$file"; return 0; }
  done
  return 1
}

# unpack WHEEL REGULAR_EXPRESSION FOLDER: the members whose name matches, without their folders.
unpack() {
  python3 - "$1" "$2" "$3" <<'PYTHON'
import os, re, shutil, sys, zipfile
wheel, pattern, folder = sys.argv[1:]
with zipfile.ZipFile(wheel) as archive:
    for member in archive.infolist():
        if not re.search(pattern, member.filename):
            continue
        path = os.path.join(folder, os.path.basename(member.filename))
        if os.path.exists(path) and os.path.getsize(path) == member.file_size:
            continue
        with archive.open(member) as source, open(path, "wb") as target:
            shutil.copyfileobj(source, target)
        print("  " + path)
PYTHON
}

if file=$(wheel 'mkl==2026.2.0' 'mkl-*.whl'); then
  unpack "$file" '/lib/libmkl_(core|gnu_thread|intel_lp64|avx2|avx512|def)\.so' "$destination/lib"
else
  missing="$missing mkl(PyPI)"
fi
if file=$(wheel 'nvidia-cudss-cu13==1.0.0.35' 'nvidia_cudss_cu13-*.whl'); then
  unpack "$file" '/lib/libcudss(_mtlayer_gomp)?\.so' "$destination/lib"
  unpack "$file" '/include/.*\.h$' "$destination/include"
else
  missing="$missing nvidia-cudss-cu13(PyPI)"
fi

if [ -n "$missing" ]; then
  echo "get_rivals: not available here:$missing" >&2
  exit 1
fi
echo "get_rivals: all rivals are in place ($destination)"
