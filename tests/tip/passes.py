#!/usr/bin/env python3
"""passes.py SCENES: runs sequences of goals that are passed at speed, and the same with stops.

SCENES is a folder that `hamelin sweep plan` wrote for problems. The goals of a sequence are the
configurations at 1, 2 and 3 quarters of a path to the goal of a problem, moved by up to 0.2 rad where
that is clear, and the goal itself. Prints how long runs take with each tolerance, the largest
accelerations, the smallest clearance and whether all was proved.
"""
import json
import random
import statistics
import sys
import tempfile
from pathlib import Path

import hamelin
import numpy as np
from upright import with_absolute_paths

TOLERANCES, AWAY, LEAST = (0.05, 0.1, 0.2), 0.2, 0.02


def along(path, share):
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    at = share * lengths.sum()
    for a, b, length in zip(path[:-1], path[1:], lengths):
        if at <= length:
            return a + at / length * (b - a)
        at -= length
    return path[-1]


def sequence(scene, rng):
    """Joint vectors, or none if there is no path."""
    path = np.array(hamelin.plan(scene, motions=False)["paths"][0]["q"])
    if len(path) < 2:
        return []
    made = hamelin.Scene(scene)
    model, environment = made.model, made.environment()
    out = []
    for share in (0.25, 0.5, 0.75):
        q = along(path, share)
        for _ in range(50):
            other = np.clip(q + [rng.uniform(-AWAY, AWAY) for _ in q], model.lower, model.upper)
            if min(float(environment.clearance(other)), float(environment.self_clearance(other))) > LEAST:
                q = other
                break
        out.append([float(x) for x in q])
    return [*out, [float(x) for x in path[-1]]]


def ride(scene, points, tolerance, passes, log):
    goals = [{"type": "joint", "q": q, "tolerance_rad": tolerance, "pass": passes} for q in points]
    goals[-1] = {"type": "joint", "q": points[-1]}
    result = hamelin.run({**scene, "goals": goals, "duration_s": 30}, log=log)
    if result.outcome != "reached":
        return result, 0.0
    read = result.read_log()
    return result, float(np.max(np.abs(np.diff(read.v, axis=0))) / 0.001)


def main():
    rides = []
    log = Path(tempfile.mkdtemp()) / "run.jsonl"
    for file in sorted(Path(sys.argv[1]).glob("*.json")):
        scene = with_absolute_paths(json.loads(file.read_text()), file.parent)
        scene["planner"] = {"name": "hybrid", "guide": "rrt-connect"}
        scene["actuation"] = {"type": "sampled"}
        scene["step_s"] = 0.001
        points = sequence(scene, random.Random(file.stem))
        if points:
            rides.append([(tolerance, passes, *ride(scene, points, tolerance, passes, log))
                          for tolerance in TOLERANCES for passes in (False, True)])
    print(f"sequences of four goals: {len(rides)}")
    for k, tolerance in enumerate(TOLERANCES):
        both = [(each[2 * k], each[2 * k + 1]) for each in rides]
        for which, name in enumerate(("stops", "passes")):
            results = [pair[which] for pair in both]
            reached = [r for r in results if r[2].outcome == "reached"]
            times = [r[2].time_s for r in reached]
            print(f"tolerance {tolerance}, {name}: {len(reached)} of {len(results)} reached, "
                  f"{statistics.median(times):.2f} s in the median ({statistics.mean(times):.2f} in the "
                  f"mean); acceleration {max(r[3] for r in reached):.0f} at most; clearance "
                  f"{1e3 * min(r[2].min_clearance_m for r in reached):.2f} mm; proved "
                  f"{min(r[2].certified_share for r in reached):.4f}")
        saved = [a[2].time_s - b[2].time_s for a, b in both
                 if a[2].outcome == b[2].outcome == "reached"]
        print(f"  saved: {statistics.median(saved):.2f} s in the median")


if __name__ == "__main__":
    main()
