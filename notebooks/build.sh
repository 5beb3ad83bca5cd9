#!/bin/sh
# Makes pages of the notebooks beside this script, and an index.html that links them: measures a silo's run where that is missing or older
# than the run, executes every notebook whose data are there, and says where the pages are.
#   notebooks/build.sh                  of the newest run of `./run.sh --story`
#   notebooks/build.sh RUN              of a directory of `grainclock run`, or run.h5 there
#   notebooks/build.sh RUN --out DIR    where the pages go; default: `pages` beside the run
#   notebooks/build.sh RUN --threads N  for measuring; default: all cores
#   notebooks/build.sh RUN --store      keeps the outputs in the notebooks too, for those who read them without running anything
# A notebook's data are there when every GRAINCLOCK_... that it names is set: GRAINCLOCK_STUDIES for the accuracy of methods.
# GRAINCLOCK_PROGRAM names a grainclock that is built already; without, it is built here.
set -eu
fail() { echo "build.sh: $*; try --help" >&2; exit 2; }

run="" out="" store="" threads=$(nproc)
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
    --store) store=1 ;;
    --help | -h) sed -n '2,10s/^# \{0,1\}//p' "$0"; exit 0 ;;
    -*) fail "unknown option '$1'" ;;
    *)
      [ -z "$run" ] || fail "one RUN, not '$run' and '$1'"
      run=$1 ;;
  esac
  shift
done
here=$(realpath "$(dirname "$0")")
[ -n "$run" ] || run=$(ls -td "$here"/../out/story-*/run.h5 2>/dev/null | head -n 1)
[ -n "$run" ] || fail "no RUN named, and ./run.sh --story has not left one in out"
[ ! -d "$run" ] || run=$run/run.h5
[ -f "$run" ] || fail "there is no $run"
[ -n "$out" ] || out=$(dirname "$run")/pages
mkdir -p "$out" || exit 4
# From here on paths start at the repository.
# Links are kept: measures go beside the run as it is named.
run=$(realpath -s "$run") out=$(realpath "$out")
[ -z "${GRAINCLOCK_PROGRAM:-}" ] || GRAINCLOCK_PROGRAM=$(realpath "$GRAINCLOCK_PROGRAM")
cd "$here/.."

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
export GRAINCLOCK_RUN="$run" GRAINCLOCK_MEASURES="$measures" PYDEVD_DISABLE_FILE_VALIDATION=1

has_data() {  # has_data NOTEBOOK: whether all that it names is set
  for name in $(grep -o 'GRAINCLOCK_[A-Z]*' "$1" | sort -u); do
    eval "[ -n \"\${$name:-}\" ]" || { echo "No page of $(basename "$1"): $name is not set"; return 1; }
  done
}
chosen=""
for notebook in notebooks/*.ipynb; do
  if has_data "$notebook"; then chosen="$chosen $notebook"; fi
done

convert() { /usr/bin/python3 -B -m nbconvert --log-level WARN "$@"; }
echo "Drawing$(for notebook in $chosen; do printf ' %s' "$(basename "$notebook" .ipynb)"; done)"
executed=$(mktemp -d)
trap 'rm -rf "$executed"' EXIT
# Times of execution and the like are left out: the same run gives the same notebooks.
convert --to notebook --execute --ClearMetadataPreprocessor.enabled=True --ClearMetadataPreprocessor.preserve_nb_metadata_mask=kernelspec \
  --output-dir "$executed" $chosen
convert --to html --no-input --TemplateExporter.extra_template_basedirs=notebooks --template page \
  --HTMLExporter.mathjax_url= --HTMLExporter.require_js_url= --output-dir "$out" "$executed"/*.ipynb
for notebook in $chosen; do
  name=$(basename "$notebook" .ipynb)
  sed -i "s|href=\"$name.ipynb\"|href=\"$name.html\"|g" "$out/index.html"
  [ -z "$store" ] || cp "$executed/$name.ipynb" "$notebook"
done
echo "Done: open $out/index.html"
