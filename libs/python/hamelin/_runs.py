"""Runs in closed loop, free motions, and their repetition."""

from __future__ import annotations

import html
import os
import sys
from typing import Any, Sequence, Union

from ._hamelin import Scene, _full_config, _integrate, _load_scene, _run, _verify
from ._logs import Log, read_log
from ._progress import Bar
from ._types import Document, DocumentMapping, Numbers, PathLike, Paths, Planner, Progress

SceneLike = Union[Scene, Document, PathLike]


class Result(DocumentMapping):
    """The result of a run: a mapping of the document hamelin.result/1, also as attributes.

    log: the file of the run's log, or None.
    """

    def __init__(self, document: Document, log: PathLike | None = None) -> None:
        super().__init__(document)
        self.log = None if log is None else os.fspath(log)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._document[name]
        except KeyError:
            raise AttributeError(f"the result has no field {name!r}") from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._document]

    @property
    def ok(self) -> bool:
        """Whether the goal was reached, the target followed, or free motion completed."""
        return self._document["outcome"] in ("reached", "followed", "completed")

    def read_log(self) -> Log:
        """The log of the run."""
        if self.log is None:
            raise ValueError("the run has no log, expected run(..., log=FILE)")
        return read_log(self.log)

    def _rows(self) -> list[tuple[str, str]]:
        d = self._document
        rows = [("outcome", str(d["outcome"]))]
        if d.get("cause"):
            rows.append(("cause", str(d["cause"])))
        rows.append(("time", f"{d['time_s']:.6g} s, {d['steps']} steps with {d['integrator']}"))
        if d.get("planner"):
            rows.append(("planner", str(d["planner"])))
        goal = d.get("goal")
        if goal:
            rows.append(("goal", f"{goal['index']} of {goal['count']} reached"))
        if d.get("min_clearance_m") is not None:
            rows.append(("clearance", f"{d['min_clearance_m']:.4g} m at least"))
        if d.get("certified_share") is not None:
            rows.append(("proved clear", f"{100 * d['certified_share']:.2f} % of the steps"))
        if self.log:
            rows.append(("log", self.log))
        return rows

    def __repr__(self) -> str:
        return f"<hamelin.Result {', '.join(f'{key}: {text}' for key, text in self._rows())}>"

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        rows = "".join(
            f"<tr><th>{html.escape(key)}</th><td>{html.escape(text)}</td></tr>"
            for key, text in self._rows()
        )
        return f"<table>{rows}</table>"


class Verification(DocumentMapping):
    """The comparison of a repeated run with its log.

    equal, to_the_bit, tolerance, finished, lines, ticks, largest, first_difference, other_build.
    """

    def __bool__(self) -> bool:
        return bool(self._document["equal"])

    def __repr__(self) -> str:
        d = self._document
        verdict = "equal to the bit" if d["to_the_bit"] else "equal" if d["equal"] else "different"
        return f"<hamelin.Verification {verdict}, {d['ticks']} ticks>"


def _record(log: PathLike | None, result: PathLike | None, every: int, bar: Bar) -> Document:
    return {
        "log": log,
        "result": result,
        "every": every,
        "argv": list(sys.argv),
        "progress": bar.function,
    }


def overrides_of(
    planner: str | None = None,
    guide: str | None = None,
    integrator: str | None = None,
    plant: str | None = None,
    step: float | None = None,
    duration: float | None = None,
    seed: int | None = None,
    set: str | Sequence[str] | None = None,  # noqa: A002 (the program's name)
) -> Document:
    """Values that replace those of a scene, as the extension module takes them."""
    return {
        "planner": planner,
        "guide": guide,
        "integrator": integrator,
        "plant": plant,
        "step": step,
        "duration": duration,
        "seed": seed,
        "set": [set] if isinstance(set, str) else None if set is None else list(set),
    }


def load_scene(
    file: PathLike,
    *,
    planner: str | None = None,
    guide: str | None = None,
    integrator: str | None = None,
    plant: str | None = None,
    step: float | None = None,
    duration: float | None = None,
    seed: int | None = None,
    set: str | Sequence[str] | None = None,  # noqa: A002
) -> Scene:
    """Reads a scene file; the other arguments replace its values, as options of `hamelin run`.

    step, duration: [s]. set: values such as "/planner/params/gain=2".
    """
    return _load_scene(
        file, overrides_of(planner, guide, integrator, plant, step, duration, seed, set)
    )


def as_scene(scene: SceneLike, overrides: Document) -> Scene:
    """The scene of an argument, with values replaced."""
    if isinstance(scene, Scene):
        changed = any(value is not None for value in overrides.values())
        return scene._with(overrides) if changed else scene
    if isinstance(scene, dict):
        return Scene(scene)._with(overrides)
    return _load_scene(scene, overrides)


def run(
    scene: SceneLike,
    *,
    planner: str | Planner | None = None,
    guide: str | None = None,
    integrator: str | None = None,
    plant: str | None = None,
    step: float | None = None,
    duration: float | None = None,
    seed: int | None = None,
    set: str | Sequence[str] | None = None,  # noqa: A002
    plugin_path: Paths = None,
    target: PathLike | None = None,
    trajectory: PathLike | None = None,
    every: int = 1,
    log: PathLike | None = None,
    result: PathLike | None = None,
    progress: Progress = False,
) -> Result:
    """Moves the arm of a scene to its goals with a planner, in closed loop, as `hamelin run`.

    scene: a file, a Scene, or a document as a dict. planner: a name, "python:FILE:CLASS", or an
    object with tick(tick, command); None: the scene's. step, duration: [s]. set: values such as
    "/planner/params/gain=2". plugin_path: folders to search first for planners. target: file with
    targets that the last goal follows. trajectory: file with a motion in place of the goals. every:
    steps between ticks in the log. log, result: files to write. progress: True shows a line on
    stderr; or a function of (time_s, duration_s). Ctrl-C ends the run: its log ends properly, and
    KeyboardInterrupt is raised.
    """
    name = planner if isinstance(planner, str) else None
    made = as_scene(scene, overrides_of(name, guide, integrator, plant, step, duration, seed, set))
    with Bar(progress, "running") as bar:
        document = _run(
            made,
            plugin_path,
            None if isinstance(planner, str) else planner,
            trajectory,
            target,
            _record(log, result, every, bar),
        )
    return Result(document, log)


def full_config(scene: SceneLike, *, plugin_path: Paths = None) -> Document:
    """The scene with all defaults, also of planner and integrator: `hamelin run --print-config`."""
    return _full_config(as_scene(scene, {}), plugin_path)


def integrate(
    source: Scene | PathLike,
    *,
    tip: str | None = None,
    q0: Numbers | None = None,
    v0: Numbers | None = None,
    integrator: str | None = None,
    alpha: float | None = None,
    start: str | None = None,
    solver: str | None = None,
    tolerance: float | None = None,
    order: int | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    step: float | None = None,
    duration: float | None = None,
    every: int = 1,
    log: PathLike | None = None,
    result: PathLike | None = None,
    progress: Progress = False,
) -> Result:
    """Integrates the free motion of a robot, as `hamelin integrate`.

    source: a scene or robot file, or a Scene. A robot file falls under gravity. q0, v0: shape (n,).
    step, duration: [s]. The others are options of the integrator; rtol and atol switch on step
    control. Integrator.simulate() does the same for a Model, without files.
    """
    options: Document = {
        key: value
        for key, value in {
            "alpha": alpha,
            "start": start,
            "solver": solver,
            "tolerance": tolerance,
            "feedback_tolerance": tolerance,
            "order": order,
            "rtol": rtol,
            "atol": atol,
        }.items()
        if value is not None
    }
    with Bar(progress, "integrating") as bar:
        document = _integrate(
            source,
            tip,
            q0,
            v0,
            integrator,
            options,
            step,
            duration,
            _record(log, result, every, bar),
        )
    return Result(document, log)


def verify(
    log: PathLike,
    *,
    planner: Planner | None = None,
    tolerance: float | None = None,
    plugin_path: Paths = None,
    progress: Progress = False,
) -> Verification:
    """Repeats the run of a log and compares line by line, as `hamelin replay --verify`.

    planner: an object, for a log of a run with one. tolerance: |a - b| <= tolerance max(1, |a|);
    None: equal bits, or 1e-6 if build or machine differ.
    """
    with Bar(progress, "replaying") as bar:
        return Verification(_verify(log, tolerance, plugin_path, planner, bar.function))
