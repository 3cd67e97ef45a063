# %% [markdown]
# # Slices of a distance field
#
# One call gives the distance of thousands of points from the nearest occupied voxel of a map: here
# horizontal slices through a shelf. Inside of obstacles the distance is negative.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

environment = hamelin.load_scene(hamelin.data_path("scenes/shelf.json")).environment()
x, y = np.meshgrid(np.linspace(-0.2, 1.0, 160), np.linspace(-0.7, 0.7, 180))

# %%
figure, axes = plt.subplots(1, 3, figsize=(9.5, 3.6), layout="constrained", sharey=True)
for axis, z in zip(axes, (0.2, 0.5, 0.8)):
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])
    distance = environment.distance(points, limit=0.4).reshape(x.shape)
    filled = axis.contourf(x, y, distance, levels=np.linspace(-0.05, 0.4, 19), cmap="viridis",
                           extend="both")  # fmt: skip
    axis.contour(x, y, distance, levels=[0.0], colors="white", linewidths=1.2)
    axis.set_title(f"z = {z:.1f} m")
    axis.set_xlabel("x [m]")
    axis.set_aspect("equal")
axes[0].set_ylabel("y [m]")
figure.colorbar(filled, ax=axes, label="distance [m]", shrink=0.8)
plt.show()
