# %% [markdown]
# # A sweep over gains
#
# A planar arm with four links passes a ball with the planner `gyro`. A sweep runs this scene for
# all combinations of two gains, and heat maps show which ones reach the goal, how long they take,
# and how close the arm comes to the ball. One learns to plan and execute many runs in one call.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

# %% [markdown]
# ## Runs
# `vary` gives the values of a parameter by its place in the scene file. Each run is a process of
# its own; `jobs` sets how many run at the same time. The folder keeps plan and records, so that a
# sweep that was interrupted resumes with `hamelin.sweep("gains")`.

# %%
attraction = [2, 5, 8, 11, 16, 24]  # k_p [1/s²]
turning = [0, 1, 3, 8]  # k_obs [m/s]


def vary(name: str, values: list[int]) -> str:
    """The values of a planner's parameter, as `sweep` takes them."""
    return f"/planner/params/{name}={','.join(map(str, values))}"


sweep = hamelin.sweep(
    "gains",
    scenes=hamelin.data_path("scenes/paper_52_gyro.json"),
    vary=[vary("k_p", attraction), vary("k_obs", turning)],
    jobs=1,
)
print(sweep)

# %% [markdown]
# ## Records
# A record has the outcome and the result of a run. The varied values are in its label `values`, as
# "/planner/params/k_p=2 /planner/params/k_obs=0".

# %%
time_s = np.full((len(turning), len(attraction)), np.nan)
clearance_m = np.full_like(time_s, np.nan)
outcomes = np.full(time_s.shape, "", dtype=object)
for record in sweep.records():
    pairs = (text.rsplit("/", 1)[1].split("=") for text in record["labels"]["values"].split())
    gains = {name: int(value) for name, value in pairs}
    at = turning.index(gains["k_obs"]), attraction.index(gains["k_p"])
    outcomes[at] = record["outcome"]
    clearance_m[at] = record["result"]["min_clearance_m"]
    if record["outcome"] == "reached":
        time_s[at] = record["result"]["time_s"]
assert all(outcomes.ravel()), "a run has no record"

# %%
figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
labels = ["time to the goal [s]", "smallest clearance [mm]"]
for axis, values, label in zip(axes, [time_s, 1e3 * clearance_m], labels):
    image = axis.imshow(values, origin="lower", cmap="cividis", aspect="auto")
    figure.colorbar(image, ax=axis, label=label)
    for (row, column), value in np.ndenumerate(values):
        text = outcomes[row, column] if np.isnan(value) else f"{value:.0f}"
        bright = value > 0.5 * (np.nanmin(values) + np.nanmax(values))
        color = "black" if bright or np.isnan(value) else "white"
        axis.text(column, row, text, ha="center", va="center", color=color, fontsize=9)
    axis.set_xticks(range(len(attraction)), attraction)
    axis.set_yticks(range(len(turning)), turning)
    axis.set(xlabel="gain of the attraction k_p [1/s²]", ylabel="gain of the turning k_obs [m/s]")
plt.show()
