#!/bin/sh
# Line coverage of the fast tests: a table by folder, and build/coverage/lines.txt with the lines that no test reaches.
#   tests/coverage.sh         all fast tests
#   tests/coverage.sh REGEX   those whose names match, as ctest -R
set -eu
cd "$(dirname "$0")/.."
.ci/install-packages --checks
cmake --preset coverage >/dev/null
cmake --build --preset coverage
find build/coverage -name '*.gcda' -delete  # of earlier runs
ctest --test-dir build/coverage -L fast -R "${1:-.}" -j "$(nproc)" --no-tests=error --output-on-failure >build/coverage/ctest.log ||
  { tail -n 40 build/coverage/ctest.log >&2; exit 1; }

# -fprofile-update=atomic and gcovr see to it that threads, and the kernels' three copies, add up.
gcovr --root . --object-directory build/coverage --filter '(core|multirate|silo|benchmarks)/' \
  --json-summary build/coverage/summary.json --txt build/coverage/lines.txt
/usr/bin/python3 -B - build/coverage/summary.json <<'PYTHON'
import json, sys
folders = {}
for file in json.load(open(sys.argv[1]))["files"]:
    total = folders.setdefault(file["filename"].split("/")[0], [0, 0])
    total[0] += file["line_covered"]
    total[1] += file["line_total"]
print("folder        covered   lines   share")
for folder, (covered, lines) in sorted(folders.items()):
    print(f"{folder:12} {covered:8} {lines:7} {covered / lines:7.1%}")
PYTHON
echo "The lines that no test reaches: build/coverage/lines.txt"
