"""Trajectories and their errors.

`trajectory_error` is the absolute trajectory error (ATE) against a reference; `relative_errors` are
the relative pose errors (RPE) per metre. Both are those of evo (Grupp 2017): APE of the
translation after alignment, and RPE with a delta of 1 m. `relation_error` is the error of Kümmerle
et al. (2009) against known relations between poses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.errors import InputError
from albot_core.evaluation.moments import STAMP_TOLERANCE, look_up, pair_moments
from albot_core.files import read_text
from albot_core.geometry.poses import compose, inverse, relative, transform_points
from albot_core.geometry.types import Pose, Poses


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """The poses of a robot over time."""

    stamps: Float64[np.ndarray, "moments"]
    """Time (s), as written: it may stand still or step back (see `pair_moments`)."""
    poses: Float64[np.ndarray, "moments 3"]
    """The robot's pose at each stamp (m, rad), all in one frame."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.stamps).all() and np.isfinite(self.poses).all()):
            raise InputError("Trajectory", "finite numbers", "NaN or infinity")


@dataclass(frozen=True, kw_only=True)
class ErrorStatistics:
    """Statistics of errors, in their unit."""

    count: int
    """Number of errors."""
    rmse: float
    """Root of their mean square: of the distances after alignment, this is the ATE."""
    mean: float
    median: float
    std: float
    """Standard deviation about the mean."""
    smallest: float
    largest: float

    @classmethod
    def of(cls, errors: Float64[np.ndarray, "errors"]) -> ErrorStatistics:
        """Return the statistics of at least one error."""
        return cls(
            count=len(errors),
            rmse=float(np.sqrt(np.mean(errors**2))),
            mean=float(errors.mean()),
            median=float(np.median(errors)),
            std=float(errors.std()),
            smallest=float(errors.min()),
            largest=float(errors.max()),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionErrors:
    """Distances between the positions of two trajectories after alignment, in the written order."""

    moments: Int64[np.ndarray, "moments"]
    """Indices of the estimate's poses that were compared."""
    distances: Float64[np.ndarray, "moments"]
    """The distances (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RelativeErrors:
    """Errors of the motions between poses that lie a way apart."""

    paths: Float64[np.ndarray, "pairs"]
    """Length of the reference's path up to the end of each motion (m)."""
    translations: Float64[np.ndarray, "pairs"]
    """Distances between the relative positions (m)."""
    rotations: Float64[np.ndarray, "pairs"]
    """Angles between the relative headings (rad), at least 0."""


def path_length(poses: Poses) -> float:
    """Return the summed straight distances between consecutive poses (m)."""
    steps = np.diff(poses[..., :2], axis=0)
    return float(np.hypot(steps[..., 0], steps[..., 1]).sum())


Align = Callable[["Trajectory", "Trajectory", float], Pose | None]
"""A function that aligns two trajectories, with the signature of `alignment`."""


def align(
    points: Float64[np.ndarray, "points 2"], targets: Float64[np.ndarray, "points 2"]
) -> Pose:
    """Return the rigid motion, without scale, that aligns `points` with `targets` (least squares).

    Umeyama, *Least-squares estimation of transformation parameters between two point
    patterns*, PAMI 1991, in the plane, where the best rotation has a closed form. The result is the
    pose of the points' frame in the targets' frame, for `transform_points`.
    """
    centre, aim = points.mean(axis=0), targets.mean(axis=0)
    (x, y), (u, v) = (points - centre).T, (targets - aim).T
    turn = math.atan2((x * v - y * u).sum(), (x * u + y * v).sum())
    moved = transform_points(np.array((0.0, 0.0, turn)), centre)
    return np.array((*(aim - moved), turn))


def alignment(
    estimate: Trajectory, reference: Trajectory, tolerance: float = STAMP_TOLERANCE
) -> Pose | None:
    """Return the pose of the frame of `estimate` in the frame of `reference` (least squares).

    None if fewer than two moments are common to both.
    """
    pairs = pair_moments(estimate.stamps, reference.stamps, tolerance)
    if len(pairs.first) < 2:
        return None
    return align(estimate.poses[pairs.first, :2], reference.poses[pairs.second, :2])


def alignment_at_start(
    estimate: Trajectory, reference: Trajectory, tolerance: float = STAMP_TOLERANCE
) -> Pose | None:
    """Return the pose of the frame of `estimate` in that of `reference` at the first common moment.

    This is the alignment of a robot that knows its start. None if no moment is common to both.
    """
    pairs = pair_moments(estimate.stamps, reference.stamps, tolerance)
    if not len(pairs.first):
        return None
    first = pairs.first.argmin()
    here, there = pairs.first[first], pairs.second[first]
    return compose(reference.poses[there], inverse(estimate.poses[here]))


def trajectory_error(
    estimate: Trajectory,
    reference: Trajectory,
    tolerance: float = STAMP_TOLERANCE,
    *,
    align: Align = alignment,
) -> ErrorStatistics | None:
    """Return the error of the positions of `estimate` after rigid alignment with `reference` (m).

    None and arguments as for `position_errors`.
    """
    errors = position_errors(estimate, reference, tolerance, align=align)
    return None if errors is None else ErrorStatistics.of(errors.distances)


def position_errors(
    estimate: Trajectory,
    reference: Trajectory,
    tolerance: float = STAMP_TOLERANCE,
    *,
    align: Align = alignment,
) -> PositionErrors | None:
    """Return the distances of `estimate` from `reference` after rigid alignment (m).

    None if fewer than two moments are common to both. Source: Sturm et al., *A benchmark for the
    evaluation of RGB-D SLAM systems*, IROS 2012.

    Args:
        estimate: The trajectory.
        reference: The reference trajectory.
        tolerance: Largest difference of stamps of the same moment (s).
        align: The alignment: `alignment` (least squares) or `alignment_at_start`.
    """
    pairs = pair_moments(estimate.stamps, reference.stamps, tolerance)
    mine, theirs = pairs.first, pairs.second
    frame = align(estimate, reference, tolerance)
    if frame is None or len(mine) < 2:
        return None
    aligned = transform_points(frame, estimate.poses[mine, :2])
    offsets = aligned - reference.poses[theirs, :2]
    return PositionErrors(moments=mine, distances=np.hypot(offsets[:, 0], offsets[:, 1]))


def relative_errors(
    estimate: Trajectory,
    reference: Trajectory,
    delta: float = 1.0,
    tolerance: float = STAMP_TOLERANCE,
) -> RelativeErrors | None:
    """Return the errors of the estimated motion over each `delta` (m) of the reference's path.

    The moments are the first and those at which the reference has moved on by `delta` since the
    last one; each motion leads from one to the next. It is evo's RPE with `--delta 1 --delta_unit m
    --pairs_from_reference`, after Sturm et al. 2012. None if there is no such motion.
    """
    pairs = pair_moments(estimate.stamps, reference.stamps, tolerance)
    truth, mine = reference.poses[pairs.second], estimate.poses[pairs.first]
    steps = np.hypot(*np.diff(truth[:, :2], axis=0).T)
    ends, moved = [0], 0.0
    for index, step in enumerate(steps, start=1):
        moved += step
        if moved >= delta:
            ends.append(index)
            moved = 0.0
    if len(ends) < 2:
        return None
    first, second = np.array(ends[:-1]), np.array(ends[1:])
    wanted = relative(truth[first], truth[second])
    errors = relative(wanted, relative(mine[first], mine[second]))
    return RelativeErrors(
        paths=np.cumsum(steps)[second - 1],
        translations=np.hypot(errors[:, 0], errors[:, 1]),
        rotations=np.abs(errors[:, 2]),
    )


SAME_STAMP = 1e-4
"""Tolerance for the stamps of relations, which are those of the log up to rounding (s).

A larger tolerance includes motion between two scans: with 10 ms, the error of the Intel log's own
reference appears as 1.9° instead of 0.4°.
"""

_FIELDS = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Relations:
    """True poses of a robot relative to its pose at another moment."""

    stamps: Float64[np.ndarray, "relations 2"]
    """Stamps of the two moments (s)."""
    poses: Float64[np.ndarray, "relations 3"]
    """The pose at the second moment in the robot's frame at the first (m, rad)."""


@dataclass(frozen=True, kw_only=True)
class RelationError:
    """Errors of a trajectory's relations against the true ones."""

    count: int
    """Number of relations whose moments are both in the trajectory."""
    translation_mean: float
    """Mean distance between the relative positions (m)."""
    translation_std: float
    """Standard deviation of those distances (m)."""
    rotation_mean: float
    """Mean angle between the relative headings (rad)."""
    rotation_std: float
    """Standard deviation of those angles (rad)."""


def read_relations(path: Path) -> Relations:
    """Read relations, one per line: `t1 t2 x y z roll pitch yaw` (s, m, rad).

    Empty lines and lines that begin with `#` are skipped; z, roll and pitch are not used.

    Raises:
        InputError: The file cannot be read, or a line is not eight finite numbers, or relates a
            moment to itself.
    """
    rows = []
    text = read_text(path, errors="replace")
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
    values = []
    for word in words:
        try:
            values.append(float(word))
        except ValueError:
            raise InputError(path, expected, repr(word), place=f"line {number}") from None
    if len(values) != _FIELDS:
        raise InputError(path, expected, f"{len(values)} fields", place=f"line {number}")
    if not np.isfinite(values).all():
        raise InputError(path, expected, "NaN or infinity", place=f"line {number}")
    if values[0] == values[1]:
        raise InputError(path, "two moments", f"{words[0]} twice", place=f"line {number}")
    return values


def relation_error(
    trajectory: Trajectory, relations: Relations, tolerance: float = SAME_STAMP
) -> RelationError | None:
    """Return the error of `trajectory` against the true relations.

    Both moments of a relation are looked up by stamp, to within `tolerance` (s). Relations whose
    moments are not in the trajectory, or are several in it, do not count. None if none counts.

    Source: Kümmerle, Steder, Dornhege, Ruhnke, Grisetti, Stachniss & Kleiner, *On measuring the
    accuracy of SLAM algorithms*, Autonomous Robots 2009, Eq. (4), with separate translational and
    rotational parts, as means of the magnitudes.
    """
    first = look_up(trajectory.stamps, relations.stamps[:, 0], tolerance)
    second = look_up(trajectory.stamps, relations.stamps[:, 1], tolerance)
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
