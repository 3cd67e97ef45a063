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
      for ((k = BASH_REMATCH[2]; k <= BASH_REMATCH[4]; ++k)); do echo "$1 ${BASH_REMATCH[1]}.$k"; done
    else
      echo "$1 ${item//[()]/}"
    fi
  done
}
cited_in_files() {
  while IFS= read -r file; do
    cited_in "$file" | expand "$file"
  done
}
grep -rlF 'theory.md' libs plugins apps tests --include='*.cpp' --include='*.hpp' --include='*.h' |
  cited_in_files >"$work/citations"
grep -rlF 'theory.md' README.md docs libs plugins tests --include='*.md' | cited_in_files >>"$work/referred"

# complain_of FILE MESSAGE: about each number in the file.
complain_of() {
  while read -r n; do complain "${2//@/($n)}"; done <"$1"
}
for list in defined background; do sort -u -o "$work/$list.sorted" "$work/$list"; done
cut -d' ' -f2 "$work/citations" | sort -u >"$work/cited"
cut -d' ' -f2 "$work/citations" "$work/referred" | sort -u | comm -23 - "$work/defined.sorted" >"$work/unknown"
while read -r n; do
  grep -hF " $n" "$work/citations" "$work/referred" | grep -E " ${n//./\\.}\$" | sort -u | cut -d' ' -f1 |
    while read -r file; do echo "$file: ($n) is not in docs/theory"; done
  failed=1
done <"$work/unknown"
comm -12 "$work/background.sorted" "$work/cited" >"$work/needless"
complain_of "$work/needless" "docs/theory: @ is listed as background, but code cites it"
sort -u "$work/background.sorted" "$work/cited" | comm -23 "$work/defined.sorted" - >"$work/forgotten"
complain_of "$work/forgotten" "docs/theory: @ is neither cited by code nor listed as background"

echo "$(wc -l <"$work/defined") equations, $(wc -l <"$work/cited") cited by code in $(cut -d' ' -f1 "$work/citations" | sort -u | wc -l) files," \
  "$(sort -u "$work/background" | wc -l) background"
[ -s "$work/defined" ] && [ -s "$work/cited" ] && [ "$failed" -eq 0 ]
