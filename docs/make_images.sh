#!/bin/bash
# make_images.sh BUILD [NAME...]: makes the pictures of docs/images that show a report page (all, or those of the given
# names): runs the scenes with BUILD/bin/hamelin, makes their pages, and takes screenshots in a headless Chromium.
# BUILD is a build folder with pages, such as build/ci. tests/report/shot.mjs takes the pictures.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build=$(realpath "$1")
shift
names=("$@")
((${#names[@]})) || names=(shelf paper_52 shelf_person shelf_seen task follow tutorial gain_map)
program=$build/bin/hamelin
export NODE_MODULES=$build/npm/node_modules
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

run() { # SCENE LOG [OPTION...]; that a goal is not reached is no failure here
  local code=0
  "$program" --quiet run "$1" --log "$work/$2" "${@:3}" || code=$?
  ((code <= 1)) || exit "$code"
}
# picture NAME TIME SIZE LOG...: a picture of the page of these logs
picture() {
  local name=$1 time=$2 size=$3
  shift 3
  "$program" --quiet report "${@/#/$work/}" -o "$work/$name.html"
  node tests/report/shot.mjs "$work/$name.html" "docs/images/$name.jpg" --time "$time" --size "$size" --scale 1.3333
}

# picture_of_maps DIR: a picture of the maps of a sweep's page
picture_of_maps() {
  "$program" --quiet sweep merge "$1" --page "$1.html" >/dev/null
  node tests/report/shot.mjs "$1.html" docs/images/gain_map.jpg --size 1010x955 --scale 1.3333 --run \
    "[...document.querySelectorAll('h2')].find((title) => title.textContent === 'Maps of what varies').scrollIntoView()"
}

for name in "${names[@]}"; do
  case $name in
    shelf) run data/scenes/shelf.json shelf.jsonl && picture shelf 6.2 1440x968 shelf.jsonl ;;
    paper_52)
      for planner in apf gyro hybrid; do run "data/scenes/paper_52_$planner.json" "$planner.jsonl"; done
      picture paper_52 8 1440x968 apf.jsonl gyro.jsonl hybrid.jsonl
      ;;
    shelf_person) run data/scenes/shelf_person.json person.jsonl && picture shelf_person 9.7 1200x806 person.jsonl ;;
    shelf_seen) run data/scenes/shelf_seen.json seen.jsonl && picture shelf_seen 1.2 1200x806 seen.jsonl ;;
    task)
      "$program" --quiet task data/tasks/table.json --log "$work/task.jsonl"
      picture task 1.15 1200x806 task.jsonl
      ;;
    follow) run data/scenes/follow_shelf.json follow.jsonl && picture follow 20 1200x806 follow.jsonl ;;
    tutorial)
      # The files of the tutorial, as its pages say to save them.
      for page in docs/tutorial/*.md; do
        awk -v folder="$work" '/(^|as )`[^`]+`:$/ && match($0, /`[^`]+`:$/) {file = folder "/" substr($0, RSTART + 1, RLENGTH - 3)}
          /^```/ {saved = ($0 != "```" && file != ""); if ($0 == "```") file = ""; next} saved {print > file}' "$page"
      done
      "$program" --quiet robot fit "$work/my_arm.urdf" -o "$work/my_arm.spheres.json"
      "$program" --quiet scene make --primitives "$work/my_cell.primitives.json" -o "$work/my_cell.bt"
      run "$work/my_first_scene.json" mine.jsonl
      picture tutorial 1.5 1200x806 mine.jsonl
      ;;
    gain_map) # as docs/gain_map.md says; takes minutes
      "$program" --quiet sweep plan --gain-sets 700 --base data/scenes/paper_52_apf.json --set /safety/type=none \
        --planner apf --planner gyro:variant=published --planner gyro:variant=energy-neutral \
        --planner hybrid:contact_radius_m=0.5 -o "$work/gain_map"
      "$program" --quiet sweep run "$work/gain_map"
      picture_of_maps "$work/gain_map"
      ;;
    *)
      echo "make_images.sh: '$name': there is no such picture" >&2
      exit 2
      ;;
  esac
done
