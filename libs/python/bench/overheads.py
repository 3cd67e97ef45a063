"""Prints what calls from Python cost beside the same calls from C++, measured in one run.

overheads.py CPP_TIMES [SOURCE_DIR]: needs the package on PYTHONPATH.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import time

import hamelin
import numpy as np


def least_time(function, repetitions):
    """The least time of several calls [s]."""
    least = float("inf")
    for _ in range(repetitions):
        begin = time.perf_counter()
        function()
        least = min(least, time.perf_counter() - begin)
    return least


def repeated(function, count):
    """The time of a call [s], of the fastest of several loops."""

    def loop():
        for _ in range(count):
            function()

    def nothing():
        for _ in range(count):
            pass

    return (least_time(loop, 10) - least_time(nothing, 10)) / count


class Nothing:
    """The cheapest planner."""

    def tick(self, tick, command):
        pass


class Small:
    """A planner of ten lines: attraction of the tip, with gravity compensated."""

    def start(self, setup):
        self.arm = setup.model

    def tick(self, tick, command):
        arm, q, v = self.arm, tick.q, tick.v
        jacobian = arm.jacobian(q)[3:]
        error = np.array([0.5, 0.0, 0.5]) - arm.tip_pose(q)[:3, 3]
        command.held_torque = arm.gravity_torque(q) + jacobian.T @ (20 * error) - 2 * v


def planner_costs(source):
    """Time of a step with each planner [s], without gravity, limits, obstacles and shield."""
    scene = {
        "schema": "hamelin.scene/1",
        "robot": {"file": str(source / "data/robots/arm7.urdf")},
        "gravity_m_s2": [0.0, 0.0, 0.0],
        "model": {"joint_limits": False, "velocity_limits": False, "torque_limits": False},
        "start": {"q": [0.0, -0.7, 0.0, -2.3, 0.0, 1.5, 0.7]},
        "goals": [{"type": "position", "position_m": [5.0, 0.0, 0.5]}],
        "stall": None,
    }

    def of(planner):
        scene["duration_s"] = 3.0
        return least_time(lambda: hamelin.run(scene, planner=planner), 5) / 3000

    return of("template"), of(Nothing()), of(Small())


def python_times(robot, scene, ticks):
    """Times of the calls that C++ makes as well [s]."""
    arm = hamelin.load_robot(robot)
    q, v, tau = (np.full(7, x) for x in (0.3, 0.2, 1.0))
    many = np.random.default_rng(1).uniform(-1, 1, size=(3, 100_000, 7))
    columns = [np.asfortranarray(x) for x in many]
    controller = hamelin.Controller(scene)
    pairs = [(q, v) for q, v in ticks]
    period = controller.period_s
    begin = time.perf_counter()
    for k, (q_now, v_now) in enumerate(pairs):
        controller.tick(k * period, q_now, v_now)
    return {
        "tick_s": (time.perf_counter() - begin) / len(pairs),
        "aba_s": repeated(lambda: arm.aba(q, v, tau), 20_000),
        "rows_s": least_time(lambda: arm.aba(*many), 10),
        "columns_s": least_time(lambda: arm.aba(*columns), 10),
    }


def least_of_rounds(measure, times):
    """The least of each time, of what was measured before and of one more round."""
    now = measure()
    return {name: min(times.get(name, value), value) for name, value in now.items()}


def main():
    source = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else ".")
    robot, scene = source / "data/robots/arm7.urdf", source / "data/scenes/shelf.json"
    with tempfile.TemporaryDirectory() as folder:
        log_file = pathlib.Path(folder) / "shelf.jsonl"
        hamelin.run(scene, log=log_file)
        log = hamelin.read_log(log_file)
        packed = pathlib.Path(folder) / "shelf.jsonl.zst"
        hamelin.run(scene, log=packed)
        states = pathlib.Path(folder) / "states.bin"
        ticks = np.stack([log.q, log.v], axis=1)
        states.write_bytes(ticks.tobytes())
        program = [sys.argv[1], robot, scene, states, hamelin.plugin_path()[0]]
        cpp, python = {}, {}
        for _ in range(5):  # in turns, because the speed of the machine may change
            cpp = least_of_rounds(lambda: json.loads(subprocess.check_output(program)), cpp)
            python = least_of_rounds(lambda: python_times(robot, scene, ticks), python)
        read = least_time(lambda: hamelin.read_log(log_file), 5)
        read_packed = least_time(lambda: hamelin.read_log(packed), 5)
    aba, tick = python["aba_s"], python["tick_s"]
    rows, in_place = python["rows_s"], python["columns_s"]
    template, nothing, small = planner_costs(source)
    us = 1e6
    print(f"one ABA                     {us * aba:7.2f} us, C++ {us * cpp['aba_s']:.2f} us")
    print(
        f"ABA of 100000 states        {1e3 * rows:7.2f} ms in C order, {1e3 * in_place:.2f} ms in "
        f"Fortran order, C++ {1e3 * cpp['aba_many_s']:.2f} ms: "
        f"{rows / cpp['aba_many_s']:.2f} and {in_place / cpp['aba_many_s']:.2f} times"
    )
    print(
        f"tick of a Controller        {us * tick:7.2f} us, C++ {us * cpp['tick_s']:.2f} us: "
        f"{us * (tick - cpp['tick_s']):+.2f} us"
    )
    print(
        f"read a log of {log.ticks} ticks  {read:7.3f} s, zstd {read_packed:.3f} s; 12955 ticks: "
        f"{read * 12955 / log.ticks:.3f} s"
    )
    print(
        f"step with a planner         {us * template:7.2f} us with template (C++), "
        f"{us * nothing:.2f} us with an empty one in Python, {us * small:.2f} us with one of ten "
        "lines"
    )


if __name__ == "__main__":
    main()
