"""The page of the Python package: signatures from its sources and from _hamelin.pyi, texts from its docstrings."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import sys
import textwrap
from pathlib import Path


def signature(node: ast.FunctionDef, name: str) -> str:
    """`name(q: ArrayLike, ...) -> Array`, broken into lines if it is long."""
    arguments = ast.unparse(node.args)
    arguments = re.sub(r"^(self|cls)(, |$)", "", arguments)
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    line = f"{name}({arguments}){returns}"
    if len(line) <= 88:
        return line
    whole = ast.parse(f"def f({arguments}): ...").body[0].args
    parts = []
    positional = whole.posonlyargs + whole.args
    defaults = [None] * (len(positional) - len(whole.defaults)) + whole.defaults
    for argument, default in zip(positional, defaults):
        parts.append(ast.unparse(argument) + (f" = {ast.unparse(default)}" if default else ""))
    if whole.vararg:
        parts.append("*" + ast.unparse(whole.vararg))
    elif whole.kwonlyargs:
        parts.append("*")
    for argument, default in zip(whole.kwonlyargs, whole.kw_defaults):
        parts.append(ast.unparse(argument) + (f" = {ast.unparse(default)}" if default else ""))
    if whole.kwarg:
        parts.append("**" + ast.unparse(whole.kwarg))
    return f"{name}(\n" + "".join(f"    {part},\n" for part in parts) + f"){returns}"


def doc_of(thing: object) -> str:
    """The docstring as Markdown, without the signature that pybind11 puts first."""
    text = inspect.getdoc(thing) or ""
    lines = text.splitlines()
    while lines and (re.match(r"^\w+\(.*\)( -> .*)?$", lines[0]) or not lines[0].strip()):
        lines.pop(0)
    text = textwrap.dedent("\n".join(lines))
    # Indented lines after a blank one are an example.
    return re.sub(
        r"(?m)(?:^|(?<=\n\n))((?: {4}.*\n?)+)",
        lambda match: "```python\n" + textwrap.dedent(match[1]).rstrip() + "\n```\n",
        text,
    )


def definitions(package: Path) -> dict[str, ast.AST]:
    """Classes and functions of the package's sources and of the types of its extension module."""
    found: dict[str, ast.AST] = {}
    for file in sorted([*package.glob("*.py"), package / "_hamelin.pyi"]):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                found.setdefault(node.name, node)
    return found


def code(text: str) -> list[str]:
    return ["```python", text, "```", ""]


def class_lines(name: str, node: ast.ClassDef, thing: type) -> list[str]:
    lines = [f"### {name}", "", doc_of(thing) if thing.__doc__ else "", ""]
    fields: list[tuple[str, str, str]] = []
    methods: list[str] = []
    overloads: dict[str, list[ast.FunctionDef]] = {}
    for item in node.body:
        if isinstance(item, ast.FunctionDef):
            kinds = [ast.unparse(decorator) for decorator in item.decorator_list]
            if any(kind.endswith(".setter") for kind in kinds):
                continue
            if "property" in kinds or "functools.cached_property" in kinds:
                if not item.name.startswith("_"):
                    returns = ast.unparse(item.returns) if item.returns else ""
                    fields.append((item.name, returns, doc_of(getattr(thing, item.name, None))))
            elif item.name == "__init__" or not item.name.startswith("_"):
                overloads.setdefault(item.name, []).append(item)
        elif isinstance(item, ast.AnnAssign) and not ast.unparse(item.target).startswith("_"):
            fields.append((ast.unparse(item.target), ast.unparse(item.annotation), ""))
    for method, nodes in overloads.items():
        shown = name if method == "__init__" else method
        if method != "__init__":
            methods += [f"#### {name}.{method}", ""]
        methods += code("\n".join(signature(item, shown) for item in nodes))
        methods += [doc_of(getattr(thing, method, None)) if method != "__init__" else "", ""]
    if fields:
        lines += ["| attribute | type | |", "|---|---|---|"]
        for field, kind, text in fields:
            meaning = " ".join(text.split()).replace("|", "\\|")
            kind = kind.replace("|", "\\|")
            lines.append(f"| `{field}` | {f'`{kind}`' if kind else ''} | {meaning} |")
        lines.append("")
    return lines + methods


def page(package: Path, built: Path) -> str:
    """The page of all public names. `built` is the folder on sys.path that has the built package."""
    sys.path.insert(0, str(built))
    sys.dont_write_bytecode = True
    module = importlib.import_module("hamelin")
    known = definitions(package)
    names = [name for name in module.__all__ if not name.startswith("__")]
    functions = [name for name in names if isinstance(known.get(name), ast.FunctionDef)]
    classes = [name for name in names if isinstance(known.get(name), ast.ClassDef)]
    lost = set(names) - set(functions) - set(classes)
    if lost:
        raise SystemExit(f"{package}: {', '.join(sorted(lost))}: no definition found, expected a class or function")
    lines = ["# Python package", "", doc_of(module), ""]
    lines += ["[hamelin from Python](../README.md) explains how to install and use it.", "", "## Functions", ""]
    for name in sorted(functions, key=str.lower):
        lines += [f"### {name}", "", *code(signature(known[name], name)), doc_of(getattr(module, name)), ""]
    lines += ["## Classes", ""]
    for name in sorted(classes, key=str.lower):
        lines += class_lines(name, known[name], getattr(module, name))
    return "\n".join(lines)
