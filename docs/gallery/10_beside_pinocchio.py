# %% [markdown]
# # For people who know Pinocchio
#
# The names of the dynamics algorithms in hamelin beside those of Pinocchio, checks of the
# identities that connect them, and the time of many states in one call. One learns the conventions
# of frames and Jacobians, and that batches need no loop in Python. Pinocchio itself is not used.
#
# | Pinocchio | hamelin |
# |---|---|
# | `pin.buildModelFromUrdf(file)` | `hamelin.load_robot(file)` |
# | `pin.rnea(model, data, q, v, a)` | `arm.rnea(q, v, a)` |
# | `pin.aba(model, data, q, v, tau)` | `arm.aba(q, v, tau)` |
# | `pin.crba(model, data, q)` | `arm.crba(q)`, both triangles |
# | `pin.nonLinearEffects(model, data, q, v)` | `arm.bias_torque(q, v)` |
# | `pin.computeGeneralizedGravity(model, data, q)` | `arm.gravity_torque(q)` |
# | `pin.computeKineticEnergy(model, data, q, v)` | `arm.kinetic_energy(q, v)` |
# | `pin.computePotentialEnergy(model, data, q)` | `arm.potential_energy(q)` |
# | `pin.forwardKinematics(model, data, q)`, `data.oMi` | `arm.forward_kinematics(q)` |
# | `pin.computeFrameJacobian(..., LOCAL_WORLD_ALIGNED)` | `arm.jacobian(q)` |
#
# There is no `data` object. Frames of links are at their centres of mass, not at the joints. The
# Jacobian has the angular rows first, Pinocchio's the linear ones.

# %%
import time

import matplotlib.pyplot as plt
import numpy as np

import hamelin

arm = hamelin.load_robot(hamelin.data_path("robots/arm7.urdf"))
rng = np.random.default_rng(1)
count = 100_000
q = rng.uniform(arm.lower, arm.upper, (count, arm.dof))
v, a = rng.normal(size=(2, count, arm.dof))

# %% [markdown]
# ## Identities
# M a + h = τ, ABA inverts RNEA, the Jacobian is the derivative of the tip's position, the kinetic
# energy is ½ vᵀ M v, and the gravity torque is the gradient of the potential energy.

# %%
few = slice(0, 1000)
tau = arm.rnea(q, v, a)
M, h = arm.crba(q[few]), arm.bias_torque(q[few], v[few])
step = 1e-6
moved = [q[few] + s * step * np.eye(arm.dof)[:, None] for s in (1, -1)]  # shape (dof, 1000, dof)
tips = [np.array([arm.tip_pose(m)[:, :3, 3] for m in side]) for side in moved]
energies = [np.array([arm.potential_energy(m) for m in side]) for side in moved]
jacobian = np.moveaxis((tips[0] - tips[1]) / (2 * step), 0, 2)
gradient = ((energies[0] - energies[1]) / (2 * step)).T
kinetic = 0.5 * np.einsum("ni,nij,nj->n", v[few], M, v[few])
residuals = {
    "M a + h = RNEA": np.einsum("nij,nj->ni", M, a[few]) + h - tau[few],
    "ABA(RNEA(a)) = a": arm.aba(q, v, tau) - a,
    "½ vᵀ M v = kinetic energy": kinetic - arm.kinetic_energy(q[few], v[few]),
    "Jacobian = differences": arm.jacobian(q[few])[:, 3:] - jacobian,
    "gravity = differences": arm.gravity_torque(q[few]) - gradient,
}
largest = {name: np.abs(residual).max() for name, residual in residuals.items()}
assert max(list(largest.values())[:3]) < 1e-8 and max(largest.values()) < 1e-6, largest

# %% [markdown]
# ## Batches
# Arrays of shape (N, n) are N states. One call avoids the cost of a call per state, and runs in
# SIMD lanes. The loop is measured for fewer states, because its time per state is constant.


# %%
def best_time(function, *arrays: np.ndarray) -> float:
    """The shortest of five times of a call, per state [µs]."""
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        function(*arrays)
        times.append(time.perf_counter() - begin)
    return 1e6 * min(times) / len(arrays[0])


sizes = [1, 10, 100, 1000, 10_000, count]
figure, axes = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
axes[0].barh(list(largest), list(largest.values()), color="#0072B2")
axes[0].set(xscale="log", xlabel="largest residual (SI units)", title="identities")
for name, color in {"rnea": "#0072B2", "aba": "#D55E00"}.items():
    call, last = getattr(arm, name), {"rnea": a, "aba": tau}[name]
    batch = [best_time(call, q[:n], v[:n], last[:n]) for n in sizes]
    loop = best_time(lambda *x: [call(*one) for one in zip(*x)], q[few], v[few], last[few])
    axes[1].loglog(sizes, batch, "o-", color=color, label=f"{name}, one call")
    axes[1].axhline(loop, color=color, linestyle="--", label=f"{name}, loop in Python")
axes[1].set(xlabel="states per call", ylabel="time per state [µs]", title="batches")
axes[1].grid(True, alpha=0.3)
axes[1].legend()
plt.show()
