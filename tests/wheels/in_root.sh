#!/bin/bash
# A wheel on another system: in the root folder of one, by chroot (as root).
#   tests/wheels/in_root.sh ROOT WHEEL [PYTHON]      PYTHON: the one there, with venv (default python3)
# A root folder, for instance of Ubuntu, with the Python of the wheel:
#   debootstrap --variant=minbase --components=main,universe --include=python3-venv noble noble http://archive.ubuntu.com/ubuntu
# or of Rocky Linux: dnf --installroot=$PWD/rocky --releasever=9 install python3 ...
# Needs PyPI, by the way this system has there (resolv.conf, PIP_CERT).
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(realpath "$1") wheel=$(realpath "$2") python=${3:-python3}
folder=$(mktemp -d "$root/tmp/espalier-XXXXXX")
mounted=()
finish() {
  for place in "${mounted[@]}"; do umount "$place"; done
  rm -rf "$folder"
}
trap finish EXIT
cp -r "$here" "$here/../first_hour" "$wheel" "$folder"
for file in /etc/resolv.conf /etc/hosts "${PIP_CERT:-/etc/ssl/certs/ca-certificates.crt}"; do
  mkdir -p "$root${file%/*}"
  cp -L "$file" "$root$file"
done
for place in proc dev; do
  mountpoint -q "$root/$place" && continue
  mount --bind "/$place" "$root/$place" && mounted+=("$root/$place")
done
inside=/tmp/$(basename "$folder")
chroot "$root" env -u PIP_FIND_LINKS PYTHONDONTWRITEBYTECODE=1 bash -euc '
  . /etc/os-release
  echo "$PRETTY_NAME, $('"$python"' --version), $(ldd --version | head -1)"
  cd '"$inside"'
  '"$python"' wheels/wheel_test.py *.whl
  '"$python"' -m venv env
  env/bin/pip install -q *.whl casadi
  '"$python"' first_hour/first_hour.py --command env/bin/espalier --python env/bin/python'
