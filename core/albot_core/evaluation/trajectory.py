"""Trajectories, and how far one is from another (absolute trajectory error)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.poses import transform_points
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


def trajectory_error(
    estimate: Trajectory, reference: Trajectory, tolerance: float = STAMP_TOLERANCE
) -> TrajectoryError | None:
    """The error of the positions of `estimate` after rigid alignment on `reference`.

    Moments are paired by stamp, to within `tolerance` (s). None where fewer than two are
    common to both. Sturm et al., *A benchmark for the evaluation of RGB-D SLAM systems*,
    IROS 2012.
    """
    frame = alignment(estimate, reference, tolerance)
    if frame is None:
        return None
    mine, theirs = associate(estimate.stamps, reference.stamps, tolerance)
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
