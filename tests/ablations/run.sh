#!/usr/bin/env bash
# Runs a planner with and without one part: run.sh HAMELIN PLANNER PARAMETER[=VALUE] DIRECTORY
set -euo pipefail
rm -rf "$4"  # the records of another build
exec "$1" bench run --planner "$2" --ablate "$3" --per-family 1 --expect-gain -o "$4"
