# %% [markdown]
# # Time against error of integrators
#
# `hamelin.accuracy` integrates the free fall of an arm with seven joints by several integrators
# and step sizes, and measures the error at the end and the processor time. The plot shows which
# integrator is the fastest for an error that one accepts. The times depend on the machine.

# %%
import matplotlib.pyplot as plt

import hamelin

# %% [markdown]
# ## Measurement
# `gauss:4` is the Gauss method of order four. The reference, from which errors are measured, is a
# separate integration of high order; hamelin estimates its error by a second one.

# %%
arm = hamelin.load_robot(hamelin.data_path("robots/arm7.urdf"))
duration_s = 0.5
styles = {
    "hamel-variational": ("#0072B2", "o"),
    "gauss:4": ("#009E73", "s"),
    "gauss:8": ("#56B4E9", "D"),
    "rk4": ("#D55E00", "^"),
    "dop853": ("#CC79A7", "v"),
}
measured = hamelin.accuracy(
    arm,
    integrators=list(styles),
    steps=[0.02, 0.01, 0.005, 0.002, 0.001, 0.0005],
    duration=duration_s,
)
print(measured.table)

# %% [markdown]
# ## Results as a table
# `to_pandas` gives one row per integration. Points whose error is below that of the reference are
# dropped, as are integrations that were not completed.

# %%
table = measured.to_pandas()
table["label"] = [
    f"{row.integrator}:{row.order}" if row.integrator == "gauss" else row.integrator
    for row in table.itertuples()
]
good = table[(table["outcome"] == "completed") & ~table["reference_limited"].astype(bool)]

# %%
figure, axes = plt.subplots(1, 2, figsize=(9, 4.6), sharey=True, layout="constrained")
for label, (color, marker) in styles.items():
    rows = good[good["label"] == label].sort_values("step_s")
    axes[0].loglog(rows["cpu_us"] * 1e-3, rows["error_q"], color=color, marker=marker, label=label)
    axes[1].loglog(rows["step_s"], rows["error_q"], color=color, marker=marker, label=label)
axes[0].set(xlabel="processor time [ms]", ylabel="error of the positions at the end [rad]")
axes[0].set_title(f"{duration_s:g} s of free fall, seven joints")
axes[1].set(xlabel="step [s]", title="Orders: slopes of the lines")
axes[0].legend(loc="lower left", fontsize="small")
for axis in axes:
    axis.grid(True, which="major", alpha=0.3)
plt.show()
