"""Files that are written whole, or not at all."""

from __future__ import annotations

import json
import os

from ._types import Document, PathLike


def write_text(file: PathLike, text: str) -> None:
    """Replaces the file by one with this text."""
    temporary = f"{os.fspath(file)}.tmp"
    with open(temporary, "w", encoding="utf-8") as out:
        out.write(text)
    os.replace(temporary, file)


def write_document(file: PathLike, document: Document) -> None:
    """Replaces the file by one with this document as JSON."""
    write_text(file, json.dumps(document, indent=1, ensure_ascii=False) + "\n")
