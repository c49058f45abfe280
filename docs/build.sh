#!/usr/bin/env bash
# Builds the documentation site: build/site/html/index.html. No network is needed where the packages are there already.
#   docs/build.sh                 the whole site; notebooks that changed are executed
#   docs/build.sh --quick         notebooks are not executed, pictures of models not drawn anew
# What it takes from outside: doxygen (Debian), the Python packages of docs/site/requirements.txt, which go into build/site/venv.
# ESPALIER_BINARY: another program espalier than build/release/espalier. ESPALIER_SITE_VENV: a virtual environment that has
# all packages, espalier among them; nothing is installed then.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/bootstrap.sh

quick=0
[[ ${1:-} != --quick ]] || quick=1
site=$PWD/build/site
mkdir -p "$site"

need_packages site build

# The program: for the reference of the command line and the pictures.
binary=${ESPALIER_BINARY:-$PWD/build/release/espalier}
if [[ ! -x $binary ]]; then
  [[ -z ${ESPALIER_BINARY:-} ]] || { echo "espalier: there is no program $binary" >&2; exit 2; }
  echo "building the program (preset release) ..."
  configure_and_build release -- espalier_cli
fi

# The Python side: one virtual environment with what requirements.txt says and the package of this checkout.
venv=${ESPALIER_SITE_VENV:-$site/venv}
if [[ -z ${ESPALIER_SITE_VENV:-} ]]; then
  wanted=$(cat docs/site/requirements.txt docs/site/constraints.txt | sha256sum)
  if [[ $(cat "$venv/wanted" 2>/dev/null) != "$wanted" ]]; then
    echo "installing the packages of docs/site/requirements.txt into $venv ..."
    python3 -m venv "$venv"
    if ! "$venv/bin/pip" install -q -r docs/site/requirements.txt -c docs/site/constraints.txt >"$site/pip.log" 2>&1; then
      tail -3 "$site/pip.log" >&2
      echo "espalier: pip could not install all packages (no network?); its log is $site/pip.log. Missing:" >&2
      "$venv/bin/python" docs/site/missing.py docs/site/requirements.txt >&2 || true
      exit 2
    fi
    echo "$wanted" >"$venv/wanted"
  fi
  # The package is built again when its sources have changed.
  sources=$(git ls-files -s -- src include python cmake CMakeLists.txt | sha256sum; git diff HEAD -- src include python | sha256sum)
  if [[ $(cat "$venv/sources" 2>/dev/null) != "$sources" ]]; then
    echo "building the Python package (some minutes the first time) ..."
    "$venv/bin/pip" install -q './python[scipy]' >"$site/package.log" 2>&1 ||
      { tail -20 "$site/package.log" >&2; echo "espalier: pip install ./python failed; its log is $site/package.log" >&2; exit 1; }
    echo "$sources" >"$venv/sources"
  fi
fi
"$venv/bin/python" docs/site/missing.py docs/site/requirements.txt espalier || exit 2

echo "headers ..."
mkdir -p "$site/doxygen"
{ cat docs/site/Doxyfile; echo "OUTPUT_DIRECTORY = $site/doxygen"; } | doxygen - >"$site/doxygen.log" 2>&1 ||
  { tail -5 "$site/doxygen.log" >&2; exit 1; }

echo "pages ..."
export ESPALIER_SITE_ROOT=$PWD ESPALIER_SITE_STAGE=$site/source ESPALIER_SITE_CACHE=$site/notebooks ESPALIER_BINARY=$binary
[[ $quick == 0 ]] || export ESPALIER_SITE_NOTEBOOKS=off
"$venv/bin/python" docs/site/stage.py "$ESPALIER_SITE_STAGE" --binary "$binary" --doxygen "$site/doxygen/xml"
PATH=$venv/bin:$PATH "$venv/bin/python" -m sphinx -b html -W --keep-going -q -c docs/site -d "$site/doctrees" "$ESPALIER_SITE_STAGE" "$site/html"
"$venv/bin/python" docs/site/check_html.py "$site/html"
echo "$site/html/index.html"
