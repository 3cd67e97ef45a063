#!/usr/bin/env python3
"""upright.py HAMELIN SCENES OUT: searches paths on which a gripper stays upright within 5 degrees.

SCENES is a folder that `hamelin sweep plan` wrote for problems. For each of its scenes two poses of
the gripper are drawn, pointing down, one near the start of the problem and one near its goal, until
paths lead to both of them one after the other. From the first one the second is searched with and
without the constraint. Writes the scenes and paths into OUT, and prints how many are found, in what
time, and the largest angle on paths and motions, sampled.
"""
import json
import math
import random
import statistics
import subprocess
import sys
from pathlib import Path

import hamelin
import numpy as np

UPRIGHT = [{"type": "axis", "axis": [0, 0, 1], "direction": [0, 0, -1],
            "angle_rad": math.radians(5)}]
DRAWS = 30


def pose_near(place, rng):
    position = [float(x) + rng.uniform(-0.15, 0.15) for x in place]
    position[2] += 0.1 * rng.random()
    half = 0.5 * rng.uniform(-math.pi, math.pi)
    return {"type": "pose", "position_m": position, "tolerance_m": 0.01, "tolerance_rad": 0.04,
            "quaternion_wxyz": [0.0, math.cos(half), math.sin(half), 0.0]}


def plan(program, scene, file):
    file.write_text(json.dumps(scene))
    out = file.with_suffix(".path.json")
    subprocess.run([program, "--quiet", "plan", file, "-o", out], check=False)
    return json.loads(out.read_text())["paths"]


def largest_angle(model, points):
    """On the straight lines between configurations, in degrees."""
    most = 0.0
    for a, b in zip(points[:-1], points[1:]):
        for s in np.linspace(0.0, 1.0, 50):
            q = np.array(a) + s * (np.array(b) - np.array(a))
            most = max(most, math.acos(np.clip(-model.tip_pose(q)[2, 2], -1.0, 1.0)))
    return math.degrees(most)


def with_absolute_paths(scene, folder):
    for part, key in ((scene["map"], "file"), (scene["robot"], "file"), (scene["robot"], "spheres")):
        part[key] = str((folder / part[key]).resolve())
    return scene


def examine(program, file, out):
    scene = with_absolute_paths(json.loads(file.read_text()), file.parent)
    model = hamelin.Scene(scene).model
    last = scene["goals"][0]["q"]
    ends = [scene["start"]["q"], last[-1] if isinstance(last[0], list) else last]
    places = [model.tip_pose(np.array(q))[:3, 3] for q in ends]
    rng = random.Random(file.stem)
    for _ in range(DRAWS):
        scene["goals"] = [pose_near(place, rng) for place in places]
        paths = plan(program, scene, out / f"{file.stem}.free.json")
        if len(paths) == 2 and all(path["found"] for path in paths):
            break
    else:
        return None
    scene["start"]["q"] = paths[0]["q"][-1]
    scene["goals"] = scene["goals"][1:]
    free = plan(program, scene, out / f"{file.stem}.free.json")[0]
    scene["goals"][0]["constraints"] = UPRIGHT
    upright = plan(program, scene, out / f"{file.stem}.upright.json")[0]
    return model, free, upright


def main():
    program, scenes, out = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    out.mkdir(parents=True, exist_ok=True)
    results = [examine(program, file, out) for file in sorted(scenes.glob("*.json"))]
    results = [result for result in results if result]
    found = [result for result in results if result[2]["found"]]
    moved = [result for result in found if result[2]["motion"] and result[1]["motion"]]
    print(f"problems with upright poses: {len(results)}")
    print(f"found upright: {len(found)}, with a motion: {len(moved)}")
    for name, which in (("free", 1), ("upright", 2)):
        times = [1e3 * result[which]["timing"]["search_s"] for result in found]
        durations = [result[which]["motion"]["duration_s"] for result in moved]
        angles = [largest_angle(result[0], result[which]["q"]) for result in found]
        angles += [largest_angle(result[0], result[which]["motion"]["q"]) for result in moved]
        print(f"{name}: searched in {statistics.median(times):.1f} ms (median), {max(times):.1f} ms at "
              f"most; moves in {statistics.median(durations):.2f} s (median); largest angle "
              f"{max(angles):.2f} degrees")


if __name__ == "__main__":
    main()
