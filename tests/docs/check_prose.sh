#!/bin/bash
# check_prose.sh SOURCE_DIR: no text uses an expression of words_not_used.txt, and documents are at most 100 columns
# wide, except for tables and words that cannot be broken.
set -u
export LC_ALL=C.UTF-8
cd "$1" || exit 1
list=tests/docs/words_not_used.txt
roots=(README.md CONTRIBUTING.md CHANGELOG.md CMakeLists.txt dev apps cmake docs libs plugins tests data)
texts=(--include='*.md' --include='*.cpp' --include='*.hpp' --include='*.h' --include='*.js' --include='*.html'
  --include='*.json' --include='*.sh' --include='*.cmake' --include='CMakeLists.txt' --include='*.txt' --include='dev'
  --exclude-dir=corpus --exclude-dir=node_modules --exclude=words_not_used.txt)
failed=0
rules=0
while IFS=$'\t' read -r expression instead; do
  [[ -z $expression || $expression == '#'* ]] && continue
  rules=$((rules + 1))
  if found=$(grep -rnEw "${texts[@]}" -e "$expression" "${roots[@]}"); then
    sed "s|\$|    [instead: $instead]|" <<<"$found"
    failed=1
  fi
done <"$list"
if wide=$(grep -rnE '^.{101,}$' --include='*.md' "${roots[@]}" | grep -vE '^[^:]+:[0-9]+: *\||[^ ]{80}'); then
  sed -E 's/^([^:]+:[0-9]+):.*/\1: wider than 100 columns/' <<<"$wide"
  failed=1
fi
echo "$rules expressions are not used"
[ "$rules" -gt 0 ] && [ "$failed" -eq 0 ]
