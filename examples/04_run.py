# An arm moves through a shelf in closed loop, and leaves a log.
import sys

import hamelin

result = hamelin.run("data/scenes/shelf.json", log=sys.argv[1], every=10)
print(f"{result.outcome} after {result.time_s:.3f} s")
print(f"nearest obstacle: {result.min_clearance_m:.6f} m")
sys.exit(0 if result.ok else 1)
