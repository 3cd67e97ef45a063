# Ten seconds of free fall: how far three integrators let the energy stray.
import numpy as np

import hamelin

arm = hamelin.load_robot("data/robots/arm7.urdf")
q0, v0 = np.full(7, 0.3), np.zeros(7)
for name in ("hamel-variational", "gauss:8", "rk4"):
    integrator = hamelin.Integrator(arm, name)
    state = integrator.start(q0, v0)
    start_J = sum(integrator.energy(state))
    strayed_J = 0.0
    for _ in range(10000):
        if not integrator.step(state, 1e-3).converged:
            raise SystemExit(1)
        strayed_J = max(strayed_J, abs(sum(integrator.energy(state)) - start_J))
    print(f"{name}: {strayed_J:.1e} J")
