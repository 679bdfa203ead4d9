"""The log of a robot's run: as in its file (`Recording`), and in the order of time (`Log`).

The readers of all formats return a recording. This module also holds what they share about lasers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.counts import many
from albot_core.evaluation.moments import clock_fault, rising_times, time_order
from albot_core.evaluation.trajectory import Trajectory, path_length
from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Poses, Ranges
from albot_core.logs.odometer_resets import OdometerReset, find_resets
from albot_core.sensing.reading import (
    LaserGeometry,
    LaserScan,
    Reading,
    Sensor,
    SonarGeometry,
    SonarScan,
)

NO_RETURN = 30.0
"""Ranges at or above this (m) count as no return: a SICK LMS sees no farther, and writes 81.83 and
above for no return."""
SICK_SPACINGS = {180: 1.0, 181: 1.0, 360: 0.5, 361: 0.5}
"""Angle between the beams of a SICK LMS over 180° (degrees), by the number of beams."""
SICK_BEAM_WIDTH = float(np.radians(0.5))
"""Width of a SICK LMS's beam (rad), measured in Intel's log: a wall that is met at 10° to 40° is
read too near by what the nearer edge of such a beam is nearer than its axis."""
_MOUNT_PLAY = 0.01
"""Largest deviation of a laser's recorded mount from its median (m, rad)."""
_MOUNT_DIGITS = 4
"""Decimals to which a mount is rounded (m, rad), because a log's poses are rounded."""
RANGE_NOISE = 0.005
"""Standard deviation (m) of the noise that `with_noise` adds to ranges; far below the laser's."""
MOTION_NOISE = np.array([0.003, 0.003, np.radians(0.1)])
"""Standard deviations (m, m, rad) of the noise that `with_noise` adds to motions."""


@dataclass(frozen=True, kw_only=True)
class Unread:
    """The lines of a damaged log that were left out.

    In a damaged archive, only the part that still unpacks is counted; in an episode that was never
    closed, nothing.
    """

    lines: int
    """Number of bad lines."""
    scans: int
    """Number of scans that begin in those lines."""
    where: str
    """Which lines these are, as `lines 12, 40 to 44`; empty if none is counted."""
    reason: str
    """The error of the first one, in one line."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Log:
    """A robot's run: its sensor data at every scan, in the order of time."""

    name: str
    """The file's name."""
    geometry: LaserGeometry | None
    """Beam geometry of the laser; None in a log without a laser."""
    stamps: Float64[np.ndarray, "scans"]
    """Time of every scan (s) as recorded; the scan's number if the log has no clock. A bad clock
    may stand still or step back: see `times`."""
    ranges: Float64[np.ndarray, "scans beams"] | None
    """Distance along every beam (m), infinity where there was no return; None without a laser."""
    odometry: Poses
    """The odometer's pose at every scan (m, rad), in the odometer's frame, as recorded: with its
    jumps."""
    sonar: SonarGeometry | None = None
    """Geometry of the sonars; None in a log without sonars."""
    echoes: Float64[np.ndarray, "scans sonars"] | None = None
    """The sonars' ranges at every scan (m); None in a log without sonars."""
    scenes: Int64[np.ndarray, "scans"] | None = None
    """The visual scene at every scan, -1 for none; None in a log without a camera."""
    compasses: Float64[np.ndarray, "scans"] | None = None
    """The heading by the compass at every scan (rad); None in a log without a compass."""
    reference: Poses | None = None
    """The robot's corrected pose at every scan, where the log holds one."""
    unread: Unread | None = None
    """What was not read; None where the log is whole."""
    notes: tuple[str, ...] = ()
    """What was taken otherwise than it stands in the file, and why, a line each."""

    @cached_property
    def times(self) -> Float64[np.ndarray, "scans"]:
        """Time of every scan (s), not decreasing: the stamps where they are a good clock's."""
        return rising_times(self.stamps)

    @cached_property
    def readings(self) -> list[Reading]:
        """One reading per scan; the motion of the first is zero.

        Where the odometer jumps (`resets`), the motion is the one found for the robot.
        """
        motions = self._motions
        for reset in self.resets:
            motions[reset.scan] = reset.motion
        return [self._reading(scan, motion) for scan, motion in enumerate(motions)]

    @property
    def recorded_readings(self) -> list[Reading]:
        """The readings as recorded: where the odometer jumps, so do they."""
        return [self._reading(scan, motion) for scan, motion in enumerate(self._motions)]

    @cached_property
    def resets(self) -> tuple[OdometerReset, ...]:
        """The jumps of the odometer, in the order of the scans."""
        return find_resets(self.stamps, self._motions, self.geometry, self.ranges)

    @property
    def _motions(self) -> Poses:
        """The odometer's motion to every scan, in the robot's frame at the scan before."""
        motions = np.zeros_like(self.odometry)
        motions[1:] = relative(self.odometry[:-1], self.odometry[1:])
        return motions

    def _reading(self, scan: int, motion: Pose) -> Reading:
        laser, sonar, scene = None, None, None
        if self.geometry is not None and self.ranges is not None:
            laser = LaserScan(ranges=self.ranges[scan], geometry=self.geometry)
        if self.sonar is not None and self.echoes is not None:
            sonar = SonarScan(ranges=self.echoes[scan], geometry=self.sonar)
        if self.scenes is not None and self.scenes[scan] >= 0:
            scene = int(self.scenes[scan])
        stamp = float(self.times[scan])
        return Reading(
            stamp=stamp,
            motion=motion,
            laser=laser,
            sonar=sonar,
            scene=scene,
            compass=None if self.compasses is None else float(self.compasses[scan]),
        )

    def with_scans(self, scans: Bool[np.ndarray, "scans"] | Int64[np.ndarray, "some"]) -> Log:
        """Return the log with only some of its scans: their numbers, in order, or a mask."""

        def thinned(rows: np.ndarray | None) -> np.ndarray | None:
            return None if rows is None else rows[scans]

        return replace(
            self,
            stamps=self.stamps[scans],
            odometry=self.odometry[scans],
            ranges=thinned(self.ranges),
            echoes=thinned(self.echoes),
            scenes=thinned(self.scenes),
            compasses=thinned(self.compasses),
            reference=thinned(self.reference),
        )

    @property
    def is_odometry_constant(self) -> bool:
        """Whether the odometer is at one pose all along: it is missing, or does not work."""
        return len(self.odometry) > 1 and bool((self.odometry == self.odometry[0]).all())

    @property
    def sensors(self) -> frozenset[Sensor]:
        """The sensors in the log besides the odometer."""
        held: dict[Sensor, object] = {
            "laser": self.ranges,
            "sonar": self.sonar,
            "scene": self.scenes,
            "compass": self.compasses,
        }
        return frozenset(sensor for sensor, recorded in held.items() if recorded is not None)

    @property
    def path_length(self) -> float:
        """Length of the path (m): by odometry without its jumps; if constant, by the reference."""
        if self.is_odometry_constant and self.reference is not None:
            return path_length(self.reference)
        jumps = (
            math.hypot(*reset.motion[:2]) - math.hypot(*reset.reported[:2]) for reset in self.resets
        )
        return path_length(self.odometry) + sum(jumps)

    @property
    def odometry_trajectory(self) -> Trajectory:
        """The trajectory by odometry."""
        return Trajectory(stamps=self.stamps, poses=self.odometry)

    @property
    def reference_trajectory(self) -> Trajectory | None:
        """The log's reference trajectory; None without one."""
        if self.reference is None:
            return None
        return Trajectory(stamps=self.stamps, poses=self.reference)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scan:
    """A scan as recorded in a log."""

    stamp: float
    """Time (s); the scan's number if the log has no clock."""
    ranges: Ranges
    """Distance along every beam (m), as recorded."""
    odometry: Pose
    """The robot's pose by its odometer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """A log as in its file, with scans in the file's order."""

    geometry: LaserGeometry
    """Beam geometry of the laser."""
    scans: list[Scan]
    """At least one scan, all of `geometry.beams` ranges."""
    reference: list[Pose] | None = None
    """The robot's corrected pose at every scan, where the log holds one."""
    unread: Unread | None = None
    """What was not read; None where the log is whole."""
    notes: tuple[str, ...] = ()
    """What the format's reader has to say of the log; see `Log.notes`."""

    def to_log(self, name: str) -> Log:
        """Return the log in the order of time.

        That is the file's, but scans whose messages arrived late are put where their stamps say
        (see `time_order`); a note tells of both, and of stamps that do not tell the time. Ranges
        at or above the laser's maximum become infinite, and so does 0, with which lasers report a
        fault.
        """
        stamps = np.array([scan.stamp for scan in self.scans])
        odometry = np.stack([scan.odometry for scan in self.scans])
        order = time_order(stamps, odometry)
        ranges = np.stack([scan.ranges for scan in self.scans])[order]
        ranges[(ranges >= self.geometry.max_range) | (ranges == 0)] = np.inf
        return Log(
            name=name,
            geometry=self.geometry,
            stamps=stamps[order],
            ranges=ranges,
            odometry=odometry[order],
            reference=None if self.reference is None else np.stack(self.reference)[order],
            unread=self.unread,
            notes=(*self.notes, *_order_notes(stamps, order)),
        )


def _order_notes(
    stamps: Float64[np.ndarray, "scans"], order: Int64[np.ndarray, "scans"]
) -> Iterator[str]:
    moved = np.flatnonzero(order != np.arange(len(order)))
    if len(moved):
        yield (
            f"{many(len(moved), 'scan')} of {len(order):,} stood out of order and were sorted by "
            f"stamp, the first of them scan {moved[0] + 1}"
        )
    fault = clock_fault(stamps[order], "scan")
    if fault is not None:
        yield f"the stamps do not tell the time ({fault}); the scans stay in the file's order"


def sick_laser(
    beams: int,
    max_range: float = NO_RETURN,
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> LaserGeometry:
    """Return the geometry of a SICK laser; `beams` is a key of `SICK_SPACINGS`."""
    spacing = float(np.deg2rad(SICK_SPACINGS[beams]))
    return LaserGeometry(
        beams=beams,
        spacing=spacing,
        beam_width=SICK_BEAM_WIDTH,
        max_range=max_range,
        mount=mount,
    )


def constant_mount(robot: Poses, laser: Poses) -> tuple[float, float, float] | None:
    """Return the laser's pose in the robot's frame, from the poses of both at every scan.

    None if it is not constant: then the poses are two different estimates.
    """
    mounts = relative(robot, laser)
    # Relative to the first, so that no heading is near the wrap of angles.
    middle = compose(mounts[0], np.median(relative(mounts[0], mounts), axis=0))
    if (np.abs(relative(middle, mounts)) > _MOUNT_PLAY).any():
        return None
    x, y, heading = np.round(middle, _MOUNT_DIGITS) + 0.0
    return float(x), float(y), float(heading)


def with_noise(log: Log, rng: np.random.Generator) -> Log:
    """Return a copy of the log with a little noise on every range and motion.

    The spread of a mapper's error over such copies shows how much its error on one log is chance.
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
