#!/usr/bin/env bash
# run.sh PROGRAM TEMPLATES MODULES WORK: makes pages of runs, of a sweep and of an accuracy
# measurement, and tests them in a headless Chromium. TEMPLATES is the folder of the built pages,
# MODULES that of the npm packages of the build. Prints the reason and exits with 77, which skips
# the test, if Node.js, Chromium, the packages or the pages are missing.
set -euo pipefail
program=$1 templates=$2 modules=$3 work=$4
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

skip() {
  echo "skipped: $1"
  exit 77
}
[[ -f "$templates/page.html" ]] || skip "$templates/page.html: not built (Node.js, npm or its registry was missing)"
command -v node >/dev/null || skip "node: not found"
[[ -d "$modules/playwright-core" ]] || skip "$modules/playwright-core: missing, expected from the build of the pages"
[[ -n "${CHROMIUM:-}" ]] || command -v chromium >/dev/null || command -v chromium-headless-shell >/dev/null ||
  skip "chromium: not found"

rm -rf "$work"
mkdir -p "$work"
cd "$here/../.."
run() { # SCENE PLANNER LOG [OPTION...]; a run that does not reach its goal is not a failure here
  local code=0
  "$program" run "$1" --planner "$2" --log "$work/$3" --quiet "${@:4}" || code=$?
  ((code <= 1)) || exit "$code"
}
for planner in apf gyro hybrid; do
  run data/scenes/shelf.json "$planner" "shelf-$planner.jsonl.zst" --set /duration_s=5 --every 4
  run "data/scenes/paper_52_$planner.json" "$planner" "paper_52-$planner.jsonl"
done
run data/scenes/shelf_person.json hybrid person.jsonl.zst --every 4
run data/scenes/shelf_carry.json hybrid carry.jsonl.zst --every 4
"$program" report "$work/carry.jsonl.zst" -o "$work/carry.html"
run data/scenes/shelf_seen.json hybrid seen.jsonl.zst --set /duration_s=1 --every 4
"$program" report "$work/seen.jsonl.zst" -o "$work/seen.html"
run data/scenes/follow_shelf.json hybrid follow.jsonl.zst --set /duration_s=10 --every 4
"$program" report "$work/follow.jsonl.zst" -o "$work/follow.html"
"$program" report "$work/person.jsonl.zst" -o "$work/person.html"
"$program" report "$work"/shelf-{apf,gyro,hybrid}.jsonl.zst -o "$work/shelf.html"
"$program" report "$work"/paper_52-{apf,gyro,hybrid}.jsonl -o "$work/paper_52.html"
"$program" sweep plan data/scenes/paper_52_gyro.json data/scenes/paper_52_apf.json --vary /duration_s=2,20 \
  --vary /step_s=0.001,0.002 -o "$work/tries"
"$program" sweep run "$work/tries"
"$program" sweep merge "$work/tries" --page "$work/tries.html" --replay 1
"$program" sweep plan --gain-sets 4 --base data/scenes/paper_52_apf.json -o "$work/gains"
"$program" sweep run "$work/gains"
"$program" sweep merge "$work/gains" --page "$work/gains.html"
# A thousand made-up runs, half of them also as a second sweep.
node "$here/make_study.mjs" 1000 "$work/study"
node "$here/make_study.mjs" 500 "$work/half"
"$program" sweep compare "$work/study" "$work/half" --page "$work/study.html"
"$program" accuracy data/robots/planar3.json --integrators hamel-variational,gauss:8,gauss:12,rk4,dop853 \
  --steps 0.1,0.05,0.02 --rtol 1e-4,1e-8 --duration 1 --page "$work/accuracy.html"

export NODE_MODULES=$modules HAMELIN_TEMPLATES=$templates
HAMELIN_SWEEP_PAGES="$work/tries.html:$work/gains.html:$work/study.html" HAMELIN_ACCURACY_PAGE="$work/accuracy.html" node --test "$here/documents.test.mjs"
# Real runs. page.test.mjs adds made-up runs with what no scene in data/ has: obstacles that appear
# later, a prismatic joint.
HAMELIN_PAGES="$work/shelf.html:$work/paper_52.html:$work/person.html:$work/carry.html:$work/follow.html:$work/seen.html" HAMELIN_TEMPLATE=$templates/page.html node --test "$here/page.test.mjs"
