#!/bin/sh
# Builds the fuzz targets with clang's libFuzzer and sanitizers, and runs each.
#   tests/fuzz/run.sh [--seconds N] [--build DIR] [TARGET ...]   (N = 5 for each target, DIR = build/fuzz, all targets)
# Prints executions, coverage and findings of each; exits with 1 if there is a finding. New inputs that reach new code stay in
# DIR/corpus and are taken up by the next call; findings stand in DIR/findings. Without clang nothing is done.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
seconds=5 build=$root/build/fuzz targets=""
while [ $# -gt 0 ]; do
  case "$1" in
    --seconds) seconds=$2; shift 2 ;;
    --build) build=$2; shift 2 ;;
    --help | -h) sed -n '2,5s/^# \{0,1\}//p' "$0"; exit 0 ;;
    -*) echo "run.sh: unknown option '$1'; try --help" >&2; exit 2 ;;
    *) targets="$targets $1"; shift ;;
  esac
done
if ! command -v clang++ >/dev/null; then
  echo "run.sh: there is no clang++, so nothing is fuzzed (Debian: apt-get install clang libclang-rt-14-dev libomp-dev)"
  exit 0
fi
[ -n "$targets" ] || targets=$(cd "$root/tests/fuzz/targets" && ls -- *.cpp | sed 's/\.cpp$//')

cmake -S "$root" -B "$build" -G Ninja -DGRAINCLOCK_FUZZ=ON -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_C_COMPILER=clang \
  -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG="-O1 -gline-tables-only" >/dev/null
cmake --build "$build" --target fuzzers

mkdir -p "$build/findings"
result=0
for target in $targets; do
  case "$target" in
    scene | study) words="-dict=$root/tests/fuzz/toml.dict" ;;
    csv | lammps) words="-dict=$root/tests/fuzz/states.dict" ;;
    *) words="-malloc_limit_mb=5000" ;;  # the library asks for what a header's 32 bits say before it looks whether the file has as much
  esac
  mkdir -p "$build/corpus/$target"
  log=$build/$target.log
  # A minute for one input is a hang, 1 GiB for one allocation a blow-up.
  if ! "$build/tests/fuzz/fuzz_$target" -max_total_time="$seconds" -timeout=60 -rss_limit_mb=3000 -malloc_limit_mb=1024 \
    -max_len=65536 -print_final_stats=1 -artifact_prefix="$build/findings/$target-" $words \
    "$build/corpus/$target" "$root/tests/fuzz/corpus/$target" >"$log" 2>&1; then
    result=1
    grep -E "finding:|ERROR:|SUMMARY:|runtime error:|Test unit written" "$log" | sed "s/^/$target: /"
  fi
  runs=$(sed -n 's/.*number_of_executed_units: *//p' "$log")
  covered=$(grep -o 'cov: [0-9]*' "$log" | tail -n 1)
  echo "$target: ${runs:-?} executions in $seconds s, $covered edges"
done
exit $result
