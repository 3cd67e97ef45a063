#!/usr/bin/env python3
"""take_over.py SCENES: gives an arm another goal while it moves, and measures how it goes on.

SCENES is a folder that `hamelin sweep plan` wrote for problems. After 40 % of the motion to the goal
of a problem the arm is sent to a pose up to 15 cm away from it instead. Prints the time from then to
arrival, the smallest speed in the next 60 ms as a share of that before, the largest accelerations,
and the smallest clearance, sampled at each tick.
"""
import json
import random
import statistics
import sys
import time
from pathlib import Path

import hamelin
import numpy as np
from upright import with_absolute_paths

FIRST, AWAY, TICK = 0.4, 0.15, 0.001


def pose_goal(tip, rng):
    w = 0.5 * np.sqrt(max(1e-12, 1 + np.trace(tip[:3, :3])))
    R = tip[:3, :3]
    x = [(R[2, 1] - R[1, 2]) / (4 * w), (R[0, 2] - R[2, 0]) / (4 * w), (R[1, 0] - R[0, 1]) / (4 * w)]
    q = np.array([w, *x])
    q /= np.linalg.norm(q)
    position = [float(p) + rng.uniform(-AWAY, AWAY) for p in tip[:3, 3]]
    return {"type": "pose", "position_m": position, "quaternion_wxyz": [float(c) for c in q],
            "speed_max": 0.05}


def ride(scene, goal, switch_s):
    made = hamelin.Scene(scene)
    controller = hamelin.Controller(made, guide_thread=False)
    robot = hamelin.Integrator(made.model, "hamel-variational")
    state = robot.start(made.start_q)
    environment = made.environment()
    v_before, out, switched = None, {"a": 0.0, "clearance": 1.0, "slowest": 1.0}, None
    postures = []
    for k in range(12000):
        now = k * TICK
        v = robot.velocity(state)
        if v_before is not None:
            out["a"] = max(out["a"], float(np.max(np.abs(v - v_before))) / TICK)
        v_before = v
        if switched is None and now >= switch_s:
            controller.set_goals([goal])
            switched = now
            speed = float(np.linalg.norm(v))
        answer = controller.tick(now, state.q, v)
        controller.run_guide()
        if switched is not None:
            postures.append(state.q.copy())
            if now - switched <= 0.06:
                out["slowest"] = min(out["slowest"], float(np.linalg.norm(v)) / max(speed, 1e-9))
            if answer.state == "reached":
                break
        robot.step(state, TICK, hamelin.Channels(held_torque=answer.torque))
    out["clearance"] = float(np.min(environment.clearance(np.array(postures))))
    out["reached"] = answer.state == "reached"
    out["time"] = now - switched
    return out


def main():
    results = []
    for file in sorted(Path(sys.argv[1]).glob("*.json")):
        scene = with_absolute_paths(json.loads(file.read_text()), file.parent)
        scene["planner"] = {"name": "hybrid", "guide": "rrt-connect"}
        scene["actuation"] = {"type": "sampled", "control_period_s": TICK}
        scene["step_s"] = TICK
        motion = hamelin.plan(scene)["paths"][0]["motion"]
        if not motion:
            continue
        model = hamelin.Scene(scene).model
        last = motion["q"][-1]
        rng = random.Random(file.stem)
        for _ in range(20):
            goal = pose_goal(model.tip_pose(np.array(last)), rng)
            there = json.loads(json.dumps(scene))
            there["goals"] = [goal]
            if hamelin.plan(there)["paths"][0]["found"]:
                break
        else:
            continue
        out = ride(scene, goal, FIRST * motion["duration_s"])
        results.append(out)
    reached = [r for r in results if r["reached"]]
    print(f"rides: {len(results)}, reached: {len(reached)}")
    times = [r["time"] for r in reached]
    print(f"time from the change to arrival: {statistics.mean(times):.3f} s in the mean, "
          f"{statistics.median(times):.3f} s in the median")
    slow = [r["slowest"] for r in results]
    print(f"slowest in the next 60 ms, as a share: {statistics.median(slow):.2f} in the median, "
          f"{min(slow):.2f} at least")
    print(f"acceleration: {max(r['a'] for r in results):.1f} at most; clearance "
          f"{min(r['clearance'] for r in results):.4f} m at least")


if __name__ == "__main__":
    main()
