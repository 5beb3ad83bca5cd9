#!/bin/sh
# Whether builds agree to the bit: release, debug and, where clang++ is there, clang's. Each of them fills a small silo and
# lets it flow by every method; what differs is shown with how far balls are apart. Exit code 1 if anything differs.
set -eu
cd "$(dirname "$0")/.."
case "${1:-}" in -*) sed -n '2,3s/^# \{0,1\}//p' "$0"; exit 0 ;; esac

build() {  # name, options...
  name=$1
  shift
  cmake -S . -B "build/agreement/$name" -G Ninja -DGRAINCLOCK_TESTS=OFF "$@" >/dev/null
  cmake --build "build/agreement/$name" --target grainclock >/dev/null
  builds="$builds $name"
}
builds=""
build release -DCMAKE_BUILD_TYPE=Release
build debug -DCMAKE_BUILD_TYPE=Debug
! command -v clang++ >/dev/null || build clang -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_C_COMPILER=clang

out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
grainclock() { build=$1; shift; "build/agreement/$build/bin/grainclock" "$@"; }
sum_of() { grainclock release info "$1" --json | sed -n 's/.*"checksum": "\([0-9a-f]*\)".*/\1/p'; }

different=0
compare() {  # name of the case: the runs $out/NAME-BUILD
  wanted=$(sum_of "$out/$1-release/final.h5")
  [ -n "$wanted" ]
  for b in $builds; do
    if [ "$(sum_of "$out/$1-$b/final.h5")" = "$wanted" ]; then echo "$1, $b: $wanted"; continue; fi
    different=1
    echo "$1, $b: differs from release"
    grainclock release compare "$out/$1-$b/final.h5" "$out/$1-release/final.h5" | sed 's/^/    /'
  done
}

for b in $builds; do
  grainclock "$b" run silo/scenes/mini-filled.toml --out "$out/fill-$b" --set phase.0.duration=1.0 --set phase.1.duration=0.3 >/dev/null
done
compare fill

flow() {  # name, keys...
  name=$1
  shift
  set -- $(printf ' --set stepping.%s' "$@")
  for b in $builds; do
    grainclock "$b" run silo/scenes/mini-flow.toml --out "$out/$name-$b" --set "initial.state='$out/fill-release/final.h5'" \
      --set phase.0.duration=0.1 "$@" >/dev/null
  done
  compare "$name"
}
uniform="method='uniform' step=5e-5"
multirate="method='multirate' step=2.5e-4"
flow uniform-lagged $uniform integrator="'lagged'" events=false
flow uniform-predicted $uniform events=false
flow uniform-pece $uniform integrator="'pece'" events=false
flow uniform-events $uniform events=true
for dashpot in relaxed pairwise solve; do flow "uniform-$dashpot" $uniform "dashpot='$dashpot'" events=false; done
for interface in accumulate extrapolate; do flow "$interface" $multirate "interface='$interface'" events=true; done
for interface in impulse frozen; do flow "$interface" $multirate "interface='$interface'" events=false; done
exit $different
