# %% [markdown]
# # Gains of a planner, swept
#
# `plan_sweep` plans a run per combination of values, and `sweep` executes them in parallel processes.
# The picture shows where the planner gyro of the paper's example 5.2 reaches its goal, and when.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

k_p = np.round(np.geomspace(4.0, 32.0, 4), 3)
k_obs = np.round(np.geomspace(0.4, 6.4, 5), 3)
hamelin.plan_sweep(
    "gains",
    hamelin.data_path("scenes/paper_52_gyro.json"),
    vary=[
        "/planner/params/k_p=" + ",".join(map(str, k_p)),
        "/planner/params/k_obs=" + ",".join(map(str, k_obs)),
    ],
)
sweep = hamelin.sweep("gains")

# %%
time_s = np.full((len(k_obs), len(k_p)), np.nan)
for record in sweep.records():
    values = dict(value.split("=") for value in record["labels"]["values"].split())
    row = np.argmin(abs(k_obs - float(values["/planner/params/k_obs"])))
    column = np.argmin(abs(k_p - float(values["/planner/params/k_p"])))
    if record["outcome"] == "reached":
        time_s[row, column] = record["result"]["time_s"]

figure, axis = plt.subplots(figsize=(8.5, 4.5), layout="constrained")
image = axis.imshow(time_s, origin="lower", aspect="auto", cmap="viridis_r")
axis.set_facecolor("0.85")
axis.set_xticks(range(len(k_p)), k_p)
axis.set_yticks(range(len(k_obs)), k_obs)
axis.set_xlabel("attraction k_p [1/s²]")
axis.set_ylabel("gyroscopic gain k_obs [m/s]")
axis.set_title("grey: the goal is not reached")
figure.colorbar(image, label="time to the goal [s]")
plt.show()
