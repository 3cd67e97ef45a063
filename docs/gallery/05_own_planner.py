# %% [markdown]
# # A planner of your own
#
# A planner is a class with a method `tick`. The one below has a spring and a damper at each joint
# and pushes the arm away from near obstacle points. It runs in the scene of a pillar beside the
# planners that hamelin has. One learns how parameters, contacts and the command work.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

# %% [markdown]
# ## The class
# `params_schema` gives defaults and bounds of the parameters. `influence_m` is the distance up to
# which `tick.contacts` lists obstacle points. The planner asks for accelerations and converts them
# to torques by inverse dynamics. Only the nearest obstacle point pushes, through the Jacobian of the
# arm's point that is nearest to it.


# %%
class Push:
    """Springs and dampers at the joints, and repulsion from near obstacle points."""

    params_schema = {
        "type": "object",
        "properties": {
            "k": {"type": "number", "minimum": 0, "default": 6.0},
            "push": {"type": "number", "minimum": 0, "default": 0.0},
        },
    }
    influence_m = 0.15

    def __init__(self, k: float = 6.0, push: float = 0.0) -> None:
        self.params = {"k": k, "push": push}

    def start(self, setup: hamelin.PlannerSetup) -> None:
        self.arm = setup.model

    def tick(self, tick: hamelin.Tick, command: hamelin.Command) -> None:
        k = self.params["k"]
        a = k * (tick.goal["q"] - tick.q) - 2.0 * np.sqrt(k) * tick.v
        if len(tick.contacts):
            near = min(tick.contacts, key=lambda contact: contact["distance_m"])
            away = near["arm_point_m"] - near["obstacle_point_m"]
            away /= max(np.linalg.norm(away), 1e-9)
            link = int(near["link"])
            pose = self.arm.forward_kinematics(tick.q)[link]
            point = pose[:3, :3].T @ (near["arm_point_m"] - pose[:3, 3])  # in the link's frame
            jacobian = self.arm.jacobian(tick.q, link, point)[3:]
            closeness = 1.0 - near["distance_m"] / self.influence_m
            a += self.params["push"] * closeness * (jacobian.T @ away)
        command.held_torque = self.arm.rnea(tick.q, tick.v, a)


# %% [markdown]
# ## Runs
# The same scene with each planner. Whether a planner reaches the goal is an outcome, not an error:
# the springs alone lead the arm into the pillar, and the shield of the scene stops it there.

# %%
scene = hamelin.load_scene(hamelin.data_path("scenes/pillar.json"))
planners = {
    "Push, k = 6": Push(),
    "Push, k = 6, push = 60": Push(push=60.0),
    "gyro": "gyro",
    "hybrid": "hybrid",
}
logs = {}
for name, planner in planners.items():
    result = hamelin.run(scene, planner=planner, duration=6.0, log="own.jsonl")
    logs[name] = result.read_log()
    causes = result.shield["causes"]
    print(f"{name}: {result.outcome} after {result.time_s:.3f} s, stops of the shield: {causes}")

# %%
colors = ["#000000", "#D55E00", "#009E73", "#0072B2"]
widths = {"gridspec_kw": {"width_ratios": [1, 2.2]}}
figure, axes = plt.subplots(1, 2, figsize=(10, 5), layout="constrained", **widths)
for (name, log), color in zip(logs.items(), colors):
    tip = scene.model.tip_pose(log.q)[:, :3, 3]
    axes[0].plot(tip[:, 0], tip[:, 1], color=color)
    deviation = np.abs(log.q - scene.document["goals"][0]["q"]).max(axis=1)
    axes[1].plot(log.time_s, deviation, color=color, label=f"{name}: {log.result['outcome']}")
obstacle = scene.document["obstacles"][0]
axes[0].add_patch(plt.Circle(obstacle["position_m"][:2], obstacle["radius_m"], color="#bbbbbb"))
axes[0].set(xlabel="x [m]", ylabel="y [m]", xlim=(0.35, 0.75), title="tip from above")
axes[0].set_aspect("equal")
axes[1].set(xlabel="time [s]", ylabel="largest joint deviation [rad]", title="distance to the goal")
axes[1].grid(True, alpha=0.3)
axes[1].legend(loc="lower right", bbox_to_anchor=(1.0, 0.2))
plt.show()
