#!/usr/bin/env python3
"""seen_shelves.py HAMELIN OUT [COUNT]: works in a shelf that only depth cameras see.

Draws COUNT scenes (100 if not given) like data/scenes/shelf_seen.json, whose arm looks at two
compartments of the shelf and reaches into each: other places in them, and another place of the
camera beside the arm. Runs each with unknown space blocked, and with the map known, two at a time,
writes their results into OUT, and prints how many reached all goals, and how many touched anything.
"""
import json
import math
import random
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

DATA = Path(__file__).resolve().parents[2] / "data"
FORWARD = [math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0]


def looking(place, at):
    """Orientation of a camera at a place that looks at a point, with the image's top up."""
    z = [b - a for a, b in zip(place, at)]
    z = [c / math.hypot(*z) for c in z]
    x = [z[1] / math.hypot(z[0], z[1]), -z[0] / math.hypot(z[0], z[1]), 0.0]
    y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]]
    w = 0.5 * math.sqrt(1.0 + x[0] + y[1] + z[2])
    return [w, (y[2] - z[1]) / (4 * w), (z[0] - x[2]) / (4 * w), (x[1] - y[0]) / (4 * w)]


def pose(place):
    return {"type": "pose", "position_m": place, "quaternion_wxyz": FORWARD}


def draw(rng):
    scene = json.loads((DATA / "scenes/shelf_seen.json").read_text())
    for key in ("file", "spheres"):
        scene["robot"][key] = str(DATA / "scenes" / scene["robot"][key])
    scene["map"]["file"] = str(DATA / "scenes" / scene["map"]["file"])
    goals = []
    for y, z in rng.sample([(-0.25, 0.45), (0.25, 0.45), (-0.25, 0.8)], 2):
        place = [rng.uniform(0.6, 0.7), y + rng.uniform(-0.04, 0.04), z + rng.uniform(-0.03, 0.03)]
        look = pose([0.42, 0.8 * place[1], 0.55 + 0.2 * (place[2] - 0.2)])
        goals += [look, pose(place), look]
    scene["goals"] = goals[:-1]
    beside = scene["sensors"][0]
    side = rng.choice((-1.0, 1.0))
    place = [rng.uniform(-0.3, 0.0), side * rng.uniform(0.7, 1.0), rng.uniform(1.0, 1.3)]
    beside["position_m"] = place
    beside["quaternion_wxyz"] = looking(place, [0.5, 0.0, 0.45])
    scene["seed"] = rng.randrange(1 << 30)
    return scene


def known(scene):
    out = {key: value for key, value in scene.items() if key != "sensors"}
    out["map"] = {"file": scene["map"]["file"], "keep_out_radius_m": 0.1}
    return out


def main():
    hamelin, out = sys.argv[1], Path(sys.argv[2])
    count = int(sys.argv[3]) if len(sys.argv) > 3 else 100
    out.mkdir(parents=True, exist_ok=True)
    rng = random.Random(1)
    files = []
    for k in range(count):
        scene = draw(rng)
        for kind, made in (("seen", scene), ("known", known(scene))):
            files.append(out / f"{kind}_{k:03}.json")
            files[-1].write_text(json.dumps(made, indent=1))

    def run(file):
        result = file.with_suffix(".result.json")
        command = [hamelin, "--quiet", "run", str(file), "--result", str(result)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode > 1:
            sys.exit(f"{file}: {done.stderr}")
        return file.name.split("_")[0], json.loads(result.read_text())

    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(run, files))
    for kind in ("seen", "known"):
        of = [result for name, result in results if name == kind]
        outcomes = [result["outcome"] for result in of]
        times = sorted(result["time_s"] for result in of if result["outcome"] == "reached")
        median = f"{times[len(times) // 2]:.1f} s" if times else "–"
        least = min(result["min_clearance_m"] for result in of)
        print(f"{kind:<6} {outcomes.count('reached')} of {len(of)} reached, "
              f"{outcomes.count('collision')} contacts, time {median} (median), "
              f"clearance {1e3 * least:.1f} mm at least")


main()
