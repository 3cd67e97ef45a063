# %% [markdown]
# # An arm through a shelf
#
# The arm of a scene visits the compartments of a shelf, whose map it avoids with all of its links.
# The picture shows some poses of the arm above a slice of the map, and clearance and velocities of
# the run's log.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

scene = hamelin.load_scene(hamelin.data_path("scenes/shelf.json"))
result = hamelin.run(scene, log="shelf.jsonl")
log = hamelin.read_log("shelf.jsonl")
print(result)

# %%
# The origins of the links at 40 ticks, seen from the side.
x, z = np.meshgrid(np.linspace(-0.3, 1.0, 160), np.linspace(-0.05, 1.2, 160))
points = np.column_stack([x.ravel(), np.full(x.size, 0.25), z.ravel()])
distance = scene.environment().distance(points, limit=0.3).reshape(x.shape)
chosen = np.linspace(0, log.ticks - 1, 40).astype(int)
poses = scene.model.forward_kinematics(log.q[chosen])  # (40, links, 4, 4)

figure = plt.figure(figsize=(9.5, 4.4), layout="constrained")
left, right = figure.subfigures(1, 2, width_ratios=[1, 1.1])
axis = left.subplots()
axis.contourf(x, z, distance, levels=[-1.0, 0.0], colors=["0.5"])
for shade, frames in zip(np.linspace(0.15, 0.95, len(poses)), poses):
    joints = np.vstack([np.zeros(3), frames[:, :3, 3]])
    axis.plot(joints[:, 0], joints[:, 2], color=plt.cm.viridis(shade), linewidth=1.2)
axis.set_xlabel("x [m]")
axis.set_ylabel("z [m]")
axis.set_title("links from start (dark) to end (light); map at y = 0.25 m", fontsize="small")
axis.set_aspect("equal")
log.plot("clearance_m", "v", "tau", figure=right)
plt.show()
