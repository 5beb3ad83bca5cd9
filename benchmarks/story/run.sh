#!/bin/sh
# The paper's whole story on its full silo (fill, rest, discharge, hammer, until it is empty): wall time over simulated
# time, uniform and selective steps one after the other, on all cores.
#   benchmarks/story/run.sh              table and chart in out/story (an hour on two cores)
#   benchmarks/story/run.sh --only M     one method: uniform (13 minutes) or multirate
#   benchmarks/story/run.sh --quick      a small silo (a minute)
#   benchmarks/story/run.sh --threads N  default: all cores
set -eu
cd "$(dirname "$0")/../.."
fail() { echo "run.sh: $*; try --help" >&2; exit 2; }

scene=silo/scenes/table1-story.toml threads=$(nproc) out=out/story methods="uniform multirate"
while [ $# -gt 0 ]; do
  case "$1" in
    --quick) scene=silo/scenes/mini.toml out=out/story-quick ;;
    --only)
      case "${2:-}" in uniform | multirate) methods=$2 ;; *) fail "--only takes uniform or multirate" ;; esac
      shift ;;
    --threads)
      case "${2:-}" in "" | *[!0-9]* | 0*) fail "--threads takes a number above 0" ;; esac
      threads=$2
      shift ;;
    --help | -h) sed -n '2,8s/^# \{0,1\}//p' "$0"; exit 0 ;;
    *) fail "unknown option '$1'" ;;
  esac
  shift
done
export GOMP_SPINCOUNT="${GOMP_SPINCOUNT:-20000}"

.ci/install-packages
cmake --preset release >/dev/null
cmake --build --preset release --target grainclock -j "$(nproc)"
exec /usr/bin/python3 -B benchmarks/story/story.py build/release/bin/grainclock "$scene" "$threads" "$out" $methods
