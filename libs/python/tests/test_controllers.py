"""The control loop: stop and resume, goals, bounds per joint, maps, and what it counts."""

import threading

import hamelin
import numpy as np
import pytest


@pytest.fixture()
def document(scenes):
    """A scene as a dict, whose paths start from the folder of another scene."""
    found = dict(hamelin.load_scene(scenes / "clutter.json").document)
    found["actuation"] = {"type": "sampled", "control_period_s": 0.001}
    found["planner"]["guide"] = "none"  # a thread would take its own time
    return found


@pytest.fixture()
def scene(document, scenes):
    return hamelin.Scene(document, folder=scenes)


class Servos:
    """An arm that follows its set points exactly."""

    def __init__(self, controller, q):
        self.controller, self.k = controller, 0
        self.q, self.v = np.array(q), np.zeros(len(q))

    def move(self, ticks, until=()):
        for _ in range(ticks):
            answer = self.controller.tick(self.k * self.controller.period_s, self.q, self.v)
            self.acceleration = (answer.v_next - self.v) / self.controller.period_s
            self.q, self.v, self.k = answer.q_next, answer.v_next, self.k + 1
            if answer.state in until:
                break
        return answer


def test_stop_and_resume(scene):
    controller = hamelin.Controller(scene, position=True)
    servos = Servos(controller, scene.start_q)
    answer = servos.move(500)
    assert answer.state == "running" and answer.reason is None and answer.cause == ""
    assert np.linalg.norm(servos.v) > 0.1
    controller.resume()  # without effect
    thread = threading.Thread(target=controller.stop, args=("the door\nis open",))
    thread.start()
    thread.join()
    answer = servos.move(1)
    assert (answer.state, answer.reason) == ("stopping", "request")
    assert answer.cause and "\n" not in answer.cause
    servos.move(1500)
    assert np.abs(servos.v).max() < 1e-3
    controller.resume()
    answer = servos.move(1)
    assert answer.state == "running" and answer.reason is None
    assert servos.move(20000, until=("reached",)).state == "reached"
    assert answer.cause == ""


def test_an_object_is_the_planner_again_after_it_failed(scene):
    class Failing:
        fails = True

        def tick(self, tick, command):
            if Failing.fails:
                raise RuntimeError("out of ideas")

    controller = hamelin.Controller(scene, planner=Failing(), position=True)
    servos = Servos(controller, scene.start_q)
    answer = servos.move(50)
    assert answer.reason == "planner" and "out of ideas" in answer.cause
    Failing.fails = False
    controller.resume()
    assert servos.move(10).state == "running"


def test_an_arm_that_cannot_follow_is_stopped(scene):
    controller = hamelin.Controller(scene, position=True, tracking_max=0.03)
    q = scene.start_q
    for k in range(3000):
        answer = controller.tick(0.001 * k, q, np.zeros(7))  # the brake is on
        if answer.state == "stopping":
            break
    assert answer.reason == "tracking" and "0.03 (tracking_max)" in answer.cause


def test_bounds_of_single_joints(scene):
    bounds = np.full(7, 15.0)
    bounds[3] = 0.5
    largest = {}
    for name, given in (("usual", 15.0), ("bounded", bounds), ("default", None)):
        controller = hamelin.Controller(scene, position=True, acceleration_max=given)
        servos = Servos(controller, scene.start_q)
        largest[name] = np.zeros(7)
        for _ in range(500):
            servos.move(1)
            largest[name] = np.maximum(largest[name], np.abs(servos.acceleration))
    assert largest["usual"][3] > 1.0
    assert largest["bounded"][3] <= 0.5 * 1.001
    np.testing.assert_array_equal(largest["usual"], largest["default"])


@pytest.mark.parametrize("name", ["acceleration_max", "jerk_max", "tracking_max"])
def test_wrong_bounds_are_refused(scene, name):
    for given, message in (
        ([1.0] * 3, "3 values given"),
        ([], "0 values given"),
        (-1.0, "expected positive numbers"),
        (np.ones((7, 7)), r"shape \(7, 7\)"),
    ):
        with pytest.raises(hamelin.Error, match=message) as raised:
            hamelin.Controller(scene, position=True, **{name: given})
        assert name in str(raised.value)
    with pytest.raises(TypeError):
        hamelin.Controller(scene, **{name: "fast"})


def test_a_dict_is_a_scene(document, scene, scenes, monkeypatch):
    monkeypatch.chdir(scenes)  # where the paths of a dict start
    from_dict = hamelin.Controller(document)
    from_scene = hamelin.Controller(scene)
    for controller in (from_dict, from_scene):
        controller.world.set_map(None)
    q, v = scene.start_q, np.zeros(7)
    expected = from_scene.tick(0.0, q, v).torque
    assert from_dict.tick(0.0, q, v).torque.tobytes() == expected.tobytes()


def test_lists_of_goals(scene):
    controller = hamelin.Controller(scene, position=True)
    servos = Servos(controller, scene.start_q)
    near = {"type": "joint", "q": [0.1, -0.7, 0.1, -2.2, 0.0, 1.6, 0.8]}
    back = {"type": "joint", "q": list(scene.start_q)}
    number = controller.set_goals([near, back])
    seen = []
    for _ in range(20000):
        answer = servos.move(1)
        assert answer.goals_number == number
        seen.append(answer.goal_index)
        if answer.state == "reached":
            break
    assert answer.state == "reached" and sorted(set(seen)) == [0, 1, 2] and seen == sorted(seen)
    for wrong, message in (
        ([], "none are given"),
        ({"type": "join"}, "goals: /goals/0"),
        ([near, {"type": "joint", "q": "there"}], "goals: /goals/1/q"),
        ({"type": "joint", "q": [0.0]}, "expected 7"),
    ):
        with pytest.raises(hamelin.Error, match=message):
            controller.set_goals(wrong)
    assert servos.move(1).goals_number == number


def test_what_a_goal_may_touch(scene):
    controller = hamelin.Controller(scene)
    q, v = list(scene.start_q), np.zeros(7)
    box = [0.6, 0.3, 0.2, 0.8, 0.5, 0.4]
    controller.set_goals({"type": "joint", "q": q, "may_touch": {"boxes_m": [box]}})
    assert controller.tick(0.0, q, v).may_touch
    with pytest.raises(hamelin.Error, match="goal 1: may_touch: obstacle 'can': there is none"):
        controller.set_goals({"type": "joint", "q": q, "may_touch": {"obstacles": ["can"]}})
    controller.set_goals({"type": "joint", "q": q})
    assert not controller.tick(0.001, q, v).may_touch


def test_trajectories_and_targets_are_in_the_answer(scene):
    controller = hamelin.Controller(scene, position=True)
    q = list(scene.start_q)
    answer = controller.tick(0.0, q, np.zeros(7))
    assert answer.target is None and answer.reference is None
    controller.set_goals({"type": "follow"})
    answer = controller.tick(0.001, q, np.zeros(7))
    assert answer.target["waiting"] and not answer.target["lost"]
    np.testing.assert_allclose(answer.target["pose"], controller.tip, atol=1e-9)
    points = [{"time_s": 0.0, "q": q}, {"time_s": 2.0, "q": q}]
    with pytest.raises(hamelin.Error):
        controller.set_goals({"type": "trajectory", "trajectory": points})


def test_points_of_a_depth_camera(document, scenes):
    document["map"] = {"resolution_m": 0.02}
    controller = hamelin.Controller(hamelin.Scene(document, folder=scenes))
    world, q, v = controller.world, hamelin.Scene(document, folder=scenes).start_q, np.zeros(7)
    controller.tick(0.0, q, v)
    y, z = np.meshgrid(np.arange(-0.2, 0.2, 0.02) + 0.013, np.arange(0.4, 0.8, 0.02) + 0.013)
    wall = np.column_stack([np.full(y.size, 1.613), y.ravel(), z.ravel() - 1.2])
    pose = np.eye(4)
    pose[:3, 3] = [-0.8, 0.0, 1.2]
    report = world.insert_points(wall, pose, time=0.0, range=3.0)
    assert report["points"] + report["on_arm"] == y.size
    assert report["occupied"] == report["points"] > 100
    assert report["snapshot"] == world.number == 1
    assert world.insert_points(wall, pose, time=0.0)["snapshot"] == 1  # nothing new
    for call, message in (
        (lambda: world.insert_points(wall[:, :2], pose, time=0.0), "shape \\(N, 3\\)"),
        (lambda: world.insert_points(wall * np.nan, pose, time=0.0), "one is not finite"),
        (lambda: world.insert_points(wall[:0], pose, time=0.0), "0 given"),
        (lambda: world.insert_points(wall, pose, time=9.0), "seen at 9 s"),
        (lambda: world.insert_points(wall, pose, time=0.0, mount="hand"), "'hand' given"),
    ):
        with pytest.raises(hamelin.Error, match=message):
            call()
    assert world.number == 1


def test_maps_as_dicts(document, scene, scenes):
    controller = hamelin.Controller(scene)
    world, q, v = controller.world, scene.start_q, np.zeros(7)
    ticks = iter(range(100))

    def clearance():
        answer = controller.tick(0.001 * next(ticks), q, v)
        assert answer.snapshot == world.number
        return controller.clearance_m

    far = clearance()
    below = controller.tip[:3, 3] - [0.0, 0.0, 0.12]
    box = [*(below - 0.01), *(below + 0.01)]
    number = world.change_map({"occupied_boxes_m": [box]})
    assert number == 1 and clearance() < far - 0.005
    world.change_map({"free_boxes_m": [box]})
    assert clearance() == far
    world.set_map(None)
    assert clearance() == far
    with pytest.raises(hamelin.Error, match="map: there is none"):
        world.change_map({"free_boxes_m": [box]})
    world.set_map({"file": "../maps/clutter.bt"})  # from the folder of the scene
    for wrong, message in (
        ([], "change: /map/changes/0: has the type array"),
        ({"free_boxes_m": [[1, 2]]}, "change: /map/changes/0/free_boxes_m/0"),
        ({"free": []}, "change: /map/changes/0"),
    ):
        with pytest.raises(hamelin.Error, match=message):
            world.change_map(wrong)
    with pytest.raises(hamelin.Error, match="map: /map/file"):
        world.set_map({"file": 3})
    world.change_map({"occupied_boxes_m": [box]})
    assert clearance() < far - 0.005


def test_counts_of_the_shield(document, scenes):
    document["map"] = None
    document["goals"] = [{"type": "joint", "q": [1.2, *document["start"]["q"][1:]]}]
    document["obstacles"] = [
        {"type": "box", "name": "wall", "size_m": [0.6, 0.02, 0.6], "position_m": [0.4, 0.3, 0.5]}
    ]
    document["planner"] = {"name": "template"}
    scene = hamelin.Scene(document, folder=scenes)
    controller = hamelin.Controller(scene, position=True)
    assert controller.shield["steps"] == 0 and controller.shield["cause"] is None
    servos = Servos(controller, scene.start_q)
    refused = 0
    for _ in range(3000):
        if not servos.move(1).stopping:
            continue
        refused += 1
        last = controller.shield
        assert last["stopping"] and last["cause"] is not None and last["line"]
    counted = controller.shield
    assert refused > 0 and counted["refused"] == refused
    assert counted["stops"] == sum(counted["causes"].values()) > 0
    assert counted["causes"]["obstacle"] > 0
    assert counted["steps"] >= 2999 and counted["longest"] <= refused
    controller.reset()
    assert controller.shield["steps"] == 0
    document["safety"] = {"type": "none"}
    assert hamelin.Controller(hamelin.Scene(document, folder=scenes)).shield is None
    assert controller.guide is None


def test_a_guide_without_a_thread(document, scenes):
    document["planner"] = {"name": "hybrid", "guide": "rrt-connect"}
    scene = hamelin.Scene(document, folder=scenes)
    controller = hamelin.Controller(scene, position=True, guide_thread=False)
    servos = Servos(controller, scene.start_q)
    servos.move(300)
    assert controller.guide["searches"] == 0
    assert controller.guide["waited_s"] == pytest.approx(0.3)
    controller.run_guide()
    servos.move(500)
    assert controller.guide["found"] == 1 and controller.guide["length"] > 0.0


def test_series(scene):
    class Mine:
        def start(self, setup):
            self.index = setup.declare_series("figure", "m")

        def tick(self, tick, command):
            command.set_series(self.index, 2.5)

    controller = hamelin.Controller(scene, planner=Mine())
    answer = controller.tick(0.0, scene.start_q, np.zeros(7))
    assert controller.series_names == ["figure"]
    assert answer.series.tolist() == [2.5]


def test_paths_and_payloads_are_bounded(scene):
    controller = hamelin.Controller(
        scene, path_points_max=3, payload_reach=0.2, payload_shapes_max=1
    )
    q = list(scene.start_q)
    controller.set_goals({"type": "path", "q": [q] * 2 + [[0.1, *q[1:]]]})
    with pytest.raises(hamelin.Error, match="expected at most 3"):
        controller.set_goals({"type": "path", "q": [q] * 3 + [[0.1, *q[1:]]]})
    can = {"name": "can", "mass_kg": 0.1, "spheres": [{"center_m": [0, 0, 0.05], "radius_m": 0.02}]}
    controller.attach(can, q)
    with pytest.raises(hamelin.Error, match="payload"):
        controller.attach({**can, "name": "other"}, q)
    with pytest.raises(hamelin.Error, match="payload: /model/payload"):
        controller.attach(None, q)
