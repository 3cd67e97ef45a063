#!/usr/bin/env bash
# make_corpus.sh HAMELIN FOLDER: fills FOLDER/<target>/ with seeds, made by the program HAMELIN and
# from data/. The inputs that fuzzing found beyond these seeds are in corpus/, minimised.
set -euo pipefail
hamelin=$(realpath "$1")
out=$2
source=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../..")
mkdir -p "$out"/{maps,scene,robot,spheres,urdf,srdf,log,primitives,waypoints,target_line}
out=$(realpath "$out")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

cp "$source"/data/scenes/*.json "$out/scene"
cp "$source"/data/maps/*.primitives.json "$out/primitives"
cp "$source"/data/robots/*.urdf "$out/urdf"
cp "$source"/data/robots/*.spheres.json "$out/spheres"
for robot in "$source"/data/robots/*.json; do
  [[ $robot == *.spheres.json ]] || cp "$robot" "$out/robot"
done

printf 'time_s,x_m,y_m,z_m\n0,0,0,0\n0.5,0.2,0,0\n1,0.5,0.1,0\n' >"$out/waypoints/walk.csv"
printf '[{"time_s": 0, "position_m": [0, 0, 0]}, {"time_s": 1, "position_m": [1, 0, 0]}]' >"$out/waypoints/list.json"

printf '{"time_s": 0.5, "position_m": [0.4, 0, 0.5], "quaternion_wxyz": [1, 0, 0, 0], "velocity_m_s": [0, 0.1, 0]}' >"$out/target_line/pose.json"
printf '{"time_s": 0.5, "velocity_m_s": [0.1, 0, 0], "angular_velocity_rad_s": [0, 0, 1]}' >"$out/target_line/twist.json"

cat >"$out/srdf/two_links.srdf" <<'XML'
<?xml version="1.0"?>
<robot name="arm">
  <group name="all"><chain base_link="link1" tip_link="link2"/></group>
  <disable_collisions link1="link1" link2="link2" reason="Adjacent"/>
</robot>
XML

"$hamelin" -q robot make-chain --links 3 --axes x,z,x -o "$out/robot/chain3.json"
"$hamelin" -q robot make-chain --links 12 -o "$out/robot/chain12.json"
for seed in 1 2 3; do
  "$hamelin" -q scene make --clutter "$seed" --seed "$seed" --sizes 0.05,0.1 \
    --bounds=-0.2,-0.2,0,0.2,0.2,0.2 --resolution 0.05 -o "$out/maps/clutter$seed.bt"
done
# The nodes of a .ot file: 4 bytes of log-odds and 1 byte of children flags each.
printf '# Octomap OcTree file\nid OcTree\nsize 4\nres 0.1\ndata\n' >"$out/maps/small.ot"
printf '\0\0\0\0\x01\0\0\0\0\x03\0\0\x80\x3f\0\0\0\x80\xbf\0' >>"$out/maps/small.ot"
printf '# Octomap OcTree file\nid OcTree\nsize 1\nres 0.1\ndata\n\0\0\x80\x3f\0' >"$out/maps/one_leaf.ot"
printf '# Octomap OcTree file\nid ColorOcTree\nsize 2\nres 0.1\ndata\n\0\0\0\0\1\2\3\1\0\0\x80\x3f\4\5\6\0' >"$out/maps/colour.ot"
printf '# Octomap OcTree binary file\nid ColorOcTree\nsize 2\nres 0.1\ndata\n\x01\0' >"$out/maps/colour.bt"
printf '# Octomap OcTree binary file\nid OcTree\nsize 9\nres 0.1\ndata\n\x56\xaa' >"$out/maps/one_node.bt"

"$hamelin" -q robot make-chain --links 2 -o two_link.json
"$hamelin" -q integrate two_link.json --integrator hamel-variational --step 0.001 --duration 0.003 \
  --log "$out/log/free.jsonl"
"$hamelin" -q integrate two_link.json --integrator rk4 --step 0.001 --duration 0.002 \
  --log "$out/log/rk4.jsonl.zst"
"$hamelin" -q run "$source/data/scenes/paper_52_apf.json" --set /duration_s=0.012 \
  --log "$out/log/run.jsonl" || true
