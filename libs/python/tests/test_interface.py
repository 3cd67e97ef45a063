"""Every public name has a docstring and a stub; errors say where and what."""

import ast
import importlib.util
import inspect
import os
import pathlib
import pickle
import subprocess
import sys

import hamelin
import hamelin._hamelin as extension
import pytest


def public(owner):
    return [name for name in vars(owner) if not name.startswith("_")]


def test_every_public_name_has_a_docstring():
    missing = [name for name in hamelin.__all__ if not getattr(hamelin, name).__doc__]
    for name in hamelin.__all__:
        member = getattr(hamelin, name)
        if not inspect.isclass(member):
            continue
        for attribute in public(member):
            value = inspect.getattr_static(member, attribute)
            if callable(value) or isinstance(value, (property, staticmethod)):
                text = (value.__doc__ or "").strip()
                # pybind11 begins a docstring with the signature.
                if not text or text.splitlines()[-1].startswith(f"{attribute}("):
                    missing.append(f"{name}.{attribute}")
    assert missing == []


def test_every_name_is_listed():
    names = {n for n in vars(hamelin) if not n.startswith("_")} | {"__version__"}
    assert {n for n in names if not inspect.ismodule(getattr(hamelin, n))} == set(hamelin.__all__)
    assert hamelin.__version__.count(".") == 2


def test_the_extension_module_has_a_stub_for_every_name():
    stub = pathlib.Path(hamelin.__file__).with_name("_hamelin.pyi")
    tree = ast.parse(stub.read_text())
    found = {}
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            found[node.name] = {n.name for n in node.body if isinstance(n, ast.FunctionDef)}
        elif isinstance(node, ast.FunctionDef):
            found[node.name] = {a.arg for a in node.args.args + node.args.kwonlyargs}
        elif isinstance(node, ast.AnnAssign):
            found[node.target.id] = set()
    wanted = {name for name in vars(extension) if not name.startswith("__")} | {"__version__"}
    assert wanted <= set(found), sorted(wanted - set(found))
    assert set(found) <= wanted, sorted(set(found) - wanted)
    for name, value in vars(extension).items():
        if inspect.isclass(value):
            missing = set(public(value)) - found[name]
            assert not missing, f"{name}: {sorted(missing)}"
            assert not {n for n in found[name] if n[0] != "_"} - set(public(value)), name
        elif not name.startswith("__") and callable(value):
            line = value.__doc__.splitlines()[0]
            for argument in found[name]:
                assert f"{argument}:" in line, f"{name}: {argument}"
    assert stub.with_name("py.typed").exists()


def test_types(source):
    if importlib.util.find_spec("mypy") is None:
        pytest.skip("mypy is not installed")
    here = source / "libs" / "python"
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", here / "tests" / "mypy.ini",
         "--cache-dir", os.devnull, here / "hamelin"],
        stdout=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


def test_errors_have_parts(tmp_path):
    with pytest.raises(hamelin.Error) as raised:
        hamelin.load_robot("missing.urdf")
    error = raised.value
    assert isinstance(error, ValueError)
    assert error.code == "io" and error.file == "missing.urdf" and error.place is None
    assert str(error).endswith(error.text)
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.code, again.file) == (str(error), error.code, error.file)
    file = tmp_path / "scene.json"
    file.write_text('{"schema": "hamelin.scene/1", "robot": 5}')
    with pytest.raises(hamelin.Error) as raised:
        hamelin.load_scene(file)
    assert raised.value.file == str(file) and raised.value.place == "/robot"
    file.write_text("{\n x")
    with pytest.raises(hamelin.Error) as raised:
        hamelin.load_scene(file)
    assert raised.value.code == "parse" and raised.value.place.startswith("line 2")


def test_objects_show_themselves(arm, scenes):
    scene = hamelin.load_scene(scenes / "shelf.json")
    objects = [arm, scene, scene.environment(), hamelin.Integrator(arm), hamelin.Channels()]
    integrator = hamelin.Integrator(arm)
    state = integrator.start([0.0] * 7)
    objects += [state, integrator.step(state, 0.001), hamelin.Controller(scene)]
    for shown in objects:
        assert repr(shown).startswith(f"<hamelin.{type(shown).__name__}"), repr(shown)
