"""Trajectories and their errors.

`trajectory_error` is the absolute trajectory error (ATE) against a reference; `relation_error` is
that of Kümmerle et al. (2009), against known relations between poses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.errors import InputError
from albot_core.files import read_bytes
from albot_core.geometry.poses import compose, inverse, relative, transform_points
from albot_core.geometry.types import Pose, Poses

STAMP_TOLERANCE = 0.01
"""Stamps no farther apart than this (s) name the same moment."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Where a robot was, moment by moment."""

    stamps: Float64[np.ndarray, "moments"]
    """Time (s), never falling."""
    poses: Float64[np.ndarray, "moments 3"]
    """The robot's pose at each stamp, all in one frame."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.stamps).all() and np.isfinite(self.poses).all()):
            raise InputError("Trajectory", "finite numbers", "NaN or infinity")
        if (np.diff(self.stamps) < 0).any():
            raise InputError("Trajectory.stamps", "stamps in the order of time", "one that falls")


@dataclass(frozen=True, kw_only=True)
class TrajectoryError:
    """How far the positions of one trajectory are from those of another, once aligned."""

    count: int
    """Moments compared."""
    rmse: float
    """Root of the mean squared distance (m): the absolute trajectory error (ATE)."""
    mean: float
    """Mean distance (m)."""
    median: float
    """Median distance (m)."""
    largest: float
    """Largest distance (m)."""


def path_length(poses: Poses) -> float:
    """The sum of the straight steps between the poses (m)."""
    steps = np.diff(poses[..., :2], axis=0)
    return float(np.hypot(steps[..., 0], steps[..., 1]).sum())


def associate(
    stamps: Float64[np.ndarray, "moments"],
    wanted: Float64[np.ndarray, "others"],
    tolerance: float = STAMP_TOLERANCE,
) -> tuple[Int64[np.ndarray, "pairs"], Int64[np.ndarray, "pairs"]]:
    """Pair each wanted stamp with the nearest one of `stamps`, if within `tolerance` (s).

    `stamps` never fall. Returns the indices of the pairs in `stamps` and in `wanted`; of
    equally near stamps the earlier is taken, and a stamp may be taken more than once.
    """
    if not len(stamps):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    after = np.searchsorted(stamps, wanted).clip(0, len(stamps) - 1)
    before = (after - 1).clip(0)
    nearer = np.abs(wanted - stamps[before]) <= np.abs(stamps[after] - wanted)
    nearest = np.where(nearer, before, after)
    close = np.abs(stamps[nearest] - wanted) <= tolerance
    return nearest[close].astype(np.int64), np.flatnonzero(close).astype(np.int64)


Align = Callable[["Trajectory", "Trajectory", float], Pose | None]
"""What lays a trajectory on another one: as `alignment`."""


def align(
    points: Float64[np.ndarray, "points 2"], targets: Float64[np.ndarray, "points 2"]
) -> Pose:
    """The rigid motion, without scale, that lays `points` best on `targets` (least squares).

    Umeyama, *Least-squares estimation of transformation parameters between two point
    patterns*, PAMI 1991, in the plane, where the best turn has a closed form. Returns the
    frame of the points as a pose in the frame of the targets; for `transform_points`.
    """
    centre, aim = points.mean(axis=0), targets.mean(axis=0)
    (x, y), (u, v) = (points - centre).T, (targets - aim).T
    turn = math.atan2((x * v - y * u).sum(), (x * u + y * v).sum())
    moved = transform_points(np.array((0.0, 0.0, turn)), centre)
    return np.array((*(aim - moved), turn))


def alignment(
    estimate: Trajectory, reference: Trajectory, tolerance: float = STAMP_TOLERANCE
) -> Pose | None:
    """The frame of `estimate` as a pose in the frame of `reference`.

    None where fewer than two moments are common to both.
    """
    mine, theirs = associate(estimate.stamps, reference.stamps, tolerance)
    if len(mine) < 2:
        return None
    return align(estimate.poses[mine, :2], reference.poses[theirs, :2])


def alignment_at_start(
    estimate: Trajectory, reference: Trajectory, tolerance: float = STAMP_TOLERANCE
) -> Pose | None:
    """The frame of `estimate` in that of `reference`, by which their first common poses agree.

    So a robot sees its map that knows where it set out. None where no moment is common to both.
    """
    mine, theirs = associate(estimate.stamps, reference.stamps, tolerance)
    if not len(mine):
        return None
    return compose(reference.poses[theirs[0]], inverse(estimate.poses[mine[0]]))


def trajectory_error(
    estimate: Trajectory,
    reference: Trajectory,
    tolerance: float = STAMP_TOLERANCE,
    *,
    align: Align = alignment,
) -> TrajectoryError | None:
    """The error of the positions of `estimate` after rigid alignment on `reference`.

    Moments are paired by stamp, to within `tolerance` (s). None where fewer than two are
    common to both. Sturm et al., *A benchmark for the evaluation of RGB-D SLAM systems*,
    IROS 2012.

    Args:
        estimate: The trajectory.
        reference: What it is compared with.
        tolerance: Stamps no farther apart than this (s) name the same moment.
        align: What lays the one on the other: `alignment`, as best it goes, or
            `alignment_at_start`.
    """
    mine, theirs = associate(estimate.stamps, reference.stamps, tolerance)
    frame = align(estimate, reference, tolerance)
    if frame is None or len(mine) < 2:
        return None
    aligned = transform_points(frame, estimate.poses[mine, :2])
    offsets = aligned - reference.poses[theirs, :2]
    distances = np.hypot(offsets[:, 0], offsets[:, 1])
    return TrajectoryError(
        count=len(mine),
        rmse=float(np.sqrt(np.mean(distances**2))),
        mean=float(distances.mean()),
        median=float(np.median(distances)),
        largest=float(distances.max()),
    )


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
