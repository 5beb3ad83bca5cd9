#!/bin/sh
# grainclock beside LAMMPS, LIGGGHTS and YADE: the same state, the same law, in turns on this machine. Installs the peers
# from Debian if they are missing, builds grainclock twice (its best kernels; the generic target that Debian builds for),
# makes the start states if ./run.sh has not, and leaves tables and charts in out/peers.
#   benchmarks/peers/run.sh                  the paper's silo (about 25 minutes on two idle cores, after the builds)
#   benchmarks/peers/run.sh --quick          a silo of 500 balls (a minute)
#   benchmarks/peers/run.sh --threads "1 2"  numbers of cores for ball-steps per second
#   benchmarks/peers/run.sh --out DIR        another place for the results
set -eu
cd "$(dirname "$0")/../.."

usage() { sed -n '2,8s/^# \{0,1\}//p' "$0"; }
fail() { echo "run.sh: $*; try --help" >&2; exit 2; }

scene=table1 quick="" threads="1 2" out=out/peers
while [ $# -gt 0 ]; do
  case "$1" in
    --quick) scene=mini quick=--quick ;;
    --threads)
      case "${2:-}" in "" | *[!0-9\ ]*) fail "--threads takes numbers, as in \"1 2\"" ;; esac
      threads=$2
      shift ;;
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

# The peers are too big to be asked of everyone who builds grainclock, so that they are not in .ci/install-packages.
install_peers() {
  packages="lammps liggghts yade openmpi-bin"
  missing=""
  for package in $packages; do
    status=$(dpkg-query -W -f='${Status}' "$package" 2>/dev/null || true)
    [ "$status" = "install ok installed" ] || missing="$missing $package"
  done
  [ -n "$missing" ] || return 0
  as_root=""
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || {
      echo "run.sh: missing:$missing. Have an administrator run: apt-get install --no-install-recommends$missing" >&2
      exit 1
    }
    as_root="sudo"
  fi
  echo "Installing:$missing"
  $as_root apt-get update -qq
  $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
}

build() {
  cmake --preset release >/dev/null
  cmake --build --preset release --target grainclock uniform_speed -j "$(nproc)"
  # For a processor that CMake does not know, only the kernels that run on any are built.
  cmake -S . -B build/generic -G Ninja -DCMAKE_BUILD_TYPE=Release -DGRAINCLOCK_TESTS=OFF \
    -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=generic >/dev/null
  cmake --build build/generic --target grainclock uniform_speed -j "$(nproc)"
}

make_state() {  # make_state FILE SCENE [OPTION...]: runs the scene and keeps its final state
  made=$1 from=$2
  shift 2
  echo "Making $made (./run.sh would have left it)"
  rm -rf "$made.work"
  build/release/bin/grainclock run "$from" --out "$made.work" --threads "$(nproc)" "$@" >/dev/null
  mv "$made.work/final.h5" "$made"
  rm -rf "$made.work"
}

.ci/install-packages
install_peers
build
mkdir -p build/cache
filled=$(ls -t build/cache/$scene-filled-*.h5 2>/dev/null | head -n 1)
if [ -z "$filled" ]; then
  filled=build/cache/$scene-filled-peers.h5
  make_state "$filled" silo/scenes/$scene-filled.toml
fi
flowing=silo/scenes/$scene-flow.h5
[ -e "$flowing" ] || make_state "$flowing" silo/scenes/$scene-open.toml --set "initial.state=\"$PWD/$filled\""

exec /usr/bin/python3 -B benchmarks/peers/peers.py --default build/release --generic build/generic --filled "$filled" \
  --flowing "$flowing" --scene silo/scenes/$scene-flow.toml --study benchmarks/peers/$scene-flow.toml --out "$out" \
  --threads "$threads" $quick
