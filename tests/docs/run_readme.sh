#!/bin/bash
# run_readme.sh SOURCE_DIR PROGRAM_DIR: runs every command in README.md's ```console blocks that begins with `hamelin`,
# in order, in a fresh folder in which data/ is the checkout's. A ```json block after "Save … as `NAME`:" is written to
# that file first. Each command must exit with 0, or with the N of a comment "exit code N". Of the outputs that ```text
# blocks show, outcomes and goals must be printed by some command; other figures may differ between machines.
set -u
source_dir=$1
readme=$source_dir/README.md
export PATH="$2:$PATH"
unset HAMELIN_PLUGIN_PATH
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
ln -s "$source_dir/data" "$work/data"
cd "$work" || exit 1

awk '/^Save .* as `[^`]+`:$/ {split($0, part, "`"); file = part[2]}
  /^```/ {json = ($0 == "```json" && file != ""); if ($0 == "```") file = ""; next}
  json {print > file}' "$readme"

# A line that ends in a backslash is continued on the next one.
mapfile -t commands < <(sed -e ':more' -e '/\\$/{N;s/ *\\\n */ /;b more' -e '}' "$readme" |
  awk '/^```console/ {shown = 1; next} /^```/ {shown = 0} shown && /^hamelin /')
if [ "${#commands[@]}" -eq 0 ]; then
  echo "README.md shows no command of hamelin in a console block"
  exit 1
fi
failed=0
for command in "${commands[@]}"; do
  if [[ "$command" == "hamelin report "* && ! -f "$2/../share/hamelin/report/page.html" ]]; then
    echo "skipped $command (the page was not built)"
    continue
  fi
  if [[ "$command" == *" --page "* && ! -f "$2/../share/hamelin/report/page.html" ]]; then
    echo "without --page, which was not built: $command"
    command=$(sed -E 's/ --page [^ ]+//' <<<"$command")
  fi
  wanted=0
  [[ "$command" =~ exit\ code\ ([0-9]+) ]] && wanted=${BASH_REMATCH[1]}
  bash -c "$command" >out.txt 2>err.txt </dev/null
  code=$?
  if [ "$code" -eq "$wanted" ]; then
    echo "ok      $command"
    cat out.txt >>printed.txt
  else
    echo "failed  $command (exit code $code, expected $wanted)"
    cat err.txt
    failed=1
  fi
done
while IFS= read -r shown; do
  if grep -qF -- "$shown" printed.txt; then
    echo "shown   $shown"
  else
    echo "failed  README.md shows '$shown', which no command printed"
    failed=1
  fi
done < <(awk '/^```text/ {text = 1; next} /^```/ {text = 0} text' "$readme" |
  sed -nE 's/^(outcome .*|goal .* reached).*/\1/p')
exit $failed
