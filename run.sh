#!/bin/sh
# Installs what is missing, builds grainclock, makes the start states, runs the accuracy-versus-speed studies up to the
# paper's full silo, and leaves charts and an HTML report in out/report.
#   ./run.sh              everything on one start state (about twenty minutes on two cores)
#   ./run.sh --starts 5   the full silo from five start states, over five seconds of discharge as well (an hour more)
#   ./run.sh --quick      small scenes only (a minute or two, after the build)
#   ./run.sh --story      instead of studies the paper's whole story on its full silo, from filling to empty, and what is measured of it
#                         (twenty minutes on two cores; with --quick a small silo, a minute); notebooks/build.sh makes its pages
#   ./run.sh --threads N  for filling, story and pictures; studies compare methods on one core. Default: all cores
# A run that was stopped goes on where it was with --continue DIR, the directory that it named (for a story, with --story too).
set -eu
cd "$(dirname "$0")"

usage() { sed -n '2,10s/^# \{0,1\}//p' "$0"; }
fail() { echo "run.sh: $*; try --help" >&2; exit 2; }

# Threads that wait for each other give way soon, so that a busy machine slows a run down by no more than its share.
export GOMP_SPINCOUNT="${GOMP_SPINCOUNT:-20000}"

small="pair chain pile mini"
others="interfaces fines inclusion small-outlet gas printed table1-printed stability mini-statistics table1-crosscheck" main=table1-flow
seeds=1 threads=$(nproc) out="" story=""
while [ $# -gt 0 ]; do
  case "$1" in
    --quick) small="pair chain pile" others="" main=mini ;;
    --starts)
      [ "${2:-}" = 1 ] || [ "${2:-}" = 5 ] || fail "--starts takes 1 or 5"
      [ "$2" = 1 ] || { main=table1-flow-starts seeds="1 2 3 4 5" others="$others table1-statistics"; }
      shift ;;
    --story) story=1 ;;
    --threads)
      case "${2:-}" in "" | *[!0-9]* | 0*) fail "--threads takes a number above 0" ;; esac
      threads=$2
      shift ;;
    --continue)
      [ -d "${2:-}" ] || fail "--continue takes the directory of the run that was stopped"
      out=$2
      shift ;;
    --help | -h) usage; exit 0 ;;
    *) fail "unknown option '$1'" ;;
  esac
  shift
done

[ -z "$story" ] || [ "$main" != table1-flow-starts ] || fail "--story has one start: leave out --starts"

# Steps with the minutes they take on two cores, for the estimate of the remaining time only.
count() { echo "$*" | wc -w; }
minutes_of() { case "$1" in table1-flow*) echo $((6 * $(count $seeds))) ;; table1-printed) echo 2 ;; *) echo 1 ;; esac; }
left=3
for study in $small $others $main; do left=$((left + $(minutes_of "$study"))); done
[ -z "$story" ] || left=20
[ -z "$story" ] || [ "$main" != mini ] || left=3
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

if [ -n "$story" ]; then
  scene=silo/scenes/table1-story.toml
  [ "$main" != mini ] || scene=silo/scenes/mini.toml
  [ -n "$out" ] || out=out/story-$(date +%Y%m%d-%H%M%S)
  step 13 "Story: $scene, into $out (should this be stopped, go on with --story --continue $out)"
  if [ ! -e "$out" ]; then
    # What is measured of a story asks for stable steps, not for exact trajectories: plain uniform ones take the least time then.
    "$program" run "$scene" --out "$out" --threads "$threads" \
      --set 'stepping.method="uniform"' --set stepping.events=false --set stepping.step=8e-5
  elif [ ! -e "$out/final.h5" ]; then
    "$program" resume "$out" --threads "$threads"
  fi
  step 5 "Measures"
  if [ ! -e "$out/measures.h5" ] || [ "$out/run.h5" -nt "$out/measures.h5" ]; then
    "$program" measure "$out" --threads "$threads"
  fi
  echo
  echo "Done in $(($(date +%s) - began)) s. Now notebooks/build.sh $out makes pages of it, beside the paper's figures."
  exit 0
fi

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
start_state() {  # start_state NAME SEED: the flowing silo beside its scene
  name=$1 seed=$2
  known=$(sed -n "s/^$name $seed //p" benchmarks/start-states.txt)
  # Filling and opening are kept apart, so that either can be used again; a key names all that a state comes from, and what
  # is recorded of it: where rounding has changed since, the record has too.
  filled=build/cache/$name-filled-$(key silo/scenes/$name-filled.toml "$seed" "$known").h5
  cached=build/cache/$name-flow-$(key silo/scenes/$name-filled.toml silo/scenes/$name-open.toml "$seed" "$known").h5
  if [ ! -e "$cached" ]; then
    [ -e "$filled" ] || make_state "$filled" silo/scenes/$name-filled.toml --set "seed=$seed"
    make_state "$cached" silo/scenes/$name-open.toml --set "initial.state=\"$filled\""
  fi
  # The same scene gives the same state to the bit; another compiler or mathematics library may not.
  sum=$("$program" info "$cached" | sed -n 's/^checksum: //p')
  if [ -z "$known" ] || [ "$sum" = "$known" ]; then
    echo "start state $name, seed $seed: checksum $sum${known:+, as recorded}"
  else
    echo "start state $name, seed $seed: checksum $sum, recorded is $known: figures may differ a little from the README's"
  fi
  beside=silo/scenes/$name-flow.h5
  [ "$seed" = 1 ] || beside=silo/scenes/$name-flow-seed$seed.h5
  cp "$cached" "$beside.part"
  mv "$beside.part" "$beside"
}

[ -n "$out" ] || out=out/$main-$(date +%Y%m%d-%H%M%S)
mkdir -p build/cache "$out"
echo "Results go to $out; should this be stopped, go on with --continue $out"

step 1 "Start states"
start_state mini 1
case "$others" in *mini-statistics*) for seed in 2 3; do start_state mini $seed; done ;; esac
case "$main" in table1*) for seed in $seeds; do start_state table1 $seed; done ;; esac
case "$others" in *fines*) benchmarks/scenes/make_starts.sh "$program" >"$out/starts.log" ;; esac

studies=""
for study in $main $small $others; do
  step "$(minutes_of $study)" "Study: benchmarks/$study.toml"
  jobs=1  # one at a time where clocks are compared
  [ "$study" != stability ] || jobs=$(nproc)
  "$program" study "benchmarks/$study.toml" --out "$out/$study" --jobs "$jobs"
  studies="$studies${studies:+:}$out/$study"
done

step 0 "Pictures and report"
flow=silo/scenes/${main%-starts}.toml
[ "$main" != mini ] || flow=silo/scenes/mini-flow.toml
rm -rf "$out/flow"
"$program" run "$flow" --out "$out/flow" --threads "$threads"
mkdir -p out/report
GRAINCLOCK_STUDIES=$studies GRAINCLOCK_RUN=$out/flow/run.h5 PYDEVD_DISABLE_FILE_VALIDATION=1 \
  /usr/bin/python3 -m nbconvert --to html --execute --no-input --HTMLExporter.mathjax_url= --HTMLExporter.require_js_url= \
  --log-level WARN --output-dir out/report --output report notebooks/accuracy_versus_speed.ipynb
cp "$out/$main/study.csv" "$out/$main/study.h5" "$out/$main"/*.png out/report/

echo
echo "Done in $(($(date +%s) - began)) s. Open out/report/report.html; the main chart is out/report/accuracy.png,"
echo "the numbers are in out/report/study.csv, all of it in $out."
