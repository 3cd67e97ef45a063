#!/usr/bin/env python3
"""lines.py SCENES [COUNT]: searches joint paths along random straight lines of 0.3 m of the tip.

SCENES is a folder that `hamelin sweep plan` wrote for problems. Lines begin at configurations drawn
from paths to the goals of the problems, in any direction, and keep the rotation of the tip. Prints
how many are proved in full, which share of the others is, why they end, and what dense sampling
finds on what was proved: the smallest distance of the arm, and the largest deviations of the tip.
"""
import json
import math
import random
import re
import statistics
import sys
from collections import Counter
from pathlib import Path

import hamelin
import numpy as np
from upright import with_absolute_paths

LENGTH, SAMPLES = 0.3, 100


def starts(scene, rng, count):
    path = hamelin.plan(scene, guide="rrt-connect", motions=False)["paths"][0]["q"]
    out = []
    for _ in range(count if len(path) > 1 else 0):
        k = rng.randrange(len(path) - 1)
        a, b = np.array(path[k]), np.array(path[k + 1])
        out.append(a + rng.random() * (b - a))
    return out


def direction(rng):
    d = np.array([rng.gauss(0, 1) for _ in range(3)])
    return d / np.linalg.norm(d)


def sampled_share(model, environment, q, tip, along):
    """How far a plain follower gets in steps of 1 mm, each of which is only sampled, up to contact."""
    q, n = q.copy(), 300
    for k in range(1, n + 1):
        target = tip[:3, 3] + LENGTH * k / n * along
        for _ in range(10):
            now = model.tip_pose(q)
            turn = tip[:3, :3] @ now[:3, :3].T
            rotation = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0],
                                       turn[1, 0] - turn[0, 1]])
            error = np.concatenate([rotation, target - now[:3, 3]])
            if np.linalg.norm(error[3:]) < 2e-4 and np.linalg.norm(rotation) < 2e-3:
                break
            J = model.jacobian(q)
            q += J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(6), error)
            q = np.clip(q, model.lower, model.upper)
        else:
            return (k - 1) / n
        if min(float(environment.clearance(q)), float(environment.self_clearance(q))) <= 0:
            return (k - 1) / n
    return 1.0


class Sampled:
    """The extremes of what was proved, at many places of each piece."""

    def __init__(self):
        self.clearance, self.own, self.away, self.turned = math.inf, math.inf, 0.0, 0.0

    def add(self, model, environment, points, start, along):
        q = np.vstack([a + (b - a) * np.linspace(0, 1, SAMPLES)[:, None]
                       for a, b in zip(points[:-1], points[1:])])
        self.clearance = min(self.clearance, float(np.min(environment.clearance(q))))
        self.own = min(self.own, float(np.min(environment.self_clearance(q))))
        tips = model.tip_pose(q)
        off = tips[:, :3, 3] - start[:3, 3]
        off -= np.clip(off @ along, 0, LENGTH)[:, None] * along
        self.away = max(self.away, float(np.max(np.linalg.norm(off, axis=1))))
        cosine = (np.einsum("nij,ij->n", tips[:, :3, :3], start[:3, :3]) - 1) / 2
        self.turned = max(self.turned, math.acos(np.clip(np.min(cosine), -1, 1)))


def main():
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    files = sorted(Path(sys.argv[1]).glob("*.json"))
    shares, plain, times, durations = [], [], [], []
    causes, sampled = Counter(), Sampled()
    for number, file in enumerate(files):
        scene = with_absolute_paths(json.loads(file.read_text()), file.parent)
        scene.setdefault("model", {})["self_collision"] = True
        made = hamelin.Scene(scene)
        model, environment = made.model, made.environment()
        rng = random.Random(file.stem)
        lines = count * (number + 1) // len(files) - count * number // len(files)
        for q in starts(scene, rng, lines):
            tip, along = model.tip_pose(q), direction(rng)
            scene["start"] = {"q": [float(x) for x in q]}
            scene["goals"] = [{"type": "position", "way": {"type": "line"},
                               "position_m": [float(x) for x in tip[:3, 3] + LENGTH * along]}]
            path = hamelin.plan(scene, guide="rrt-connect")["paths"][0]
            shares.append(path["way"]["share"])
            plain.append(sampled_share(model, environment, q, tip, along))
            times.append(1e3 * path["timing"]["search_s"])
            if path["motion"]:
                durations.append(path["motion"]["duration_s"])
            if path["cause"]:
                causes[re.sub(r".*then |'[^']*' ", "", path["cause"])] += 1
            points = np.array(path["way"]["q"])
            if len(points) > 1:
                sampled.add(model, environment, points, tip, along)
    whole = sum(share >= 1 for share in shares)
    print(f"lines: {len(shares)}, proved in full: {whole}, with a motion: {len(durations)}")
    print(f"a plain follower, sampled up to contact: {sum(share >= 1 for share in plain)} in full, "
          f"mean share {statistics.mean(plain):.3f}")
    print(f"mean share proved: {statistics.mean(shares):.3f}; ends: {dict(causes.most_common())}")
    print(f"time: {statistics.median(times):.1f} ms in the median, {max(times):.0f} ms at most; "
          f"motion {statistics.median(durations):.2f} s in the median, {max(durations):.2f} at most")
    print(f"sampled: clearance {sampled.clearance:.5f} m, own {sampled.own:.5f} m; tip away "
          f"{1e3 * sampled.away:.3f} mm, turned {sampled.turned:.5f} rad")


if __name__ == "__main__":
    main()
