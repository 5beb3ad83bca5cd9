#!/bin/sh
# Installs what is missing, builds grainclock, fills the paper's silo, runs the accuracy-versus-speed study on it
# and leaves charts and an HTML report in out/report.
#   ./run.sh              the full Table 1 silo, 22,741 balls (at most 10 minutes on two cores)
#   ./run.sh --starts 3   the same from three start states (longer)
#   ./run.sh --quick      a silo of 500 balls (seconds, after the build)
#   ./run.sh --threads N  default: all cores
set -eu
cd "$(dirname "$0")"

usage() { sed -n '2,7s/^# \{0,1\}//p' "$0"; }
fail() { echo "run.sh: $*; try --help" >&2; exit 2; }

# Threads that wait for each other give way soon, so that a busy machine slows a run down by no more than its share.
export GOMP_SPINCOUNT="${GOMP_SPINCOUNT:-2000}"

name=table1 study=table1-flow seeds="1" threads=$(nproc)
while [ $# -gt 0 ]; do
  case "$1" in
    --quick) name=mini study=mini ;;
    --starts)
      [ "${2:-}" = 1 ] || [ "${2:-}" = 3 ] || fail "--starts takes 1 or 3"
      [ "$2" = 1 ] || { study=table1-flow-starts seeds="1 2 3"; }
      shift ;;
    --threads)
      case "${2:-}" in "" | *[!0-9]* | 0*) fail "--threads takes a number above 0" ;; esac
      threads=$2
      shift ;;
    --help | -h) usage; exit 0 ;;
    *) fail "unknown option '$1'" ;;
  esac
  shift
done
[ "$name" != mini ] || seeds="1"

# Steps with the minutes they take on two cores, for the estimate of the remaining time only.
if [ "$name" = mini ]; then start_minutes=0 study_minutes=1; else start_minutes=3 study_minutes=4; fi
left=$((2 + start_minutes * $(echo $seeds | wc -w) + study_minutes * $(echo $seeds | wc -w)))
began=$(date +%s)
step() {  # step MINUTES TEXT: announces a step that takes about MINUTES
  echo
  echo "== $2   ($(($(date +%s) - began)) s so far, about $left min left)"
  left=$((left > $1 ? left - $1 : 0))
}

step 0 "Packages"
.ci/install-packages

step 2 "Build"
cmake --preset release >/dev/null
cmake --build --preset release --target grainclock -j "$(nproc)"
program=build/release/bin/grainclock

# A start state is kept under a name that changes with the scene that makes it and with the format of states.
state_version=2
key() {  # key SCENE... SEED
  for part; do if [ -e "$part" ]; then cat "$part"; else echo "$part, states $state_version"; fi; done | sha256sum | cut -c1-16
}
make_state() {  # make_state FILE SCENE [OPTION...]: runs the scene and keeps its final state
  made=$1 scene=$2
  shift 2
  rm -rf "$made.work"
  "$program" run "$scene" --out "$made.work" --threads "$threads" "$@"
  mv "$made.work/final.h5" "$made"
  rm -rf "$made.work"
}
out=out/$study-$(date +%Y%m%d-%H%M%S)
mkdir -p build/cache "$out"
for seed in $seeds; do
  # Filling and opening are kept apart, so that either can be used again; a key names all that a state comes from.
  filled=build/cache/$name-filled-$(key silo/scenes/$name-filled.toml "$seed").h5
  cached=build/cache/$name-flow-$(key silo/scenes/$name-filled.toml silo/scenes/$name-open.toml "$seed").h5
  if [ -e "$cached" ]; then
    step "$start_minutes" "Start state, seed $seed: cached"
  else
    step "$start_minutes" "Start state, seed $seed: fill and open the silo"
    [ -e "$filled" ] || make_state "$filled" silo/scenes/$name-filled.toml --set "seed=$seed"
    make_state "$cached" silo/scenes/$name-open.toml --set "initial.state=\"$filled\""
  fi
  # The same scene gives the same state to the bit; another compiler or mathematics library may not.
  sum=$("$program" info "$cached" | sed -n 's/^checksum: //p')
  known=$(sed -n "s/^$name $seed //p" benchmarks/start-states.txt)
  if [ -z "$known" ] || [ "$sum" = "$known" ]; then
    echo "start state $name, seed $seed: checksum $sum${known:+, as recorded}"
  else
    echo "start state $name, seed $seed: checksum $sum, recorded is $known: figures may differ a little from the README's"
  fi
  beside=silo/scenes/$name-flow.h5
  [ "$seed" = 1 ] || beside=silo/scenes/$name-flow-seed$seed.h5
  cp "$cached" "$beside.part"
  mv "$beside.part" "$beside"
done

step "$study_minutes" "Study: benchmarks/$study.toml"
"$program" study "benchmarks/$study.toml" --out "$out/study"  # one thread: it is methods that are compared

step 0 "Pictures and report"
"$program" run "silo/scenes/$name-flow.toml" --out "$out/flow" --threads "$threads"
/usr/bin/python3 benchmarks/report.py "$out/study" --run "$out/flow/run.h5" --out out/report
cp "$out/study/study.csv" "$out/study/study.h5" out/report/

echo
echo "Done in $(($(date +%s) - began)) s. Open out/report/report.html; the chart is out/report/chart.png,"
echo "the numbers are in out/report/study.csv, all of it in $out."
