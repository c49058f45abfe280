#!/bin/bash
# The first hour of somebody who uses pip: a fresh environment, the package, CasADi, and the problems of this folder.
#   tests/first_hour/with_pip.sh [what pip installs]     default: ./python; or a wheel
# PYTHON: with which the environment is made (default python3). Needs PyPI, for NumPy and CasADi.
set -euo pipefail
cd "$(dirname "$0")/../.."
what=${1:-./python}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
begin=$(date +%s)
"${PYTHON:-python3}" -m venv "$folder/env"
if ! "$folder/env/bin/pip" --disable-pip-version-check install --quiet "$what" casadi >"$folder/log" 2>&1; then
  tail -30 "$folder/log"
  "$folder/env/bin/pip" --disable-pip-version-check download --quiet --no-deps --dest "$folder" casadi >/dev/null 2>&1 ||
    echo "PyPI cannot be reached from here: these checks need NumPy and CasADi from there"
  exit 1
fi
echo "pip install $what casadi: $(($(date +%s) - begin)) s"
"$folder/env/bin/espalier" info | sed -nE 's/^ +(package .*)/\1/p'
"$folder/env/bin/python" -B tests/first_hour/first_hour.py --command "$folder/env/bin/espalier" --python "$folder/env/bin/python"
