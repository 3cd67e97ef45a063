# %% [markdown]
# # Energy of a free arm over many steps
#
# A chain of three links swings freely, so its total energy is constant. The energy error of a
# variational integrator oscillates, and does not grow with the number of steps; that of an explicit
# Runge-Kutta method of higher order begins smaller, and grows.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

chain = hamelin.make_chain(links=3, length_m=0.5, gravity=[0.0, -9.81, 0.0])
q0 = np.array([np.pi - 0.8, 0.3, 0.2])  # hanging, drawn aside

# %%
figure, axis = plt.subplots(figsize=(8.5, 4), layout="constrained")
for name in ("hamel-variational", "gauss:6", "rk4"):
    integrator = hamelin.Integrator(chain, name)
    motion = integrator.simulate(q0, step=0.02, duration=400.0, every=20)
    energy = motion["kinetic_J"] + motion["potential_J"]
    axis.semilogy(motion["time_s"][1:], np.abs(energy - energy[0])[1:], linewidth=0.7, label=name)
axis.set_xlabel("time [s]")
axis.set_ylabel("energy error [J]")
axis.grid(True, alpha=0.3)
axis.legend(loc="lower right")
plt.show()
