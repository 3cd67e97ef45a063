# %% [markdown]
# # Following a moving target
#
# A `Controller` is the control loop of a robot. The program tells it where the target is, and each
# tick turns the measured state of the arm into torques. Here an integrator is in place of the robot.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hamelin

scene = hamelin.load_scene(hamelin.data_path("scenes/pillar.json"), set='/goals=[{"type":"follow"}]')
controller = hamelin.Controller(scene)
arm = scene.model
integrator = hamelin.Integrator(arm)
state = integrator.start(scene.start_q)

# %%
h = controller.period_s
start = arm.tip_pose(scene.start_q)
steps, radius, rate = 6000, 0.1, 1.0
tip, target = np.empty((steps, 3)), np.empty((steps, 3))
for k in range(steps):
    phase = rate * k * h
    pose = start.copy()
    pose[:3, 3] += radius * np.array([0.0, np.sin(phase), 1.0 - np.cos(phase)])
    velocity = radius * rate * np.array([0.0, np.cos(phase), np.sin(phase)])
    controller.set_target(k * h, pose, velocity=velocity)
    answer = controller.tick(k * h, state.q, integrator.velocity(state))
    integrator.step(state, h, hamelin.Channels(held_torque=answer.torque))
    tip[k], target[k] = arm.tip_pose(state.q)[:3, 3], pose[:3, 3]

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 4), layout="constrained")
left.plot(target[:, 1], target[:, 2], "--", color="0.4", label="target")
left.plot(tip[:, 1], tip[:, 2], label="tip")
left.set_xlabel("y [m]")
left.set_ylabel("z [m]")
left.set_aspect("equal")
left.legend(loc="center")
right.semilogy(h * np.arange(steps), 1e3 * np.linalg.norm(tip - target, axis=1))
right.set_xlabel("time [s]")
right.set_ylabel("distance of the tip from the target [mm]")
right.grid(True, alpha=0.3)
plt.show()
