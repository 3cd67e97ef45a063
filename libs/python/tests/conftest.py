"""Where the checkout, the program and the package are."""

import os
import pathlib
import sys

import pytest

sys.path.insert(0, os.environ["HAMELIN_PACKAGE_DIR"])
os.environ.setdefault("MPLBACKEND", "Agg")

import hamelin  # noqa: E402


def pytest_terminal_summary(terminalreporter):
    """Lets CTest count a file as skipped if some of its tests were and none failed."""
    if not terminalreporter.stats.get("failed") and not terminalreporter.stats.get("error"):
        for report in terminalreporter.stats.get("skipped", []):
            print(f"\ntest skipped: {report.nodeid}: {report.longrepr[2]}")


@pytest.fixture(scope="session")
def source() -> pathlib.Path:
    return pathlib.Path(os.environ["HAMELIN_SOURCE_DIR"])


@pytest.fixture(scope="session")
def program() -> str:
    return os.environ["HAMELIN_PROGRAM"]


@pytest.fixture(scope="session")
def reference_program() -> str:
    return os.environ["HAMELIN_PYTHON_REFERENCE"]


@pytest.fixture(scope="session")
def robots(source):
    return source / "data" / "robots"


@pytest.fixture(scope="session")
def scenes(source):
    return source / "data" / "scenes"


@pytest.fixture(scope="session")
def panda(robots):
    return hamelin.load_robot(robots / "third_party" / "panda.urdf", tip="panda_hand")


@pytest.fixture(scope="session")
def arm(robots):
    return hamelin.load_robot(robots / "arm7.urdf", spheres=robots / "arm7.spheres.json")
