#!/usr/bin/env python3
"""pick_place.py OUT [COUNT [PLANT]]: picks and places a can on a table and in a shelf.

Each of COUNT seeds (50) draws where the can stands, where it is put and what is in between: on a
table with a wall, and in a shelf from one compartment to the other. The can stays upright within 10
degrees on the way. PLANT (mujoco) simulates the arm; OUT gets the tasks and maps. Prints how many
runs reach the end, what touched, and how long planning takes.
"""
import json
import random
import statistics
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import hamelin

HALF = 0.7071067811865476
HOME = [0, -0.785, 0, -2.356, 0, 1.571, 0.785]
SIDE = {"position_m": [-0.06, 0, 0.03], "quaternion_wxyz": [HALF, 0, HALF, 0], "turns": 24}
TOP = {"position_m": [0, 0, 0.09], "quaternion_wxyz": [0, 1, 0, 0], "turns": 8}


def task(scene, at, to, support):
    return {
        "schema": "hamelin.task/1",
        "scene": {"schema": "hamelin.scene/1", "start": {"q": HOME}, "planner": {"name": "hybrid"},
                  "robot": {"file": str(hamelin.data_path("robots/arm7.urdf")), "tip": "flange",
                            "spheres": str(hamelin.data_path("robots/arm7.spheres.json"))},
                  "actuation": {"type": "sampled"}, **scene},
        "objects": [{"name": "can", "type": "cylinder", "radius_m": 0.033, "length_m": 0.12,
                     "position_m": at, "mass_kg": 0.35, "stands_on": support,
                     "grasps": [SIDE, TOP]}],
        "steps": [{"type": "pick", "object": "can"},
                  {"type": "place", "position_m": to, "turns": 12, "tilt_rad": 0.17, "onto": support},
                  {"type": "move", "goal": {"type": "joint", "q": HOME}}]}


def table(rng, folder):
    top = rng.uniform(0.0, 0.2)
    wall = rng.uniform(0.1, 0.3)
    boxes = [("table", [0.6, 1.2, 0.04], [0.6, 0, top - 0.02]),
             ("wall", [0.4, 0.04, wall], [rng.uniform(0.55, 0.7), 0, top + 0.5 * wall])]
    boxes += [(f"block {i}", [0.08, 0.08, h], [rng.uniform(0.4, 0.8), y, top + 0.5 * h])
              for i, (y, h) in enumerate((s * rng.uniform(0.4, 0.5), rng.uniform(0.1, 0.3))
                                         for s in (-1, 1))]
    scene = {"obstacles": [{"name": name, "type": "box", "size_m": size, "position_m": at}
                           for name, size, at in boxes]}
    ends = [[rng.uniform(0.4, 0.65), s * rng.uniform(0.15, 0.3), top + 0.06] for s in (1, -1)]
    return task(scene, *ends, {"obstacles": ["table"]})


def shelf(rng, folder):
    given = json.loads(hamelin.data_path("maps/shelf.primitives.json").read_text())
    given["obstacles"] = [one for one in given["obstacles"] if one["name"] != "can"]
    for one in given["obstacles"]:
        if one["name"] in ("divider", "bowl"):
            one["position_m"][1] += rng.uniform(-0.06, 0.06)
    primitives, octomap = folder / "shelf.json", folder / "shelf.bt"
    primitives.write_text(json.dumps(given))
    subprocess.run(["hamelin", "scene", "make", "--primitives", primitives, "-o", octomap],
                   check=True, capture_output=True)
    ends = [[rng.uniform(0.65, 0.75), s * rng.uniform(0.2, 0.38), 0.34] for s in (1, -1)]
    return task({"map": {"file": str(octomap), "keep_out_radius_m": 0.1}}, *ends, None)


def one(given):
    make, seed, out, plant = given
    folder = Path(out) / f"{make.__name__}_{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    document = make(random.Random(f"{make.__name__} {seed}"), folder)
    document["scene"]["seed"] = seed + 1
    (folder / "task.json").write_text(json.dumps(document, indent=1))
    since = time.perf_counter()
    try:
        scene = hamelin.task(document)
    except hamelin.Error as error:
        return {"outcome": "no plan", "cause": str(error), "plan_s": time.perf_counter() - since}
    plan_s = time.perf_counter() - since
    result = hamelin.run(scene, plant=plant, log=folder / "run.jsonl.zst", every=5)
    return {**dict(result), "plan_s": plan_s}


def report(name, runs):
    reached = [run for run in runs if run["outcome"] == "reached"]
    print(f"{name}: {len(reached)} of {len(runs)} reached the end")
    for (outcome, cause), n in Counter((run["outcome"], run.get("cause") or "") for run in runs
                                       if run["outcome"] != "reached").items():
        print(f"  {n} {outcome}: {cause}")
    plan = [1e3 * run["plan_s"] for run in runs]
    print(f"  planning {statistics.median(plan):.0f} ms in the median, {max(plan):.0f} at most")
    if not reached:
        return
    times = [run["time_s"] for run in reached]
    print(f"  time {statistics.median(times):.1f} s in the median, {max(times):.1f} at most; "
          f"clearance at least {1e3 * min(run['min_clearance_m'] for run in reached):.2f} mm")
    contacts = sum((run.get("plant") or {}).get("contacts", 0) for run in runs)
    judged = sum((run.get("plant") or {}).get("judge_contacts", 0) for run in runs)
    print(f"  contacts that no step allows: {contacts} counted by the plant, {judged} by the judge")
    tilt = [0.17 + c["excess"] for run in reached for c in run["constraints"] if c["type"] == "axis"]
    if tilt:
        print(f"  largest tilt {max(tilt):.4f} rad")


def main():
    out = sys.argv[1]
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 50
    plant = sys.argv[3] if len(sys.argv) > 3 else "mujoco"
    with ProcessPoolExecutor(2) as pool:
        for make in (table, shelf):
            report(make.__name__,
                   list(pool.map(one, [(make, seed, out, plant) for seed in range(count)])))


if __name__ == "__main__":
    main()
