"""The log of a real robot's run: as it stands in its file (`Recording`), and as it is used (`Log`).

Readers of all formats hand over a recording. What they know of lasers stands here too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory, path_length
from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Poses, Ranges
from albot_core.sensing.reading import (
    LaserGeometry,
    LaserScan,
    Reading,
    Sensor,
    SonarGeometry,
    SonarScan,
)

NO_RETURN = 30.0
"""Ranges at and beyond this (m) are taken for none: a SICK LMS sees no farther, and writes
81.83 and above where nothing came back."""
SICK_SPACINGS = {180: 1.0, 181: 1.0, 360: 0.5, 361: 0.5}
"""Degrees between the beams of a SICK LMS that sweeps 180°, by their number."""
_MOUNT_PLAY = 0.01
"""How far (m, rad) a recorded laser may seem to stray from its place on the robot."""
_MOUNT_DIGITS = 4
"""Digits after the point (m, rad) to which the rounded poses of a log tell a mount."""
RANGE_NOISE = 0.005
"""Standard deviation (m) of what is added to every range, far below the laser's own."""
MOTION_NOISE = np.array([0.003, 0.003, np.radians(0.1)])
"""Standard deviations (m, m, rad) of what is added to every motion."""

Record = TypeVar("Record")


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """What of a damaged log was not read.

    Where an archive is torn, only what still unpacks is counted.
    """

    lines: int
    """Lines from the first bad one on."""
    scans: int
    """Scans begun in those lines."""
    reason: str
    """What is wrong, and where, in one line."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Log:
    """A robot's run: what it sensed, scan by scan, in the order of time."""

    name: str
    """The file's name."""
    geometry: LaserGeometry | None
    """Where the laser's beams point; None in a log without a laser."""
    stamps: Float64[np.ndarray, "scans"]
    """Time of every scan (s), never falling; the scan's number where the log has no clock."""
    ranges: Float64[np.ndarray, "scans beams"] | None
    """Distance along every beam (m), infinity where nothing came back; None without a laser."""
    odometry: Poses
    """The odometer's pose at every scan, in the odometer's frame."""
    sonar: SonarGeometry | None = None
    """Where the sonars sit and point; None in a log without."""
    echoes: Float64[np.ndarray, "scans sonars"] | None = None
    """The sonars' ranges at every scan (m); None in a log without."""
    scenes: Int64[np.ndarray, "scans"] | None = None
    """The visual scene at every scan, -1 where none is seen; None in a log without."""
    reference: Poses | None = None
    """The robot's corrected pose at every scan, where the log holds one."""
    left_out: LeftOut | None = None
    """What was not read; None where the log is whole."""

    @cached_property
    def readings(self) -> list[Reading]:
        """A reading for every scan; the first one's motion is none."""
        motions = np.zeros_like(self.odometry)
        motions[1:] = relative(self.odometry[:-1], self.odometry[1:])
        return [self._reading(scan, motion) for scan, motion in enumerate(motions)]

    def _reading(self, scan: int, motion: Pose) -> Reading:
        laser, sonar, scene = None, None, None
        if self.geometry is not None and self.ranges is not None:
            laser = LaserScan(ranges=self.ranges[scan], geometry=self.geometry)
        if self.sonar is not None and self.echoes is not None:
            sonar = SonarScan(ranges=self.echoes[scan], geometry=self.sonar)
        if self.scenes is not None and self.scenes[scan] >= 0:
            scene = int(self.scenes[scan])
        stamp = float(self.stamps[scan])
        return Reading(stamp=stamp, motion=motion, laser=laser, sonar=sonar, scene=scene)

    @property
    def sensors(self) -> frozenset[Sensor]:
        """Which sensors the log holds besides the odometer."""
        held: dict[Sensor, object] = {
            "laser": self.ranges,
            "sonar": self.sonar,
            "scene": self.scenes,
        }
        return frozenset(sensor for sensor, recorded in held.items() if recorded is not None)

    @property
    def path_length(self) -> float:
        """How far the odometer says that the robot went (m)."""
        return path_length(self.odometry)

    @property
    def odometry_trajectory(self) -> Trajectory:
        """Where the odometer says that the robot was."""
        return Trajectory(stamps=self.stamps, poses=self.odometry)

    @property
    def reference_trajectory(self) -> Trajectory | None:
        """Where the log's own reference says that the robot was."""
        if self.reference is None:
            return None
        return Trajectory(stamps=self.stamps, poses=self.reference)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scan:
    """A scan as it stands in a log."""

    stamp: float
    """Time (s); the scan's number where the log has no clock."""
    ranges: Ranges
    """Distance along every beam (m), as recorded."""
    odometry: Pose
    """The robot's pose by its odometer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """A log as it stands in its file, scans in the file's order."""

    geometry: LaserGeometry
    """Where the laser's beams point."""
    scans: list[Scan]
    """At least one scan, all of `geometry.beams` ranges."""
    reference: list[Pose] | None = None
    """The robot's corrected pose at every scan, where the log holds one."""
    left_out: LeftOut | None = None
    """What was not read; None where the log is whole."""

    def in_time(self, name: str) -> Log:
        """The log in the order of time.

        Scans are sorted by stamp, those of one stamp staying as they stand: robots' logs
        are merged from several programs and come late. A range of none, or at and beyond
        the laser's largest, becomes infinite, and so does 0, with which lasers tell a fault.
        """
        stamps = np.array([scan.stamp for scan in self.scans])
        order = np.argsort(stamps, kind="stable")
        ranges = np.stack([scan.ranges for scan in self.scans])[order]
        ranges[(ranges >= self.geometry.max_range) | (ranges == 0)] = np.inf
        return Log(
            name=name,
            geometry=self.geometry,
            stamps=stamps[order],
            ranges=ranges,
            odometry=np.stack([scan.odometry for scan in self.scans])[order],
            reference=None if self.reference is None else np.stack(self.reference)[order],
            left_out=self.left_out,
        )


def good_beginning(
    records: Iterator[Record], keep_going: bool
) -> tuple[list[Record], InputError | None]:
    """All records; or, if told to keep going, those before the first bad one and its error.

    Raises:
        InputError: A record is bad, and none came before it or it is not to be passed over.
    """
    good: list[Record] = []
    try:
        for record in records:
            good.append(record)  # noqa: PERF402
    except InputError as error:
        if not keep_going or not good:
            raise
        return good, error
    return good, None


def sick_laser(
    beams: int,
    max_range: float = NO_RETURN,
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> LaserGeometry:
    """The SICK laser with one of the numbers of beams in `SICK_SPACINGS`, from -90° on."""
    spacing = float(np.deg2rad(SICK_SPACINGS[beams]))
    return LaserGeometry(beams=beams, spacing=spacing, max_range=max_range, mount=mount)


def steady_mount(robot: Poses, laser: Poses) -> tuple[float, float, float] | None:
    """The laser's pose in the robot's frame, from the poses of both at every scan.

    None where it does not keep still: then the two are not one body's, but two estimates.
    """
    mounts = relative(robot, laser)
    # Seen from the first, so that no heading lies where angles wrap.
    middle = compose(mounts[0], np.median(relative(mounts[0], mounts), axis=0))
    if (np.abs(relative(middle, mounts)) > _MOUNT_PLAY).any():
        return None
    x, y, heading = np.round(middle, _MOUNT_DIGITS) + 0.0
    return float(x), float(y), float(heading)


def with_noise(log: Log, rng: np.random.Generator) -> Log:
    """A copy of the log with a little noise on every range and every motion.

    How a mapper's error varies over such copies tells how much of it on one real log is luck.
    """
    ranges = log.ranges
    if ranges is not None:
        ranges = np.abs(ranges + rng.normal(0.0, RANGE_NOISE, ranges.shape))
    motions = relative(log.odometry[:-1], log.odometry[1:])
    motions += rng.normal(size=motions.shape) * MOTION_NOISE
    odometry = [log.odometry[0]]
    for motion in motions:
        odometry.append(compose(odometry[-1], motion))
    return replace(log, ranges=ranges, odometry=np.array(odometry))
