#!/bin/sh
# Speed, memory and time to build of silos from 23 thousand to 2 million balls, beside what the machine allows. Makes the
# states (once: about three minutes) out of the filled silo of Table 1 and leaves tables and a chart in out/scale.
#   benchmarks/scale/run.sh             all four sizes (about eight minutes the first time, five after that)
#   benchmarks/scale/run.sh --quick     23 and 180 thousand balls only (a minute)
#   benchmarks/scale/run.sh --out DIR   another place for the results
set -eu
cd "$(dirname "$0")/../.."

usage() { sed -n '2,6s/^# \{0,1\}//p' "$0"; }
fail() { echo "run.sh: $*; try --help" >&2; exit 2; }

# Table 1's silo so many times as wide and high, and how many balls it holds then.
sizes="1:22741 2:181928 3.53:1000000 4.45:2000000" out=out/scale
while [ $# -gt 0 ]; do
  case "$1" in
    --quick) sizes="1:22741 2:181928" ;;
    --out)
      [ -n "${2:-}" ] || fail "--out takes a directory"
      out=$2
      shift ;;
    --help | -h) usage; exit 0 ;;
    *) fail "unknown option '$1'" ;;
  esac
  shift
done

# Threads that wait for each other give way soon, so that a busy machine slows a run down by no more than its share.
export GOMP_SPINCOUNT="${GOMP_SPINCOUNT:-20000}"
threads=1
[ "$(nproc)" -lt 2 ] || threads="1 2"
began=$(date +%s)
step() { echo; echo "== $1   ($(($(date +%s) - began)) s so far)"; }

install_mbw() {  # measures the bandwidth of the memory
  ! command -v mbw >/dev/null || return 0
  as_root=""
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || {
      echo "run.sh: missing: mbw. Have an administrator run: apt-get install --no-install-recommends mbw" >&2
      exit 1
    }
    as_root="sudo"
  fi
  $as_root apt-get update -qq
  $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends mbw >/dev/null
}

step "Packages and build"
.ci/install-packages
install_mbw
cmake --preset release >/dev/null
cmake --build --preset release --target grainclock scale_state scale_measure -j "$(nproc)"
bin=build/release/bin

# The original, under the name that ./run.sh gives it: scene, seed, what is recorded of it, and the format of states make the key.
step "States"
mkdir -p build/cache "$out"
scene=silo/scenes/table1-filled.toml
known=$(sed -n 's/^table1 1 //p' benchmarks/start-states.txt)
original=build/cache/table1-filled-$( (cat $scene; printf '%s, states 2\n' 1 "$known") | sha256sum | cut -c1-16).h5
if [ ! -e "$original" ]; then
  rm -rf "$original.work"
  $bin/grainclock run $scene --out "$original.work" --threads "$(nproc)" --set seed=1
  mv "$original.work/final.h5" "$original"
  rm -rf "$original.work"
fi
key=$( (echo "$original"; cd benchmarks/scale; cat packing.?pp scaled_silo.?pp settle.?pp make_state.cpp) | sha256sum | cut -c1-16)
states="" counts=""
for size in $sizes; do
  factor=${size%:*} balls=${size#*:}
  if [ "$factor" = 1 ]; then
    state=$original
  else
    state=build/cache/scale-$balls-$key.h5
    if [ ! -e "$state" ]; then
      $bin/scale_state "$original" "$factor" "$balls" "$state.part.h5" --threads "$(nproc)"
      mv "$state.part.h5" "$state"
    fi
  fi
  states="$states $state" counts="$counts $balls"
done

# Copies of as many bytes as a step of the uniform stepper touches (about 330 a ball); on two cores half of them on each.
# Taken before and after the timings. Rows: threads,balls,method and MiB copied per second, each both read and written.
measure_bandwidth() {
  for balls in $counts; do
    for n in $threads; do
      mib=$((balls * 330 / 2 / 1048576 / n + 1))
      for core in $(seq "$n"); do
        mbw -q -a -n $((500 / mib + 5)) -t0 "$mib" >"$out/mbw.$core.0" && mbw -q -a -n $((500 / mib + 5)) -t1 "$mib" >"$out/mbw.$core.1" &
      done
      wait
      cat "$out"/mbw.*.? | awk -v n="$n" -v balls="$balls" '/Method:/ {print n "," balls "," $3 "," $(NF - 1)}'
      rm -f "$out"/mbw.*.?
    done
  done
}

step "What the machine allows"
$bin/scale_measure limits --threads $threads >"$out/limits.csv"
echo "threads,balls,method,rate" >"$out/bandwidth.csv"
measure_bandwidth >>"$out/bandwidth.csv"

step "Speed, uniform"
$bin/scale_measure speed $states --method uniform --threads $threads >"$out/speed-uniform.csv"
step "Speed, multi-rate"
$bin/scale_measure speed $states --method multirate --threads 1 >"$out/speed-multirate.csv"

measure_bandwidth >>"$out/bandwidth.csv"

step "Memory and time to build"
$bin/scale_measure load $states >"$out/load.csv"
: >"$out/memory.csv"
for method in uniform multirate; do
  for state in $states; do
    $bin/scale_measure memory "$state" --method $method >"$out/one.csv"
    [ -s "$out/memory.csv" ] || head -n 1 "$out/one.csv" >"$out/memory.csv"
    tail -n 1 "$out/one.csv" >>"$out/memory.csv"
  done
done
rm "$out/one.csv"

step "Chart"
/usr/bin/python3 benchmarks/scale/charts.py "$out"
echo
echo "Done in $(($(date +%s) - began)) s: $out/scale.csv and $out/scale.png"
