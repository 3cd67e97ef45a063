"""Speed against error of integrators."""

from __future__ import annotations

import os
from typing import Any, Sequence

from ._files import write_document
from ._hamelin import Model, _measure, load_robot
from ._progress import Bar
from ._types import Document, DocumentMapping, Numbers, PathLike, Progress


class AccuracyResult(DocumentMapping):
    """A measurement of integrators: a mapping of the document hamelin.accuracy/1.

    table: the document as text.
    """

    def __init__(self, document: Document, table: str) -> None:
        super().__init__(document)
        self.table = table

    def to_pandas(self) -> Any:
        """A table with one row per integration."""
        import pandas

        return pandas.DataFrame(self._document["rows"])

    def save(self, file: PathLike) -> None:
        """Writes the document, which `hamelin report` shows."""
        write_document(file, self._document)

    def __repr__(self) -> str:
        return self.table


def accuracy(
    robot: Model | PathLike,
    *,
    integrators: Sequence[str],
    steps: Sequence[float] = (),
    rtol: Sequence[float] = (),
    tolerance: Sequence[float] = (),
    atol: float | None = None,
    duration: float = 1.0,
    q0: Numbers | None = None,
    v0: Numbers | None = None,
    damping: Numbers | None = None,
    every: int = 0,
    reference: bool = True,
    progress: Progress = False,
) -> AccuracyResult:
    """Measures speed against error of integrators in free motion, as `hamelin accuracy`.

    robot: a Model or a robot file. integrators: such as "gauss:8". steps: fixed steps [s]. rtol:
    relative tolerances of integrators with step control; atol: absolute, None: equal to rtol.
    tolerance: of root-finding. duration: [s]. q0, v0: shape (n,). damping: viscous, shape (n,).
    every: steps between samples of the energy; 0: chosen. reference: whether errors of q and v are
    measured.
    """
    model = robot if isinstance(robot, Model) else load_robot(robot)
    name = model.name if isinstance(robot, Model) else os.fspath(robot)
    names = [integrators] if isinstance(integrators, str) else list(integrators)
    with Bar(progress, "measuring") as bar:
        document, table = _measure(
            model,
            name,
            q0,
            v0,
            damping,
            duration,
            ",".join(names),
            list(steps),
            list(rtol),
            list(tolerance),
            atol,
            every,
            reference,
            bar.function,
        )
    return AccuracyResult(document, table)
