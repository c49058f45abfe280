# shellcheck shell=bash
# Sourced by ./run, ./test and .ci/run: makes sure that the packages of some groups of packages.txt are there.
# Usage: need_packages GROUP...

script_dir=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

# The packages of the given groups that are not installed, one a line.
missing_packages() {
  local group package
  while read -r group package; do
    [[ " $* " == *" $group "* ]] || continue
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || echo "$package"
  done < <(grep -v '^#' "$script_dir/packages.txt")
}

as_root() {
  if [[ $(id -u) == 0 ]]; then "$@"; else sudo -n "$@"; fi
}

# Ends the script with the packages that are missing and how to get them.
give_up() {
  echo "espalier: $1" >&2
  echo "  missing packages: $2" >&2
  echo "  install them with: sudo apt-get update && sudo apt-get install -y $2" >&2
  exit 2
}

need_packages() {
  if ! command -v dpkg-query >/dev/null; then
    echo "espalier: this is not a Debian or Ubuntu system; going on with what is installed" >&2
    echo "  needed: a C++20 compiler, CMake 3.25, Ninja, zlib, fmt, nlohmann-json, CLI11, Highway, Eigen, pugixml" >&2
    return 0
  fi
  local missing
  missing=$(missing_packages "$@" | xargs)
  [[ -z $missing ]] && return 0
  if [[ $(id -u) != 0 ]] && ! sudo -n true 2>/dev/null; then
    give_up "packages are missing and this user may not install them" "$missing"
  fi
  echo "installing: $missing"
  local log
  log=$(mktemp)
  # shellcheck disable=SC2086 # a list of names
  if ! { as_root apt-get update -q && as_root env DEBIAN_FRONTEND=noninteractive \
           apt-get install -q -y --no-install-recommends $missing; } >"$log" 2>&1 </dev/null; then
    tail -5 "$log" >&2
    give_up "apt-get could not install all packages (no network?); its log is $log" "$(missing_packages "$@" | xargs)"
  fi
  rm -f "$log"
}

# Where nvcc is, also outside PATH; empty when there is none.
find_nvcc() {
  command -v nvcc 2>/dev/null || { [[ -x /usr/local/cuda/bin/nvcc ]] && echo /usr/local/cuda/bin/nvcc; } || true
}

# The value of a cache variable of preset $1's build folder; empty where there is none.
cached() { sed -nE "s/^$2:[A-Z]+=(.*)/\1/p" "build/$1/CMakeCache.txt" 2>/dev/null || true; }

# The options of a build from nothing: the sources of the command line and of the model layer together. With a
# compiler cache, which knows each file for itself, the ordinary way is cheaper.
from_scratch() { [[ -n ${CMAKE_CXX_COMPILER_LAUNCHER:-} ]] || echo -DESPALIER_FROM_SCRATCH=ON; }

# Configures preset $1 (further arguments are passed on) and builds the targets after "--". Quiet unless it fails. A build
# folder that another generator, compiler or source folder has left behind is made again.
configure_and_build() {
  local preset=$1 log
  shift
  local options=()
  while [[ $# -gt 0 && $1 != -- ]]; do options+=("$1"); shift; done
  shift || true
  log=build/$preset.log
  mkdir -p build
  if ! cmake --preset "$preset" "${options[@]}" >"$log" 2>&1 &&
     ! { [[ -f build/$preset/CMakeCache.txt ]] && echo "configuring build/$preset afresh ..." &&
         rm -rf "build/$preset/CMakeCache.txt" "build/$preset/CMakeFiles" &&
         cmake --preset "$preset" "${options[@]}" >"$log" 2>&1; }; then
    tail -40 "$log" >&2
    echo "espalier: configuring failed; the whole log is $log" >&2
    return 1
  fi
  local targets=()
  [[ $# -gt 0 ]] && targets=(--target "$@")
  if [[ -t 1 ]]; then
    cmake --build "build/$preset" "${targets[@]}" || { echo "espalier: the build failed (see above)" >&2; return 1; }
  elif ! cmake --build "build/$preset" "${targets[@]}" >>"$log" 2>&1; then
    grep -E -A12 'error|FAILED' "$log" | tail -60 >&2
    echo "espalier: the build failed; the whole log is $log" >&2
    return 1
  fi
}
