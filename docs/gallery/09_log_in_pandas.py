# %% [markdown]
# # A log as a table of pandas
#
# A log becomes a table with one row per tick. From there on everything is pandas: columns by name,
# statistics per half second, files in other formats.

# %%
import matplotlib.pyplot as plt
import pandas as pd

import hamelin

hamelin.run(hamelin.data_path("scenes/pillar.json"), log="run.jsonl")
table = hamelin.read_log("run.jsonl").to_pandas()
print(table[["q[0]", "v[0]", "tau[0]", "clearance_m"]].describe())

# %%
table.index = pd.to_timedelta(table.index, unit="s")
halves = table.resample("500ms").agg({"clearance_m": "min", "energy.kinetic_J": "max"})
halves.index = halves.index.total_seconds()
halves.to_csv("halves.csv")

figure, (upper, lower) = plt.subplots(2, 1, figsize=(8.5, 4.5), layout="constrained", sharex=True)
upper.bar(halves.index, halves["clearance_m"], width=0.45, align="edge", color="tab:blue")
upper.set_ylabel("least clearance [m]")
lower.bar(halves.index, halves["energy.kinetic_J"], width=0.45, align="edge", color="tab:orange")
lower.set_ylabel("largest kinetic energy [J]")
lower.set_xlabel("time [s], by half seconds")
plt.show()
