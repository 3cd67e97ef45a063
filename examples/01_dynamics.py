# The dynamics of an arm from its URDF: torques, accelerations, mass matrix, and where the tip is.
import numpy as np

import hamelin

arm = hamelin.load_robot("data/robots/arm7.urdf")
q, v, a = np.full(7, 0.3), np.full(7, -0.2), np.ones(7)

tau = arm.rnea(q, v, a)
back = arm.aba(q, v, tau)
print(f"{arm.name}: {arm.dof} joints, {arm.mass:.3f} kg")
print(f"torque of the first joint: {tau[0]:.9f} Nm")
same = "equal" if np.linalg.norm(back - a) < 1e-9 else "wrong"
print(f"back from torques to accelerations: {same}")

mass = arm.crba(q)
print(f"kinetic energy: {0.5 * v @ mass @ v:.9f} J")

tip = arm.frame_pose(q, "flange")[:3, 3]
print("tip: {:.6f} {:.6f} {:.6f} m".format(*tip))
