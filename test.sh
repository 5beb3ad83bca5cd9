#!/bin/sh
# Installs what is missing, builds and runs the tests.
#   ./test.sh              the fast ones (minutes)
#   ./test.sh --all        the slow ones too
#   ./test.sh --sanitize   the fast ones with memory and undefined behaviour watched (address and undefined-behaviour sanitizer)
#   ./test.sh --sanitize FOLDER...   of these folders only (core, multirate, silo, benchmarks)
# In continuous integration (the variable CI is set) warnings are errors.
#
# Sanitized, null pointers and objects are left to the address sanitizer, which halves the time to compile; g++ takes values
# for uninitialized that only the sanitizers' code leaves so.
set -eu
cd "$(dirname "$0")"

preset=release which_tests="-L fast" packages="" folders=""
case "${1:-}" in
  "") ;;
  --all) which_tests="" packages=--slow ;;
  --sanitize) preset=sanitize; shift; folders="$*" ;;
  --help | -h) sed -n '2,7s/^# \{0,1\}//p' "$0"; exit 0 ;;
  *) echo "test.sh: unknown option '$1'; try --help" >&2; exit 2 ;;
esac

.ci/install-packages $packages
jobs=$(nproc) werror=OFF
[ -z "${CI:-}" ] || werror=ON
export LSAN_OPTIONS="suppressions=$PWD/tests/leaks.supp:print_suppressions=0"
cmake --preset $preset -DGRAINCLOCK_TESTS=ON -DGRAINCLOCK_WERROR=$werror
if [ -n "$folders" ]; then
  cmake --build --preset $preset -j "$jobs" --target $(printf 'test_%s ' $folders)
  # Whole programs, not test by test: what tests share is made once.
  printf '%s\n' $folders | xargs -P "$jobs" -I{} env "build/$preset/tests/test_{}" --gtest_filter='-Slow*' --gtest_brief=1
  exit 0
fi
cmake --build --preset $preset -j "$jobs"
exec ctest --test-dir build/$preset $which_tests -j "$jobs" --output-on-failure --no-tests=error
