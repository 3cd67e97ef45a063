#!/usr/bin/env python3
"""persons.py OUT [COUNT]: other persons in the scene shelf_person.

Draws COUNT scenes (70 if not given) like data/scenes/shelf_person.json and writes them into OUT:
the person stands up to 6 cm elsewhere along each axis, and moves up to twice as fast. Then:
hamelin sweep plan OUT/*.json -o PLAN
hamelin sweep run PLAN
"""
import json
import random
import sys
from pathlib import Path

DATA = Path(__file__).resolve().parents[2] / "data"


def moved(rows, time_scale, by):
    """Way-points of a file, other lines as they are: times scaled, positions shifted."""
    for row in rows:
        try:
            numbers = [float(x) for x in row.split(",")]
        except ValueError:
            yield row
            continue
        numbers[0] *= time_scale
        numbers[1:4] = [x + d for x, d in zip(numbers[1:4], by)]
        yield ",".join(f"{x:.9g}" for x in numbers)


def draw(rng, scene, out, name):
    scene = json.loads(json.dumps(scene))
    time_scale, by = rng.uniform(0.5, 1.0), [rng.uniform(-0.06, 0.06) for _ in range(3)]
    for obstacle in scene["obstacles"]:
        motion = obstacle.get("motion")
        if motion is None:
            if "attached_to" not in obstacle:
                obstacle["position_m"] = [x + d for x, d in zip(obstacle["position_m"], by)]
            continue
        rows = (DATA / "scenes" / motion["file"]).read_text().splitlines()
        file = out / f"{name}_{obstacle['name']}.csv"
        relative = "attached_to" in obstacle
        file.write_text("\n".join(moved(rows, time_scale, [0, 0, 0] if relative else by)) + "\n")
        motion["file"] = file.name
    return scene


def main():
    out = Path(sys.argv[1])
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 70
    out.mkdir(parents=True, exist_ok=True)
    scene = json.loads((DATA / "scenes" / "shelf_person.json").read_text())
    for key in ("file", "spheres"):
        scene["robot"][key] = str((DATA / "scenes" / scene["robot"][key]).resolve())
    scene["map"]["file"] = str((DATA / "scenes" / scene["map"]["file"]).resolve())
    rng = random.Random(5)
    for k in range(count):
        drawn = draw(rng, scene, out, f"person_{k:03}")
        (out / f"person_{k:03}.json").write_text(json.dumps(drawn, indent=1))


main()
