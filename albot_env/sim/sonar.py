"""The sonars: a ring of ultrasonic rangers that report the nearest echo in a wide cone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from albot_core.ranges import NOT_NEGATIVE, SHARE, Range, check_fields
from albot_core.sensing.reading import SonarGeometry
from albot_env.sim.noise import normal_table
from albot_env.sim.wall_index import WallIndex

_HAIR = 1e-6
"""Tolerance (m) that exceeds any rounding error of a wall's position."""
_SPECULAR = Range("a number within (0, pi/2]", 0.0, math.pi / 2, beyond=True)


@dataclass(frozen=True, kw_only=True)
class SonarConfig:
    """Positions, echo model and errors of the sonars.

    A sonar reports the nearest point that lies in its cone, echoes, and is not hidden. A wall
    echoes where it is hit within the specular limit of its perpendicular. A wall hit at a larger
    angle reflects the sound away, and still hides what is behind it. Corners and edges are
    points that echo by their own rules (`sonar_echoes`).
    """

    geometry: SonarGeometry = field(default_factory=SonarGeometry)
    """Positions and directions of the sonars, their cone and their range limits."""
    specular_limit: float = math.pi / 2
    """Maximum angle from a wall's perpendicular at which it echoes (rad); pi/2 for any angle."""
    corner_reach: float = 0.0
    """Distance (m) up to which concave, nearly right-angled corners echo; 0 for no echo."""
    edge_reach: float = 0.0
    """Distance (m) up to which convex corners and the ends of walls echo; 0 for no echo."""
    range_noise: float = 0.0
    """Standard deviation of the constant part of the range error (m)."""
    proportional_noise: float = 0.0
    """Standard deviation of a second, independent range error, as a share of the range."""
    crosstalk: float = 0.0
    """Probability, per reading, that a sonar listens while a neighbour's pulse is under way.

    Both neighbours are equally likely; a missing neighbour at the ring's end sends no pulse.
    The sonar then also hears the neighbour's echo, at half the path from the neighbour to its
    echoing point and on to this sonar, and reports the nearer of the two (Borenstein
    and Koren, Error eliminating rapid ultrasonic firing for mobile robot obstacle
    avoidance, IEEE Trans. Robotics and Automation 11(1), 1995, on the direct path).
    """
    dropout: float = 0.0
    """Probability that an echo is missed."""

    def __post_init__(self) -> None:
        check_fields(self, _SPECULAR, "specular_limit")
        check_fields(
            self, NOT_NEGATIVE, "corner_reach", "edge_reach", "range_noise", "proportional_noise"
        )
        check_fields(self, SHARE, "crosstalk", "dropout")

    @property
    def constants(self) -> SonarConstants:
        """The constants of the compiled sonars."""
        geometry = self.geometry
        bearings = np.array(geometry.bearings)
        directions = np.stack((np.cos(bearings), np.sin(bearings)), axis=1)
        places = np.array(geometry.places, np.float64)
        return SonarConstants(
            mounts=np.hstack((places, directions)),
            horizon=float(geometry.max_range + np.hypot(*places.T).max()),
            behind=self._behind(),
            slope=math.tan(geometry.cone / 2),
            min_range=float(geometry.min_range),
            max_range=float(geometry.max_range),
            cos_limit=math.cos(self.specular_limit),
            sin_limit=math.sin(self.specular_limit),
            corner_reach=float(self.corner_reach),
            edge_reach=float(self.edge_reach),
            noise=float(self.range_noise),
            proportional_noise=float(self.proportional_noise),
            crosstalk=round(self.crosstalk * 2**25),
            dropout=round(self.dropout * 2**26),
            normals=normal_table(1.0),
        )

    def _behind(self) -> float:
        """Return the lowest x in the robot's frame that any cone reaches (m)."""
        geometry = self.geometry
        # The part of a cone in range lies within a triangle whose height is the maximum range.
        bearings, side = np.array(geometry.bearings), math.tan(geometry.cone / 2)
        turns = np.cos(bearings) - np.abs(np.sin(bearings)) * side
        corners = np.minimum(geometry.max_range * turns, 0.0)
        return float((np.array(geometry.places)[:, 0] + corners).min()) - _HAIR


class SonarConstants(NamedTuple):
    """Constants of the compiled sonars; see `SonarConfig.constants`."""

    mounts: np.ndarray
    """(sonars, 4) float64: x, y (m), cosine and sine of the bearing, in the robot's frame."""
    horizon: float
    """Distance (m) from the robot's centre beyond which no sonar hears anything."""
    behind: float
    """A surface whose ends both have an x below this (m, robot's frame) is in no sonar's cone."""
    slope: float
    """Tangent of half the cone."""
    min_range: float
    """Nearer echoes are reported at this range (m)."""
    max_range: float
    """Farther echoes are not heard (m)."""
    cos_limit: float
    """Cosine and sine of the specular limit."""
    sin_limit: float
    corner_reach: float
    """Distance (m) up to which concave corners echo."""
    edge_reach: float
    """Distance (m) up to which edges and wall ends echo."""
    noise: float
    """Standard deviation of the constant part of the range error (m)."""
    proportional_noise: float
    """Standard deviation of the proportional range error, as a share of the range."""
    crosstalk: int
    """Probability of hearing a neighbour's pulse, times 2^25."""
    dropout: int
    """Probability of missing an echo, times 2^26."""
    normals: np.ndarray
    """(NORMALS,) float64: equally likely standard normal numbers."""


NO_SONARS = SonarConfig().constants._replace(mounts=np.empty((0, 4)))
"""The constants for a robot without sonars."""


def sonar_wall_index(sonar: SonarConfig | None) -> WallIndex:
    """Return an index of the walls that such sonars can hear."""
    if sonar is None:
        return WallIndex(0.0, (0.0, 0.0))
    spread = max(math.hypot(x, y) for x, y in sonar.geometry.places)
    return WallIndex(sonar.constants.horizon, (0.0, 0.0), spread=spread)


SONARS: Mapping[str, SonarConfig] = MappingProxyType(
    {
        "ideal": SonarConfig(),
        "pioneer": SonarConfig(
            specular_limit=math.radians(25),
            corner_reach=4.0,
            edge_reach=1.0,
            range_noise=0.005,
            proportional_noise=0.01,
            crosstalk=0.005,
            dropout=0.01,
        ),
        "poor": SonarConfig(
            specular_limit=math.radians(15),
            corner_reach=2.0,
            edge_reach=0.5,
            range_noise=0.02,
            proportional_noise=0.02,
            crosstalk=0.05,
            dropout=0.05,
        ),
    }
)
"""Sonars by name.

`ideal`: the exact distance of the nearest surface in the cone, hit at any angle.

`pioneer`: painted walls, with the range error of 1 % that is specified for rangers of the
Polaroid kind. The specular limit depends on the wall; its 25°, the rates of misses and
cross-talk, and the edges' reach are our choice.

`poor`: smooth walls, which echo only within 15° of their perpendicular, and sonars that fire
too fast and hear each other.
"""
