#!/usr/bin/env bash
# check_symbols.sh OBJECT...: every symbol that the linker may merge with another object's (weak or unique) must bear the
# name of its own instruction set, isa_baseline, isa_v3 or isa_v4, as the object's folder does.
set -euo pipefail
command -v nm >/dev/null || { echo "skipped: nm is not there"; exit 77; }
status=0 checked=0
for object in "$@"; do
  isa=$(sed -E 's#.*_(baseline|v3|v4)\.dir/.*#isa_\1#' <<<"$object")
  while read -r name; do
    echo "$object: '$name' could serve another instruction set than $isa"
    status=1
  done < <(nm -C --defined-only "$object" | awk '$2 ~ /^[WVwvu]$/ { $1 = $2 = ""; print }' | grep -v "$isa" || true)
  checked=$((checked + $(nm --defined-only "$object" | wc -l)))
done
((checked > 0)) || { echo "no symbols at all: is '$1' an object?"; exit 1; }
exit "$status"
