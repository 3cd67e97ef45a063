"""The data that hamelin is installed with."""

from __future__ import annotations

import pathlib

from ._error import Error
from ._hamelin import _prefix


def data_path(name: str = "") -> pathlib.Path:
    """The path of a file of hamelin's own data, such as "scenes/shelf.json"; "": their folder."""
    file = pathlib.Path(_prefix()) / "share" / "hamelin" / name
    if not file.exists():
        known = sorted(part.name for part in file.parent.glob("*")) or ["another folder"]
        raise Error(f"{file}: does not exist, expected one of {', '.join(known)}", "io")
    return file
