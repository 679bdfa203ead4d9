"""The reading: a mapper's whole input at a step, from a simulator or a log."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose, Ranges
from albot_core.ranges import FINITE, NOT_NEGATIVE, POSITIVE, Range, are_numbers, check_fields

Sensor = Literal["laser", "sonar", "scene", "compass"]
"""The sensors that a reading can hold besides odometry."""

_BEAMS = Range("a whole number from 2", 2.0, whole=True)
_SPACING = Range("an angle within (0, pi/2]", 0.0, math.pi / 2, beyond=True)
_BEAM_WIDTH = Range("an angle within [0, pi/2)", 0.0, math.nextafter(math.pi / 2, 0.0))
_CONE = Range("an angle within (0, pi)", 0.0, math.nextafter(math.pi, 0.0), beyond=True)


def _check_array(name: str, value: object, count: int, what: str) -> None:
    """Raise InputError unless a value is an array of `count` numbers; `what` says which."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu":
        kind = f"one of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
        raise InputError(name, f"an array of {count} {what}", kind)
    if value.shape != (count,):
        raise InputError(name, f"{count} {what}", str(value.shape))


@dataclass(frozen=True, kw_only=True)
class LaserGeometry:
    """Beam geometry of a planar laser. The default is a SICK LMS-200 at 1°."""

    beams: int = 181
    """Number of beams."""
    first_bearing: float = -np.pi / 2
    """Bearing of the first beam from the laser's axis (rad); beams run counter-clockwise."""
    spacing: float = np.pi / 180
    """Angle between neighbouring beams (rad)."""
    beam_width: float = 0.0
    """Full angle of a beam (rad), which measures the nearest of what it meets; 0 for a ray."""
    max_range: float = 30.0
    """Maximum range (m); ranges at or above it mean no return."""
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose of the laser in the robot's frame: x, y (m), heading (rad)."""

    def __post_init__(self) -> None:
        check_fields(self, _BEAMS, "beams")
        check_fields(self, FINITE, "first_bearing")
        if not are_numbers(self.mount, 3):
            expected = "three finite numbers x, y (m), heading (rad)"
            raise InputError("LaserGeometry.mount", expected, str(self.mount))
        check_fields(self, _SPACING, "spacing")
        check_fields(self, _BEAM_WIDTH, "beam_width")
        check_fields(self, POSITIVE, "max_range")
        if (self.beams - 1) * self.spacing > 2 * np.pi + 1e-9:
            found = f"{self.beams} beams {self.spacing:g} rad apart"
            raise InputError("LaserGeometry.beams", "at most a full turn", found)

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
    """One scan of the laser."""

    ranges: Ranges
    """Distance along every beam (m); infinity where there was no return."""
    geometry: LaserGeometry
    """The beam geometry."""

    def __post_init__(self) -> None:
        _check_array("LaserScan.ranges", self.ranges, self.geometry.beams, "ranges, one per beam")
        if not (self.ranges >= 0).all():
            beam = int(np.argmin(self.ranges >= 0))
            raise InputError(
                "LaserScan.ranges", "distances or infinity", f"{self.ranges[beam]} at beam {beam}"
            )

    @property
    def points(self) -> Points:
        """The points hit by beams, in the robot's frame (m), in the order of the beams."""
        hit = self.ranges < self.geometry.max_range
        reach = self.ranges[hit, None] * self.geometry.directions[hit]
        return np.asarray(np.asarray(self.geometry.mount[:2]) + reach)


_BEARINGS = tuple(np.radians((-90, -50, -30, -10, 10, 30, 50, 90)).tolist())
_ARC = ((0.069, 0.136), (0.114, 0.119), (0.148, 0.078), (0.166, 0.027))
_PLACES = (*((x, -y) for x, y in _ARC), *reversed(_ARC))


@dataclass(frozen=True, kw_only=True)
class SonarGeometry:
    """Geometry of a robot's sonars. The default is a Pioneer 3-DX's front array.

    Positions and bearings are those of its parameter file in MobileRobots' ARIA. The cone and
    the shorter range are those of the papers, whose sonars had a range of about 4 m.
    """

    bearings: tuple[float, ...] = _BEARINGS
    """Bearing of every sonar from the robot's heading (rad), counter-clockwise."""
    places: tuple[tuple[float, float], ...] = _PLACES
    """Position of every sonar in the robot's frame: x, y (m)."""
    cone: float = np.pi / 6
    """Full opening angle of a sonar's cone (rad)."""
    min_range: float = 0.1
    """Minimum range (m); closer echoes are reported as this."""
    max_range: float = 4.0
    """Maximum range (m); ranges at or above it mean no return."""

    def __post_init__(self) -> None:
        if not self.bearings or not are_numbers(self.bearings):
            expected = "one finite bearing (rad) or more"
            raise InputError("SonarGeometry.bearings", expected, str(self.bearings))
        known = len(self.places) == len(self.bearings)
        if not known or not all(are_numbers(place, 2) for place in self.places):
            expected = f"{len(self.bearings)} finite pairs x, y (m), one per bearing"
            raise InputError("SonarGeometry.places", expected, str(self.places))
        check_fields(self, _CONE, "cone")
        check_fields(self, NOT_NEGATIVE, "min_range")
        check_fields(self, POSITIVE, "max_range")
        if self.min_range >= self.max_range:
            expected = f"more than min_range, {self.min_range:g}"
            raise InputError("SonarGeometry.max_range", expected, f"{self.max_range:g}")


@dataclass(frozen=True, kw_only=True, eq=False)
class SonarScan:
    """One range of every sonar."""

    ranges: Ranges
    """Distance from every sonar to the nearest echo (m); infinity where there was no return."""
    geometry: SonarGeometry
    """The geometry of the sonars."""

    def __post_init__(self) -> None:
        count = len(self.geometry.bearings)
        _check_array("SonarScan.ranges", self.ranges, count, "ranges, one per sonar")
        if not (self.ranges >= 0).all():
            sonar = int(np.argmin(self.ranges >= 0))
            found = f"{self.ranges[sonar]} at sonar {sonar}"
            raise InputError("SonarScan.ranges", "distances or infinity", found)


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """A robot's sensor data at a step. It never contains ground truth."""

    stamp: float
    """Time (s) on the robot's or the log's clock."""
    motion: Pose
    """Odometry: the robot's pose in its own frame at the previous reading (m, m, rad)."""
    laser: LaserScan | None = None
    """The laser scan at this step; None without a laser."""
    sonar: SonarScan | None = None
    """The sonar ranges at this step; None without sonars."""
    scene: int | None = None
    """Number of the visible scene; None for no scene or without a camera."""
    compass: float | None = None
    """Heading by the compass (rad), from a direction that stays the same; None without one."""

    def __post_init__(self) -> None:
        _check_array("Reading.motion", self.motion, 3, "numbers: x, y (m), heading (rad)")
        if not np.isfinite(self.motion).all():
            raise InputError("Reading.motion", "three finite numbers", str(self.motion))
        if self.compass is not None and not math.isfinite(self.compass):
            raise InputError("Reading.compass", "a finite heading", str(self.compass))

    def required_laser(self, by: str) -> LaserScan:
        """Return the laser scan.

        Args:
            by: Name of what needs it, for the error.

        Raises:
            InputError: The robot has no laser.
        """
        if self.laser is None:
            raise InputError("Reading.laser", f"a laser scan, which {by} needs", "none")
        return self.laser

    def required_sonar(self, by: str) -> SonarScan:
        """Return the sonar ranges.

        Args:
            by: Name of what needs them, for the error.

        Raises:
            InputError: The robot has no sonars.
        """
        if self.sonar is None:
            raise InputError("Reading.sonar", f"sonar ranges, which {by} needs", "none")
        return self.sonar

    def required_compass(self, by: str) -> float:
        """Return the heading by the compass (rad).

        Args:
            by: Name of what needs it, for the error.

        Raises:
            InputError: The robot has no compass.
        """
        if self.compass is None:
            raise InputError("Reading.compass", f"a compass, which {by} needs", "none")
        return self.compass


@dataclass(frozen=True, kw_only=True, eq=False)
class Readings:
    """The readings of several robots at a step, as arrays with one row per robot."""

    stamps: Float64[np.ndarray, "robots"]
    """Times (s); see `Reading.stamp`."""
    motions: Float64[np.ndarray, "robots 3"]
    """Odometry; see `Reading.motion`."""
    laser: LaserGeometry | None = None
    """Beam geometry of all lasers; None without lasers."""
    ranges: Float64[np.ndarray, "robots beams"] | None = None
    """Laser ranges (m); see `LaserScan.ranges`. None without lasers."""
    sonar: SonarGeometry | None = None
    """Geometry of all robots' sonars; None without sonars."""
    echoes: Float64[np.ndarray, "robots sonars"] | None = None
    """Sonar ranges (m); see `SonarScan.ranges`. None without sonars."""
    scenes: Int64[np.ndarray, "robots"] | None = None
    """Numbers of the visible scenes, -1 for none; None without cameras."""
    compasses: Float64[np.ndarray, "robots"] | None = None
    """Headings by the compasses (rad); see `Reading.compass`. None without compasses."""

    def __getitem__(self, row: int) -> Reading:
        """Return a copy of one robot's reading."""
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
            compass=None if self.compasses is None else float(self.compasses[row]),
        )
