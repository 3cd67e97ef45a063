# %% [markdown]
# # Following a target that moves
#
# `Controller` is hamelin's control loop without a simulation: each tick takes the measured state
# and answers with torques. The script moves a target along a figure of eight, and an integrator
# takes the place of the robot. The plots show the path of the tip and its distance from the target.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

# %% [markdown]
# ## The controller
# A goal of the type "follow" without a motion waits for targets that the program streams.

# %%
file = hamelin.data_path("scenes/follow.json")
document = hamelin.load_scene(file).document
document["goals"] = [{"type": "follow"}]
scene = hamelin.Scene(document, folder=file.parent)
controller = hamelin.Controller(scene)
arm, period_s = scene.model, controller.period_s
start = arm.tip_pose(scene.start_q)


def target_pose(time_s: float) -> np.ndarray:
    """The target's pose: it starts at rest at the tip and then moves along a figure of eight."""
    phase = 0.25 * 2.0 * np.pi * (time_s - 1.0 + np.exp(-time_s))
    pose = start.copy()
    pose[1, 3] += 0.20 * np.sin(phase)
    pose[2, 3] += 0.08 * np.sin(2.0 * phase)
    return pose


# %% [markdown]
# ## The loop
# The target's velocity is not given, so the controller estimates it from the poses. At `jump_s` the
# target jumps upwards by `jump_m`, and the arm catches up.

# %%
robot = hamelin.Integrator(arm, "rk4")
state = robot.start(scene.start_q)
duration_s, jump_s, jump_m = 12.0, 8.0, 0.05
times_s = np.arange(round(duration_s / period_s)) * period_s
targets, tips = [], []
for time_s in times_s:
    target = target_pose(time_s)
    if time_s >= jump_s:
        target[2, 3] += jump_m
    controller.set_target(time_s, target)
    answer = controller.tick(time_s, state.q, robot.velocity(state))
    targets.append(target[:3, 3])
    tips.append(arm.tip_pose(state.q)[:3, 3])
    report = robot.step(state, period_s, hamelin.Channels(held_torque=answer.torque))
    assert report.converged
print(f"controller at the end: {answer.state}")

# %%
target_m, tip_m = np.array(targets), np.array(tips)
error_mm = 1e3 * np.linalg.norm(tip_m - target_m, axis=1)
figure, axes = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
axes[0].plot(*target_m[:, 1:].T, ".", markersize=2, color="#E69F00", label="target")
axes[0].plot(*tip_m[:, 1:].T, color="#0072B2", linewidth=1.0, label="tip")
axes[0].set(xlabel="y [m]", ylabel="z [m]", ylim=(0.36, 0.66), aspect="equal", title="seen along x")
axes[0].legend(loc="lower center", ncols=2, markerscale=4)
# The error at the start is zero, which has no logarithm, so the plot begins at 1e-3 mm.
axes[1].semilogy(times_s, np.maximum(error_mm, 1e-3), color="#0072B2")
axes[1].axvline(jump_s, color="gray", linestyle=":", label="jump of the target")
axes[1].set(xlabel="time [s]", ylabel="distance of tip and target [mm]", title="tracking error")
axes[1].grid(True, alpha=0.3)
axes[1].legend(loc="upper left")
plt.show()
