# %% [markdown]
# # Slices of a distance field
#
# The distance of any point to the nearest obstacle is what planners and safety checks ask for. The
# script evaluates it on grids of points in the map of a shelf, with one call per grid, and draws
# three slices. One sees boards, side walls and the divider, and how wide the compartments are.

# %%
import time

import matplotlib.pyplot as plt
import numpy as np

import hamelin

# %%
scene = hamelin.load_scene(hamelin.data_path("scenes/shelf.json"))
environment = scene.environment()
limit_m = 0.3  # distances are not searched beyond it

# %% [markdown]
# ## Slices
# A slice is a plane on which one coordinate is constant. `Environment.distance` takes points of
# shape (N, 3) and returns N distances to the map, which are zero or negative in its occupied boxes.

# %%
ranges = {"x": (0.2, 1.1), "y": (-0.8, 0.8), "z": (-0.05, 1.25)}
slices = [("x", 0.75), ("y", -0.25), ("z", 0.45)]
resolution_m = 0.005


def distances(normal: str, value: float) -> tuple[list[str], list[np.ndarray], np.ndarray, float]:
    """The distance on a plane: names and values of its axes, the field, the time of the call."""
    names = [name for name in "xyz" if name != normal]
    lines = [np.arange(*ranges[name], resolution_m) for name in names]
    first, second = np.meshgrid(*lines)
    points = np.full((first.size, 3), value)
    points[:, "xyz".index(names[0])] = first.ravel()
    points[:, "xyz".index(names[1])] = second.ravel()
    begin = time.perf_counter()
    field = environment.distance(points, limit=limit_m).reshape(first.shape)
    return names, lines, field, time.perf_counter() - begin


# %%
widths = {"gridspec_kw": {"width_ratios": [1.6, 0.95, 0.9]}}
figure, axes = plt.subplots(1, 3, figsize=(10, 4.2), layout="constrained", **widths)
for axis, (normal, value) in zip(axes, slices):
    names, lines, field, seconds = distances(normal, value)
    levels = np.linspace(0.0, limit_m, 13)
    filled = axis.contourf(*lines, field, levels, cmap="viridis")
    axis.contourf(*lines, field, [-1.0, 0.0], colors="#303030")
    axis.contour(*lines, field, [0.1], colors="white", linewidths=1.0)
    axis.set(xlabel=f"{names[0]} [m]", ylabel=f"{names[1]} [m]", aspect="equal")
    axis.set_title(f"{normal} = {value:g} m")
    print(f"{normal} = {value:g} m: {field.size} points in {1e3 * seconds:.1f} ms")
figure.colorbar(filled, ax=axes, label="distance to the map [m]")
figure.suptitle("Distance to the shelf (dark: occupied, white line: 0.1 m)")
plt.show()
