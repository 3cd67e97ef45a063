"""Builds the Python package with CMake, for `pip install .` (PEP 517).

Config settings (`pip install . --config-settings=KEY=VALUE`): `build-dir` is a folder that CMake has
built already, which is then only installed; `cmake-args` are further arguments of CMake.
"""

from __future__ import annotations

import base64
import hashlib
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import zipfile

try:
    import tomllib
except ImportError:  # before Python 3.11
    from pip._vendor import tomli as tomllib  # type: ignore

ROOT = pathlib.Path(__file__).resolve().parents[3]
# The program's commands in a wheel. The package has functions for most of what the others do.
COMMANDS = ("run", "replay", "report", "plan", "scene", "plugins", "schema", "help")


def _project() -> dict:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    cmake = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    match = re.search(r"project\(hamelin VERSION (\d+\.\d+\.\d+)", cmake)
    if match is None:
        raise RuntimeError("CMakeLists.txt: has no version, expected project(hamelin VERSION x.y.z")
    return {**project, "version": match[1]}


def _metadata(project: dict) -> str:
    lines = [
        "Metadata-Version: 2.1",
        f"Name: {project['name']}",
        f"Version: {project['version']}",
        f"Summary: {project['description']}",
        f"License: {project['license']['text']}",
        f"Requires-Python: {project['requires-python']}",
    ]
    lines += [f"Requires-Dist: {name}" for name in project["dependencies"]]
    for extra, names in project.get("optional-dependencies", {}).items():
        lines.append(f"Provides-Extra: {extra}")
        lines += [f'Requires-Dist: {name}; extra == "{extra}"' for name in names]
    lines.append("Description-Content-Type: text/markdown")
    text = (ROOT / project["readme"]).read_text(encoding="utf-8")
    return "\n".join(lines) + "\n\n" + text


def _tag() -> str:
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    return f"{python}-{python}-{platform}"


def _package_folder() -> str:
    return f"lib/python{sys.version_info.major}.{sys.version_info.minor}/site-packages"


def _install(stage: pathlib.Path, settings: dict) -> None:
    build = settings.get("build-dir")
    if build is None:
        build = os.environ.get("HAMELIN_WHEEL_DIR") or ROOT / "build" / "wheel"
        arguments = [
            "-DCMAKE_BUILD_TYPE=Release",
            "-DHAMELIN_BUILD_TESTS=OFF",
            "-DHAMELIN_BUILD_PYTHON=ON",
            "-DHAMELIN_BUILD_C_INTERFACE=OFF",
            "-DHAMELIN_COMMANDS=" + ";".join(COMMANDS),
            "-DHAMELIN_INSTRUCTION_SETS=baseline;best",
            f"-DPython3_EXECUTABLE={sys.executable}",
            f"-DHAMELIN_PYTHON_DIR={_package_folder()}",
            "-DCMAKE_INSTALL_LIBDIR=lib",
            *shlex.split(settings.get("cmake-args", "")),
        ]
        generator = ["-G", "Ninja"] if shutil.which("ninja") else []
        subprocess.run(["cmake", "-S", ROOT, "-B", build, *generator, *arguments], check=True)
        build_wheel = ["cmake", "--build", build, "--parallel", "--target", "wheel"]
        subprocess.run(build_wheel, check=True)
    for component in ("python3-hamelin", "hamelin", "hamelin-plugins"):
        install = ["cmake", "--install", build, "--prefix", stage, "--component", component]
        subprocess.run(install, check=True)


def _only_folder(stage: pathlib.Path, pattern: str, what: str) -> pathlib.Path:
    """The folder of an installation, whose place depends on the options of the build."""
    found = [folder for folder in sorted(stage.glob(pattern)) if folder.is_dir()]
    if len(found) != 1:
        raise RuntimeError(f"{stage}/{pattern}: {len(found)} folders, expected one with {what}")
    return found[0]


def _files(stage: pathlib.Path, data: str) -> dict[str, pathlib.Path]:
    """Names in the wheel, and the files: the package, the program, planners and shared data."""
    found = {}
    package = _only_folder(
        stage, "lib/python*/*-packages/hamelin", "the package (HAMELIN_BUILD_PYTHON=ON)"
    )
    plugins = _only_folder(stage, "lib/**/hamelin/plugins", "the planners")
    for folder, name in (
        (package, "hamelin"),
        (stage / "bin", f"{data}/scripts"),
        (plugins, f"{data}/data/{plugins.relative_to(stage).as_posix()}"),
        (stage / "share", f"{data}/data/share"),
    ):
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                found[f"{name}/{file.relative_to(folder).as_posix()}"] = file
    return found


def _digest(content: bytes) -> str:
    hashed = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
    return f"sha256={hashed}"


def _wheel_file() -> str:
    return f"Wheel-Version: 1.0\nGenerator: hamelin\nRoot-Is-Purelib: false\nTag: {_tag()}\n"


def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    """Writes the metadata of the wheel, without building it, and returns the folder's name."""
    project = _project()
    name = f"{project['name']}-{project['version']}.dist-info"
    folder = pathlib.Path(metadata_directory) / name
    folder.mkdir()
    (folder / "METADATA").write_text(_metadata(project), encoding="utf-8")
    (folder / "WHEEL").write_text(_wheel_file(), encoding="utf-8")
    return name


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Builds the wheel and returns its name."""
    project = _project()
    base = f"{project['name']}-{project['version']}"
    wheel = f"{base}-{_tag()}.whl"
    records = []
    with tempfile.TemporaryDirectory() as folder:
        stage = pathlib.Path(folder)
        _install(stage, dict(config_settings or {}))
        with zipfile.ZipFile(
            pathlib.Path(wheel_directory) / wheel, "w", zipfile.ZIP_DEFLATED
        ) as out:

            def add(name: str, content: bytes, mode: int = 0o644) -> None:
                info = zipfile.ZipInfo(name)  # with a fixed date
                info.external_attr = (0o100000 | mode) << 16
                info.compress_type = zipfile.ZIP_DEFLATED
                out.writestr(info, content)
                records.append(f"{name},{_digest(content)},{len(content)}")

            for name, file in _files(stage, f"{base}.data").items():
                add(name, file.read_bytes(), file.stat().st_mode & 0o777)
            add(f"{base}.dist-info/METADATA", _metadata(project).encode())
            add(f"{base}.dist-info/WHEEL", _wheel_file().encode())
            add(f"{base}.dist-info/LICENSE", (ROOT / "LICENSE").read_bytes())
            record = f"{base}.dist-info/RECORD"
            out.writestr(record, "\n".join([*records, f"{record},,"]) + "\n")
    return wheel


def build_sdist(sdist_directory, config_settings=None):
    """Packs the files of the checkout and returns the archive's name."""
    project = _project()
    base = f"{project['name']}-{project['version']}"
    listed = subprocess.run(
        ["git", "-C", ROOT, "ls-files", "-z"], stdout=subprocess.PIPE, check=True
    ).stdout
    with tempfile.TemporaryDirectory() as folder:
        info = pathlib.Path(folder) / "PKG-INFO"
        info.write_text(_metadata(project), encoding="utf-8")
        with tarfile.open(pathlib.Path(sdist_directory) / f"{base}.tar.gz", "w:gz") as out:
            for name in filter(None, listed.decode().split("\0")):
                out.add(ROOT / name, f"{base}/{name}")
            out.add(info, f"{base}/PKG-INFO")
    return f"{base}.tar.gz"
