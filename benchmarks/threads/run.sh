#!/bin/sh
# What a second thread is worth on the flowing Table 1 silo, uniform and selective steps, beside what two independent
# processes reach; and what a contact costs in selective steps. Table in out/threads; about a minute.
#   benchmarks/threads/run.sh [STATE.h5]     default: silo/scenes/table1-flow.h5, which ./run.sh makes
set -eu
cd "$(dirname "$0")/../.."
state=${1:-silo/scenes/table1-flow.h5}
[ -e "$state" ] || { echo "run.sh: $state is missing; ./run.sh makes it" >&2; exit 4; }
export GOMP_SPINCOUNT="${GOMP_SPINCOUNT:-20000}"
.ci/install-packages
cmake --preset release >/dev/null
cmake --build --preset release --target timed_steps -j "$(nproc)" >/dev/null
exec /usr/bin/python3 -B benchmarks/threads/threads.py build/release/bin/timed_steps "$state" out/threads
