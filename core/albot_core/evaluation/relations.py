"""Errors of a trajectory against known relations between its poses (Kümmerle et al. 2009)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory, associate
from albot_core.files import read_bytes
from albot_core.geometry.poses import relative

SAME_STAMP = 1e-4
"""Relations name their moments by the stamps of the log, to the rounding of its digits (s).

A wider match takes in what the robot does between two scans: at 10 ms the Intel log's own
reference seems 1.9° off where it is 0.4°.
"""

_FIELDS = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Relations:
    """Where a robot truly was at one moment, seen from where it was at another."""

    stamps: Float64[np.ndarray, "relations 2"]
    """The two moments (s)."""
    poses: Float64[np.ndarray, "relations 3"]
    """The pose at the second moment in the robot's frame at the first."""


@dataclass(frozen=True, kw_only=True)
class RelationError:
    """How far a trajectory's relations are from the true ones."""

    count: int
    """Relations both of whose moments the trajectory holds."""
    translation_mean: float
    """Mean distance between the relative positions (m)."""
    translation_std: float
    """Standard deviation of those distances (m)."""
    rotation_mean: float
    """Mean angle between the relative headings (rad)."""
    rotation_std: float
    """Standard deviation of those angles (rad)."""


def read_relations(path: Path) -> Relations:
    """Read relations: a line each, `t1 t2 x y z roll pitch yaw` (s, m, rad).

    Empty lines and lines that begin with `#` are passed over; z, roll and pitch are not used.

    Raises:
        InputError: The file cannot be read, or a line is not eight finite numbers.
    """
    rows = []
    text = read_bytes(path).decode("utf-8", "replace")
    for number, line in enumerate(text.split("\n"), start=1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        rows.append(_numbers(words, path, number))
    if not rows:
        raise InputError(path, "at least one relation, t1 t2 x y z roll pitch yaw", "none")
    table = np.array(rows)
    return Relations(stamps=table[:, :2], poses=table[:, [2, 3, 7]])


def _numbers(words: list[str], path: Path, number: int) -> list[float]:
    expected = "eight finite numbers, t1 t2 x y z roll pitch yaw"
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise InputError(path, expected, str(error), place=f"line {number}") from None
    if len(values) != _FIELDS:
        raise InputError(path, expected, f"{len(values)} fields", place=f"line {number}")
    if not np.isfinite(values).all():
        raise InputError(path, expected, "NaN or infinity", place=f"line {number}")
    return values


def relation_error(
    trajectory: Trajectory, relations: Relations, tolerance: float = SAME_STAMP
) -> RelationError | None:
    """The error of `trajectory` against the true relations.

    Both moments of a relation are looked up by stamp, to within `tolerance` (s); relations
    that the trajectory does not hold are not counted. None where it holds none.

    Kümmerle, Steder, Dornhege, Ruhnke, Grisetti, Stachniss & Kleiner, *On measuring the
    accuracy of SLAM algorithms*, Autonomous Robots 2009, Eq. (4), its translational and
    its rotational part apart, as means of the magnitudes.
    """
    first = _lookup(trajectory, relations.stamps[:, 0], tolerance)
    second = _lookup(trajectory, relations.stamps[:, 1], tolerance)
    known = (first >= 0) & (second >= 0)
    if not known.any():
        return None
    measured = relative(trajectory.poses[first[known]], trajectory.poses[second[known]])
    errors = relative(relations.poses[known], measured)
    translations = np.hypot(errors[:, 0], errors[:, 1])
    rotations = np.abs(errors[:, 2])
    return RelationError(
        count=int(known.sum()),
        translation_mean=float(translations.mean()),
        translation_std=float(translations.std()),
        rotation_mean=float(rotations.mean()),
        rotation_std=float(rotations.std()),
    )


def _lookup(
    trajectory: Trajectory, wanted: Float64[np.ndarray, "relations"], tolerance: float
) -> np.ndarray:
    """The index in the trajectory of every wanted stamp; -1 where it holds none near."""
    indices = np.full(len(wanted), -1)
    mine, theirs = associate(trajectory.stamps, wanted, tolerance)
    indices[theirs] = mine
    return indices
