"""Speed against error of integrators, and many runs."""

from __future__ import annotations

import json
import os
import sys
from typing import Any, Iterator, Mapping, Sequence

from ._hamelin import Model, _measure, _merge_sweeps, _plan_sweep, _run_sweep, load_robot
from ._progress import Bar
from ._types import Document, Numbers, PathLike, Paths, Progress


class AccuracyResult(Mapping[str, Any]):
    """A measurement of integrators: a mapping of the document hamelin.accuracy/1.

    table: the document as text.
    """

    def __init__(self, document: Document, table: str) -> None:
        self._document = document
        self.table = table

    def __getitem__(self, key: str) -> Any:
        return self._document[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._document)

    def __len__(self) -> int:
        return len(self._document)

    def to_pandas(self) -> Any:
        """A table with one row per integration."""
        import pandas

        return pandas.DataFrame(self._document["rows"])

    def save(self, file: PathLike) -> None:
        """Writes the document, which `hamelin report` shows."""
        with open(file, "w", encoding="utf-8") as out:
            out.write(json.dumps(self._document, indent=2, ensure_ascii=False) + "\n")

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


class Sweep(Mapping[str, Any]):
    """Many runs in a folder: a mapping of the summary hamelin.summary/1 of what is recorded.

    directory: the folder. table: the summary as text. run: what the last call executed.
    """

    def __init__(self, directory: str, by: Sequence[str], executed: Document) -> None:
        self.directory = directory
        self.run = executed
        self._document, self.table = _merge_sweeps(directory, list(by))

    def __getitem__(self, key: str) -> Any:
        return self._document[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._document)

    def __len__(self) -> int:
        return len(self._document)

    def records(self) -> list[Document]:
        """One record per run (hamelin.record/1), in the order in which the runs ended."""
        with open(os.path.join(self.directory, "records.jsonl"), encoding="utf-8") as lines:
            return [json.loads(line) for line in lines]

    def __repr__(self) -> str:
        return self.table


def sweep(
    directory: PathLike,
    *,
    scenes: Paths = None,
    planner: str | Sequence[str] = (),
    set: str | Sequence[str] = (),  # noqa: A002
    vary: str | Sequence[str] = (),
    seeds: Sequence[int] = (1,),
    duration: float | None = None,
    jobs: int | None = None,
    only: str = "",
    limit: int | None = None,
    fresh: bool = False,
    timeout: float | None = 600.0,
    by: Sequence[str] = ("planner",),
    plugin_path: Paths = None,
    progress: Progress = False,
) -> Sweep:
    """Executes many runs, one process per run, and sums them up, as `hamelin sweep`.

    directory: folder of the sweep. scenes: scene and problem files; None: resume the plan that the
    folder has. planner: names, each for all scenes. set: values for all runs, such as
    "/planner/params/gain=2". vary: values such as "/planner/params/gain=1,2", one run per
    combination. seeds: one run each. duration: longest simulated time [s]. jobs: number of parallel
    processes; None: one per core. only: execute only runs whose id contains this text. limit:
    largest number of runs to execute now. fresh: drop existing records. timeout: wall-clock time
    after which a run is killed [s]. by: labels that the summary groups by.
    """
    folder = os.fspath(directory)
    if scenes is not None:

        def texts(given: str | Sequence[str]) -> list[str]:
            return [given] if isinstance(given, str) else list(given)

        _plan_sweep(
            folder,
            scenes,
            texts(planner),
            texts(set),
            texts(vary),
            list(seeds),
            duration,
            plugin_path,
        )
    command = [sys.executable, "-m", "hamelin._sweep_one"]
    folders: list[str] = []
    if plugin_path is not None:
        many = isinstance(plugin_path, (list, tuple))
        folders = [os.fspath(p) for p in (plugin_path if many else [plugin_path])]  # type: ignore
    for one in folders:
        command += ["--plugin-path", one]
    package_folder = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join([package_folder, *([before] if before else [])])
    try:
        with Bar(progress, "runs") as bar:
            executed = _run_sweep(
                folder,
                command,
                (os.cpu_count() or 1) if jobs is None else jobs,
                only,
                limit,
                fresh,
                timeout,
                plugin_path,
                bar.function,
            )
    finally:
        if before is None:
            del os.environ["PYTHONPATH"]
        else:
            os.environ["PYTHONPATH"] = before
    return Sweep(folder, by, executed)


