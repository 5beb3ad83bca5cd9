#!/bin/sh
# Runs an ensemble of silos over seeds and variants on all cores, one thread each, and makes a page of it: envelopes over seeds,
# selective against uniform steps, one radius, a smoother wall. Stopped, the same call goes on.
#   benchmarks/ensemble/run.sh              the paper's silo: out/ensemble/ensemble.html (an hour of two cores)
#   benchmarks/ensemble/run.sh --quick      a silo of 500 balls: out/ensemble-quick/ensemble.html (a minute)
#   benchmarks/ensemble/run.sh --jobs N     runs at once; default: all cores
#   benchmarks/ensemble/run.sh --page       only the page, of the members that are done
#   benchmarks/ensemble/run.sh --out DIR    another directory
# GRAINCLOCK_PROGRAM names a grainclock that is built already; without, it is built here.
set -eu
fail() { echo "run.sh: $*; try --help" >&2; exit 2; }

name=table1 out="" jobs=$(nproc) only_page=""
while [ $# -gt 0 ]; do
  case "$1" in
    --quick) name=mini ;;
    --page) only_page=yes ;;
    --jobs)
      case "${2:-}" in "" | *[!0-9]* | 0*) fail "--jobs takes a number above 0" ;; esac
      jobs=$2
      shift ;;
    --out)
      [ -n "${2:-}" ] || fail "--out takes a directory"
      out=$2
      shift ;;
    --help | -h) sed -n '2,9s/^# \{0,1\}//p' "$0"; exit 0 ;;
    *) fail "unknown option '$1'" ;;
  esac
  shift
done
if [ -z "$out" ]; then
  out=$(dirname "$0")/../../out/ensemble
  [ "$name" = table1 ] || out=$out-quick
fi
mkdir -p "$out" || exit 4
# From here on paths start at the repository.
out=$(realpath "$out")
program=${GRAINCLOCK_PROGRAM:+$(realpath "$GRAINCLOCK_PROGRAM")}
cd "$(dirname "$0")/../.."

if [ -z "$only_page" ]; then
  if [ -z "$program" ]; then
    .ci/install-packages
    cmake --preset release >/dev/null
    cmake --build --preset release --target grainclock -j "$(nproc)"
    program=build/release/bin/grainclock
  fi
  /usr/bin/python3 -B benchmarks/ensemble/ensemble.py "benchmarks/ensemble/$name.toml" --out "$out" --program "$program" --jobs "$jobs"
fi

echo "Drawing"
GRAINCLOCK_ENSEMBLE=$out PYDEVD_DISABLE_FILE_VALIDATION=1 \
  /usr/bin/python3 -B -m nbconvert --to html --execute --no-input --TemplateExporter.extra_template_basedirs=notebooks --template page \
  --HTMLExporter.mathjax_url= --HTMLExporter.require_js_url= --ExecutePreprocessor.startup_timeout=600 --log-level WARN \
  --output-dir "$out" notebooks/ensemble.ipynb
sed -i '/<nav class="index">/d' "$out/ensemble.html"  # notebooks/build.sh makes an index
echo "Done: open $out/ensemble.html"
