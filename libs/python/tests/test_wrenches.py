"""Wrenches of the surroundings: dynamics, steps, and laws that depend on the state."""

import hamelin
import numpy as np
import pytest


@pytest.fixture
def state():
    return np.random.default_rng(7).uniform(-0.5, 0.5, size=(3, 7))


def pushes(arm):
    return [
        arm.wrench(force=[1, -2, 3], moment=[0.1, 0, 0.2]),
        arm.wrench("panda_link4", force=[0, 5, 0], reference="local"),
        arm.wrench("panda_link6", moment=[1, 1, -1], force=[2, 0, 0], reference="world"),
    ]


def test_torques_are_those_of_the_jacobians(panda, state):
    q, v, a = state
    wrenches = pushes(panda)
    expected = sum(
        panda.frame_jacobian(q, w.frame, reference=w.reference).T @ w.wrench for w in wrenches
    )
    tau = panda.external_torque(q, wrenches)
    assert np.allclose(tau, expected, rtol=0, atol=1e-13)
    needed = panda.rnea(q, v, a, wrenches=wrenches)
    assert np.allclose(needed, panda.rnea(q, v, a) - tau, rtol=0, atol=1e-12)
    assert np.allclose(panda.aba(q, v, needed, wrenches=wrenches), a, rtol=0, atol=1e-9)


def test_many_states(panda):
    q, v, a = np.random.default_rng(3).uniform(-1, 1, size=(3, 40, 7))
    wrenches = pushes(panda)
    together = panda.rnea(q, v, a, wrenches=wrenches)
    for i in range(40):
        assert np.array_equal(together[i], panda.rnea(q[i], v[i], a[i], wrenches=wrenches))


def test_the_work_of_a_push_is_in_the_energy(panda, state):
    channels = hamelin.Channels(wrenches=pushes(panda))
    out = hamelin.Integrator(panda, "gauss").simulate(
        state[0], step=1e-3, duration=0.1, channels=channels
    )
    gained = np.diff(out["kinetic_J"] + out["potential_J"])
    assert np.abs(out["external_work_J"]).sum() > 1e-3
    assert np.allclose(gained, out["external_work_J"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["gauss", "hamel-variational", "rk4"])
def test_a_spring_by_a_law(panda, state, name):
    anchor, stiffness = np.array([0.4, 0.1, 0.5]), 50.0

    def spring(q, v):
        force = stiffness * (anchor - panda.tip_pose(q)[:3, 3])
        return [[0, 0, 0, *force]]

    channels = hamelin.Channels(wrenches=[panda.wrench()], wrench_law=spring)
    out = hamelin.Integrator(panda, name).simulate(
        state[0], step=1e-3, duration=0.1, channels=channels
    )
    away = panda.tip_pose(out["q"])[:, :3, 3] - anchor
    total = out["kinetic_J"] + out["potential_J"] + 0.5 * stiffness * (away**2).sum(axis=1)
    assert np.ptp(total) < (1e-12 if name == "gauss" else 1e-3) * abs(total[0])


def test_what_a_law_raises_arrives(panda, state):
    def broken(q, v):
        raise RuntimeError("no sensor")

    integrator = hamelin.Integrator(panda, "gauss")
    with pytest.raises(RuntimeError, match="no sensor"):
        integrator.simulate(
            state[0],
            step=1e-3,
            duration=0.1,
            channels=hamelin.Channels(wrenches=[panda.wrench()], wrench_law=broken),
        )
    wrong = hamelin.Channels(wrenches=[panda.wrench()], wrench_law=lambda q, v: np.zeros(6))
    with pytest.raises(hamelin.Error, match=r"wrench_law: it returned shape \(6,\), expected"):
        integrator.step(integrator.start(state[0]), 1e-3, wrong)


def test_wrong_wrenches(panda, state):
    with pytest.raises(TypeError, match="expected wrenches"):
        panda.rnea(*state, wrenches=[[0, 0, 1]])
    with pytest.raises(hamelin.Error, match="did you mean 'panda_link4'"):
        panda.wrench("panda_lnk4")
    with pytest.raises(hamelin.Error, match="force"):
        panda.wrench(force=[1, 2])
    assert "force [1, -2, 3]" in repr(pushes(panda)[0])


@pytest.mark.parametrize("name", ["hamel-variational", "gauss"])
def test_derivatives_of_a_step(panda, state, name):
    integrator = hamelin.Integrator(panda, name)
    h, d = 0.01, 1e-6
    torque = panda.gravity_torque(state[0])

    def after(q, tau, step):
        channels = hamelin.Channels(held_torque=tau, wrenches=pushes(panda))
        out = integrator.start(q)
        assert integrator.step(out, step, channels).converged
        return out, channels

    def numbers(*arguments):
        out, _ = after(*arguments)
        return np.concatenate([out.q, out.momentum])

    found = integrator.step_derivatives(*after(state[0], torque, h))
    assert found["step_s"] == h
    by_torque = [
        (numbers(state[0], torque + d * e, h) - numbers(state[0], torque - d * e, h)) / (2 * d)
        for e in np.eye(7)
    ]
    assert np.allclose(found["by_torque"], np.array(by_torque).T, atol=1e-8)
    by_step = (numbers(state[0], torque, h + d) - numbers(state[0], torque, h - d)) / (2 * d)
    assert np.allclose(found["by_step"], by_step, atol=1e-6)
    assert found["by_state"].shape == (14, 14)
    with pytest.raises(hamelin.Error, match="expected hamel-variational or gauss"):
        rk4 = hamelin.Integrator(panda, "rk4")
        rk4.step_derivatives(rk4.start(state[0]))
