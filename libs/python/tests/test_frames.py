"""Frames by name: poses, Jacobians, velocities and accelerations."""

import hamelin
import numpy as np
import pytest

REFERENCES = ["world", "local", "local_world_aligned"]
TIME = 1e-6


@pytest.fixture
def state():
    return np.random.default_rng(48).uniform(-0.5, 0.5, size=(3, 7))


def test_frames_are_the_links_of_the_file(panda):
    names = panda.frame_names
    assert names[0] == panda.tip_name == "panda_hand"
    assert {"panda_link0", "panda_link3", "panda_link8", "panda_leftfinger"} <= set(names)
    q = np.zeros(7)
    poses = panda.frame_poses(q)
    assert poses.shape == (len(names), 4, 4)
    for index, name in enumerate(names):
        assert np.array_equal(poses[index], panda.frame_pose(q, name))
        assert np.array_equal(poses[index], panda.frame_pose(q, index))
    assert np.array_equal(panda.frame_pose(q), panda.tip_pose(q))
    assert np.array_equal(panda.frame_pose(q, "panda_link0"), np.eye(4))
    # The first joint is 0.333 m above the base, in the file.
    assert np.allclose(panda.frame_pose(q, "panda_link1")[:3, 3], [0, 0, 0.333], atol=1e-15)


@pytest.mark.parametrize("reference", REFERENCES)
def test_velocities_and_accelerations(panda, state, reference):
    q, v, a = state
    frame = {"frame": "panda_link8", "reference": reference}
    jacobian = panda.frame_jacobian(q, **frame)
    velocity = panda.frame_velocity(q, v, **frame)
    assert np.allclose(jacobian @ v, velocity, atol=1e-14)
    drift = panda.frame_drift(q, v, **frame)
    assert np.allclose(
        jacobian @ a + drift, panda.frame_acceleration(q, v, a, **frame), atol=1e-13
    )
    later, earlier = (
        panda.frame_velocity(q + t * v + 0.5 * t * t * a, v + t * a, **frame)
        for t in (TIME, -TIME)
    )
    assert np.allclose((later - earlier) / (2 * TIME), jacobian @ a + drift, atol=1e-8)


def test_many_states(panda):
    q, v, a = np.random.default_rng(3).uniform(-1, 1, size=(3, 40, 7))
    for function, arguments in [
        (panda.frame_pose, (q,)),
        (panda.frame_jacobian, (q,)),
        (panda.frame_velocity, (q, v)),
        (panda.frame_drift, (q, v)),
        (panda.frame_acceleration, (q, v, a)),
    ]:
        together = function(*arguments, "panda_link5")
        single = [function(*(x[i] for x in arguments), "panda_link5") for i in range(40)]
        assert np.allclose(together, single, rtol=0, atol=1e-14)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("states", [1, 7, 300])
def test_many_states_in_both_orders(panda, order, states):
    q = np.asarray(np.random.default_rng(4).uniform(-1, 1, size=(states, 7)), order=order)
    poses, jacobians = panda.frame_pose(q, "panda_link6"), panda.frame_jacobian(q, "panda_link6")
    assert poses.shape == (states, 4, 4)
    assert jacobians.shape == (states, 6, 7)
    for i in range(states):
        assert np.allclose(poses[i], panda.frame_pose(q[i], "panda_link6"), rtol=0, atol=1e-14)
        assert np.allclose(
            jacobians[i], panda.frame_jacobian(q[i], "panda_link6"), rtol=0, atol=1e-14
        )
    if order == "F" and states > 1:
        assert jacobians.flags.f_contiguous


def test_derivatives_of_the_dynamics(panda, state):
    q, v, a = state
    push = [panda.wrench(force=[3, -2, 5], moment=[0.1, 0.2, -0.3], reference="local")]
    h = 1e-6

    def differences(function, x, argument):
        columns = []
        for unit in np.eye(7):
            up, down = (
                function(*(y + h * sign * unit * (i == argument) for i, y in enumerate(x)))
                for sign in (1, -1)
            )
            columns.append((up - down) / (2 * h))
        return np.array(columns).T

    tau = panda.rnea(q, v, a, wrenches=push)
    for derivatives, function, x in [
        (panda.rnea_derivatives, panda.rnea, (q, v, a)),
        (panda.aba_derivatives, panda.aba, (q, v, tau)),
    ]:
        found = derivatives(*x, wrenches=push)
        for argument in range(3):
            expected = differences(lambda *y: function(*y, wrenches=push), x, argument)
            assert np.allclose(found[argument], expected, rtol=1e-5, atol=1e-5)
        many = derivatives(*(np.tile(y, (20, 1)) for y in x), wrenches=push)
        assert all(np.array_equal(m[7], f) for m, f in zip(many, found))


def test_the_regressor(panda, state):
    parameters = panda.inertial_parameters
    regressor = panda.regressor(*state)
    assert regressor.shape == (7, 70)
    assert np.allclose(regressor @ parameters, panda.rnea(*state), rtol=0, atol=1e-12)
    heavier = 1.1 * parameters
    other = panda.with_inertial_parameters(heavier)
    assert np.isclose(other.mass, 1.1 * panda.mass)
    assert np.allclose(other.rnea(*state), regressor @ heavier, rtol=0, atol=1e-11)


def test_centre_of_mass_and_momentum(panda, state):
    q, v, _ = state
    matrix = panda.centroidal_matrix(q)
    assert np.allclose(matrix @ v, panda.centroidal_momentum(q, v), atol=1e-14)
    later, earlier = (panda.center_of_mass(q + t * v) for t in (TIME, -TIME))
    velocity = (later - earlier) / (2 * TIME)
    assert np.allclose(panda.mass * velocity, panda.centroidal_momentum(q, v)[3:], atol=1e-8)


def test_the_frame_jacobian_of_the_tip_is_the_jacobian(panda, state):
    assert np.allclose(panda.frame_jacobian(state[0]), panda.jacobian(state[0]), atol=1e-15)


def test_frames_survive_a_document(panda, state):
    again = hamelin.Model(panda.to_dict())
    assert again.frame_names == panda.frame_names
    assert np.array_equal(again.frame_poses(state[0]), panda.frame_poses(state[0]))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m, q: m.frame_pose(q, "panda_lnk8"), "did you mean 'panda_link8'"),
        (lambda m, q: m.frame_pose(q, -1), "frame: -1, expected 0 to"),
        (
            lambda m, q: m.frame_jacobian(q, reference="body"),
            "reference: 'body', expected 'world', 'local' or 'local_world_aligned'",
        ),
        (lambda m, q: m.frame_velocity(q, q[:3]), r"v: shape \(3,\), expected"),
    ],
)
def test_wrong_arguments(panda, call, message):
    with pytest.raises(hamelin.Error, match=message):
        call(panda, np.zeros(7))
