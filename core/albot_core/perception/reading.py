"""The reading: all that a mapper gets at a step, from a simulator or from a log."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose, Ranges


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
        if self.beams < 2:
            raise InputError("LaserGeometry.beams", "at least 2", str(self.beams))
        if not 0 < self.spacing <= np.pi / 2:
            raise InputError("LaserGeometry.spacing", "within (0, pi/2]", str(self.spacing))
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """What the robot senses at a step. It never holds the truth."""

    stamp: float
    """Time (s) on the robot's or the log's clock."""
    motion: Pose
    """Odometry: the robot's pose now, in its own frame at the previous reading."""
    laser: LaserScan
    """The laser's sweep at this step."""

    def __post_init__(self) -> None:
        if self.motion.shape != (3,) or not np.isfinite(self.motion).all():
            raise InputError("Reading.motion", "three finite numbers", str(self.motion))
