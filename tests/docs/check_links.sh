#!/bin/bash
# check_links.sh SOURCE_DIR: every relative link of the documentation must lead to a file or folder.
set -u
cd "$1" || exit 1
shopt -s nullglob globstar
pages=(README.md CONTRIBUTING.md CHANGELOG.md docs/**/*.md libs/*/README.md plugins/*/README.md tests/**/README.md)
checked=0
broken=0
for page in "${pages[@]}"; do
  # Code blocks hold no links; of a link only the path counts, without #section and "title".
  while IFS= read -r target; do
    target=${target%%#*}
    target=${target%% *}
    case $target in "" | *://* | mailto:*) continue ;; esac
    checked=$((checked + 1))
    if [ ! -e "$(dirname "$page")/$target" ]; then
      echo "$page: no '$target'"
      broken=$((broken + 1))
    fi
  done < <(awk '/^ *```/ {code = !code; next} !code' "$page" | grep -oE '\]\([^)]+\)' | sed -E 's/^\]\(//; s/\)$//')
done
echo "${#pages[@]} pages, $checked relative links, $broken broken"
[ "$checked" -gt 0 ] && [ "$broken" -eq 0 ]
