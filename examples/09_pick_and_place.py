# Takes a thing from a table and puts it down elsewhere, by grasps that are chosen.
import sys

import hamelin

scene = hamelin.task("data/tasks/table.json")
result = hamelin.run(scene)
goals = len(scene.resolved()["goals"])
print(f"{result.outcome} after {result.time_s:.3f} s, {goals} goals")
sys.exit(0 if result.ok else 1)
