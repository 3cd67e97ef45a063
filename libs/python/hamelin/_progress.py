"""Progress of long calls."""

from __future__ import annotations

import sys
from typing import Any, Callable

from ._types import Progress


class Bar:
    """A line on stderr that shows how far a call is; a function of the caller replaces it."""

    def __init__(self, progress: Progress, title: str) -> None:
        self._title = title
        self._shown = -1
        self.function: Callable[[float, float], Any] | None = None
        if callable(progress):
            self.function = progress
        elif progress:
            self.function = self._show

    def _show(self, done: float, all_: float) -> None:
        percent = int(100.0 * done / all_) if all_ > 0 else 0
        if percent == self._shown:
            return
        self._shown = percent
        filled = percent * 30 // 100
        sys.stderr.write(f"\r{self._title} [{'#' * filled}{' ' * (30 - filled)}] {percent:3d} %")
        sys.stderr.flush()

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown >= 0:
            sys.stderr.write("\r" + " " * (len(self._title) + 42) + "\r")
            sys.stderr.flush()
