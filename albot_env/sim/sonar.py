"""The sonars: a ring of ultrasonic rangers that hear the nearest echo in a wide cone."""

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
"""More than rounding can move a wall by (m)."""
_SPECULAR = Range("a number within (0, pi/2]", 0.0, math.pi / 2, beyond=True)


@dataclass(frozen=True, kw_only=True)
class SonarConfig:
    """The sonars' places, what echoes, and their errors.

    A sonar reports the nearest point that lies in its cone, echoes, and is not hidden. A
    wall echoes where it is hit within the specular limit of its perpendicular; a wall
    hit more aslant throws the sound away, and still hides what is behind it. Corners
    and edges are points that echo by rules of their own (`sonar_echoes`).
    """

    geometry: SonarGeometry = field(default_factory=SonarGeometry)
    """Where the sonars sit and point, their cone, and how far they reach."""
    specular_limit: float = math.pi / 2
    """Greatest angle from a wall's perpendicular at which it echoes (rad); pi/2 from anywhere."""
    corner_reach: float = 0.0
    """Distance (m) up to which concave corners of about a right angle echo; 0 not at all."""
    edge_reach: float = 0.0
    """Distance (m) up to which convex corners and the ends of walls echo; 0 not at all."""
    range_noise: float = 0.0
    """Standard deviation of a range (m)."""
    proportional_noise: float = 0.0
    """Standard deviation of a further, independent error of a range, as a share of it."""
    crosstalk: float = 0.0
    """Probability that at a reading a sonar listens while a neighbour's pulse is under way.

    Each neighbour is as likely; one that a sonar at the ring's end lacks sends none. The
    sonar then hears the neighbour's echo too, after half the way from the neighbour to the
    point that echoes to it and on to this sonar, and reports the first of both (Borenstein
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
        """What the compiled sonars compute with."""
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
        """What no cone reaches farther behind than: an x in the robot's frame (m)."""
        geometry = self.geometry
        # What is in a cone and in reach lies within a triangle, as long as the reach.
        bearings, side = np.array(geometry.bearings), math.tan(geometry.cone / 2)
        turns = np.cos(bearings) - np.abs(np.sin(bearings)) * side
        corners = np.minimum(geometry.max_range * turns, 0.0)
        return float((np.array(geometry.places)[:, 0] + corners).min()) - _HAIR


class SonarConstants(NamedTuple):
    """What the compiled sonars compute with; see `SonarConfig.constants`."""

    mounts: np.ndarray
    """(sonars, 4) float64: x, y (m), cosine and sine of the bearing, robot's frame."""
    horizon: float
    """Distance (m) from the robot's middle beyond which no sonar hears."""
    behind: float
    """Nothing with both ends at x below this (m), robot's frame, is in any sonar's cone."""
    slope: float
    """Tangent of half the cone."""
    min_range: float
    """Nearer echoes are reported as this (m)."""
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
    """Standard deviation of a range (m)."""
    proportional_noise: float
    """Standard deviation of a range as a share of it."""
    crosstalk: int
    """Probability of hearing a neighbour's pulse, times 2^25."""
    dropout: int
    """Probability of missing an echo, times 2^26."""
    normals: np.ndarray
    """(4096,) float64: normal numbers of deviation 1, each as likely as the others."""


NO_SONARS = SonarConfig().constants._replace(mounts=np.empty((0, 4)))
"""The sonars of a robot without any."""


def sonar_wall_index(sonar: SonarConfig | None) -> WallIndex:
    """An index of what such sonars can hear from where."""
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
"""The sonars by name.

`ideal`: the nearest surface in the cone, from whatever angle, exactly.

`pioneer`: on painted walls, with the one percent of range error that rangers of the
Polaroid kind are sold with. Where the specular limit lies depends on the wall; 25°, the
rates of misses and cross-talk, and the edges' reach are ours.

`poor`: smooth walls, which echo only when hit within the half of the cone, and sonars that
fire too fast and hear each other.
"""
