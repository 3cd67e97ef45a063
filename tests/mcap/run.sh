#!/usr/bin/env bash
# run.sh PROGRAM TEMPLATES MODULES WORK: exports the logs of several runs as MCAP files and tests
# them. TEMPLATES is the folder of the built pages, MODULES that of the npm packages of the build.
# Prints the reason and exits with 77, which skips the test, if Node.js, the packages or the pages
# are missing.
set -euo pipefail
program=$1 templates=$2 modules=$3 work=$4
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

skip() {
  echo "skipped: $1"
  exit 77
}
[[ -f "$templates/page.html" ]] || skip "$templates/page.html: not built (Node.js, npm or its registry was missing)"
command -v node >/dev/null || skip "node: not found"
[[ -d "$modules/@mcap/core" ]] || skip "$modules/@mcap/core: missing, expected from the build of the pages"

rm -rf "$work"
mkdir -p "$work"
cd "$here/../.."
export_run() { # NAME SCENE PLANNER EXPORT_OPTIONS [RUN_OPTION...]; a run need not reach its goal
  local code=0 log="$work/$1.jsonl"
  "$program" run "data/scenes/$2.json" --planner "$3" --log "$log" --quiet "${@:5}" || code=$?
  ((code <= 1)) || exit "$code"
  # shellcheck disable=SC2086  # several options
  "$program" export "$log" --format mcap $4 -o "$work/$1.mcap"
  # The report gives the geometry of the robot and the places of obstacles by another route.
  "$program" report "$log" -o "$work/$1.html"
}
export_run shelf shelf hybrid "" --set /duration_s=2
export_run person shelf_person hybrid "--rate 50" --set /duration_s=6 --every 4
export_run carry shelf_carry hybrid "" --every 20
export_run follow follow hybrid "--rate 100" --set /duration_s=3
export_run planar paper_52_hybrid hybrid "" --set /duration_s=0.5
export_run drawing clutter mppi "--rate 20" --set /duration_s=0.5 --set /planner/params/record_rollouts=3

NODE_MODULES=$modules HAMELIN_RUNS=$work node --test "$here/mcap.test.mjs"
