#!/usr/bin/env bash
# run.sh PROGRAM TEMPLATE WORK: makes pages of runs, of a sweep and of a measurement of accuracy, and drives them in a
# headless Chromium.
# Exit code 77 where Node.js, Chromium or the page is missing: the test is skipped then, and says why.
set -euo pipefail
program=$1 template=$2 work=$3
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source=$(cd "$here/../.." && pwd)

skip() {
  echo "skipped: $1"
  exit 77
}
[[ -f "$template" ]] || skip "the page was not built (Node.js with npm was missing, or the registry)"
command -v npm >/dev/null || skip "npm is missing"
[[ -n "${CHROMIUM:-}" ]] || command -v chromium >/dev/null || command -v chromium-headless-shell >/dev/null ||
  skip "Chromium is missing"

rm -rf "$work/tries"
mkdir -p "$work"
cp "$source"/libs/report/page/{package.json,package-lock.json,.npmrc} "$work"
(cd "$work" && npm ci --ignore-scripts --no-audit --no-fund >npm.log 2>&1) || skip "npm cannot fetch playwright-core: $(tail -n 1 "$work/npm.log")"

cd "$source"
run() { # SCENE PLANNER LOG; a planner that does not arrive is no failure here
  local code=0
  "$program" run "$1" --planner "$2" --log "$work/$3" --quiet || code=$?
  ((code <= 1)) || exit "$code"
}
for planner in apf gyro hybrid; do
  run data/scenes/shelf.json "$planner" "shelf-$planner.jsonl.zst"
  run "data/scenes/paper_52_$planner.json" "$planner" "paper_52-$planner.jsonl"
done
"$program" report "$work"/shelf-{apf,gyro,hybrid}.jsonl.zst -o "$work/shelf.html"
"$program" report "$work"/paper_52-{apf,gyro,hybrid}.jsonl -o "$work/paper_52.html"
"$program" sweep plan data/scenes/paper_52_gyro.json data/scenes/paper_52_apf.json -o "$work/tries"
"$program" sweep run "$work/tries"
"$program" sweep merge "$work/tries" --page "$work/tries.html"
"$program" accuracy data/robots/planar3.json --integrators hamel-variational,gauss:8,gauss:12,rk4,dop853 \
  --steps 0.1,0.05,0.02 --rtol 1e-4,1e-8 --duration 1 --page "$work/accuracy.html"
templates=$(dirname "$template")
HAMELIN_SWEEP_PAGE="$work/tries.html" HAMELIN_ACCURACY_PAGE="$work/accuracy.html" HAMELIN_TEMPLATES="$templates" \
  NODE_MODULES="$work/node_modules" node --test "$here/documents.test.mjs"
# Real runs, and made-up ones for what no scene in data/ has: obstacles that move or come late, a prismatic joint.
export HAMELIN_PAGES="$work/shelf.html:$work/paper_52.html" HAMELIN_TEMPLATE=$template HAMELIN_FIXTURES=one,planar
NODE_MODULES="$work/node_modules" node --test "$here/page.test.mjs"
