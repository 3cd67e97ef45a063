# The motion of least effort to the goals of a scene, by discrete mechanics.
import sys

import hamelin

motion = hamelin.optimize("data/scenes/pillar.json")
if not motion.valid:
    sys.exit(1)
for goal in motion["goals"]:
    print(
        f"{goal['duration_s']:.3f} s, cost {goal['cost']:.4f}, "
        f"proved to keep {goal['margin_m']:.4f} m"
    )
