# %% [markdown]
# # A payload in the hand
#
# The same motion with and without a payload of one kilogram at the tip. The planner knows of it, so
# the arm arrives in both cases, but the torques differ by the load's weight and inertia.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

scene = hamelin.data_path("scenes/shelf.json")
loads = {"no payload": "null", "1 kg": '{"mass_kg": 1.0}'}

# %%
figure, (upper, lower) = plt.subplots(2, 1, figsize=(8.5, 5), layout="constrained", sharex=True)
for (name, payload), style in zip(loads.items(), ("--", "-")):
    result = hamelin.run(scene, set=f"/model/payload={payload}", log="run.jsonl")
    log = hamelin.read_log("run.jsonl")
    joint = int(np.argmax(np.nanmedian(np.abs(log.tau), axis=0)))
    upper.plot(log.time_s, log.q[:, joint], style, label=f"{name}: {result.outcome}")
    lower.plot(log.time_s, log.tau[:, joint], style, label=name)
upper.set_ylabel(f"position of {log.joint_names[joint]} [rad]")
lower.set_ylabel(f"torque of {log.joint_names[joint]} [Nm]")
lower.set_xlabel("time [s]")
upper.legend()
for axis in (upper, lower):
    axis.grid(True, alpha=0.3)
plt.show()
