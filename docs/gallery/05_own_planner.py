# %% [markdown]
# # A planner of one's own
#
# A planner is a class with `tick`. This one pulls the joints to the goal by springs, and is pushed
# away from near obstacle points. It runs in the same scene as two planners of hamelin.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin


class Springs:
    """Springs to the goal, and a push away from each near obstacle point."""

    params_schema = {
        "type": "object",
        "properties": {
            "stiffness": {"type": "number", "exclusiveMinimum": 0, "default": 20.0},
            "push": {"type": "number", "minimum": 0, "default": 0.3},
        },
    }
    influence_m = 0.15  # obstacle points up to here are listed

    def __init__(self, stiffness=20.0, push=0.3):
        self.params = {"stiffness": stiffness, "push": push}

    def start(self, setup):
        self.arm = setup.model

    def tick(self, tick, command):
        k = self.params["stiffness"]
        a = k * (tick.goal["q"] - tick.q) - 2.0 * np.sqrt(k) * tick.v
        torque = self.arm.rnea(tick.q, tick.v, a)
        frames = self.arm.forward_kinematics(tick.q)
        for near in tick.contacts:
            frame = frames[near["link"]]
            point = frame[:3, :3].T @ (near["arm_point_m"] - frame[:3, 3])
            J = self.arm.jacobian(tick.q, near["link"], point)[3:]
            force = self.params["push"] * (1.0 / near["distance_m"] - 1.0 / self.influence_m)
            torque += J.T @ (force * near["direction"])
        command.held_torque = torque


# %%
scene = hamelin.data_path("scenes/pillar.json")
figure, axis = plt.subplots(figsize=(8.5, 4), layout="constrained")
for planner in (Springs(), "apf", "hybrid"):
    name = planner if isinstance(planner, str) else "Springs"
    result = hamelin.run(scene, planner=planner, log=f"{name}.jsonl")
    log = hamelin.read_log(f"{name}.jsonl")
    axis.plot(log.time_s, log.clearance_m, label=f"{name}: {result.outcome}")
axis.axhline(0.0, color="black", linewidth=0.8)
axis.set_xlabel("time [s]")
axis.set_ylabel("clearance [m]")
axis.grid(True, alpha=0.3)
axis.legend()
plt.show()
