#!/bin/bash
# run_readme.sh SOURCE_DIR PROGRAM_DIR: runs every line of README.md's ```console blocks that begins with `hamelin`, in
# order, in one fresh folder in which data/ is the checkout's. Each must exit with 0, or the N of a comment "exit code N". Of the outputs that ```text blocks show,
# outcomes and goals must still be printed; other figures may differ from machine to machine in their last digits.
set -u
source_dir=$1
export PATH="$2:$PATH"
unset HAMELIN_PLUGIN_PATH
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
ln -s "$source_dir/data" "$work/data"
cd "$work" || exit 1
mapfile -t commands < <(awk '/^```console/ {shown = 1; next} /^```/ {shown = 0} shown && /^hamelin / {print}' "$source_dir/README.md")
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
done < <(awk '/^```text/ {text = 1; next} /^```/ {text = 0} text' "$source_dir/README.md" |
  sed -nE 's/^(outcome .*|goal .* reached).*/\1/p')
exit $failed
