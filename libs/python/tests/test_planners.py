"""Planners in Python, and the control loop."""

import hashlib
import json
import os
import subprocess
import sys
import threading

import hamelin
import numpy as np
import pytest

PLANNER = '''
import numpy as np


class Spring:
    """A spring and a damper at each joint."""

    params_schema = {
        "type": "object",
        "properties": {"k_p": {"type": "number", "minimum": 0, "default": 30.0}},
    }
    influence_m = 0.15

    def __init__(self, k_p=30.0):
        self.params = {"k_p": k_p}
        self.k_p = k_p

    def start(self, setup):
        self.arm = setup.model
        self.error = setup.declare_series("error", "rad")
        assert setup.influence_m == 0.15

    def tick(self, tick, command):
        offset = tick.goal["q"] - tick.q
        a = self.k_p * offset - 2 * np.sqrt(self.k_p) * tick.v
        command.held_torque = self.arm.rnea(tick.q, tick.v, a)
        command.set_series(self.error, np.abs(offset).max())
'''


@pytest.fixture(scope="module")
def planner_file(tmp_path_factory):
    file = tmp_path_factory.mktemp("planner") / "mine.py"
    file.write_text(PLANNER)
    return file


@pytest.fixture(scope="module")
def free_scene(robots):
    return {
        "schema": "hamelin.scene/1",
        "robot": {"file": str(robots / "arm7.urdf"), "spheres": str(robots / "arm7.spheres.json")},
        "gravity_m_s2": [0.0, 0.0, 0.0],
        "model": {"joint_limits": False, "velocity_limits": False, "torque_limits": False},
        "start": {"q": [0.0, -0.7, 0.0, -2.3, 0.0, 1.5, 0.7]},
        "goals": [{"type": "joint", "q": [0.2, -0.5, 0.1, -2.0, 0.1, 1.4, 0.5]}],
        "duration_s": 5.0,
    }


def load(planner_file):
    space = {}
    exec(compile(PLANNER, str(planner_file), "exec"), space)
    return space["Spring"]


def write(folder, scene):
    file = folder / "scene.json"
    file.write_text(json.dumps(scene))
    return file


def test_three_ways_to_the_same_run(program, planner_file, free_scene, tmp_path):
    scene_file = tmp_path / "scene.json"
    scene_file.write_text(json.dumps(free_scene))
    logs = [tmp_path / f"{i}.jsonl" for i in range(3)]
    name = f"python:{planner_file}:Spring"
    done = subprocess.run(
        [program, "run", scene_file, "--planner", name, "--log", logs[0]],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert done.returncode == 0, done.stderr
    assert hamelin.run(scene_file, planner=name, log=logs[1]).ok
    assert hamelin.run(scene_file, planner=load(planner_file)(), log=logs[2]).outcome == "reached"
    read = [hamelin.read_log(log) for log in logs]
    for log in read[1:]:
        assert log.q.tobytes() == read[0].q.tobytes()
    assert hamelin.verify(logs[0], tolerance=0)["to_the_bit"]
    replay = subprocess.run(
        [program, "replay", logs[1], "--verify", "--tolerance", "0"], stdout=subprocess.PIPE
    )
    assert replay.returncode == 0
    assert hamelin.verify(logs[2], planner=load(planner_file)(), tolerance=0)["to_the_bit"]
    assert read[0].header["series"] == [{"name": "error", "unit": "rad"}]
    offset = np.abs(np.array([0.2, -0.5, 0.1, -2.0, 0.1, 1.4, 0.5]) - read[0].q).max(axis=1)
    given = np.isfinite(read[0].series[:, 0])
    assert given.sum() > 100
    np.testing.assert_array_equal(read[0].series[given, 0], offset[given])


def test_the_log_knows_whether_the_file_has_changed(program, planner_file, free_scene, tmp_path):
    file, log = tmp_path / "mine.py", tmp_path / "log.jsonl"
    file.write_text(planner_file.read_text())
    hamelin.run(free_scene, planner=f"python:{file}:Spring", duration=0.05, log=log)
    inputs = {i["role"]: i for i in hamelin.read_log(log).header["provenance"]["inputs"]}
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    assert inputs["planner_file"]["sha256"] == digest
    moved = tmp_path / "other" / "log.jsonl"  # replayed beside the file, wherever it is
    moved.parent.mkdir()
    log.rename(moved)
    file.rename(moved.parent / "mine.py")
    assert hamelin.verify(moved, tolerance=0)["to_the_bit"]
    (moved.parent / "mine.py").write_text(planner_file.read_text() + "\n# changed\n")
    with pytest.raises(hamelin.Error, match="mine.py: has changed since the log was written"):
        hamelin.verify(moved)


def test_an_object_of_an_interpreter_replays_with_an_object(free_scene, tmp_path):
    class Here:
        def start(self, setup):
            self.arm = setup.model

        def tick(self, tick, command):
            command.held_torque = self.arm.gravity_torque(tick.q)

    log = tmp_path / "log.jsonl"
    space = {}
    exec("class Nowhere(Base): pass", {"Base": Here}, space)
    planner = space["Nowhere"]()
    planner.__class__.__module__ = "nowhere"
    hamelin.run(free_scene, planner=planner, duration=0.02, log=log)
    assert hamelin.verify(log, planner=planner)["equal"]
    with pytest.raises(hamelin.Error, match="exists only in the Python program"):
        hamelin.verify(log)


def test_parameters(planner_file, free_scene):
    name = f"python:{planner_file}:Spring"
    stiff = hamelin.run(
        free_scene, planner=name, duration=0.1, set="/planner/params/params/k_p=100"
    )
    soft = hamelin.run(free_scene, planner=name, duration=0.1)
    assert stiff.q != soft.q
    with pytest.raises(hamelin.Error, match="k_p"):
        hamelin.run(free_scene, planner=name, set="/planner/params/params/k_p=-1")
    with pytest.raises(hamelin.Error, match="no_such"):
        hamelin.run(free_scene, planner=f"python:{planner_file}:no_such")
    with pytest.raises(hamelin.Error, match="expected python:FILE:CLASS"):
        hamelin.run(free_scene, planner="python:")
    with pytest.raises(hamelin.Error, match="No such file"):
        hamelin.run(free_scene, planner="python:missing.py:Mine")


def run_with(scene, tick, start=None, **options):
    class Mine:
        def tick(self, t, c):
            tick(t, c)

    mine = Mine()
    if start is not None:
        mine.start = start
    return hamelin.run(scene, planner=mine, duration=0.01, **options)


def test_exceptions_end_the_run(free_scene):
    def fail(tick, command):
        raise ValueError("no way")

    result = run_with(free_scene, fail)
    assert result.outcome == "defect" and "ValueError: no way" in result.cause

    def not_finite(tick, command):
        command.held_torque[:] = np.nan

    result = run_with(free_scene, not_finite)
    assert result.outcome == "defect"

    def wrong_shape(tick, command):
        command.held_torque = np.zeros(3)

    result = run_with(free_scene, wrong_shape)
    assert result.outcome == "defect" and "expected (7,)" in result.cause

    def resized(tick, command):
        command.damping.resize(3, refcheck=False)

    result = run_with(free_scene, resized)
    assert result.outcome == "defect"

    def bad_start(setup):
        raise KeyError("x")

    with pytest.raises(hamelin.Error, match="KeyError"):
        run_with(free_scene, fail, start=bad_start)

    def give_up(tick, command):
        command.give_up("far too hard")

    result = run_with(free_scene, give_up)
    assert "far too hard" in result.cause
    with pytest.raises(TypeError):
        hamelin.run(free_scene, planner=object())


def test_interrupt_in_a_tick(free_scene):
    def interrupted(tick, command):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_with(free_scene, interrupted)


def test_views_outlive_their_calls(free_scene):
    kept = []

    def keep(tick, command):
        if not kept:
            kept.extend([tick, command, tick.q, command.held_torque, tick.contacts, tick.goal])
        kept[2].sum()

    setups = []
    run_with(free_scene, keep, start=setups.append)
    tick, command, q, torque, contacts, goal = kept
    assert np.isfinite(q).all() and torque.shape == (7,)
    for use in (
        lambda: tick.k,
        lambda: tick.contacts,
        lambda: tick.goal,
        lambda: command.give_up("x"),
        lambda: command.potential_J,
        lambda: command.add_gyroscopic(0, [0, 0, 0], [0, 0, 0]),
        lambda: command.set_series(0, 1.0),
        lambda: setups[0].log("x"),
        lambda: setups[0].clearance(np.zeros(7)),
        lambda: setups[0].distance(np.zeros(3)),
        lambda: setups[0].motion_clear(np.zeros(7), np.zeros(7)),
        lambda: setups[0].refresh(),
        lambda: setups[0].draw_path(np.zeros((2, 3))),
        lambda: setups[0].request_path(),
        lambda: setups[0].declare_series("x"),
    ):
        with pytest.raises(hamelin.Error):
            use()
    with pytest.raises(ValueError):
        q[0] = 1.0


def test_a_planner_asks_for_a_path(free_scene):
    seen = []

    class Mine:
        def start(self, setup):
            self.setup = setup

        def tick(self, tick, command):
            goal = tick.goal
            if goal["path_search"] == "not sought":
                assert "path" not in goal
                assert self.setup.request_path()
            if not seen or seen[-1][0] != goal["path_search"]:
                seen.append((goal["path_search"], goal, tick.q))
            command.held_torque = self.setup.model.gravity_torque(tick.q)
            command.damping[:] = 10.0

    hamelin.run(free_scene, planner=Mine(), duration=0.3)
    assert [state for state, _, _ in seen] == ["not sought", "sought", "found"]
    assert np.abs(seen[1][1]["q"] - seen[1][2]).max() < 1e-6  # the arm holds its place
    _, goal, q = seen[2]
    assert goal["type"] == "joint"
    assert goal["path"].shape[0] >= 2
    assert np.abs(goal["path"][0] - q).max() < 1e-3
    assert np.array_equal(goal["path"][-1], goal["q"])

    class Refused(Mine):
        def tick(self, tick, command):
            assert not self.setup.request_path()
            command.held_torque = self.setup.model.gravity_torque(tick.q)

    hamelin.run(free_scene, planner=Refused(), duration=0.01, guide="none")


def test_services_belong_to_the_thread_of_a_call(free_scene):
    refused = []

    class Mine:
        def start(self, setup):
            self.setup = setup

        def tick(self, tick, command):
            def other():
                for call in (self.setup.log, self.setup.warn, self.setup.declare_series):
                    try:
                        call("x")
                    except hamelin.Error:
                        refused.append(call)

            thread = threading.Thread(target=other)
            thread.start()
            thread.join()
            self.setup.log("here")

    hamelin.run(free_scene, planner=Mine(), duration=0.001)
    assert len(refused) == 3


def test_services_of_the_host(scenes, tmp_path):
    scene = hamelin.load_scene(scenes / "shelf.json")
    environment = scene.environment()
    seen = {}

    class Mine:
        def start(self, setup):
            self.setup = setup
            setup.log("begins")

        def tick(self, tick, command):
            s = self.setup
            if not seen:
                s.refresh()
                seen["one"] = s.clearance(tick.q)
                seen["many"] = s.clearance(np.stack([tick.q, tick.q + 0.05]))
                seen["distance"] = s.distance(np.array([0.6, 0.0, 0.6]), limit=0.3)
                seen["clear"] = s.motion_clear(tick.q, tick.q + 0.01)
                seen["contacts"] = tick.contacts
                seen["goal"] = tick.goal
                seen["limits"] = s.velocity_max
            s.draw_path(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]))
            command.damping[:] = 1.0
            command.potential_J = 0.0
            command.held_torque = s.model.gravity_torque(tick.q)

    hamelin.run(scene, planner=Mine(), duration=0.01, log=tmp_path / "log.jsonl")
    assert seen["goal"]["type"] == "pose"
    # The environment of the scene is the independent reference; a planner's is cut off earlier.
    limit = seen["one"]
    assert limit == environment.clearance(scene.start_q, limit=limit)
    assert seen["many"][0] == seen["one"]
    assert seen["distance"] == environment.distance([0.6, 0.0, 0.6], limit=0.3)
    assert seen["clear"] is True
    assert seen["limits"].shape == (7,)


def test_node_velocity_and_gyroscopic(scenes):
    class Mine:
        def tick(self, tick, command):
            command.add_gyroscopic(3, [0, 0, 0.1], [0, 0, 1.0])
            command.node_velocity = np.full(7, 0.01)
            assert command.node_velocity.shape == (7,)

    result = hamelin.run(scenes / "pillar.json", planner=Mine(), duration=0.02)
    assert result.outcome == "timeout"
    assert result.planner == "python"


def simulate(controller, model, q, seconds):
    integrator = hamelin.Integrator(model)
    state = integrator.start(q)
    h = controller.period_s
    answer = None
    for k in range(round(seconds / h)):
        answer = controller.tick(k * h, state.q, integrator.velocity(state))
        if answer.state != "running":
            break
        channels = hamelin.Channels(held_torque=answer.torque)
        assert integrator.step(state, h, channels).converged
    return answer, state


@pytest.fixture()
def sampled_scene(free_scene):
    scene = dict(free_scene)
    scene["actuation"] = {"type": "sampled", "control_period_s": 0.002}
    scene["step_s"] = 0.002
    scene["planner"] = {"name": "hybrid", "guide": "none"}  # a thread would take its own time
    return scene


def test_a_control_loop_has_the_bits_of_a_run(sampled_scene, tmp_path):
    log = tmp_path / "log.jsonl"
    assert hamelin.run(sampled_scene, log=log).outcome == "reached"
    scene = hamelin.Scene(sampled_scene)
    controller = hamelin.Controller(scene)
    answer, state = simulate(controller, scene.model, scene.start_q, 5.0)
    assert answer.state == "reached"
    expected = hamelin.read_log(log)
    assert state.q.tobytes() == expected.q[state.k].tobytes()


def test_controller_updates(sampled_scene):
    scene = hamelin.Scene(sampled_scene)
    controller = hamelin.Controller(scene, position=True)
    q = scene.start_q
    answer = controller.tick(0.0, q, np.zeros(7))
    assert answer.state == "running" and answer.q_next.shape == (7,)
    assert controller.verdict is None or "certified" in controller.verdict
    number = controller.world.set_obstacle(
        {"type": "sphere", "name": "ball", "radius_m": 0.05, "position_m": [2.0, 0.0, 0.5]}
    )
    pose = np.eye(4)
    pose[:3, 3] = [2.0, 0.5, 0.5]
    assert controller.world.move_obstacle("ball", pose, time=0.001) == number + 1
    assert controller.world.observe_obstacle("ball", pose, time=0.5) == number + 2
    assert controller.world.last_observed("ball") == 0.5
    assert controller.tick(0.002, q, np.zeros(7)).snapshot == number + 2
    controller.world.remove_obstacle("ball")
    with pytest.raises(hamelin.Error, match="ball"):
        controller.world.remove_obstacle("ball")
    goals = controller.set_goals({"type": "joint", "q": list(q)})
    answer = controller.tick(0.004, q, np.zeros(7))
    assert answer.goals_number == goals and answer.state == "reached"
    controller.set_planner_params({"cruise_speed": 1.0})
    assert controller.planner_params()["cruise_speed"] == 1.0
    with pytest.raises(hamelin.Error):
        controller.set_planner_params({"cruise_speed": "fast"})
    with pytest.raises(hamelin.Error):
        controller.set_goals([])
    with pytest.raises(hamelin.Error):
        controller.set_target(0.1, pose)
    load = controller.attach({"mass_kg": 0.2, "name": "cup"}, q)
    assert controller.attached() == ["cup"]
    assert controller.tick(0.006, q, np.zeros(7)).load == load
    controller.detach("cup", q)
    assert controller.attached() == []
    world = controller.world
    del controller
    assert world.number > number  # a world keeps its controller


def test_follow_a_target(sampled_scene):
    scene = dict(sampled_scene)
    scene["goals"] = [{"type": "follow"}]
    made = hamelin.Scene(scene)
    controller = hamelin.Controller(made)
    model = made.model
    integrator = hamelin.Integrator(model)
    state = integrator.start(made.start_q)
    target = model.tip_pose(made.start_q)
    h = controller.period_s
    for k in range(1500):
        target[0, 3] += 0.05 * h  # 5 cm/s along x
        controller.set_target(k * h, target, velocity=[0.05, 0.0, 0.0])
        answer = controller.tick(k * h, state.q, integrator.velocity(state))
        assert answer.state == "running"
        integrator.step(state, h, hamelin.Channels(held_torque=answer.torque))
    error = np.linalg.norm(model.tip_pose(state.q)[:3, 3] - target[:3, 3])
    assert error < 0.01


def test_a_planner_of_python_in_a_control_loop(sampled_scene, planner_file):
    planner = load(planner_file)()
    scene = hamelin.Scene(sampled_scene)
    controller = hamelin.Controller(scene, planner=planner)
    answer, _ = simulate(controller, scene.model, scene.start_q, 5.0)
    assert answer.state == "reached"

    class Nested:
        def tick(self, tick, command):
            controller.tick(1.0, np.zeros(7), np.zeros(7))

    nested = Nested()
    controller = hamelin.Controller(scene, planner=nested)
    answer = controller.tick(0.0, scene.start_q, np.zeros(7))
    assert answer.state == "stopping" and "expected a loop" in answer.cause


def test_a_planner_of_python_with_a_load(sampled_scene, planner_file, tmp_path):
    """attach() makes the planner again: of an object a copy, of a file a new object."""
    scene = hamelin.Scene(sampled_scene)
    name = hamelin.load_scene(write(tmp_path, sampled_scene), planner=f"python:{planner_file}:Spring")
    for controller in (
        hamelin.Controller(scene, planner=load(planner_file)()),
        hamelin.Controller(name),
    ):
        q, v = scene.start_q, np.zeros(7)
        a = 30.0 * (np.array(sampled_scene["goals"][0]["q"]) - q)
        before = controller.tick(0.0, q, v).torque
        np.testing.assert_allclose(before, scene.model.rnea(q, v, a), atol=1e-9)
        load_number = controller.attach({"mass_kg": 1.0, "name": "cup"}, q)
        answer = controller.tick(controller.period_s, q, v)
        assert answer.load == load_number and answer.state == "running"
        heavier = hamelin.Scene({**sampled_scene, "model": {"payload": {"mass_kg": 1.0}}}).model
        np.testing.assert_allclose(answer.torque, heavier.rnea(q, v, a), atol=1e-9)
        assert np.abs(answer.torque - before).max() > 1.0
        controller.detach("cup", q)
        answer = controller.tick(2 * controller.period_s, q, v)
        np.testing.assert_allclose(answer.torque, before, atol=1e-9)


THREADS = """
import builtins, sys, threading, time
import hamelin

builtins.held_lock = []
scene = hamelin.load_scene(sys.argv[1])

def run():
    try:
        hamelin.run(scene, planner="python:" + sys.argv[2] + ":planner", duration=0.001)
    except hamelin.Error as error:
        assert "header line 1" in str(error), error
    # Now the thread alone keeps the object, which was loaded for a planner that is never made.
    sys.modules.pop("hamelin_planner_wide").__dict__.clear()

for ended in range(1, 21):
    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    for _ in range(1000):  # a thread is joined before its C++ part has ended
        if len(builtins.held_lock) == ended:
            break
        time.sleep(0.01)
run()  # on the main thread, which ends after the interpreter
print(builtins.held_lock)
"""

WIDE = """
import builtins
import ctypes


class Wide:
    influence_m = 0.1

    def tick(self, tick, command):
        pass

    def __del__(self, held_lock=builtins.held_lock, check=ctypes.pythonapi.PyGILState_Check):
        held_lock.append(check())


planner = Wide()
"""


def test_planners_on_threads_that_end(free_scene, tmp_path):
    (tmp_path / "wide.py").write_text(WIDE)
    (tmp_path / "map.bt").write_text("no map")  # found after the planner was loaded
    free_scene = {**free_scene, "map": {"file": str(tmp_path / "map.bt")}}
    done = subprocess.run(
        [sys.executable, "-c", THREADS, str(write(tmp_path, free_scene)), str(tmp_path / "wide.py")],
        env={**os.environ, "PYTHONPATH": os.environ["HAMELIN_PACKAGE_DIR"]}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [1] * 20


def test_environment_variables_are_left_alone():
    assert "hamelin" not in os.environ.get("PYTHONPATH", "")
