# Searches proved paths and motions to the goals of a scene.
import sys

import hamelin

plan = hamelin.plan("data/scenes/shelf.json")
for goal, way_points, motion in zip(plan["paths"], plan.paths, plan.motions):
    if motion is None:
        sys.exit(1)
    print(
        f"{len(way_points)} way-points, {goal['search']['checks']} checks: {motion.duration_s:.3f} s, "
        f"proved to keep {motion.clearance_m:.4f} m"
    )
