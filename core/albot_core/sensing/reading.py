"""The reading: all that a mapper gets at a step, from a simulator or from a log."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose, Ranges
from albot_core.ranges import FINITE, Range, check_fields

Sensor = Literal["laser", "sonar", "scene"]
"""What a reading can hold besides the odometer's motion."""

_BEAMS = Range("a whole number from 2", 2.0, whole=True)


@dataclass(frozen=True, kw_only=True)
class LaserGeometry:
    """Where the beams of a planar laser point. The default is a SICK LMS-200 at 1°."""

    beams: int = 181
    """Number of beams."""
    first_bearing: float = -np.pi / 2
    """Bearing of the first beam from the laser's axis (rad); beams run counter-clockwise."""
    spacing: float = np.pi / 180
    """Angle between neighbouring beams (rad)."""
    max_range: float = 30.0
    """Distance (m) at and beyond which a range means that nothing came back."""
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose of the laser in the robot's frame: x, y (m), heading (rad)."""

    def __post_init__(self) -> None:
        check_fields(self, _BEAMS, "beams")
        check_fields(self, FINITE, "first_bearing")
        if len(self.mount) != 3 or any(number not in FINITE for number in self.mount):
            expected = "three finite numbers x, y (m), heading (rad)"
            raise InputError("LaserGeometry.mount", expected, str(self.mount))
        if not 0 < self.spacing <= np.pi / 2:
            raise InputError("LaserGeometry.spacing", "within (0, pi/2]", str(self.spacing))
        if (self.beams - 1) * self.spacing > 2 * np.pi + 1e-9:
            found = f"{self.beams} beams {self.spacing:g} rad apart"
            raise InputError("LaserGeometry.beams", "a full turn at most", found)
        if not 0 < self.max_range < np.inf:
            raise InputError("LaserGeometry.max_range", "a positive length", str(self.max_range))

    @cached_property
    def bearings(self) -> Ranges:
        """Bearing of every beam from the laser's axis (rad)."""
        return self.first_bearing + self.spacing * np.arange(self.beams)

    @cached_property
    def directions(self) -> Float64[np.ndarray, "beams 2"]:
        """Unit vector of every beam in the robot's frame."""
        bearings = self.bearings + self.mount[2]
        return np.stack((np.cos(bearings), np.sin(bearings)), axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class LaserScan:
    """One sweep of the laser."""

    ranges: Ranges
    """Distance along every beam (m); infinity where nothing came back."""
    geometry: LaserGeometry
    """Where the beams point."""

    def __post_init__(self) -> None:
        if self.ranges.shape != (self.geometry.beams,):
            raise InputError(
                "LaserScan.ranges",
                f"{self.geometry.beams} ranges as the geometry says",
                str(self.ranges.shape),
            )
        if not (self.ranges >= 0).all():
            beam = int(np.argmin(self.ranges >= 0))
            raise InputError(
                "LaserScan.ranges", "distances or infinity", f"{self.ranges[beam]} at beam {beam}"
            )

    @property
    def points(self) -> Points:
        """The points that were hit, in the robot's frame (m), in the order of the beams."""
        hit = self.ranges < self.geometry.max_range
        reach = self.ranges[hit, None] * self.geometry.directions[hit]
        return np.asarray(np.asarray(self.geometry.mount[:2]) + reach)


_BEARINGS = tuple(np.radians((-90, -50, -30, -10, 10, 30, 50, 90)).tolist())
_ARC = ((0.069, 0.136), (0.114, 0.119), (0.148, 0.078), (0.166, 0.027))
_PLACES = (*((x, -y) for x, y in _ARC), *reversed(_ARC))


@dataclass(frozen=True, kw_only=True)
class SonarGeometry:
    """Where the sonars of a robot sit and point. The default is a Pioneer 3-DX's front array.

    Places and bearings are those of its parameter file in MobileRobots' ARIA; the cone and
    the shorter range are as in the papers, whose sonars reached about 4 m.
    """

    bearings: tuple[float, ...] = _BEARINGS
    """Bearing of every sonar from the robot's heading (rad), counter-clockwise."""
    places: tuple[tuple[float, float], ...] = _PLACES
    """Where every sonar sits in the robot's frame: x, y (m)."""
    cone: float = np.pi / 6
    """Full angle of the cone in which a sonar hears echoes (rad)."""
    min_range: float = 0.1
    """Nearer echoes are reported as this (m)."""
    max_range: float = 4.0
    """Distance (m) at and beyond which a range means that nothing came back."""

    def __post_init__(self) -> None:
        if not self.bearings or not np.isfinite(self.bearings).all():
            expected = "one finite bearing (rad) or more"
            raise InputError("SonarGeometry.bearings", expected, str(self.bearings))
        if len(self.places) != len(self.bearings) or not np.isfinite(self.places).all():
            expected = f"{len(self.bearings)} finite pairs x, y (m), as there are bearings"
            raise InputError("SonarGeometry.places", expected, str(self.places))
        if not 0 < self.cone < np.pi:
            raise InputError("SonarGeometry.cone", "within (0, pi)", str(self.cone))
        if not 0 <= self.min_range < self.max_range < np.inf:
            found = f"{self.min_range:g} and {self.max_range:g}"
            raise InputError("SonarGeometry.max_range", "lengths above min_range", found)


@dataclass(frozen=True, kw_only=True, eq=False)
class SonarScan:
    """One echo of every sonar."""

    ranges: Ranges
    """Distance to the nearest echo from every sonar (m); infinity where nothing came back."""
    geometry: SonarGeometry
    """Where the sonars point."""

    def __post_init__(self) -> None:
        count = len(self.geometry.bearings)
        if self.ranges.shape != (count,):
            expected = f"{count} ranges as the geometry says"
            raise InputError("SonarScan.ranges", expected, str(self.ranges.shape))
        if not (self.ranges >= 0).all():
            sonar = int(np.argmin(self.ranges >= 0))
            found = f"{self.ranges[sonar]} at sonar {sonar}"
            raise InputError("SonarScan.ranges", "distances or infinity", found)


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """What the robot senses at a step, by whichever sensors it has. It never holds the truth."""

    stamp: float
    """Time (s) on the robot's or the log's clock."""
    motion: Pose
    """Odometry: the robot's pose now, in its own frame at the previous reading."""
    laser: LaserScan | None = None
    """The laser's sweep at this step; None on a robot without a laser."""
    sonar: SonarScan | None = None
    """The sonars' echoes at this step; None on a robot without sonars."""
    scene: int | None = None
    """Number of the visual scene that is seen; None where none is, or without a camera."""

    def __post_init__(self) -> None:
        if self.motion.shape != (3,) or not np.isfinite(self.motion).all():
            raise InputError("Reading.motion", "three finite numbers", str(self.motion))

    def required_laser(self, by: str) -> LaserScan:
        """The laser's sweep.

        Args:
            by: Who needs it, for the error.

        Raises:
            InputError: The robot has no laser.
        """
        if self.laser is None:
            raise InputError("Reading.laser", f"a laser scan, which {by} needs", "none")
        return self.laser

    def required_sonar(self, by: str) -> SonarScan:
        """The sonars' echoes.

        Args:
            by: Who needs them, for the error.

        Raises:
            InputError: The robot has no sonars.
        """
        if self.sonar is None:
            raise InputError("Reading.sonar", f"sonar ranges, which {by} needs", "none")
        return self.sonar


@dataclass(frozen=True, kw_only=True, eq=False)
class Readings:
    """What many robots sense at a step, in arrays: readings by the row of the robot."""

    stamps: Float64[np.ndarray, "robots"]
    """Times (s), as `Reading.stamp`."""
    motions: Float64[np.ndarray, "robots 3"]
    """Odometry, as `Reading.motion`."""
    laser: LaserGeometry | None = None
    """Where the beams of all lasers point; None on robots without."""
    ranges: Float64[np.ndarray, "robots beams"] | None = None
    """The lasers' ranges (m), as `LaserScan.ranges`; None on robots without."""
    sonar: SonarGeometry | None = None
    """Where the sonars of all robots point; None on robots without."""
    echoes: Float64[np.ndarray, "robots sonars"] | None = None
    """The sonars' ranges (m), as `SonarScan.ranges`; None on robots without."""
    scenes: Int64[np.ndarray, "robots"] | None = None
    """The visual scenes, -1 where none is seen; None on robots without a camera."""

    def __getitem__(self, row: int) -> Reading:
        """A copy of what one robot senses."""
        laser, sonar, scene = None, None, None
        if self.laser is not None and self.ranges is not None:
            laser = LaserScan(ranges=self.ranges[row].copy(), geometry=self.laser)
        if self.sonar is not None and self.echoes is not None:
            sonar = SonarScan(ranges=self.echoes[row].copy(), geometry=self.sonar)
        if self.scenes is not None and self.scenes[row] >= 0:
            scene = int(self.scenes[row])
        return Reading(
            stamp=float(self.stamps[row]),
            motion=self.motions[row].copy(),
            laser=laser,
            sonar=sonar,
            scene=scene,
        )
