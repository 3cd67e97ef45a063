# %% [markdown]
# # A payload that the planner knows of, or not
#
# The arm makes the same motion three times: without a payload, with one that its planner knows of,
# and with one that it does not know of. The planner computes torques by inverse dynamics, with a
# feedback of small gain. The plots show the torques, and how far the arm strays from its motion.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

# %% [markdown]
# ## The planner
# It follows a smooth motion from start to goal. `arm` is the model of its inverse dynamics.

# %%
start = np.array([0.0, -0.3, 0.0, -2.0, 0.0, 1.7, 0.8])
goal = np.array([0.8, 0.3, 0.0, -1.3, 0.0, 1.6, 0.8])
motion_s = 2.0


def motion(time_s: float | np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration of a polynomial of order five from rest to rest."""
    s = np.clip(np.asarray(time_s) / motion_s, 0.0, 1.0)[..., None]
    way = goal - start
    velocity = way * 30.0 * s**2 * (1.0 - s) ** 2 / motion_s
    acceleration = way * (60.0 * s - 180.0 * s**2 + 120.0 * s**3) / motion_s**2
    return start + way * s**3 * (10.0 - 15.0 * s + 6.0 * s**2), velocity, acceleration


class ComputedTorque:
    """Inverse dynamics of a given model, and feedback."""

    def __init__(self, arm: hamelin.Model) -> None:
        self.arm = arm

    def tick(self, tick: hamelin.Tick, command: hamelin.Command) -> None:
        q, v, a = motion(tick.time_s)
        wanted = a + 40.0 * (q - tick.q) + 12.0 * (v - tick.v)
        command.held_torque = self.arm.rnea(tick.q, tick.v, wanted)


# %% [markdown]
# ## Three runs
# A payload belongs to the scene, so `scene.model` includes it. The planner that does not know of it
# gets the model of the scene without payload. The goal's tolerance is so small that all runs last
# until the end of `duration_s`. The planner knows no limits, so the scene has none.

# %%
document = {
    "schema": "hamelin.scene/1",
    "robot": {"file": str(hamelin.data_path("robots/arm7.urdf"))},
    "model": {"joint_limits": False, "velocity_limits": False, "torque_limits": False},
    "start": {"q": start.tolist()},
    "goals": [{"type": "joint", "q": goal.tolist(), "tolerance_rad": 1e-9}],
    "duration_s": 3.0,
}
payload = {"mass_kg": 2.0, "position_m": [0.0, 0.0, 0.1]}
empty = hamelin.Scene(document)
loaded = hamelin.Scene({**document, "model": {**document["model"], "payload": payload}})
assert np.isclose(loaded.model.mass - empty.model.mass, payload["mass_kg"])
runs = {
    "no payload": (empty, empty.model, "#000000"),
    "payload, known": (loaded, loaded.model, "#0072B2"),
    "payload, not known": (loaded, empty.model, "#D55E00"),
}

# %%
figure, axes = plt.subplots(3, 1, figsize=(9, 7), sharex=True, layout="constrained")
for name, (scene, model, color) in runs.items():
    result = hamelin.run(scene, planner=ComputedTorque(model), log="payload.jsonl")
    assert result.time_s == scene.duration_s, result.cause
    log = result.read_log()
    ideal = scene.model.tip_pose(motion(log.time_s)[0])[:, :3, 3]
    error_mm = 1e3 * np.linalg.norm(scene.model.tip_pose(log.q)[:, :3, 3] - ideal, axis=1)
    print(f"{name}: tip at most {error_mm.max():.2g} mm from its motion")
    axes[0].plot(log.time_s, log.tau[:, 1], color=color, label=name)
    axes[1].plot(log.time_s, log.tau[:, 3], color=color)
    # The error at the start is zero, which has no logarithm, so the plot begins at 1e-4 mm.
    axes[2].semilogy(log.time_s, np.maximum(error_mm, 1e-4), color=color)
labels = ["torque of joint 2 [Nm]", "torque of joint 4 [Nm]", "tip error [mm]"]
for axis, label in zip(axes, labels):
    axis.set_ylabel(label)
    axis.grid(True, alpha=0.3)
axes[0].legend()
axes[2].set_xlabel("time [s]")
plt.show()
