#!/usr/bin/env bash
# run.sh HAMELIN_COST: counts the instructions per call of the library with unused features and of
# code without them; fails if the library needs more than 0.5 % more. The difference of two runs
# excludes the start of the program.
set -euo pipefail
program=$1
few=200 many=1200
command -v valgrind >/dev/null || { echo "valgrind not found: skipped"; exit 77; }
export HAMELIN_ISA=x86-64 # valgrind does not support AVX-512

instructions() {
  valgrind --tool=cachegrind --cache-sim=no --cachegrind-out-file=/dev/null "$program" "$@" 2>&1 |
    sed -n 's/.*I *refs: *\([0-9,]*\)/\1/p' | tr -d ,
}
each() { echo $((($(instructions "$1" "$2" $many) - $(instructions "$1" "$2" $few)) / (many - few))); }

status=0
printf '%-20s %12s %12s %9s\n' "instructions/call" library without ratio
for case in $("$program" list); do
  with=$(each "$case" library)
  without=$(each "$case" without)
  verdict=$(awk -v a="$with" -v b="$without" 'BEGIN { printf "%.4f%s", a / b, a <= 1.005 * b ? "" : "  more than 0.5 %" }')
  printf '%-20s %12d %12d %9s\n' "$case" "$with" "$without" "$verdict"
  [[ $verdict != *more* ]] || status=1
done
exit $status
