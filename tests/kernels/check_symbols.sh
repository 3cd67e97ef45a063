#!/usr/bin/env bash
# check_symbols.sh OBJECT...: every symbol that the linker may merge with one of another object
# (weak or unique) must contain the name of its instruction set (isa_baseline, isa_v3 or isa_v4),
# which is part of the name of the object's folder.
set -euo pipefail
command -v nm >/dev/null || { echo "skipped: nm not found"; exit 77; }
status=0 checked=0
for object in "$@"; do
  isa=$(sed -E 's#.*_(baseline|v3|v4)\.dir/.*#isa_\1#' <<<"$object")
  while read -r name; do
    echo "$object: '$name' could be used for another instruction set than $isa"
    status=1
  done < <(nm -C --defined-only "$object" | awk '$2 ~ /^[WVwvu]$/ { $1 = $2 = ""; print }' | grep -v "$isa" || true)
  checked=$((checked + $(nm --defined-only "$object" | wc -l)))
done
((checked > 0)) || { echo "$1: no symbols found, expected an object file"; exit 1; }
exit "$status"
