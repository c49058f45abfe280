#!/usr/bin/env bash
# Builds the programs of the campaigns and runs them: see campaign.py, or --help.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/bootstrap.sh
for word; do [[ $word != --help && $word != -h && $word != --list ]] || exec python3 scripts/campaign.py "$@"; done
need_packages build test
programs=(espalier_verdict espalier_exact espalier_follow espalier_value_changes espalier_sequences espalier_c_sequences)
# shellcheck disable=SC2046 # none or one word
configure_and_build release -DESPALIER_TESTS=ON $(from_scratch) -- "${programs[@]}"
exec python3 scripts/campaign.py "$@"
