"""The raw odometry of a CARMEN log whose poses a mapping program has corrected.

GMapping's `gfs2log` writes such logs (the `*-corrected.log` of Radish). Both poses of every
scan are the corrected one; the `ODOM` line before a scan bears the scan's stamp and tells
where the odometer had come since the previous corrected pose, and the one after it repeats
the corrected pose, from which the odometer's steps then go on. So from each corrected pose
to the `ODOM` line before the next lies the odometer's raw motion.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Poses, Ranges


@dataclass(frozen=True, kw_only=True, eq=False)
class Odometer:
    """An `ODOM` line."""

    stamp: float
    pose: Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """A `FLASER` or `ROBOTLASER1` line."""

    stamp: float
    ranges: Ranges
    laser: Pose
    robot: Pose


@dataclass(frozen=True, kw_only=True)
class _Neighbours:
    """A scan and the messages beside it."""

    before: Odometer | Sweep | None
    sweep: Sweep
    after: Odometer | Sweep | None


def raw_odometry(records: Sequence[Odometer | Sweep]) -> Poses | None:
    """The odometer's pose at every scan of a corrected log, beginning at the first's pose.

    None where the log is not corrected: where an `ODOM` line lacks beside a scan, or does
    not say what it would, or the odometer is nowhere apart from the scans' poses.
    """
    scans = list(_with_neighbours(records))
    arrivals = [_arrival(scan, first=k == 0) for k, scan in enumerate(scans)]
    poses = [scans[0].sweep.robot]
    apart = False
    for scan, next_scan, arrival in zip(scans[:-1], scans[1:], arrivals[1:], strict=True):
        if arrival is None:
            return None
        apart |= not np.array_equal(arrival, next_scan.sweep.robot)
        poses.append(compose(poses[-1], relative(scan.sweep.robot, arrival)))
    return np.stack(poses) if apart and arrivals[0] is not None else None


def _arrival(scan: _Neighbours, *, first: bool) -> Pose | None:
    """Where the odometer had come at a corrected scan; None if the scan is not like one."""
    sweep, before, after = scan.sweep, scan.before, scan.after
    if not np.array_equal(sweep.laser, sweep.robot):
        return None
    if after is not None and not (
        isinstance(after, Odometer) and np.array_equal(after.pose, sweep.robot)
    ):
        return None
    if before is None and first:
        return sweep.robot
    if isinstance(before, Odometer) and before.stamp == sweep.stamp:
        return before.pose
    return None


def _with_neighbours(records: Sequence[Odometer | Sweep]) -> Iterator[_Neighbours]:
    padded = [None, *records, None]
    for before, record, after in zip(padded[:-2], records, padded[2:], strict=True):
        if isinstance(record, Sweep):
            yield _Neighbours(before=before, sweep=record, after=after)
