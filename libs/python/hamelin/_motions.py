"""Paths and motions to the goals of a scene, and explanations of contacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Sequence

import numpy as np

from ._files import write_document
from ._hamelin import Scene, _explain, _optimize, _plan, _postures, _task
from ._progress import Bar
from ._runs import SceneLike, as_scene, overrides_of
from ._types import Array, Document, DocumentMapping, PathLike, Progress


@dataclass(frozen=True)
class PathMotion:
    """A motion from rest to rest along a path, all of which is proved clear.

    duration_s [s]; clearance_m: what the arm keeps from obstacles and itself, at least [m];
    time_s: times of points, shape (N,) [s]; q, v, a: positions, velocities and accelerations
    there, shape (N, n) [rad or m, and per s and s^2].
    """

    duration_s: float
    clearance_m: float
    time_s: Array
    q: Array
    v: Array
    a: Array


class PathPlan(DocumentMapping):
    """Joint paths to the goals of a scene: a mapping of the document hamelin.path/1."""

    @property
    def motions(self) -> list[PathMotion | None]:
        """The motion to each goal; None where there is none, or none was asked for."""
        return [
            PathMotion(
                goal["motion"]["duration_s"],
                goal["motion"]["clearance_m"],
                *(
                    np.array(goal["motion"][key], dtype=np.float64)
                    for key in ("time_s", "q", "v", "a")
                ),
            )
            if goal["motion"]
            else None
            for goal in self._document["paths"]
        ]

    @property
    def found(self) -> bool:
        """Whether there is a path to each goal that was searched for; the search ends otherwise."""
        return all(goal["found"] for goal in self._document["paths"])

    @property
    def paths(self) -> list[Array]:
        """The way-points to each goal, shape (N, n) [rad or m]; N is 0 for a path not found."""
        joints = len(self._document["joints"])
        return [
            np.array(goal["q"], dtype=np.float64).reshape(-1, joints)
            for goal in self._document["paths"]
        ]

    def save(self, file: PathLike) -> None:
        """Writes the document."""
        write_document(file, self._document)

    def __bool__(self) -> bool:
        return self.found

    def __repr__(self) -> str:
        texts = [
            f"path of length {goal['length']:.4g}" if goal["found"] else f"none: {goal['cause']}"
            for goal in self._document["paths"]
        ]
        return f"<hamelin.PathPlan by {self._document['guide']}: {'; '.join(texts)}>"


class Motion(DocumentMapping):
    """An optimised motion to the goals of a scene: a mapping of hamelin.trajectory/1.

    valid: whether it reaches all goals, keeps all limits and is proved clear.
    """

    def __init__(self, document: Document, valid: bool) -> None:
        super().__init__(document)
        self.valid = valid

    def _column(self, key: str) -> Array:
        return np.array([point[key] for point in self._document["points"]], dtype=np.float64)

    @property
    def time_s(self) -> Array:
        """Times of the points, shape (N,) [s]."""
        return self._column("time_s")

    @property
    def q(self) -> Array:
        """Positions, shape (N, n) [rad or m]."""
        return self._column("q")

    @property
    def v(self) -> Array:
        """Velocities, shape (N, n) [rad/s or m/s]."""
        return self._column("v")

    @property
    def a(self) -> Array:
        """Accelerations, shape (N, n) [rad/s^2 or m/s^2]."""
        return self._column("a")

    @property
    def tau(self) -> Array:
        """Torques of inverse dynamics, shape (N, n) [Nm or N]."""
        return self._column("tau")

    @property
    def duration_s(self) -> float:
        """Time to the last goal [s]."""
        return float(sum(goal["duration_s"] for goal in self._document["goals"]))

    def save(self, file: PathLike) -> None:
        """Writes the document; run(scene, trajectory=file) follows it."""
        write_document(file, self._document)

    def to_pandas(self) -> Any:
        """A table with one row per point, indexed by time_s: columns q[0], ..., tau[n - 1]."""
        import pandas

        columns = {
            f"{key}[{j}]": values[:, j]
            for key, values in (("q", self.q), ("v", self.v), ("a", self.a), ("tau", self.tau))
            for j in range(values.shape[1])
        }
        return pandas.DataFrame(columns, index=pandas.Index(self.time_s, name="time_s"))

    def __bool__(self) -> bool:
        return self.valid

    def __repr__(self) -> str:
        d = self._document
        state = "valid" if self.valid else "not valid"
        return f"<hamelin.Motion of least {d['minimize']}, {self.duration_s:.6g} s, {state}>"


class Explanation(DocumentMapping):
    """Whether a contact could have been avoided: a mapping of hamelin.explanation/1.

    nothing: why there is nothing to explain, or "".
    """

    def __init__(self, document: Document, nothing: str) -> None:
        super().__init__(document)
        self.nothing = nothing

    def __bool__(self) -> bool:
        return not self.nothing

    def __repr__(self) -> str:
        text = f"nothing to explain: {self.nothing}" if self.nothing else self["verdict"]
        return f"<hamelin.Explanation {text}>"


def plan(
    scene: SceneLike,
    *,
    guide: str | None = None,
    checks: int | None = None,
    seed: int | None = None,
    set: str | Sequence[str] | None = None,  # noqa: A002 (the program's name)
    motions: bool = True,
) -> PathPlan:
    """Searches a path to each goal of a scene and the fastest motion along it, both proved clear,
    as `hamelin plan`.

    scene: a file, a Scene, or a document as a dict. guide: as in a scene; None:
    the scene's. checks: after which a search ends without a path. set: values such as
    "/planner/guide_options/margin_m=0.02". motions: whether motions are made.
    """
    values = [set] if isinstance(set, str) else list(set or ())
    if checks is not None:
        values.append(f"/planner/guide_options/checks_max={checks}")
    made = as_scene(scene, overrides_of(guide=guide, seed=seed, set=values))
    return PathPlan(_plan(made, motions))


def postures(
    scene: SceneLike,
    goal: int = 0,
    *,
    count: int = 10,
    apart: float = 0.1,
    attempts: int = 1000,
    set: str | Sequence[str] | None = None,  # noqa: A002 (the program's name)
) -> dict[str, Any]:
    """Configurations at a goal of a scene that touch nothing: many solutions of inverse
    kinematics, without repeats.

    goal: its index. count: how many, at most. apart: by how much they differ in some joint, at
    least. attempts: from so many starts, at most about. Returns q, shape (N, n), their clearances
    [m] and options, and how many starts were tried, reached the goal and were clear.
    """
    values = [set] if isinstance(set, str) else list(set or ())
    made = as_scene(scene, overrides_of(set=values))
    found: dict[str, Any] = _postures(made, goal, count, apart, attempts)
    return found


def task(
    task: PathLike | Document,
    *,
    planner: str | None = None,
    plant: str | None = None,
    duration: float | None = None,
    seed: int | None = None,
    set: str | Sequence[str] | None = None,  # noqa: A002 (the program's name)
) -> Scene:
    """Chooses grasps and ways for the steps of a task, as `hamelin task`: a scene for run().

    task: a file, or a document of hamelin.task/1 as a dict. The other arguments replace values of
    its scene. Raises Error if a step cannot be done.
    """
    values = overrides_of(planner=planner, plant=plant, duration=duration, seed=seed, set=set)
    return _task(task, values)


def optimize(
    scene: SceneLike,
    *,
    guide: str | None = None,
    minimize: str = "effort",
    duration: float | None = None,
    intervals: int = 50,
    margin: float = 0.005,
    limit_share: float | None = None,
    acceleration: float | None = None,
    jerk: float | None = None,
    set: str | Sequence[str] | None = None,  # noqa: A002
    rate: float | None = None,
) -> Motion:
    """Finds the motion of least effort or least time to the goals of a scene, and proves it clear,
    as `hamelin optimize`.

    scene: a file, a Scene, or a document as a dict. guide: finds the path of the first guess.
    minimize: "effort" or "time". duration: time to each goal [s]; None: at half of the velocity
    limits. intervals: between knots, to each goal. margin: least clearance [m]. limit_share: share
    of the limits of velocity and torque that the motion may use; None: all of the velocities, 0.9
    of the torques. acceleration, jerk: limits of all joints [rad/s^2 or m/s^2, and per s].
    rate: points per second [1/s]; None: the knots.
    """
    made = as_scene(scene, overrides_of(guide=guide, set=set))
    document, valid = _optimize(
        made,
        {
            "minimize": minimize,
            "duration": duration,
            "intervals": intervals,
            "margin": margin,
            "limit_share": limit_share,
            "acceleration": acceleration,
            "jerk": jerk,
            "rate": rate,
        },
    )
    return Motion(document, valid)


def explain(
    log: PathLike, *, motions: int = 2000, seed: int = 1, progress: Progress = False
) -> Explanation:
    """Searches whether the arm could have avoided the moving obstacle that it touched at the end of
    a run, as `hamelin explain`.

    motions: tried from each state before the contact. seed: of the random motions.
    """
    with Bar(progress, "searching") as bar:
        return Explanation(*_explain(log, motions, seed, bar.function))
