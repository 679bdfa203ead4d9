"""The odometer in CARMEN logs whose scans hold a SLAM system's poses.

GMapping's `gfs2log` writes such logs (the `*-corrected.log` of Radish). Both poses of a scan are
the corrected one. The `ODOM` line before a scan has the scan's stamp and the odometer's pose,
integrated from the previous corrected pose. The `ODOM` line after the scan repeats the corrected
pose, with the stamp 0, and the odometer continues from it. So its raw motion leads from each
corrected pose to the last `ODOM` line before the next scan. (With its option `-odom` the lines are
the odometer's own, and its motion leads from one to the next.)

Some of these lines are often lost. A log is taken for a corrected one if two scans or more show
the pattern: one chance would not repeat itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.counts import many
from albot_core.evaluation.moments import read_clock
from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Poses, Ranges

_FEWEST = 2
"""Fewest scans that must show the pattern of a corrected log."""
_FARTHEST = 3.0
"""A motion is continued for as much longer than it was observed at most."""
_SAME_POSE = 1e-4
"""Largest difference (m, rad) between two records of one pose, which may be rounded."""
_REPEATED_SHARE = 0.25
"""Least share of the scans with another pose than their `ODOM` line's that the next line must
repeat where stamps are too coarse to be those of one moment."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OdometerLine:
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


@dataclass(frozen=True, kw_only=True, eq=False)
class RecoveredOdometry:
    """The odometer's poses in a corrected log."""

    poses: Poses
    """The odometer's pose at every scan, from the first scan's pose on (m, rad); all the same if
    most are lost."""
    notes: tuple[str, ...]
    """What is lost, in one line; empty if nothing is."""


class _Lines:
    """The `ODOM` lines around each scan."""

    def __init__(self, records: Sequence[OdometerLine | Sweep]) -> None:
        at = [k for k, record in enumerate(records) if isinstance(record, Sweep)]
        sweeps = [record for record in records if isinstance(record, Sweep)]
        count = len(sweeps)
        self.robot = np.stack([sweep.robot for sweep in sweeps])
        self.stamps = np.array([sweep.stamp for sweep in sweeps])
        self.arrival = np.full((count, 3), np.nan)
        """The pose by the last `ODOM` line before each scan and after the previous one, but for
        that which repeats the previous scan's pose; NaN without one. Where that line is not of the
        scan's moment, the motion between the last two goes on until then."""
        self.arrives_then = np.zeros(count, np.bool_)
        """Whether it has the scan's stamp."""
        self.is_repeated = np.zeros(count, np.bool_)
        """Whether the next line repeats the scan's pose."""
        self.is_marked = np.zeros(count, np.bool_)
        """Whether it does so with the stamp 0, which is not the clock's."""
        gaps = [
            [record for record in records[begin + 1 : end] if isinstance(record, OdometerLine)]
            for begin, end in zip([-1, *at], [*at, len(records)], strict=True)
        ]
        for number, sweep in enumerate(sweeps):
            for line in gaps[number + 1][:1]:
                self.is_repeated[number] = np.array_equal(line.pose, sweep.robot)
                has_mark = line.stamp == 0 and sweep.stamp != 0
                self.is_marked[number] = self.is_repeated[number] and has_mark
            between = gaps[number]
            if number and between and self.is_repeated[number - 1]:
                between[0] = OdometerLine(stamp=self.stamps[number - 1], pose=between[0].pose)
                if len(between) == 1:
                    continue
            if between:
                self.arrives_then[number] = between[-1].stamp == sweep.stamp
                begin = self.stamps[number - 1] if number else between[0].stamp
                self.arrival[number] = _continued(between[-2:], begin, sweep.stamp)


def _continued(lines: Sequence[OdometerLine], begin: float, end: float) -> Pose:
    """Return the pose at the end of a step by the step's last line.

    If that is of before, the motion between the last two lines goes on for a little. NaN if the
    lines tell of less than half of the step.
    """
    last = lines[-1]
    gap, step = end - last.stamp, last.stamp - lines[0].stamp
    if 2 * gap > end - begin > 0:
        return np.full(3, np.nan)
    if not 0 < gap <= _FARTHEST * step:
        return last.pose
    return compose(last.pose, relative(lines[0].pose, last.pose) * (gap / step))


def recover_odometry(records: Sequence[OdometerLine | Sweep]) -> RecoveredOdometry | None:
    """Return the odometer's poses at the scans of a corrected log; None if it is not corrected.

    A motion whose `ODOM` line is lost is continued from the lines before it, if these tell of half
    of it, or else taken as the mean of the nearest motions known before and after. If most are
    lost, nothing is known of the odometer.

    Args:
        records: The log's lines in their order, with at least one scan.
    """
    sweeps = [record for record in records if isinstance(record, Sweep)]
    if not all(np.array_equal(sweep.laser, sweep.robot) for sweep in sweeps):
        return None
    lines = _Lines(records)
    if not _is_corrected(lines):
        return None
    motions = _motions(lines)
    lost = np.isnan(motions[:, 0])
    short = ~lost & ~lines.arrives_then[1:]
    count = len(sweeps)
    if 2 * lost.sum() > len(motions):
        note = (
            f"{many(int(lost.sum()), 'scan')} of {count:,} lack the ODOM line before them; the "
            "scans' poses, which are corrected ones, serve as reference only, and nothing is known "
            "of the odometer"
        )
        return RecoveredOdometry(poses=np.repeat(lines.robot[:1], count, axis=0), notes=(note,))
    poses = [lines.robot[0]]
    for motion in _bridged(motions, lost):
        poses.append(compose(poses[-1], motion))
    notes: tuple[str, ...] = ()
    if lost.any() or short.any():
        notes = (_lost_note(lines, lost, short),)
    return RecoveredOdometry(poses=np.stack(poses), notes=notes)


def _is_corrected(lines: _Lines) -> bool:
    """Whether a log's scans, all with one pose, are corrected: two poses tell of one moment."""
    with np.errstate(invalid="ignore"):
        is_apart = (np.abs(lines.arrival - lines.robot) > _SAME_POSE).any(axis=1)
    told_twice = lines.arrives_then.copy()
    told_twice[0] = False  # Before the first scan the odometer may have been set anywhere.
    apart = told_twice & is_apart
    if 2 * told_twice.sum() > len(told_twice) and apart.sum() < _FEWEST:
        return False  # The odometer is where the scans are.
    if lines.is_marked.sum() >= _FEWEST:
        return True
    if apart.sum() < _FEWEST or 2 * apart.sum() <= told_twice.sum():
        return False
    if (apart & lines.is_repeated).sum() > _REPEATED_SHARE * apart.sum():
        return True
    return not read_clock(lines.stamps).is_coarse


def _motions(lines: _Lines) -> Float64[np.ndarray, "steps 3"]:
    """Return the odometer's motion to each scan but the first; NaN where it is lost."""
    if _continues_from_scans(lines):
        return np.asarray(relative(lines.robot[:-1], lines.arrival[1:]))
    return np.asarray(relative(lines.arrival[:-1], lines.arrival[1:]))


def _continues_from_scans(lines: _Lines) -> bool:
    """Whether the odometer goes on from each corrected pose rather than from where it was.

    Then its lines repeat these poses, or at least stay nearer to them than the robot moves.
    """
    if lines.is_repeated.sum() >= _FEWEST or not lines.arrives_then.any():
        return True
    gaps = np.hypot(*(lines.arrival - lines.robot)[lines.arrives_then, :2].T)
    steps = np.hypot(*np.diff(lines.robot[:, :2], axis=0).T)
    return bool(2 * np.median(gaps) < np.median(steps))


def _bridged(
    motions: Float64[np.ndarray, "steps 3"], lost: Bool[np.ndarray, "steps"]
) -> Float64[np.ndarray, "steps 3"]:
    """Return the motions, those lost as the mean of the nearest known before and after."""
    known = np.flatnonzero(~lost)
    steps = np.arange(len(motions))
    before = known[(np.searchsorted(known, steps, side="right") - 1).clip(0)]
    after = known[np.searchsorted(known, steps).clip(0, len(known) - 1)]
    means = (motions[before] + motions[after]) / 2
    return np.where(lost[:, None], means, motions)


def _lost_note(
    lines: _Lines, lost: Bool[np.ndarray, "steps"], short: Bool[np.ndarray, "steps"]
) -> str:
    first = int(np.flatnonzero(lost | short)[0]) + 1
    which = f"first scan {first + 1}, stamp {lines.stamps[first]:.6f}"
    reasons = []
    if lost.any():
        reasons.append(
            f"{many(int(lost.sum()), 'motion')} of the odometer {_are(lost)} lost with "
            "the ODOM lines and taken as the mean of the steps before and after"
        )
    if short.any():
        reasons.append(
            f"{many(int(short.sum()), 'motion')} of the odometer {_are(short)} continued from an "
            "ODOM line before the scan's"
        )
    return f"{'; '.join(reasons)} ({which})"


def _are(which: Bool[np.ndarray, "steps"]) -> str:
    return "is" if which.sum() == 1 else "are"
