"""Many runs: plans, their execution, and summaries."""

from __future__ import annotations

import io
import json
import os
import sys
import tempfile
from typing import Any, Sequence

import numpy as np

from ._hamelin import (
    _compare_sweeps,
    _merge_sweeps,
    _plan_sweep,
    _run_sweep,
    _sweep_csv,
    _write_records,
)
from ._progress import Bar
from ._types import Document, DocumentMapping, Numbers, PathLike, Paths, Progress


class Sweep(DocumentMapping):
    """Many runs in a folder: a mapping of the summary hamelin.summary/1 of what is recorded.

    directory: the folder. table: the summary as text. run: what the last call executed.
    """

    def __init__(self, directory: str, by: Sequence[str], executed: Document) -> None:
        self.directory = directory
        self.run = executed
        document, self.table = _merge_sweeps(directory, list(by))
        super().__init__(document)

    def records(self) -> list[Document]:
        """One record per run (hamelin.record/1), in the order of the plan, of all shards."""
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "records.jsonl")
            _write_records(self.directory, file)
            with open(file, encoding="utf-8") as lines:
                return [json.loads(line) for line in lines]

    def compare(
        self, other: Sweep | PathLike | None = None, *, label: str = "planner",
        ignore: str | Sequence[str] = (),
    ) -> Document:  # fmt: skip
        """Paired tests of this sweep and another (hamelin.comparison/1), as `sweep compare`.

        other: another sweep or its folder; none: the values of `label` in this one. ignore: labels
        in which the runs of a pair may differ.
        """
        folders: list[PathLike] = [self.directory]
        if other is not None:
            folders.append(other.directory if isinstance(other, Sweep) else other)
        return _compare_sweeps(folders, label, _texts(ignore))

    def to_pandas(self) -> Any:
        """A pandas DataFrame with a row per run, the columns of `hamelin sweep merge --csv`."""
        import pandas

        return pandas.read_csv(io.StringIO(_sweep_csv(self.directory)))

    def __repr__(self) -> str:
        return self.table


def _texts(given: str | Sequence[str]) -> list[str]:
    return [given] if isinstance(given, str) else list(given)


def _keep_out(given: Numbers) -> list[Numbers]:
    balls = np.asarray(given, dtype=np.float64)
    return [balls] if balls.ndim == 1 else list(balls)


def plan_sweep(
    directory: PathLike,
    scenes: Paths = None,
    *,
    planner: str | Sequence[str] = (),
    set: str | Sequence[str] = (),  # noqa: A002 (the program's name)
    vary: str | Sequence[str] = (),
    seeds: Sequence[int] = (1,),
    duration: float | None = None,
    goal: str | Sequence[str] = (),
    sphere_on_path: float | None = None,
    visible_within: float | None = None,
    swing: Numbers | None = None,
    prediction: str = "constant-acceleration",
    robot: PathLike | None = None,
    spheres: PathLike | None = None,
    tip: str | None = None,
    resolution: float = 0.02,
    mark: str = "touch",
    base: PathLike | None = None,
    clutter: int = 0,
    pairs: int = 1,
    primitives: int = 30,
    sizes: Numbers = (0.05, 0.2),
    bounds: Numbers = (-0.8, -0.8, 0, 0.8, 0.8, 1.2),
    keep_out: Numbers = (0.0, 0.0, 0.2, 0.35),
    gain_sets: int = 0,
    draw_seed: int = 1,
    plugin_path: Paths = None,
    progress: Progress = False,
) -> Document:
    """Plans a run per combination of scene, planner, value and seed, as `hamelin sweep plan`.

    directory: folder of the plan and of generated scenes. scenes: scene files and MotionBenchMaker
    problems. planner: names, with parameters as in "hybrid:escape=none", or "python:FILE:CLASS".
    set: values for all runs, such as "/planner/params/gain=2". vary: values such as
    "/planner/params/gain=1,2", one run per combination. seeds: one run each. duration: longest
    simulated time [s].

    Problems: goal: kinds, "joint" (the default), "position" or "pose". sphere_on_path: radius of a
    sphere on the path that hybrid finds [m], seen within visible_within [m]; swing: amplitude [m]
    and period [s]; prediction: what is known of its motion. robot, spheres, tip: the arm.
    resolution: edge of a voxel [m]. mark: "touch" or "centre".

    Random scenes for the arm of the scene `base`: clutter: number of maps, each with `pairs` of
    start and goal, and `primitives` obstacles of `sizes` (smallest, largest) [m] within `bounds`
    (lower and upper corner) [m], none in the balls `keep_out`, shape (4,) or (N, 4): centre and
    radius [m]. gain_sets: number of random gain sets. draw_seed: of all that is random.

    Returns a summary: directory, scenes, feasible, runs, sha256 and notes.
    """
    with Bar(progress, "planning") as bar:
        return _plan_sweep(
            directory,
            {
                "scenes": scenes,
                "planner": _texts(planner),
                "set": _texts(set),
                "vary": _texts(vary),
                "seeds": list(seeds),
                "duration": duration,
                "goal": _texts(goal),
                "sphere_on_path": sphere_on_path,
                "visible_within": visible_within,
                "swing": swing,
                "prediction": prediction,
                "robot": robot,
                "spheres": spheres,
                "tip": tip,
                "resolution": resolution,
                "mark": mark,
                "base": base,
                "clutter": clutter,
                "pairs": pairs,
                "primitives": primitives,
                "sizes": sizes,
                "bounds": bounds,
                "keep_out": _keep_out(keep_out),
                "gain_sets": gain_sets,
                "draw_seed": draw_seed,
                "plugin_path": plugin_path,
            },
            bar.function,
        )


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
    shard: str | None = None,
    limit: int | None = None,
    fresh: bool = False,
    timeout: float | None = 600.0,
    by: Sequence[str] = ("planner",),
    plugin_path: Paths = None,
    progress: Progress = False,
) -> Sweep:
    """Executes many runs, one process per run, and sums them up, as `hamelin sweep`.

    directory: folder of the sweep. scenes: scene files, planned with the arguments up to duration;
    None: execute the plan that the folder has, of plan_sweep(). planner: names, each for all
    scenes. set: values for all runs, such as "/planner/params/gain=2". vary: values such as
    "/planner/params/gain=1,2", one run per combination. seeds: one run each. duration: longest
    simulated time [s]. jobs: number of parallel processes; None: one per core. only: execute only
    runs whose id contains this text. shard: execute only this part of the plan, such as "3/40",
    also at the same time as other parts. limit: largest number of runs to execute now. fresh: drop
    existing records. timeout: wall-clock time after which a run is killed [s]. by: labels that the
    summary groups by.
    """
    folder = os.fspath(directory)
    if scenes is not None:
        plan_sweep(
            folder,
            scenes,
            planner=planner,
            set=set,
            vary=vary,
            seeds=seeds,
            duration=duration,
            plugin_path=plugin_path,
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
                shard,
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


