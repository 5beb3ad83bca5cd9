#!/bin/sh
# Looks for faults with clang-tidy; .clang-tidy says which checks, and why not others. Exit code 1 if there is a finding.
#   tests/tidy.sh              core, multirate, silo and benchmarks
#   tests/tidy.sh FOLDER...    these folders only
set -eu
cd "$(dirname "$0")/.."
case "${1:-}" in -*) sed -n '2,4s/^# \{0,1\}//p' "$0"; exit 0 ;; esac
[ $# -gt 0 ] || set -- core multirate silo benchmarks

.ci/install-packages --checks
cmake --preset release >/dev/null
cmake --build --preset release --target grainclock_provenance >/dev/null  # writes a header that silo includes
folders=$(printf '|%s' "$@")
exec run-clang-tidy -quiet -p build/release -j "$(nproc)" "^$PWD/(${folders#|})/[a-z_]*\.cpp\$"
