"""Planners that are classes in Python files."""

from __future__ import annotations

import importlib.util
import inspect
import os
import sys
from typing import Any, cast


def load_class(file: str, name: str) -> type:
    """Executes a Python file and returns the class of that name in it."""
    path = os.path.abspath(file)
    module_name = "hamelin_planner_" + os.path.splitext(os.path.basename(path))[0]
    spec = importlib.util.spec_from_file_location(module_name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file} is not a Python file, expected a name that ends in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    folder = os.path.dirname(path)
    if folder not in sys.path:
        sys.path.append(folder)  # for modules beside it
    spec.loader.exec_module(module)
    found: Any = module
    for part in name.split("."):
        found = getattr(found, part)
    if not callable(getattr(found, "tick", None)):
        raise TypeError(f"{name} has no method tick(tick, command)")
    return cast(type, found)


def describe(planner: Any) -> dict[str, Any]:
    """Parameters of the planner `python` for an object: where its class is, and its parameters."""
    type_ = type(planner)
    try:
        file: str | None = inspect.getsourcefile(type_)
    except (TypeError, OSError):
        file = None
    if file is not None and not os.path.isfile(file):
        file = None  # defined in a notebook or an interpreter
    params = getattr(planner, "params", {})
    return {
        "file": file,
        "class": type_.__qualname__,
        "object": True,
        "params": dict(params) if isinstance(params, dict) else {},
    }
