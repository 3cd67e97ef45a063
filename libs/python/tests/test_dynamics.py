"""Robots, dynamics and distances: the same bits as the C++ libraries."""

import copy
import json
import pickle
import subprocess

import hamelin
import numpy as np
import pytest

STATES = 50


@pytest.fixture(scope="module")
def states():
    return np.random.default_rng(20).normal(size=(STATES, 3, 7))


class Reader:
    """Reads the numbers of the reference one after the other."""

    def __init__(self, numbers):
        self.numbers = numbers
        self.at = 0

    def next(self, *shape):
        size = int(np.prod(shape, dtype=int))
        out = self.numbers[self.at : self.at + size].reshape(shape)
        self.at += size
        return out


@pytest.fixture(scope="module")
def reference(reference_program, robots, scenes, states, tmp_path_factory):
    file = tmp_path_factory.mktemp("reference") / "states.bin"
    file.write_bytes(states.tobytes())
    out = subprocess.run(
        [
            reference_program,
            robots / "arm7.urdf",
            robots / "arm7.spheres.json",
            scenes / "shelf.json",
            file,
        ],
        stdout=subprocess.PIPE,
        check=True,
    ).stdout
    return np.frombuffer(out)


def same(actual, expected):
    assert np.asarray(actual).shape == np.asarray(expected).shape
    assert np.asarray(actual).tobytes() == np.asarray(expected).tobytes()


def test_same_bits_as_the_libraries(arm, scenes, states, reference):
    environment = hamelin.load_scene(scenes / "shelf.json").environment()
    reader = Reader(reference)
    singles, distances = [], []
    for q, v, x in states:
        single = (
            arm.rnea(q, v, x),
            arm.aba(q, v, x),
            arm.gravity_torque(q),
            arm.bias_torque(q, v),
            arm.momentum(q, v),
            arm.solve_mass(q, v),
            arm.crba(q),
            np.array([arm.kinetic_energy(q, v), arm.potential_energy(q)]),
            arm.forward_kinematics(q),
            arm.tip_pose(q),
            arm.jacobian(q),
        )
        for value in single:
            same(value, reader.next(*value.shape))
        distance = (
            environment.clearance(q),
            environment.self_clearance(q),
            environment.distance(arm.tip_pose(q)[:3, 3]),
        )
        same(np.array(distance), reader.next(3))
        singles.append(single)
        distances.append(distance)
    q, v, x = (np.ascontiguousarray(states[:, i]) for i in range(3))
    same(arm.rnea(q, v, x), reader.next(STATES, 7))
    same(arm.aba(q, v, x), reader.next(STATES, 7))
    same(arm.crba(q), reader.next(STATES, 7, 7))
    for matrices in (*arm.rnea_derivatives(q, v, x), *arm.aba_derivatives(q, v, x)):
        same(matrices, reader.next(STATES, 7, 7))
    assert reader.at == reference.size
    # Arrays of states give the same bits as one state after the other.
    same(arm.gravity_torque(q), np.array([s[2] for s in singles]))
    same(arm.bias_torque(q, v), np.array([s[3] for s in singles]))
    same(arm.momentum(q, v), np.array([s[4] for s in singles]))
    same(arm.solve_mass(q, v), np.array([s[5] for s in singles]))
    same(arm.kinetic_energy(q, v), np.array([s[7][0] for s in singles]))
    same(arm.potential_energy(q), np.array([s[7][1] for s in singles]))
    same(arm.forward_kinematics(q), np.array([s[8] for s in singles]))
    same(arm.tip_pose(q), np.array([s[9] for s in singles]))
    same(arm.jacobian(q), np.array([s[10] for s in singles]))
    same(environment.clearance(q), np.array([d[0] for d in distances]))
    same(environment.self_clearance(q), np.array([d[1] for d in distances]))


@pytest.mark.parametrize("count", [0, 1, 2, 135, 136, 137, 300])
def test_layouts_give_the_same_bits(arm, count):
    q, v, x = np.random.default_rng(count).normal(size=(3, count, 7))
    rows = arm.aba(q, v, x)
    assert rows.shape == (count, 7)
    columns = arm.aba(np.asfortranarray(q), np.asfortranarray(v), np.asfortranarray(x))
    mixed = arm.aba(q, np.asfortranarray(v), x)
    strided = arm.aba(np.repeat(q, 2, axis=0)[::2], v[::-1][::-1], x)
    same(columns, rows)
    same(mixed, rows)
    same(strided, rows)
    if count > 1:
        assert columns.flags.f_contiguous
    if count:
        same(arm.aba(q.astype(np.float32).astype(float), v, x)[0].shape, (7,))


@pytest.mark.parametrize("count", [0, 1, 2, 7, 15, 16, 135, 136, 137, 300])
def test_matrices_of_many_states_are_those_of_one(arm, count):
    q, v, x = np.random.default_rng(count).normal(size=(3, count, 7))
    few = range(min(count, 40))
    for function, arguments in [
        (lambda q: (arm.crba(q),), (q,)),
        (arm.rnea_derivatives, (q, v, x)),
        (arm.aba_derivatives, (q, v, x)),
    ]:
        many = function(*arguments)
        columns = function(*(np.asfortranarray(y) for y in arguments))
        mixed = function(np.asfortranarray(q), *arguments[1:])
        for k, matrices in enumerate(many):
            assert matrices.shape == (count, 7, 7)
            assert matrices.flags.c_contiguous
            same(columns[k], matrices)
            same(mixed[k], matrices)
            if count > 1:
                assert columns[k].flags.f_contiguous
        for s in few:
            single = function(*(y[s] for y in arguments))
            for matrices, expected in zip(many, single):
                scale = np.abs(expected).max()
                np.testing.assert_allclose(matrices[s], expected, rtol=0, atol=1e-12 * scale)


def test_a_state_that_is_not_finite_affects_no_other(arm):
    q, v, x = np.random.default_rng(4).normal(size=(3, 40, 7))
    clean = (arm.crba(q), *arm.rnea_derivatives(q, v, x), *arm.aba_derivatives(q, v, x))
    q[13, 2], v[13, 0], x[13, 1] = np.nan, np.inf, -np.inf
    others = np.arange(40) != 13
    found = (arm.crba(q), *arm.rnea_derivatives(q, v, x), *arm.aba_derivatives(q, v, x))
    for matrices, expected in zip(found, clean):
        same(matrices[others], expected[others])
        assert not np.isfinite(matrices[13]).all()


def test_dynamics_against_independent_formulas(arm):
    # M from unit accelerations, energy and power by finite differences.
    rng = np.random.default_rng(3)
    q, v = rng.normal(size=(2, 7))
    M = arm.crba(q)
    columns = [arm.rnea(q, np.zeros(7), e) - arm.gravity_torque(q) for e in np.eye(7)]
    np.testing.assert_allclose(M, np.array(columns).T, atol=1e-12)
    np.testing.assert_allclose(arm.kinetic_energy(q, v), 0.5 * v @ M @ v, rtol=1e-13)
    h = 1e-6
    gradient = [
        (arm.potential_energy(q + h * e) - arm.potential_energy(q - h * e)) / (2 * h)
        for e in np.eye(7)
    ]
    np.testing.assert_allclose(arm.gravity_torque(q), gradient, atol=1e-7)
    J = arm.jacobian(q)[3:]
    moved = [
        (arm.tip_pose(q + h * e) - arm.tip_pose(q - h * e))[:3, 3] / (2 * h) for e in np.eye(7)
    ]
    np.testing.assert_allclose(J, np.array(moved).T, atol=1e-8)
    link = arm.link_names[3]
    point = np.array([0.1, -0.2, 0.05])

    def at(x):
        return (arm.forward_kinematics(x)[3] @ np.append(point, 1.0))[:3]

    moved = [(at(q + h * e) - at(q - h * e)) / (2 * h) for e in np.eye(7)]
    np.testing.assert_allclose(
        arm.jacobian(q, link=link, point=point)[3:], np.array(moved).T, atol=1e-8
    )
    same(arm.jacobian(q, link=3, point=point), arm.jacobian(q, link=link, point=point))


def test_base_and_gravity(robots):
    base = np.eye(4)
    base[:3, 3] = [1.0, 2.0, 3.0]
    here = hamelin.load_robot(robots / "arm7.urdf", base=base, gravity=[0, 0, 0])
    there = hamelin.load_robot(robots / "arm7.urdf")
    q = np.full(7, 0.3)
    np.testing.assert_allclose(
        here.tip_pose(q)[:3, 3], there.tip_pose(q)[:3, 3] + [1, 2, 3], atol=1e-14
    )
    assert not here.gravity_torque(q).any()


def test_models_pickle(robots, states):
    for model in (
        hamelin.load_robot(robots / "arm7.urdf", spheres=robots / "arm7.spheres.json"),
        hamelin.load_robot(robots / "arm6.urdf", gravity=(0.1, 0.2, -3.0)),
        hamelin.make_chain(links=3, axes="z"),
    ):
        again = pickle.loads(pickle.dumps(model))
        assert repr(again) == repr(model)
        q, v, x = states[0][:, : model.dof]
        same(again.aba(q, v, x), model.aba(q, v, x))
        assert again.to_dict() == model.to_dict()
        third = hamelin.Model(model.to_dict(), gravity=model.gravity)
        same(third.aba(q, v, x), model.aba(q, v, x))
        assert copy.deepcopy(model).to_dict() == model.to_dict()


def test_info_and_check_are_those_of_the_program(program, robots):
    files = [robots / "arm7.urdf", "--spheres", robots / "arm7.spheres.json"]
    out = subprocess.run(
        [program, "robot", "info", *files, "--json"], stdout=subprocess.PIPE, check=True
    ).stdout
    expected = json.loads(out)
    arm = hamelin.load_robot(robots / "arm7.urdf", spheres=robots / "arm7.spheres.json")
    actual = hamelin.robot_info(arm)
    del expected["file"]
    assert actual == expected
    out = subprocess.run(
        [program, "robot", "check", *files, "--samples", "200", "--json"], stdout=subprocess.PIPE
    ).stdout
    assert json.loads(out) == hamelin.check_robot(
        robots / "arm7.urdf", spheres=robots / "arm7.spheres.json", samples=200
    )


def test_fit_is_that_of_the_program(program, robots, tmp_path):
    out = tmp_path / "arm6.spheres.json"
    subprocess.run(
        [program, "robot", "fit", robots / "arm6.urdf", "--total", "20", "-o", out],
        stdout=subprocess.DEVNULL,
        check=True,
    )
    fit = hamelin.fit_robot(robots / "arm6.urdf", total=20)
    mine = tmp_path / "mine.json"
    fit.save(mine)
    assert json.loads(mine.read_text()) == json.loads(out.read_text())
    model = hamelin.load_robot(robots / "arm6.urdf", spheres=fit.sidecar)
    assert model.shapes["radius_m"].size > 0


def test_scene_info_has_the_same_clearance(program, scenes):
    out = subprocess.run(
        [program, "scene", "info", scenes / "shelf.json", "--json"],
        stdout=subprocess.PIPE,
        check=True,
    ).stdout
    scene = hamelin.load_scene(scenes / "shelf.json")
    environment = scene.environment()
    assert environment.clearance(scene.start_q, limit=0.2) == json.loads(out)["clearance_at_start_m"]


def test_distances_of_shapes(scenes):
    environment = hamelin.load_scene(scenes / "shelf.json").environment()
    rng = np.random.default_rng(5)
    points = rng.uniform([0.4, -0.4, 0.2], [0.8, 0.4, 1.0], size=(300, 3))
    distances = environment.distance(points)
    spheres = environment.shape_distance(points, radius=0.03)
    outside = distances > 0.03
    np.testing.assert_allclose(spheres[outside], distances[outside] - 0.03, atol=1e-12)
    # The boxes of the map, by brute force.
    low, high = environment.boxes()
    inverse = np.linalg.inv(environment.map_pose)
    local = points @ inverse[:3, :3].T + inverse[:3, 3]
    gap = np.maximum(np.maximum(low[None] - local[:, None], local[:, None] - high[None]), 0.0)
    brute = np.linalg.norm(gap, axis=2).min(axis=1)
    free = brute > 0
    np.testing.assert_allclose(distances[free], brute[free], atol=1e-12)
    assert (distances[~free] <= 0).all()
    # A capsule is no farther than its ends.
    ends = points + rng.normal(scale=0.05, size=points.shape)
    capsules = environment.shape_distance(points, ends, radius=np.full(300, 0.01))
    assert (capsules <= np.minimum(distances, environment.distance(ends)) - 0.01 + 1e-12)[
        outside
    ].all()


def test_contacts_agree_with_clearance(scenes):
    scene = hamelin.load_scene(scenes / "shelf.json")
    environment = scene.environment(influence=0.3)
    q = scene.start_q + 0.1
    contacts = environment.contacts(q, influence=0.3)
    assert contacts.size > 0
    assert contacts["distance_m"].min() == environment.clearance(q, view="planner")
    centers = scene.model.shape_centers(q)
    radius = scene.model.shapes["radius_m"]
    first = contacts[0]
    gap = np.linalg.norm(first["obstacle_point_m"] - centers[first["shape"]])
    np.testing.assert_allclose(gap - radius[first["shape"]], first["distance_m"], atol=1e-9)


def test_limits_of_joints(arm, robots):
    links = hamelin.robot_info(robots / "arm7.urdf")["links"]
    for name in ("lower", "upper", "velocity_max", "effort_max", "damping"):
        given = [np.inf if link[name] is None else link[name] for link in links]
        assert np.array_equal(getattr(arm, name), given)
