# %% [markdown]
# # For users of Pinocchio
#
# The same quantities under hamelin's names, with identities that they satisfy, and the time of many
# states in one call beside a loop in Python.
#
# | Pinocchio | hamelin |
# |---|---|
# | `pin.buildModelFromUrdf(file)` | `hamelin.load_robot(file)` |
# | `pin.rnea(model, data, q, v, a)` | `arm.rnea(q, v, a)` |
# | `pin.aba(model, data, q, v, tau)` | `arm.aba(q, v, tau)` |
# | `pin.crba(model, data, q)` | `arm.crba(q)` |
# | `pin.computeGeneralizedGravity(model, data, q)` | `arm.gravity_torque(q)` |
# | `pin.forwardKinematics`, `data.oMi` | `arm.forward_kinematics(q)`, shape (links, 4, 4) |
# | `pin.computeJointJacobians`, LOCAL_WORLD_ALIGNED | `arm.jacobian(q)`, angular rows first |
# | `pin.computeTotalEnergy` | `arm.kinetic_energy(q, v) + arm.potential_energy(q)` |

# %%
import time

import matplotlib.pyplot as plt
import numpy as np

import hamelin

arm = hamelin.load_robot(hamelin.data_path("robots/arm7.urdf"))
rng = np.random.default_rng(1)
q, v, a = rng.uniform(-1.0, 1.0, (3, 7))
tau = arm.rnea(q, v, a)

# %%
# Forward dynamics inverts inverse dynamics; M(q) a plus the bias torque is the torque.
np.testing.assert_allclose(arm.aba(q, v, tau), a, atol=1e-9)
np.testing.assert_allclose(arm.crba(q) @ a + arm.bias_torque(q, v), tau, atol=1e-9)
# The linear rows of the Jacobian are the derivative of the tip's position.
step = 1e-6
moved = [arm.tip_pose(q + step * e)[:3, 3] - arm.tip_pose(q - step * e)[:3, 3] for e in np.eye(7)]
np.testing.assert_allclose(arm.jacobian(q)[3:], np.transpose(moved) / (2 * step), atol=1e-8)

# %%
arm.aba(*rng.uniform(-1.0, 1.0, (3, 10, 7)))  # so that the first call's set-up is not measured
counts = [1, 10, 100, 1000, 10_000, 100_000]
loop, batch = [], []
for count in counts:
    Q, V, T = rng.uniform(-1.0, 1.0, (3, count, 7))
    begun = time.perf_counter()
    arm.aba(Q, V, T)
    batch.append((time.perf_counter() - begun) / count)
    few = min(count, 10_000)
    begun = time.perf_counter()
    for i in range(few):
        arm.aba(Q[i], V[i], T[i])
    loop.append((time.perf_counter() - begun) / few)

figure, axis = plt.subplots(figsize=(8.5, 4), layout="constrained")
axis.loglog(counts, 1e6 * np.array(loop), "o-", label="a call per state")
axis.loglog(counts, 1e6 * np.array(batch), "s-", label="one call for all states")
axis.set_xlabel("number of states")
axis.set_ylabel("time per state [µs]")
axis.set_title(f"forward dynamics of seven joints, instruction set {hamelin.instruction_set()}")
axis.grid(True, which="both", alpha=0.3)
axis.legend()
plt.show()
