#!/bin/bash
# check_theory.sh SOURCE_DIR: the equation numbers of docs/theory. Each is defined once, in the chapter that it names; each
# number that is cited exists; each equation is cited by code or listed as background at the end of its page.
set -u
export LC_ALL=C.UTF-8
cd "$1" || exit 1
number='[0-9]+\.[0-9]+'
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
failed=0
complain() {
  echo "$1"
  failed=1
}

for page in docs/theory/*.md; do
  chapter=$(sed -nE '1s/^# ([0-9]+) .*/\1/p' "$page")
  [ -n "$chapter" ] || complain "$page: the first line is not '# CHAPTER Title'"
  awk '/^```/ {code = ($0 == "```text"); next} code' "$page" | grep -oE "\($number\)\$" | tr -d '()' >"$work/here"
  grep -vE "^$chapter\." "$work/here" | while read -r n; do echo "$page: ($n) is not of chapter $chapter"; done
  cat "$work/here" >>"$work/defined"
  # The paragraph "Background equations, cited by no code: (1.1), (1.2)."
  awk 'BEGIN {RS = ""} /^Background equations, cited by no code: /' "$page" | grep -oE "\($number\)" | tr -d '()' >>"$work/background"
  # Numbers that the pages themselves refer to.
  grep -oE "\($number\)" "$page" | tr -d '()' | sed "s|^|$page |" >>"$work/referred"
done
sort "$work/defined" | uniq -d | while read -r n; do echo "docs/theory: ($n) is defined twice"; done >"$work/twice"
[ -s "$work/twice" ] && complain "$(cat "$work/twice")"

# Citations: `docs/theory.md (4.7)`, a list with commas, a range with an en dash; comments may break lines in between.
cited_in() {
  tr '\n' ' ' <"$1" | sed -E 's/ +(\/\/[\/!<]*|\*|#) +/ /g; s/ +/ /g' |
    grep -oE "theory\.md\`? \($number\)((,| and|–) ?\($number\))*" |
    sed -E "s/^theory\.md\`? //; s/ and /, /g; s/, */\n/g"
}
expand() {
  while IFS= read -r item; do
    if [[ $item =~ ^\(([0-9]+)\.([0-9]+)\)–\(([0-9]+)\.([0-9]+)\)$ ]]; then
      for ((k = BASH_REMATCH[2]; k <= BASH_REMATCH[4]; ++k)); do echo "${BASH_REMATCH[1]}.$k"; done
    else
      tr -d '()' <<<"$item"
    fi
  done
}
while IFS= read -r file; do
  cited_in "$file" | expand | sed "s|^|$file |"
done < <(grep -rlE 'theory\.md' libs plugins apps tests --include='*.cpp' --include='*.hpp' --include='*.h') >"$work/citations"
while IFS= read -r file; do
  cited_in "$file" | expand | sed "s|^|$file |"
done < <(grep -rlE 'theory\.md' README.md docs libs plugins tests --include='*.md') >>"$work/referred"

while read -r file n; do
  grep -qxF -- "$n" "$work/defined" || complain "$file: ($n) is not in docs/theory"
done < <(sort -u "$work/citations" "$work/referred")
cut -d' ' -f2 "$work/citations" | sort -u >"$work/cited"
while read -r n; do
  if grep -qxF -- "$n" "$work/background"; then
    grep -qxF -- "$n" "$work/cited" && complain "docs/theory: ($n) is listed as background, but code cites it"
  elif ! grep -qxF -- "$n" "$work/cited"; then
    complain "docs/theory: ($n) is neither cited by code nor listed as background"
  fi
done < <(sort -u "$work/defined")

echo "$(wc -l <"$work/defined") equations, $(wc -l <"$work/cited") cited by code in $(cut -d' ' -f1 "$work/citations" | sort -u | wc -l) files," \
  "$(sort -u "$work/background" | wc -l) background"
[ -s "$work/defined" ] && [ -s "$work/cited" ] && [ "$failed" -eq 0 ]
