"""The package after `cmake --install` and after `pip install .` into a clean environment."""

import os
import pathlib
import shutil
import subprocess
import sys

import pytest

CODE = """
import sys
import numpy as np
import hamelin
arm = hamelin.load_robot(sys.argv[1] + "/data/robots/arm7.urdf")
assert arm.aba(np.zeros(7), np.zeros(7), np.zeros(7)).shape == (7,)
scene = sys.argv[1] + "/data/scenes/pillar.json"
assert hamelin.run(scene, duration=0.01).planner == "hybrid"
class Mine:
    def tick(self, tick, command):
        pass
assert hamelin.run(scene, duration=0.01, planner=Mine()).planner == "python"
print(hamelin.__file__, hamelin.__version__)
"""


def run(command, environment=None, **options):
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("HAMELIN", "PYTHONPATH"))}
    done = subprocess.run(
        list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        env={**kept, **(environment or {})}, **options,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:]
    return done.stdout


@pytest.fixture(scope="module")
def build():
    return pathlib.Path(os.environ["HAMELIN_BUILD_DIR"])


@pytest.fixture(scope="module")
def version(source):
    text = (source / "CMakeLists.txt").read_text()
    return text.split("project(hamelin VERSION ")[1].split()[0]


MINE = "class Mine:\n    def tick(self, tick, command):\n        pass\n"


def test_cmake_install(build, source, version, tmp_path):
    run(["cmake", "--install", build, "--prefix", tmp_path / "prefix"])
    package = next((tmp_path / "prefix").glob("lib/python3*/*-packages"))
    out = run(
        [sys.executable, "-c", CODE, source], {"PYTHONPATH": str(package)}, cwd=tmp_path
    )
    assert out.split() == [str(package / "hamelin" / "__init__.py"), version]
    (tmp_path / "mine.py").write_text(MINE)
    out = subprocess.run(
        [tmp_path / "prefix" / "bin" / "hamelin", "run", source / "data/scenes/pillar.json",
         "--planner", "python:mine.py:Mine", "--duration", "0.01"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert out.returncode == 1 and "planner python" in out.stdout, out.stdout


def test_pip_install(build, source, version, tmp_path):
    if shutil.which("pip3") is None:
        pytest.skip("python3-pip is not installed")
    venv = tmp_path / "venv"
    try:
        run([sys.executable, "-m", "venv", "--system-site-packages", venv])
    except AssertionError:
        pytest.skip("python3-venv is not installed")
    # The folder that CMake has built, so that the test does not build everything again.
    run(
        [venv / "bin" / "python", "-m", "pip", "install", "--no-deps", "--no-index", source,
         f"--config-settings=build-dir={build}"],
        cwd=tmp_path,
    )  # fmt: skip
    out = run([venv / "bin" / "python", "-c", CODE, source], cwd=tmp_path)
    place = next(venv.glob("lib/python3*/site-packages")) / "hamelin" / "__init__.py"
    assert out.split() == [str(place), version]
    (tmp_path / "mine.py").write_text(MINE)
    done = subprocess.run(
        [venv / "bin" / "hamelin", "run", source / "data/scenes/pillar.json", "--planner",
         "python:mine.py:Mine", "--duration", "0.01"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert done.returncode == 1 and "planner python" in done.stdout, done.stdout
    run([venv / "bin" / "python", "-m", "pip", "uninstall", "-y", "hamelin"], cwd=tmp_path)
    assert not list(venv.glob("lib/**/hamelin/plugins/*.so"))
