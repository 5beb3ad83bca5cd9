#!/bin/sh
# Makes the page that sets a silo's run beside the paper's figures: measures the run where that is missing or older than the run,
# executes notebooks/silo_story.ipynb, and says where the page is.
#   notebooks/build.sh RUN              a directory of `grainclock run`, or run.h5 there; page and measures beside it
#   notebooks/build.sh RUN --out DIR    the page goes to DIR/silo_story.html
#   notebooks/build.sh RUN --threads N  for measuring; default: all cores
# GRAINCLOCK_PROGRAM names a grainclock that is built already; without, it is built here.
set -eu
fail() { echo "build.sh: $*; try --help" >&2; exit 2; }

run="" out="" threads=$(nproc)
while [ $# -gt 0 ]; do
  case "$1" in
    --out)
      [ -n "${2:-}" ] || fail "--out takes a directory"
      out=$2
      shift ;;
    --threads)
      case "${2:-}" in "" | *[!0-9]* | 0*) fail "--threads takes a number above 0" ;; esac
      threads=$2
      shift ;;
    --help | -h) sed -n '2,7s/^# \{0,1\}//p' "$0"; exit 0 ;;
    -*) fail "unknown option '$1'" ;;
    *)
      [ -z "$run" ] || fail "one RUN, not '$run' and '$1'"
      run=$1 ;;
  esac
  shift
done
[ -n "$run" ] || fail "no RUN named"
[ ! -d "$run" ] || run=$run/run.h5
[ -f "$run" ] || fail "there is no $run"
[ -n "$out" ] || out=$(dirname "$run")
mkdir -p "$out" || exit 4
# From here on paths start at the repository.
run=$(realpath "$run") out=$(realpath "$out")
[ -z "${GRAINCLOCK_PROGRAM:-}" ] || GRAINCLOCK_PROGRAM=$(realpath "$GRAINCLOCK_PROGRAM")
cd "$(dirname "$0")/.."

measures=$(dirname "$run")/measures.h5
if [ ! -e "$measures" ] || [ "$run" -nt "$measures" ]; then
  program=${GRAINCLOCK_PROGRAM:-}
  if [ -z "$program" ]; then
    .ci/install-packages
    cmake --preset release >/dev/null
    cmake --build --preset release --target grainclock -j "$(nproc)"
    program=build/release/bin/grainclock
  fi
  echo "Measuring $run"
  "$program" measure "$run" --threads "$threads" --output "$measures"
fi

echo "Drawing"
GRAINCLOCK_RUN=$run GRAINCLOCK_MEASURES=$measures PYDEVD_DISABLE_FILE_VALIDATION=1 \
  /usr/bin/python3 -B -m nbconvert --to html --execute --no-input --HTMLExporter.mathjax_url= --HTMLExporter.require_js_url= \
  --log-level WARN --output-dir "$out" --output silo_story notebooks/silo_story.ipynb
echo "Done: open $out/silo_story.html"
