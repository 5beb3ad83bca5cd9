#!/bin/sh
# Installs what is missing, builds and runs the tests.
#   ./test.sh              the fast ones (minutes)
#   ./test.sh --all        the slow ones too
#   ./test.sh --sanitize   the fast ones with every access, overflow and conversion watched (address and undefined-behaviour
#                          sanitizer); a regular expression behind it chooses by name, as ctest -R
# In CI (the variable CI is set) warnings are errors.
set -eu
cd "$(dirname "$0")"

preset=release which_tests="-L fast" packages=""
case "${1:-}" in
  "") ;;
  --all) which_tests="" packages=--slow ;;
  --sanitize) preset=sanitize which_tests="-L fast -R ${2:-.}" ;;
  --help | -h) sed -n '2,7s/^# \{0,1\}//p' "$0"; exit 0 ;;
  *) echo "test.sh: unknown option '$1'; try --help" >&2; exit 2 ;;
esac

.ci/install-packages $packages
jobs=$(nproc) werror=OFF
[ -z "${CI:-}" ] || werror=ON
cmake --preset $preset -DGRAINCLOCK_TESTS=ON -DGRAINCLOCK_WERROR=$werror
cmake --build --preset $preset -j "$jobs"
exec ctest --test-dir build/$preset $which_tests -j "$jobs" --output-on-failure --no-tests=error
