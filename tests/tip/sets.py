#!/usr/bin/env python3
"""sets.py SCENES OUT: searches paths to any of 1, 10 and 100 grasps.

SCENES is a folder that `hamelin sweep plan` wrote for problems. The grasps of a problem are poses
of the tip about that at its goal: turned about the tip's axis by any angle, tilted by up to 60
degrees and moved by up to 5 cm. Each is also searched alone. Prints how many sets have a path, and
how the time of their search compares with that of the fastest grasp alone.
"""
import json
import math
import random
import statistics
import sys
from pathlib import Path

import hamelin
import numpy as np
from upright import with_absolute_paths

SIZES = (1, 10, 100)
MEASURES = (("checks to the first path", "", lambda path: path["search"]["first_checks"]),
            ("time of the search", "ms", lambda path: 1e3 * path["timing"]["search_s"]))
CHECKS_ALONE, CHECKS_SET = 20000, 200000


def turn(axis, angle):
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


def quaternion(R):
    """Of a rotation by less than a half turn, or near it."""
    K = np.array([[R[0, 0] - R[1, 1] - R[2, 2], R[1, 0] + R[0, 1], R[2, 0] + R[0, 2], R[2, 1] - R[1, 2]],
                  [0, R[1, 1] - R[0, 0] - R[2, 2], R[2, 1] + R[1, 2], R[0, 2] - R[2, 0]],
                  [0, 0, R[2, 2] - R[0, 0] - R[1, 1], R[1, 0] - R[0, 1]],
                  [0, 0, 0, R[0, 0] + R[1, 1] + R[2, 2]]])
    values, vectors = np.linalg.eigh((np.triu(K) + np.triu(K, 1).T) / 3)
    x, y, z, w = vectors[:, -1]
    return [w, x, y, z]


def grasp(tip, rng):
    tilt = rng.uniform(0, math.pi)
    R = tip[:3, :3] @ turn((0, 0, 1), rng.uniform(-math.pi, math.pi)) @ turn(
        (math.cos(tilt), math.sin(tilt), 0), rng.uniform(-math.pi / 3, math.pi / 3))
    position = [float(x) + rng.uniform(-0.05, 0.05) for x in tip[:3, 3]]
    return {"type": "pose", "position_m": position, "quaternion_wxyz": [float(c) for c in quaternion(R)],
            "tolerance_m": 0.005, "tolerance_rad": 0.05}


def plan(scene, goal, checks):
    scene["goals"] = [goal]
    return hamelin.plan(scene, guide="rrt-connect", checks=checks, motions=False)["paths"][0]


def examine(file, out):
    scene = with_absolute_paths(json.loads(file.read_text()), file.parent)
    model = hamelin.Scene(scene).model
    last = scene["goals"][0]["q"]
    tip = model.tip_pose(np.array(last[-1] if isinstance(last[0], list) else last))
    rng = random.Random(file.stem)
    grasps = [grasp(tip, rng) for _ in range(SIZES[-1])]
    alone = [plan(scene, each, CHECKS_ALONE) for each in grasps]
    sets = {n: plan(scene, {"type": "any_of", "any_of": grasps[:n]}, CHECKS_SET)
            for n in SIZES}
    for n, path in sets.items():
        (out / f"{file.stem}.{n}.path.json").write_text(json.dumps(path))
    return alone, sets


def main():
    scenes, out = Path(sys.argv[1]), Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    results = [examine(file, out) for file in sorted(scenes.glob("*.json"))]
    for n in SIZES:
        pairs = [(sets[n], [path for path in alone[:n] if path["found"]]) for alone, sets in results]
        found = sum(of_set["found"] for of_set, _ in pairs)
        print(f"sets of {n}: {found} of {len(results)} found, {sum(bool(a) for _, a in pairs)} with "
              "a grasp that is found alone")
        pairs = [(of_set, paths) for of_set, paths in pairs if of_set["found"] and paths]
        for what, unit, measure in MEASURES:
            both = [(measure(of_set), min(map(measure, paths))) for of_set, paths in pairs]
            ratios = sorted(a / b for a, b in both)
            print(f"  {what}: {statistics.median(a for a, _ in both):.3g} {unit} in the median, best "
                  f"alone {statistics.median(b for _, b in both):.3g}; ratio "
                  f"{statistics.median(ratios):.2f} in the median, "
                  f"{ratios[9 * len(ratios) // 10]:.2f} at 90 %; {sum(r <= 2 for r in ratios)} of "
                  f"{len(ratios)} within 2")


if __name__ == "__main__":
    main()
