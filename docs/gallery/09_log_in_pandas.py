# %% [markdown]
# # A log as a table of pandas
#
# `Log.to_pandas` gives a table with a row per tick, indexed by the time. The script resamples it,
# computes the smallest clearance of each second, sums up the energies, and saves a CSV file. Logs
# in this form work with everything that reads tables.

# %%
import matplotlib.pyplot as plt
import pandas as pd

import hamelin

result = hamelin.run(hamelin.data_path("scenes/shelf.json"), log="shelf.jsonl")
assert result.ok, result.cause
table = hamelin.read_log("shelf.jsonl").to_pandas()
print(table[["q[0]", "v[0]", "tau[0]", "clearance_m"]].describe())

# %% [markdown]
# ## One row per second
# With an index of time differences, `resample` works as for any time series. The groups begin at
# full seconds, and the last one may be shorter.

# %%
table.index = pd.to_timedelta(table.index, unit="s")
per_second = pd.DataFrame(
    {
        "min_clearance_m": table["clearance_m"].resample("1s").min(),
        "max_kinetic_J": table["energy.kinetic_J"].resample("1s").max(),
        "ticks": table["clearance_m"].resample("1s").count(),
    }
)
per_second.index = per_second.index.total_seconds().rename("begin_s")
per_second.to_csv("per_second.csv")
again = pd.read_csv("per_second.csv", index_col="begin_s")
pd.testing.assert_frame_equal(per_second, again, check_freq=False)
assert per_second["ticks"].sum() == len(table)

# %% [markdown]
# ## Energies
# Kinetic, potential and control energy, less the works of all channels, stay constant up to the
# error of the integrator. The work of stops by the shield has no value before the first stop. The
# columns `filter_work_J` and `recovery_work_J` are parts of the other works, so they do not count.

# %%
seconds = table.index.total_seconds()
energy = table.filter(like="energy.").rename(columns=lambda name: name.removeprefix("energy."))
stored = energy[["kinetic_J", "potential_J", "control_J"]].sum(axis=1)
works = ["gyroscopic_work_J", "held_work_J", "node_work_J", "stop_work_J"]
supplied = energy.reindex(columns=works).fillna(0.0).sum(axis=1) - energy["dissipated_J"]
error = (stored - supplied) - (stored - supplied).iloc[0]
print(f"largest energy error: {error.abs().max():.2e} J")
assert abs(error.abs().max() - result.energy_error_max_J) < 1e-9

# %%
figure, axes = plt.subplots(3, 1, figsize=(9, 7), sharex=True, layout="constrained")
axes[0].bar(per_second.index, per_second["min_clearance_m"], 0.95, align="edge", color="#56B4E9")
axes[0].plot(seconds, table["clearance_m"], color="#000000", linewidth=1.0)
axes[0].set_ylabel("clearance [m]\n(bars: least per second)")
axes[1].plot(seconds, stored - stored.iloc[0], color="#0072B2", label="kinetic + potential")
axes[1].plot(seconds, supplied, "--", color="#D55E00", label="work of all channels")
axes[1].set_ylabel("since the start [J]")
axes[1].legend()
axes[2].plot(seconds, 1e6 * error, color="#000000", linewidth=0.8)
axes[2].set(xlabel="time [s]", ylabel="difference [µJ]")
for axis in axes:
    axis.grid(True, alpha=0.3)
plt.show()
