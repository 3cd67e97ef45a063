# %% [markdown]
# # Energy over a long time
#
# An arm without motors or friction swings under gravity, so its energy is constant. The script
# integrates this motion with several integrators of fixed step and plots how far the computed
# energy strays. It shows the difference between a bounded error of the energy and a drift.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

# %% [markdown]
# ## The arm and its motion
# A chain of three links hangs below its base and starts at rest, away from its equilibrium. The
# energy error is divided by the largest kinetic energy of the motion.

# %%
arm = hamelin.make_chain(links=3, axes="z", length_m=0.5, mass_kg=1.0, gravity=[0.0, -9.81, 0.0])
q0 = np.array([np.pi - 0.6, 0.3, -0.2])  # the arm hangs at [pi, 0, 0]
step_s, duration_s = 0.02, 500.0
names = ["rk4", "hamel-variational", "newmark", "gauss:4"]
colors = ["#D55E00", "#0072B2", "#CC79A7", "#009E73"]

# %%
motions = {}
for name in names:
    integrator = hamelin.Integrator(arm, name)
    motions[name] = integrator.simulate(q0, step=step_s, duration=duration_s)
    assert motions[name]["completed"], f"{name} did not complete the motion"

# %% [markdown]
# ## Energy error
# The upper plot shows the largest error so far on a logarithmic axis. A curve that becomes flat
# belongs to a bounded error; a curve that keeps rising belongs to a drift. The lower plot shows the
# error itself at the start of the motion.

# %%
figure, axes = plt.subplots(2, 1, figsize=(9, 6), layout="constrained")
for name, color in zip(names, colors):
    motion = motions[name]
    energy = motion["kinetic_J"] + motion["potential_J"]
    error = (energy - energy[0]) / motion["kinetic_J"].max()
    largest = np.maximum.accumulate(np.abs(error))
    axes[0].semilogy(motion["time_s"][1:], largest[1:], color=color, label=name)
    first = motion["time_s"] <= 5.0
    axes[1].semilogy(motion["time_s"][first][1:], np.abs(error[first])[1:], color=color)
axes[0].set(ylabel="largest relative error so far", title=f"Energy error, step {step_s:g} s")
axes[1].set(xlabel="time [s]", ylabel="relative error, first 5 s")
axes[0].set_xlabel("time [s]")
axes[0].legend(loc="lower right", ncols=4)
for axis in axes:
    axis.grid(True, alpha=0.3)
plt.show()
