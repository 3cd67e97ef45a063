"""Paths, optimal motions and explanations: the results of the program."""

import json
import os
import signal
import subprocess
import threading
import time

import hamelin
import numpy as np
import pytest


def documents(program, *arguments):
    done = subprocess.run([program, *map(str, arguments), "--json"], stdout=subprocess.PIPE)
    return json.loads(done.stdout)


def without_timing(plan):
    return [{k: v for k, v in goal.items() if k != "timing"} for goal in plan["paths"]]


def test_plan_is_that_of_the_program(program, scenes, tmp_path):
    found = hamelin.plan(scenes / "shelf.json", guide="rrt-connect", seed=3)
    expected = documents(
        program, "plan", scenes / "shelf.json", "--guide", "rrt-connect", "--seed", 3
    )
    assert without_timing(found) == without_timing(expected)
    assert found and found.found and "rrt-connect" in repr(found)
    scene = hamelin.load_scene(scenes / "shelf.json")
    assert len(found.paths) == len(scene.document["goals"])
    np.testing.assert_array_equal(found.paths[0][0], scene.start_q)
    np.testing.assert_array_equal(found.paths[1][0], found.paths[0][-1])
    environment = scene.environment()
    least = min(environment.clearance(path, limit=0.2).min() for path in found.paths)
    proved = min(goal["certificate"]["smallest_m"] for goal in found["paths"])
    assert 0.0 < proved <= least + 1e-4
    found.save(tmp_path / "path.json")
    assert json.loads((tmp_path / "path.json").read_text()) == dict(found)


def test_no_path(scenes):
    found = hamelin.plan(scenes / "shelf.json", guide="rrt-connect", checks=1)
    assert not found and not found.found and found.paths[-1].shape == (0, 7)
    with pytest.raises(hamelin.Error, match="expected on-request"):
        hamelin.plan(scenes / "shelf.json", guide="none")


def test_optimize_is_that_of_the_program(program, scenes, tmp_path):
    options = {"minimize": "time", "intervals": 20, "limit_share": 0.9}
    motion = hamelin.optimize(scenes / "pillar.json", guide="rrt-connect", **options)
    expected = documents(
        program, "optimize", scenes / "pillar.json", "--guide", "rrt-connect", "--minimize", "time",
        "--intervals", 20, "--limit-share", 0.9,
    )  # fmt: skip
    assert dict(motion) == expected
    assert motion and motion.valid and "least time" in repr(motion)
    assert motion.q.shape == motion.v.shape == motion.a.shape == motion.tau.shape == (21, 7)
    assert motion.time_s[-1] == pytest.approx(motion.duration_s)
    model = hamelin.load_scene(scenes / "pillar.json").model
    np.testing.assert_allclose(
        model.rnea(motion.q, motion.v, motion.a), motion.tau, rtol=1e-9, atol=1e-9
    )
    table = motion.to_pandas()
    assert table.shape == (21, 28) and table.index.name == "time_s"
    motion.save(tmp_path / "fast.json")
    followed = hamelin.run(scenes / "pillar.json", trajectory=tmp_path / "fast.json")
    assert followed.ok


@pytest.mark.parametrize(
    "wrong, text",
    [
        ({"minimize": "money"}, "expected effort or time"),
        ({"intervals": 1}, "intervals: 1, expected 6"),
        ({"margin": float("nan")}, "margin: nan"),
        ({"limit_share": 0.0}, "limit_share"),
        ({"duration": -1.0}, "duration"),
        ({"rate": 0.0}, "rate"),
    ],
)
def test_optimize_refuses(scenes, wrong, text):
    with pytest.raises(hamelin.Error, match=text):
        hamelin.optimize(scenes / "pillar.json", **wrong)


def test_interrupt_ends_an_optimization(scenes):
    begun = time.monotonic()
    threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        hamelin.optimize(scenes / "shelf.json", guide="rrt-connect", intervals=5000)
    assert time.monotonic() - begun < 60.0


def search_for_long(scenes, robots):
    hamelin.plan(
        scenes / "shelf.json",
        guide="rrt-connect",
        checks=1_000_000_000,
        set="/planner/guide_options/improve_checks=1000000000",
    )


def measure_for_long(scenes, robots):
    hamelin.accuracy(
        robots / "arm7.urdf", integrators=["rk4"], steps=[1e-6], duration=100.0, reference=False
    )


@pytest.mark.parametrize("call", [search_for_long, measure_for_long])
def test_interrupt_ends_a_search_and_a_measurement(scenes, robots, call):
    begun = time.monotonic()
    threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        call(scenes, robots)
    assert time.monotonic() - begun < 60.0


def test_explain(program, robots, tmp_path):
    log = tmp_path / "log.jsonl"
    scene = {
        "schema": "hamelin.scene/1",
        "robot": {"file": str(robots / "arm7.urdf"), "spheres": str(robots / "arm7.spheres.json")},
        "gravity_m_s2": [0.0, 0.0, 0.0],
        "model": {"joint_limits": False, "velocity_limits": False, "torque_limits": False},
        "start": {"q": [0.0] * 7},
        "goals": [{"type": "joint", "q": [0.0] * 6 + [1.0]}],
        "obstacles": [
            {
                "name": "ball", "type": "sphere", "radius_m": 0.1, "position_m": [2.0, 0.0, 0.5],
                "motion": {"type": "linear", "velocity_m_s": [-5.0, 0.0, 0.0]},
            }
        ],
        "planner": {"name": "template"},
        "safety": {"type": "none"},
        "duration_s": 3.0,
    }  # fmt: skip
    assert hamelin.run(scene, log=log).outcome == "collision"
    explanation = hamelin.explain(log, motions=50, seed=2)
    assert dict(explanation) == documents(program, "explain", log, "--motions", 50, "--seed", 2)
    assert explanation and explanation["verdict"] in repr(explanation)
    assert explanation["mover_contact"]["obstacle"] == "ball"
    with pytest.raises(hamelin.Error, match="motions"):
        hamelin.explain(log, motions=0)
    hamelin.run(scene, log=log, set='/obstacles=[]', duration=0.1)
    nothing = hamelin.explain(log)
    assert not nothing and "without contact" in nothing.nothing and nothing.nothing in repr(nothing)
