#!/usr/bin/env bash
# run.sh [TARGET|all] [EXECUTIONS] [BUILD_FOLDER]: long fuzzing runs outside CI. See README.md.
set -euo pipefail
source=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../..")
target=${1:-all}
executions=${2:-500000}
build=${3:-$source/build/fuzz}
targets=(maps scene robot spheres urdf srdf log primitives waypoints target_line c_interface)
[[ $target == all ]] || targets=("$target")

export CC=clang CXX=clang++
if command -v ccache >/dev/null; then export CMAKE_CXX_COMPILER_LAUNCHER=ccache; fi
cmake -S "$source" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo \
  -DHAMELIN_BUILD_TESTS=ON -DHAMELIN_BUILD_FUZZ=ON \
  -DHAMELIN_SANITIZE='fuzzer-no-link;address;undefined' >/dev/null
cmake --build "$build" --target "${targets[@]/#/hamelin_fuzz_}" hamelin_fuzz_replay hamelin_c_calls

# AddressSanitizer keeps freed memory to detect its use. Small quarantines keep executions fast.
export ASAN_OPTIONS=quarantine_size_mb=1:thread_local_quarantine_size_kb=64:malloc_context_size=4
status=0
for name in "${targets[@]}"; do
  found=$build/fuzz/found/$name
  work=$build/fuzz/work/$name
  mkdir -p "$found" "$work"
  dictionary=()
  [[ -f $source/tests/fuzz/$name.dict ]] && dictionary=(-dict="$source/tests/fuzz/$name.dict")
  echo "$name: $executions executions; findings go to $found"
  # The files in FUZZ_SEEDS/<target>/ are additional seeds.
  seeds=("$source/tests/fuzz/corpus/$name")
  [[ -d ${FUZZ_SEEDS:-/nowhere}/$name ]] && seeds+=("$FUZZ_SEEDS/$name")
  nice -n 10 "$build/bin/hamelin_fuzz_$name" -runs="$executions" -timeout=1 -rss_limit_mb=1024 \
    -max_len=2000 -print_final_stats=1 -artifact_prefix="$found/" "${dictionary[@]}" "$work" \
    "${seeds[@]}" >"$work.log" 2>&1 || status=$?
  grep -aE 'check failed|runtime error|ERROR|SUMMARY|Test unit written|DONE|number_of_exec|average_exec' \
    "$work.log" || true
done
exit "$status"
