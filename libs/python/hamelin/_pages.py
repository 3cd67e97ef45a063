"""Reports: pages that replay the arm in its map."""

from __future__ import annotations

import html
import os

from ._files import write_text
from ._hamelin import _make_report
from ._runs import Result
from ._types import Document, PathLike


class Page:
    """A page of `hamelin report`, shown in a notebook. text: its HTML. runs: a summary of each."""

    def __init__(self, text: str, runs: list[Document]) -> None:
        self.text = text
        self.runs = runs

    def save(self, file: PathLike) -> None:
        """Writes the page to a file."""
        write_text(file, self.text)

    def _repr_html_(self) -> str:
        """The page in a frame, for notebooks."""
        return (
            f'<iframe srcdoc="{html.escape(self.text, quote=True)}" width="100%" height="640" '
            'style="border: 0"></iframe>'
        )

    def __repr__(self) -> str:
        names = ", ".join(str(run["name"]) for run in self.runs)
        return f"<hamelin.Page of {names}, {1e-6 * len(self.text):.2f} MB>"


def report(*logs: Result | PathLike, output: PathLike | None = None, frames: int = 2000) -> Page:
    """Makes a page that replays the arm in its map, with plots, as `hamelin report`.

    logs: files, or results of runs with a log, shown side by side. output: file to write. frames:
    largest number of arm poses per run.
    """
    files = []
    for log in logs:
        if isinstance(log, Result):
            if log.log is None:
                raise ValueError("the run has no log, expected run(..., log=FILE)")
            files.append(log.log)
        else:
            files.append(os.fspath(log))
    text, runs = _make_report(files, frames)
    page = Page(text, runs)
    if output is not None:
        page.save(output)
    return page
