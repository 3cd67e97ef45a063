#!/usr/bin/env python3
"""variants.py PLAN OUT KIND: other moving obstacles instead of the swinging sphere of a plan.

PLAN is a folder that `hamelin sweep plan … --sphere-on-path R --swing A,T` made; OUT, which must
lie beside it, is made anew.
KIND is one of
  pair    two spheres that swing in antiphase, 0.3 m apart
  box     a bar of 0.4 m that turns once in T
  appear  the sphere stands still from 0.4 s on, A from the path, along its swing
  comes   the same, and moves across the path at 0.5 m/s
  walk    a trunk and two forearms walk to and fro for 30 s, while the arm goes there and back
Then: hamelin sweep run OUT
"""
import hashlib
import json
import math
import random
import shutil
import sys
from pathlib import Path


def scaled(k, a):
    return [k * x for x in a]


def added(a, b):
    return [x + y for x, y in zip(a, b)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a):
    return scaled(1.0 / math.sqrt(sum(x * x for x in a)), a)


def pair(ball, swing, period, rng):
    apart = scaled(0.15, unit(cross(unit(swing), unit([rng.gauss(0, 1) for _ in range(3)]))))
    return [
        {**ball, "name": name, "position_m": added(ball["position_m"], scaled(sign, apart)),
         "motion": {**ball["motion"], "amplitude_m": scaled(sign, swing)}}
        for name, sign in (("one", 1.0), ("other", -1.0))
    ]


def box(ball, swing, period, rng):
    axis, eighth = unit(swing), math.pi / 4.0
    poses = [
        {"time_s": k * period / 8.0, "position_m": ball["position_m"],
         "quaternion_wxyz": [math.cos(0.5 * k * eighth)] + scaled(math.sin(0.5 * k * eighth), axis)}
        for k in range(9)
    ]
    poses[8]["quaternion_wxyz"] = poses[0]["quaternion_wxyz"]
    side = 2.0 * ball["radius_m"] / 2.0
    across = [0.4, side, side] if abs(axis[0]) < 0.7 else [side, 0.4, side]
    return [{"name": "bar", "type": "box", "size_m": across, "position_m": [0.0, 0.0, 0.0],
             "motion": {"type": "waypoints", "repeat": True, "waypoints": poses}}]


def appear(ball, swing, period, rng, speed=0.0):
    out = {**ball, "appears_s": 0.4}
    out.pop("motion")
    out["position_m"] = added(ball["position_m"], swing)
    if speed > 0.0:
        way = 2.0 * math.sqrt(sum(x * x for x in swing))  # farther on it could meet the base
        out["motion"] = {"type": "linear", "velocity_m_s": scaled(-speed, unit(swing)),
                         "start_s": 0.4, "duration_s": way / speed}
    return [out]


def comes(ball, swing, period, rng):
    return appear(ball, swing, period, rng, 0.5)


def walk(ball, swing, period, rng):
    x, y, z = ball["position_m"]
    angle, distance = math.atan2(y, x), max(0.55, math.hypot(x, y))
    out, along = [math.cos(angle), math.sin(angle), 0.0], [-math.sin(angle), math.cos(angle), 0.0]
    half, pause = 1.2, 1.0
    way_s = 2.0 * half / rng.uniform(0.4, 0.7)
    stops = [(0.0, -half), (way_s, half), (way_s + pause, half), (2 * way_s + pause, -half),
             (2 * way_s + 2 * pause, -half)]
    path = [{"time_s": t, "position_m": added(scaled(distance, out), scaled(s, along))}
            for t, s in stops]

    def limb(name, radius, length, outwards, sideways, height):
        place = added(scaled(outwards, out), scaled(sideways, along))
        return {"name": name, "type": "capsule", "radius_m": radius, "length_m": length,
                "position_m": [place[0], place[1], height], "attached_to": "person"}

    return [{"name": "person", "type": "frame", "position_m": [0.0, 0.0, 0.0],
             "motion": {"type": "waypoints", "repeat": True, "waypoints": path}},
            limb("trunk", 0.14, 0.7, 0.25, 0.0, 0.55),
            limb("left forearm", 0.05, 0.3, 0.1, 0.2, z),
            limb("right forearm", 0.05, 0.3, 0.05, -0.2, max(0.2, z - 0.2))]


def there_and_back(scene):
    goal = scene["goals"][0]
    back = {**goal, "q": list(reversed(goal["q"][:-1])) + [scene["start"]["q"]]}
    scene["goals"] = [goal, back] * 6
    scene["duration_s"] = 30.0


KINDS = {f.__name__: f for f in (pair, box, appear, comes, walk)}


def main():
    if len(sys.argv) != 4 or sys.argv[3] not in KINDS:
        sys.exit(__doc__)
    source, target, kind = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
    plan = json.loads((source / "plan.json").read_text())
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(source / "scenes", target / "scenes")
    for entry in plan["scenes"]:
        file = target / entry["file"]
        scene = json.loads(file.read_text())
        ball = scene["obstacles"].pop()
        motion = ball["motion"]
        rng = random.Random(file.stem)
        scene["obstacles"] += KINDS[kind](ball, motion["amplitude_m"], motion["period_s"], rng)
        if kind == "walk":
            there_and_back(scene)
        text = json.dumps(scene)
        file.write_text(text)
        entry["sha256"] = hashlib.sha256(text.encode()).hexdigest()
    (target / "plan.json").write_text(json.dumps(plan))


if __name__ == "__main__":
    main()
