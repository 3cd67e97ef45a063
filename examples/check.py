"""check.py NAME BUILD: runs the example NAME in C++ and in Python; both must print the same."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[1]
WITH_PLANNERS = ("04_run", "07_control_loop", "09_pick_and_place")


def output(command, build):
    environment = {**os.environ, "PYTHONPATH": str(build / "lib" / "python")}
    done = subprocess.run(
        list(map(str, command)), cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True
    )
    if done.returncode != 0:
        sys.exit(f"{command[0]}: exit code {done.returncode}, expected 0\n{done.stdout}")
    return done.stdout


def run_programs(name, build, log):
    """What both programs print; the second reads what the first has written."""
    cpp = [build / "examples" / name]
    python = [sys.executable, "-B", f"examples/{name}.py"]
    if name in WITH_PLANNERS:
        cpp.append(build / "lib" / "hamelin" / "plugins")
    if name == "04_run":
        cpp.append(log)
        python.append(log)
    printed = output(cpp, build), output(python, build)
    if name == "04_run":
        cpp = [build / "examples" / "05_read_log", log]
        python[2:] = ["examples/05_read_log.py", log]
        printed = printed[0] + output(cpp, build), printed[1] + output(python, build)
    return printed


def run_planners(build, folder):
    """Where the arm is after a second with each planner, as text."""
    results = []
    planners = "springs", "python:examples/08_own_planner.py:Springs"
    for number, planner in enumerate(planners):
        file = folder / f"{number}.json"
        command = [build / "bin" / "hamelin", "run", "data/scenes/pillar.json", "--duration", "1"]
        command += ["--planner", planner, "--result", file]
        command += ["--plugin-path", build / "lib" / "hamelin" / "test_plugins"]
        subprocess.run(list(map(str, command)), cwd=ROOT, stdout=subprocess.PIPE)
        results.append(" ".join(f"{angle:.9f}" for angle in json.loads(file.read_text())["q"]))
    return tuple(results)


def main(name, build):
    build = pathlib.Path(build)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        if name == "08_own_planner":
            cpp, python = run_planners(build, folder)
        else:
            cpp, python = run_programs(name, build, folder / "run.jsonl")
    print(cpp)
    if not cpp or cpp != python:
        sys.exit(f"{name}: Python prints other lines than C++:\n{python}")


main(*sys.argv[1:])
