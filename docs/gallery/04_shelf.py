# %% [markdown]
# # An arm in a shelf
#
# The planner `hybrid` moves an arm with seven joints into three compartments of a shelf and back
# between them. The first figure shows positions, clearance and torques from the log of the run. The
# second one draws the motion from the side and from above, with slices of the map. One learns to
# run a scene, to read its log, and to draw an arm.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

# %%
scene = hamelin.load_scene(hamelin.data_path("scenes/shelf.json"))
result = hamelin.run(scene, log="shelf.jsonl")
print(result)
assert result.ok, result.cause
log = result.read_log()

# %% [markdown]
# ## The log
# `log.plot("q", "clearance_m", "tau")` draws a similar figure in one call. The vertical lines are
# the times at which the goals were reached, from the events of the log. A log has clearances up to
# the distance within which the planner sees obstacles. At a limit, the shield of the scene may stop
# the arm for a moment, which is a peak of the torque; the last line prints these events.

# %%
arm = scene.model
goal_times = [event["time_s"] for event in log.events if event["text"].endswith("reached")]
colors = ["#000000", "#E69F00", "#56B4E9", "#009E73", "#D0B000", "#0072B2", "#D55E00"]
figure, axes = plt.subplots(3, 1, figsize=(9, 7), sharex=True, layout="constrained")
for j, color in enumerate(colors):
    axes[0].plot(log.time_s, log.q[:, j], color=color, label=arm.joint_names[j])
    axes[2].plot(log.time_s, log.tau[:, j], color=color, linewidth=0.8)
axes[1].plot(log.time_s, log.clearance_m, color="#0072B2")
axes[1].set_ylim(bottom=0.0)
for axis, label in zip(axes, ["position [rad]", "clearance [m]", "torque [Nm]"]):
    axis.set_ylabel(label)
    axis.grid(True, alpha=0.3)
    for goal_time in goal_times:
        axis.axvline(goal_time, color="gray", linestyle=":")
axes[0].legend(ncols=7, loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize="small")
axes[2].set_xlabel("time [s]")
plt.show()
print(*(f"{event['time_s']:.3f} s: {event['text']}" for event in log.events), sep="\n")

# %% [markdown]
# ## The motion
# A pose is drawn as a line from the base through the frames of the links, which are at their
# centres of mass, to the tip. The gray areas are the occupied part of the map in one plane. Each
# view shows the poses at the goals, which are not all in that plane, and the path of the tip.

# %%
environment = scene.environment()
tips = arm.tip_pose(log.q)[:, :3, 3]
reached = np.minimum(np.searchsorted(log.time_s, goal_times), log.ticks - 1)
shown = np.concatenate([[0], reached[::2]])  # the goals between them are the pose of the start
frames = arm.forward_kinematics(log.q[shown])[:, :, :3, 3]
base = np.broadcast_to(arm.base[:3, 3], (len(shown), 1, 3))
lines = np.concatenate([base, frames, tips[shown][:, None]], axis=1)

# %%
pose_colors = ["#000000", "#D55E00", "#0072B2", "#009E73"]
figure, axes = plt.subplots(1, 2, figsize=(10, 5.2), layout="constrained")
for axis, (first, second), plane in zip(axes, [(0, 2), (0, 1)], [-0.25, 0.45]):
    normal = 3 - first - second
    grid = np.meshgrid(np.arange(-0.3, 1.1, 0.01), np.arange(-0.75, 1.3, 0.01))
    points = np.full((grid[0].size, 3), plane)
    points[:, first], points[:, second] = grid[0].ravel(), grid[1].ravel()
    distance = environment.distance(points).reshape(grid[0].shape)
    axis.contourf(*grid, distance, [-1.0, 0.0], colors="#bbbbbb")
    axis.plot(tips[:, first], tips[:, second], color="#CC79A7", linewidth=1.0, label="tip")
    for k, line, color in zip(shown, lines, pose_colors):
        label = f"{log.time_s[k]:.2f} s"
        axis.plot(line[:, first], line[:, second], "o-", color=color, markersize=4, label=label)
    low = -0.05 if second == 2 else -0.7
    axis.set(xlim=(-0.25, 1.05), ylim=(low, low + 1.3), aspect="equal")
    axis.set(xlabel=f"{'xyz'[first]} [m]", ylabel=f"{'xyz'[second]} [m]")
    axis.set_title(f"map at {'xyz'[normal]} = {plane:g} m")
axes[1].legend(loc="upper left")
plt.show()
