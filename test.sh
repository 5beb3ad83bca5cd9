#!/bin/sh
# Installs what is missing, builds the release preset and runs the tests.
#   ./test.sh         the fast ones (minutes)
#   ./test.sh --all   the slow ones too
set -eu
cd "$(dirname "$0")"

which_tests="-L fast" packages=""
case "${1:-}" in
  "") ;;
  --all) which_tests="" packages=--slow ;;
  --help | -h) sed -n '2,4s/^# \{0,1\}//p' "$0"; exit 0 ;;
  *) echo "test.sh: unknown option '$1'; try --help" >&2; exit 2 ;;
esac

.ci/install-packages $packages
jobs=$(nproc)
cmake --preset release -DGRAINCLOCK_TESTS=ON
cmake --build --preset release -j "$jobs"
exec ctest --test-dir build/release $which_tests -j "$jobs" --output-on-failure --no-tests=error
