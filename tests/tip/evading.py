#!/usr/bin/env python3
"""evading.py [COUNT]: an arm keeps its tip upright while balls cross its way.

Each of COUNT seeds (40) draws four places above a table, to which arm7 goes one after the other with
its tip pointing down within 0.15 rad, and three balls that swing through the space in between. Prints
how many runs end well, and by how much the constraint was exceeded.
"""
import random
import statistics
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor

import hamelin

HOME = [0, -0.785, 0, -2.356, 0, 1.571, 0.785]
ANGLE = 0.15


def scene(seed):
    rng = random.Random(seed)
    down = {"type": "axis", "axis": [0, 0, 1], "direction": [0, 0, -1], "angle_rad": ANGLE}
    goals = [{"type": "pose", "quaternion_wxyz": [0, 1, 0, 0], "constraints": [down],
              "position_m": [rng.uniform(0.35, 0.6), side * rng.uniform(0.2, 0.4),
                             rng.uniform(0.25, 0.5)]} for side in (1, -1, 1, -1)]
    balls = [{"name": f"ball {i}", "type": "sphere", "radius_m": rng.uniform(0.05, 0.1),
              "position_m": [rng.uniform(0.35, 0.6), rng.uniform(-0.15, 0.15), rng.uniform(0.2, 0.6)],
              "motion": {"type": "sine", "period_s": rng.uniform(2.5, 5),
                         "amplitude_m": [rng.uniform(-0.25, 0.25) for _ in range(3)]}}
             for i in range(3)]
    return {"schema": "hamelin.scene/1", "start": {"q": HOME}, "goals": goals, "obstacles": balls,
            "robot": {"file": str(hamelin.data_path("robots/arm7.urdf")), "tip": "flange",
                      "spheres": str(hamelin.data_path("robots/arm7.spheres.json"))},
            "planner": {"name": "hybrid"}, "actuation": {"type": "sampled"}, "seed": seed + 1,
            "duration_s": 40}


def one(seed):
    result = hamelin.run(scene(seed))
    return result.outcome, result.time_s, max([c["excess"] for c in result.constraints], default=-ANGLE)


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    with ProcessPoolExecutor(2) as pool:
        runs = list(pool.map(one, range(count)))
    print(f"runs: {dict(Counter(outcome for outcome, _, _ in runs))}")
    excess = [e for _, _, e in runs]
    print(f"exceeded in {sum(e > 0 for e in excess)} of {count}, by {max(excess):.3f} rad at most, "
          f"{statistics.mean(max(e, 0) for e in excess):.4f} in the mean")
    times = [t for outcome, t, _ in runs if outcome == "reached"]
    print(f"time {statistics.median(times):.1f} s in the median of those that arrive")


if __name__ == "__main__":
    main()
