# %% [markdown]
# # Error against computing time of integrators
#
# `hamelin.accuracy` integrates the same motion by several methods and steps, and measures the error
# against a reference of its own. The best method for a wanted error is the one farthest to the left.

# %%
import matplotlib.pyplot as plt

import hamelin

result = hamelin.accuracy(
    hamelin.data_path("robots/arm7.urdf"),
    integrators=["hamel-variational", "gauss:4", "gauss:8", "rk4"],
    steps=[0.016, 0.008, 0.004, 0.002, 0.001],
    duration=0.8,
    q0=[0.3, -0.6, 0.2, -1.8, 0.1, 1.2, 0.4],
)
table = result.to_pandas()

# %%
figure, axis = plt.subplots(figsize=(8.5, 4.5), layout="constrained")
for (keys, group), marker in zip(table.groupby(["integrator", "order"], sort=False), "osD^"):
    name = "{}, order {}".format(*keys)
    axis.loglog(group["cpu_us"] / 1e3, group["error_q"], marker=marker, label=name)
axis.set_xlabel("computing time [ms]")
axis.set_ylabel("largest error of q at the end [rad]")
axis.grid(True, which="both", alpha=0.3)
axis.legend()
plt.show()
