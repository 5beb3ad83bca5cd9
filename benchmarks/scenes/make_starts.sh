#!/bin/sh
# Makes the start states of fines, inclusion, gas and small-outlet beside their scenes; the studies of the same names need
# them. A minute or so.
#   benchmarks/scenes/make_starts.sh PROGRAM    PROGRAM: grainclock as built (default: build/release/bin/grainclock)
set -eu
program=$(realpath "${1:-build/release/bin/grainclock}")
cd "$(dirname "$0")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

state_of() { /usr/bin/python3 -B make_states.py "$1"; }
settle() {  # settle SCENE START END [OPTION...]: runs SCENE from START and keeps the last state as END
  scene=$1 start=$2 end=$3
  shift 3
  rm -rf "$work/run"
  "$program" run "$scene" --out "$work/run" --set "initial.state=\"$start\"" --set stepping.method=\"uniform\" "$@"
  mv "$work/run/final.h5" "$end"
}

state_of gas >"$work/gas.csv"
settle gas.toml "$work/gas.csv" gas.h5 --set phase.0.duration=0.016 --set stepping.step=1e-4

state_of stream >"$work/stream.csv"
settle inclusion.toml "$work/stream.csv" inclusion.h5 --set phase.0.duration=0.256 --set stepping.step=1e-4

state_of box >"$work/box.csv"
settle fines-settle.toml "$work/box.csv" "$work/packing.h5"
"$program" export "$work/packing.h5" --to csv --output "$work/packing.csv"
state_of fines <"$work/packing.csv" >"$work/fines.csv"
settle fines.toml "$work/fines.csv" fines.h5 --set phase.0.duration=0.128 --set stepping.step=2e-5

"$program" run small-outlet-filled.toml --out "$work/filled"
settle small-outlet-open.toml "$work/filled/final.h5" small-outlet.h5

for scene in gas inclusion fines small-outlet; do
  echo "$scene: $("$program" info "$scene.h5" | grep '^checksum')"
done
