"""Robot files: info and fitted collision shapes."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Mapping

from ._files import write_document
from ._hamelin import Model, _fit_robot, _robot_info, load_robot
from ._types import Document, PathLike, Paths


def robot_info(robot: Model | PathLike) -> Document:
    """Joints, limits, masses and collision shapes of a robot, as `hamelin robot info --json`.

    robot: a Model, or a file that load_robot() reads.
    """
    if isinstance(robot, Model):
        return _robot_info(robot)
    return {"file": os.fspath(robot), **_robot_info(load_robot(robot))}


@dataclass(frozen=True)
class FitResult:
    """Collision shapes that cover the geometry of a URDF, and how well they fit.

    sidecar: the document that load_robot() takes as `spheres`. figures: per link and in total.
    """

    sidecar: Document
    figures: Document

    def save(self, file: PathLike) -> None:
        """Writes the sidecar to a file."""
        write_document(file, self.sidecar)

    def __repr__(self) -> str:
        links = self.sidecar.get("links", {})
        capsules = self.sidecar.get("capsules", {})
        shapes = sum(map(len, links.values())) + sum(map(len, capsules.values()))
        return f"<hamelin.FitResult {shapes} shapes>"


def fit_robot(
    file: PathLike,
    *,
    excess: float = 0.025,
    total: int | None = None,
    spheres_per_link: int = 64,
    capsules: bool = False,
    padding: float = 0.0,
    package: Mapping[str, PathLike] | None = None,
    meshes: Paths = None,
    visual: bool = False,
    srdf: PathLike | None = None,
    tip: str | None = None,
    tolerance: float = 1e-4,
) -> FitResult:
    """Covers the collision geometry of a URDF with spheres or capsules, as `hamelin robot fit`.

    excess: largest distance by which a shape may stick out [m]. total: largest number of shapes of
    all links; the excess is then as small as possible. padding: length added to each radius [m].
    package: folders of ROS packages by name. meshes: folders to search for meshes. visual: use
    <visual> of links without <collision>. srdf: file whose disabled pairs are listed too. tip: tip
    link, for the pairs that always touch. tolerance: accuracy of the bound on a gap [m].
    """
    sidecar, figures = _fit_robot(
        file,
        excess,
        total,
        spheres_per_link,
        capsules,
        padding,
        dict(package or {}),
        meshes,
        visual,
        srdf,
        tip,
        tolerance,
    )
    return FitResult(sidecar, figures)


