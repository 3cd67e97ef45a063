"""Runs, free motions, logs and pages: the same bits as the program."""

import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import hamelin
import numpy as np
import pytest

CLOCK = {"timing", "cpu_s", "tick_us", "controller_us", "planner_us", "deadline_us", "late_ticks", "provenance"}


def lines_of(file):
    """The lines of a log, without what depends on clock and machine."""
    with open(file, encoding="utf-8") as lines:
        for line in lines:
            document = json.loads(line)
            if document["type"] != "header":
                yield {key: value for key, value in document.items() if key not in CLOCK}


def run_program(program, *arguments):
    return subprocess.run(
        [program, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def without_clock(document):
    return {key: value for key, value in document.items() if key not in CLOCK}


@pytest.mark.parametrize(
    "scene, options",
    [
        ("shelf.json", {"duration": 2.0}),
        ("pillar.json", {"planner": "apf", "duration": 1.0, "seed": 5}),
        ("shelf.json", {"integrator": "rk4", "duration": 0.5, "set": "/model/torque_limits=false"}),
        ("pillar.json", {"duration": 0.2, "step": 0.0005}),
    ],
)
def test_run_has_the_bits_of_the_program(program, scenes, tmp_path, scene, options):
    logs = [tmp_path / "program.jsonl", tmp_path / "python.jsonl"]
    result_file = tmp_path / "program.json"
    flags = [part for key, value in options.items() for part in (f"--{key}", value)]
    run_program(
        program, "run", scenes / scene, *flags, "--log", logs[0], "--result", result_file
    )
    result = hamelin.run(
        scenes / scene, **options, log=logs[1], result=tmp_path / "python.json"
    )
    assert list(lines_of(logs[0])) == list(lines_of(logs[1]))
    expected = json.loads(result_file.read_text())
    assert without_clock(dict(result)) == without_clock(expected)
    assert json.loads((tmp_path / "python.json").read_text()) == dict(result)
    assert run_program(program, "replay", logs[1], "--verify", "--tolerance", 0).returncode == 0
    assert hamelin.verify(logs[0], tolerance=0)["to_the_bit"]


@pytest.mark.parametrize("name", hamelin.integrator_names())
def test_integrate_has_the_bits_of_the_program(program, robots, tmp_path, name):
    logs = [tmp_path / "program.jsonl", tmp_path / "python.jsonl"]
    q0 = [0.3, -0.5, 0.2, -1.0, 0.4, 0.6, 0.1]
    control = {"rtol": 1e-6} if name == "rosenbrock" else {}
    flags = [part for key, value in control.items() for part in (f"--{key}", value)]
    done = run_program(
        program, "integrate", robots / "arm7.urdf", "--integrator", name, "--q0",
        ",".join(map(str, q0)), "--step", 0.002, "--duration", 0.1, "--log", logs[0], *flags,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    result = hamelin.integrate(
        robots / "arm7.urdf", integrator=name, q0=q0, step=0.002, duration=0.1, log=logs[1],
        **control,
    )  # fmt: skip
    assert result.ok
    assert list(lines_of(logs[0])) == list(lines_of(logs[1]))
    # The same without files.
    arm = hamelin.load_robot(robots / "arm7.urdf")
    motion = hamelin.Integrator(arm, name, **control).simulate(q0, step=0.002, duration=0.1)
    log = hamelin.read_log(logs[0])
    assert motion["completed"]
    assert motion["q"].tobytes() == log.q.tobytes()
    assert motion["v"].tobytes() == log.v.tobytes()
    assert motion["time_s"].tobytes() == log.time_s.tobytes()


@pytest.fixture(scope="module")
def shelf_log(scenes, tmp_path_factory):
    file = tmp_path_factory.mktemp("log") / "shelf.jsonl"
    hamelin.run(scenes / "shelf.json", duration=1.0, log=file)
    return file


def test_a_log_has_the_numbers_of_its_lines(shelf_log):
    log = hamelin.read_log(shelf_log)
    ticks = [d for d in map(json.loads, open(shelf_log)) if d["type"] == "tick"]
    assert log.ticks == len(ticks) == 1001
    assert log.q.tobytes() == np.array([t["q"] for t in ticks]).tobytes()
    assert log.time_s.tobytes() == np.array([t["time_s"] for t in ticks]).tobytes()
    kinetic = np.array([t["energy"]["kinetic_J"] for t in ticks])
    assert log["energy.kinetic_J"].tobytes() == kinetic.tobytes()
    held = [t.get("channels", {}).get("held") or [np.nan] * 7 for t in ticks]
    np.testing.assert_array_equal(log["channels.held"], np.array(held))
    assert log["saturated"].dtype == bool
    assert log.header["type"] == "header" and log.result["type"] == "result"
    table = log.to_pandas()
    assert table["q[3]"].iloc[5] == ticks[5]["q"][3]
    assert table.index.name == "time_s"


def test_logs_in_chunks_and_compressed(shelf_log, scenes, tmp_path):
    whole = hamelin.read_log(shelf_log)
    chunks = list(hamelin.LogStream(shelf_log))
    assert [len(c["k"]) for c in chunks] == [1000, 1]
    assert np.concatenate([c["q"] for c in chunks]).tobytes() == whole.q.tobytes()
    packed = tmp_path / "shelf.jsonl.zst"
    hamelin.run(scenes / "shelf.json", duration=1.0, log=packed)
    assert hamelin.read_log(packed).q.tobytes() == whole.q.tobytes()
    stream = hamelin.LogStream(packed)
    assert len(stream.read(10)["k"]) == 10 and stream.result is None
    assert len(stream.read()["k"]) == 991 and stream.read() is None
    assert stream.result["outcome"] == whole.result["outcome"]


def test_damaged_logs(shelf_log, tmp_path):
    text = shelf_log.read_bytes()
    cut = tmp_path / "cut.jsonl"
    cut.write_bytes(text[: len(text) // 2])
    log = hamelin.read_log(cut)
    assert log.cut and log.result is None and 0 < log.ticks < 1001
    for wrong in (b'{"type":"tick","k":1,"q":[1,2}\n', b'{"type":"tick","k":01x}\n', b"nonsense\n",
                  b'{"type":"tick","k":1\n', b'{"type":"other"}\n', b'[1]\n',
                  b'{"type":"tick",' + b'"a":{' * 200 + b"}" * 200 + b"}\n"):  # fmt: skip
        bad = tmp_path / "bad.jsonl"
        bad.write_bytes(text.split(b"\n")[0] + b"\n" + wrong)
        with pytest.raises(hamelin.Error) as raised:
            hamelin.read_log(bad)
        assert raised.value.file == str(bad)
        assert raised.value.place.startswith("line 2"), str(raised.value)
    empty = tmp_path / "empty.jsonl"
    empty.write_bytes(b"")
    with pytest.raises(hamelin.Error, match="expected a header"):
        hamelin.read_log(empty)


def test_unusual_ticks(shelf_log, tmp_path):
    header = shelf_log.read_bytes().split(b"\n")[0]
    file = tmp_path / "ticks.jsonl"
    file.write_bytes(
        header + b'\n{"k": 0, "type": "tick", "q": [1e-3, null], "x": "a\\"]b", "n": [[1], "]"]}\n'
        b'{"type":"tick","k":1,"q":[2,-3],"late":true,"m":{"o":[]}}\n'
    )
    log = hamelin.read_log(file)
    np.testing.assert_array_equal(log.k, [0, 1])
    np.testing.assert_array_equal(log.q, [[1e-3, np.nan], [2, -3]])
    np.testing.assert_array_equal(log.late, [np.nan, 1.0])
    assert set(log) == {"k", "q", "late"}


def test_plots_and_pages(shelf_log, tmp_path):
    pytest.importorskip("matplotlib")
    log = hamelin.read_log(shelf_log)
    figure = log.plot()
    assert [axis.get_ylabel() for axis in figure.axes][:2] == ["q [rad, m]", "v [rad/s, m/s]"]
    assert len(figure.axes[0].lines) == 7
    with pytest.raises(KeyError):
        log.plot("nothing")
    try:
        page = hamelin.report(shelf_log, output=tmp_path / "page.html")
    except hamelin.Error as error:
        if "is missing" not in str(error):
            raise
        pytest.skip("the page was not built: Node.js with npm is missing")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == page.text
    assert page._repr_html_().startswith("<iframe srcdoc=")


def test_the_page_is_that_of_the_program(program, shelf_log, tmp_path):
    done = run_program(program, "report", shelf_log, "-o", tmp_path / "page.html")
    if done.returncode != 0 and b"is missing" in done.stderr:
        pytest.skip("the page was not built: Node.js with npm is missing")
    page = hamelin.report(shelf_log)
    assert page.text.encode() == (tmp_path / "page.html").read_bytes()


def test_results_show_themselves(scenes):
    result = hamelin.run(scenes / "pillar.json", duration=0.01)
    assert "outcome: timeout" in repr(result)
    assert result._repr_html_().startswith("<table>")
    assert not result.ok and result.steps == 10
    with pytest.raises(AttributeError):
        result.nothing
    with pytest.raises(ValueError):
        result.read_log()


def test_scenes(program, scenes, tmp_path):
    scene = hamelin.load_scene(scenes / "shelf.json", duration=3.0, seed=7)
    assert scene.duration_s == 3.0 and scene.document["seed"] == 7
    again = pickle.loads(pickle.dumps(scene))
    assert again.resolved() == scene.resolved()
    copied = hamelin.Scene(scene.document, folder=scenes, name=scene.name)
    assert copied.resolved() == scene.resolved()
    out = run_program(
        program, "run", scenes / "shelf.json", "--print-config", "--duration", 3, "--seed", 7
    )
    assert json.loads(out.stdout) == hamelin.full_config(scene)
    with pytest.raises(hamelin.Error) as raised:
        hamelin.load_scene(scenes / "shelf.json", step=-1.0)
    assert raised.value.place == "/step_s" and raised.value.code == "invalid"


def test_gravity_and_limits_are_on_unless_switched_off(program, robots, tmp_path):
    document = {"schema": "hamelin.scene/1", "robot": {"file": str(robots / "arm7.urdf")}}
    home = {"q": [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]}
    scene = hamelin.Scene({**document, "start": home})
    resolved = scene.resolved()
    assert resolved["gravity_m_s2"] == [0.0, 0.0, -9.81]
    limits = ("joint_limits", "velocity_limits", "torque_limits")
    assert all(resolved["model"][key] is True for key in limits)
    assert scene.model.gravity.tolist() == [0.0, 0.0, -9.81]
    assert np.abs(hamelin.integrate(scene, duration=0.1).v).max() > 0.1  # the arm falls
    file = tmp_path / "scene.json"
    file.write_text(json.dumps(scene.document))
    shown = run_program(program, "scene", "info", file).stdout.decode()
    assert len(scene.modelled.splitlines()) == 2
    assert all(line in shown for line in scene.modelled.splitlines())
    assert "limits: joint on, velocity on, torque on" in scene.modelled

    off = hamelin.Scene({**document, "gravity_m_s2": None, "model": dict.fromkeys(limits, False)})
    assert off.resolved()["gravity_m_s2"] == [0.0, 0.0, 0.0]
    assert off.modelled.startswith("no gravity; limits: joint off, velocity off, torque off")
    assert np.abs(hamelin.integrate(off, duration=0.1).q).max() == 0.0

    goals = [{"type": "joint", "q": home["q"]}]
    run = {**document, "goals": goals, "planner": {"name": "template"}}
    with pytest.raises(hamelin.Error, match='"joint_limits": false under /model') as raised:
        hamelin.run(run, duration=0.01)  # zeros are beyond a limit of joint4
    assert str(raised.value).startswith("scene: /start/q: joint 'joint4' is at 0")
    assert raised.value.code == "invalid"
    hamelin.run(run, duration=0.01, set="/model/joint_limits=false")


def test_values_without_json_are_named(scenes):
    document = hamelin.load_scene(scenes / "pillar.json").document
    goals = [{"type": "joint", "q": [0.0, np.inf]}]
    with pytest.raises(hamelin.Error, match="^/goals/0/q/1: inf, expected a finite number"):
        hamelin.run({**document, "goals": goals})
    with pytest.raises(TypeError, match="^/planner/params: set, expected dict"):
        hamelin.run({**document, "planner": {"name": "apf", "params": {1}}})


def test_outputs_do_not_replace_inputs(scenes):
    with pytest.raises(hamelin.Error, match="is an input of the run"):
        hamelin.run(scenes / "shelf.json", log=scenes / "shelf.json")
    with pytest.raises(hamelin.Error, match="expected different paths"):
        hamelin.run(scenes / "shelf.json", log="x.json", result="x.json")


def test_progress(scenes):
    seen = []
    hamelin.run(
        scenes / "shelf.json", duration=3.0, progress=lambda done, all: seen.append((done, all))
    )
    assert seen and all(total == 3.0 for _, total in seen)

    def fail(done, all):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        hamelin.run(scenes / "shelf.json", duration=3.0, progress=fail)


def test_interrupt_ends_the_run_and_its_log(scenes, tmp_path):
    script = f"""
import sys
sys.path.insert(0, {os.environ["HAMELIN_PACKAGE_DIR"]!r})
import hamelin
print("ready", flush=True)
try:
    hamelin.run({str(scenes / "pillar.json")!r}, duration=100000.0, log="run.jsonl", every=1000,
                planner="template",
                set=["/stall=null", "/goals/0/tolerance_rad=1e-9", "/safety=null"])
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
    process = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, cwd=tmp_path, text=True
    )
    assert process.stdout.readline() == "ready\n"
    while not (tmp_path / "run.jsonl").exists() and process.poll() is None:
        time.sleep(0.01)
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    assert out == "interrupted\n"
    log = hamelin.read_log(tmp_path / "run.jsonl")
    assert not log.cut and log.result["outcome"] == "interrupted"


def test_long_calls_release_the_lock(scenes):
    counted = []
    done = threading.Event()

    def count():
        while not done.is_set():
            counted.append(None)
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    before = len(counted)
    hamelin.run(scenes / "shelf.json")  # takes some tenths of a second
    during = len(counted) - before
    done.set()
    thread.join()
    assert during > 20


def test_integrator_steps(arm):
    q0, v0 = np.full(7, 0.2), np.full(7, 0.1)
    integrator = hamelin.Integrator(arm, "gauss:8")
    state = integrator.start(q0, v0)
    kept = state.copy()
    report = integrator.step(state, 0.01)
    assert report.converged and state.k == 1 and kept.k == 0
    again = kept.copy()
    integrator.step(again, 0.01)
    assert again.q.tobytes() == state.q.tobytes()
    # Energy is conserved; with damping it decreases by what the report says.
    damped = kept.copy()
    channels = hamelin.Channels(damping=np.full(7, 0.5))
    before = sum(integrator.energy(damped))
    report = integrator.step(damped, 0.001, channels)
    after = sum(integrator.energy(damped))
    assert report.dissipated_J > 0
    np.testing.assert_allclose(before - after, report.dissipated_J, rtol=1e-6)
    integrator.set_velocity(state, v0)
    np.testing.assert_allclose(integrator.velocity(state), v0, atol=1e-12)
    integrator.kick(state, arm.momentum(state.q, v0))
    np.testing.assert_allclose(integrator.velocity(state), 2 * v0, atol=1e-12)


def test_a_state_belongs_to_its_scheme_and_model(arm):
    rk4 = hamelin.Integrator(arm, "rk4")
    state = rk4.start(np.zeros(7))
    hamel = hamelin.Integrator(arm, "hamel")
    for call in (hamel.velocity, hamel.energy, lambda s: hamel.kick(s, np.ones(7))):
        with pytest.raises(hamelin.Error, match="state: belongs to rk4, expected a state of hamel"):
            call(state)
    loaded = hamelin.Integrator(hamelin.make_chain(links=7, mass_kg=1.1), "rk4")
    with pytest.raises(hamelin.Error, match="belongs to another model"):
        loaded.step(state, 0.001)
    with pytest.raises(hamelin.Error, match="channels.damping: -1 given"):
        rk4.step(state, 0.001, hamelin.Channels(damping=np.full(7, -1.0)))
    with pytest.raises(ValueError, match="dp"):
        rk4.kick(state, np.full(7, np.nan))
    assert state.k == 0 and rk4.step(state.copy(), 0.001).converged


def test_step_control_and_callbacks(arm):
    integrator = hamelin.Integrator(arm, "dop853", rtol=1e-9)
    seen = []
    motion = integrator.simulate(
        np.full(7, 0.3), step=0.01, duration=0.5, on_step=lambda s, r: seen.append((s.k, r.step_s))
    )
    assert len(seen) == len(motion["time_s"]) - 1
    np.testing.assert_allclose(np.diff(motion["time_s"]), [step for _, step in seen], atol=1e-15)
    np.testing.assert_allclose(motion["time_s"][-1], 0.5, atol=1e-12)
    total = motion["kinetic_J"] + motion["potential_J"]
    assert np.ptp(total) < 1e-6
    ended = integrator.simulate(
        np.full(7, 0.3), step=0.01, duration=0.5, on_step=lambda s, r: s.k == 3
    )
    assert len(ended["time_s"]) == 4
    with pytest.raises(hamelin.Error, match="another call uses it"):
        integrator.simulate(
            np.zeros(7), step=0.01, duration=0.5, on_step=lambda s, r: integrator.energy(s)
        )
    with pytest.raises(ZeroDivisionError):
        integrator.simulate(np.zeros(7), step=0.01, duration=0.5, on_step=lambda s, r: 1 / 0)


def test_accuracy_and_sweep(program, robots, scenes, tmp_path):
    q0 = [0.3, -0.5, 0.2, -1.0, 0.4, 0.6, 0.1]
    measured = hamelin.accuracy(
        robots / "arm7.urdf", integrators=["gauss:8", "rk4"], steps=[0.02, 0.01], duration=0.2,
        q0=q0,
    )  # fmt: skip
    out = run_program(
        program, "accuracy", robots / "arm7.urdf", "--integrators", "gauss:8,rk4", "--steps",
        "0.02,0.01", "--duration", 0.2, "--q0", ",".join(map(str, q0)), "--json",
    )  # fmt: skip
    expected = json.loads(out.stdout)
    for row in [*measured["rows"], *expected["rows"]]:
        del row["cpu_us"]
    assert measured["rows"] == expected["rows"]
    assert len(measured.to_pandas()) == 4
    swept = hamelin.sweep(
        tmp_path / "tries", scenes=scenes / "pillar.json", planner=["hybrid", "apf"],
        duration=0.05, seeds=[1, 2], jobs=2,
    )  # fmt: skip
    assert swept.run["run"] == 4 and swept.run["crashed"] == 0
    assert len(swept.records()) == 4
    resumed = hamelin.sweep(tmp_path / "tries")
    assert resumed.run["run"] == 0 and resumed.run["recorded"] == 4
    merged = run_program(program, "sweep", "merge", tmp_path / "tries", "--by", "planner", "--json")
    assert json.loads(merged.stdout) == dict(resumed)
