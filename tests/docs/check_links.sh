#!/bin/bash
# check_links.sh SOURCE_DIR: every relative link of the documentation must lead to a file or folder, and its #anchor to
# a heading there.
set -u
export LC_ALL=C.UTF-8
cd "$1" || exit 1
shopt -s nullglob globstar
pages=(README.md CONTRIBUTING.md CHANGELOG.md data/README.md examples/README.md docs/**/*.md libs/**/README.md plugins/*/README.md
  tests/**/README.md)

# Text outside of code blocks.
prose() { awk '/^ *```/ {code = !code; next} !code' "$1"; }

# The anchors that a page's headings have when it is rendered: lower case, no punctuation, hyphens for spaces.
anchors() { prose "$1" | sed -nE '/^#+ +/{s///; s/[^[:alnum:] _-]//g; s/ /-/g; s/.*/\L&/; p}'; }

checked=0
broken=0
complain() {
  echo "$1"
  broken=$((broken + 1))
}
for page in "${pages[@]}"; do
  [[ $page == */* ]] || page=./$page
  while IFS= read -r link; do
    link=${link%% *}
    case $link in *://* | mailto:*) continue ;; esac
    checked=$((checked + 1))
    path=${link%%#*}
    target=$page
    [ -z "$path" ] || target=${page%/*}/$path
    if [ ! -e "$target" ]; then
      complain "$page: no '$path'"
    elif [[ $link == *#* ]] && ! anchors "$target" | grep -qxF -- "${link#*#}"; then
      complain "$page: no heading for '$link'"
    fi
  done < <(prose "$page" | grep -oE '\]\([^)]+\)' | sed -E 's/^\]\(//; s/\)$//')
done
echo "${#pages[@]} pages, $checked relative links, $broken broken"
[ "$checked" -gt 0 ] && [ "$broken" -eq 0 ]
