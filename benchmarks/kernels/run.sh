#!/bin/sh
# Builds the kernel benchmarks, runs them and draws their chart: tables and kernels.png in out/kernels. Two minutes.
#   benchmarks/kernels/run.sh                        the flowing silo, if ./run.sh has made it, else a random packing
#   benchmarks/kernels/run.sh --state FILE [--open]  another state; --open leaves the outlet's plug out
set -eu
cd "$(dirname "$0")/../.."

usage() { sed -n '2,4s/^# \{0,1\}//p' "$0"; }

state="" open=""
while [ $# -gt 0 ]; do
  case "$1" in
    --state) state=${2:?"run.sh: --state takes a file"}; shift ;;
    --open) open=--open ;;
    --help | -h) usage; exit 0 ;;
    *) echo "run.sh: unknown option '$1'; try --help" >&2; exit 2 ;;
  esac
  shift
done
flow=silo/scenes/table1-flow.h5
if [ -z "$state" ] && [ -e "$flow" ]; then state=$flow open=--open; fi

# Threads that wait for each other give way soon, so that a busy machine slows a run down by no more than its share.
export GOMP_SPINCOUNT="${GOMP_SPINCOUNT:-20000}"

.ci/install-packages
cmake --preset release >/dev/null
cmake --build --preset release --target kernel_benchmarks kernel_terms -j "$(nproc)"

out=out/kernels
mkdir -p "$out"
# In random order, so that a slow spell of the machine meets no benchmark more than others.
build/release/bin/kernel_benchmarks ${state:+--state "$state"} $open --benchmark_repetitions=9 --benchmark_min_time=0.03 \
  --benchmark_enable_random_interleaving=true --benchmark_display_aggregates_only=true \
  --benchmark_out="$out/kernels.json" --benchmark_out_format=json >"$out/kernels.txt"
build/release/bin/kernel_terms ${state:+--state "$state"} $open --out "$out/terms.csv"
/usr/bin/python3 benchmarks/kernels/charts.py "$out"
