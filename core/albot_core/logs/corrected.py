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
from pathlib import Path

import numpy as np

from albot_core.errors import InputError
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


def raw_odometry(records: Sequence[Odometer | Sweep], source: Path) -> Poses | None:
    """The odometer's pose at every scan of a corrected log, beginning at the first's pose.

    None where the log is not corrected: where most scans lack an `ODOM` line beside them
    that says what it would, or the odometer is nowhere apart from the scans' poses.

    Raises:
        InputError: Most scans are corrected ones and some is not: its lines were torn
            apart, and its raw motion with them. Its pose is the truth and no odometry.
    """
    scans = list(_with_neighbours(records))
    arrivals = [_arrival(scan, first=k == 0) for k, scan in enumerate(scans)]
    fitting = [
        (arrival, scan.sweep.robot)
        for arrival, scan in zip(arrivals, scans, strict=True)
        if arrival is not None
    ]
    apart = sum(not np.array_equal(arrival, robot) for arrival, robot in fitting)
    if not apart or 2 * len(fitting) <= len(scans):
        return None
    poses = [scans[0].sweep.robot]
    for number, arrival in enumerate(arrivals):
        if arrival is None:
            raise InputError(
                source,
                "the ODOM lines of a corrected log before and after the scan",
                "other lines",
                place=f"scan {number + 1}, stamp {scans[number].sweep.stamp:.6f}",
            )
        if number:
            before = scans[number - 1].sweep.robot
            poses.append(compose(poses[-1], relative(before, arrival)))
    return np.stack(poses)


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
