"""The compass: a heading by the polarisation of the sky, as Sahabot 2's.

Lambrinos and others, *A mobile robot employing insect strategies for navigation* (Robotics and
Autonomous Systems 30, 2000), as told in Hossain's thesis, section 2.3.1: the pattern of
polarisation is the same for a heading and its opposite, and an ambient-light sensor decides between
the two.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import wrap_angle
from albot_core.kernels.compiled import kernel
from albot_core.ranges import FINITE, NOT_NEGATIVE, POSITIVE, SHARE, check_fields
from albot_core.robot import CONTROL_STEP
from albot_env.sim.noise import draw_normals, draw_uniform


@dataclass(frozen=True, kw_only=True)
class CompassConfig:
    """Errors of the compass. The sources name them and give no values: these are ours."""

    meridian: float = 0.0
    """Direction from which headings are measured (rad, world frame): that of the sun."""
    noise: float = 0.0
    """Standard deviation of the error of one reading (rad)."""
    drift: float = 0.0
    """Standard deviation of a slow error (rad), such as that of the sun's way over the sky."""
    drift_time: float = 300.0
    """Time in which the slow error becomes another one (s), at a reading per control step of 0.1 s.
    In half of this time its correlation falls to 0.7, in twice this time to 0."""
    flipped: float = 0.0
    """Probability that the ambient-light sensor takes the opposite heading for the right one."""

    def __post_init__(self) -> None:
        check_fields(self, FINITE, "meridian")
        check_fields(self, NOT_NEGATIVE, "noise", "drift")
        check_fields(self, POSITIVE, "drift_time")
        check_fields(self, SHARE, "flipped")

    @property
    def constants(self) -> CompassConstants:
        """The constants of the compiled compass."""
        return CompassConstants(
            meridian=float(self.meridian),
            noise=float(self.noise),
            drift=float(self.drift),
            drift_readings=max(round(self.drift_time / CONTROL_STEP), 1),
            flipped=float(self.flipped),
            is_carried=1,
        )


COMPASSES: Mapping[str, CompassConfig] = MappingProxyType(
    {
        "ideal": CompassConfig(),
        "polarised": CompassConfig(
            noise=math.radians(1), drift=math.radians(0.5), drift_time=600.0, flipped=0.001
        ),
        "clouded": CompassConfig(
            noise=math.radians(5), drift=math.radians(3), drift_time=60.0, flipped=0.05
        ),
    }
)
"""Compasses by name.

`ideal`: no error.

`polarised`: a clear sky.

`clouded`: clouds, which hide parts of the pattern and let the light come from elsewhere.
"""


class CompassConstants(NamedTuple):
    """Constants of the compiled compass; see `CompassConfig`."""

    meridian: float
    """Direction of heading 0 (rad, world frame)."""
    noise: float
    """Standard deviation of a reading's error (rad)."""
    drift: float
    """Standard deviation of the slow error (rad)."""
    drift_readings: int
    """Number of readings from one drawn slow error to the next."""
    flipped: float
    """Probability of the opposite heading."""
    is_carried: int
    """1 if the robots have a compass, 0 if not."""


NO_COMPASS = CompassConfig().constants._replace(is_carried=0)
"""The constants of robots without a compass."""

COMPASS_DRAWS = 3
"""Number of random numbers that a reading draws; those of the slow error are apart."""
_DRIFT_DRAWS = 2
DRIFT_COUNTER = 2**40
"""Distance from the compass's first counter to the first of the slow error."""


@kernel()
def read_compass(
    heading: float, compass: CompassConstants, key: np.uint64, first: int, reading: int
) -> float:
    """Return the heading that a compass shows (rad, from the meridian, in [-pi, pi)).

    The slow error runs through normal numbers, one at each multiple of `drift_readings`: between
    two it is cos(a) times the one plus sin(a) times the other, with a from 0 to pi / 2. So it is a
    normal number with the same deviation at all times, and a function of key and reading alone.

    Args:
        heading: True heading (rad, world frame).
        compass: The compass.
        key: Key of the robot's random numbers.
        first: The compass's first counter.
        reading: Number of readings before this one.
    """
    counter = first + reading * COMPASS_DRAWS
    error, _ = draw_normals(key, counter)
    knot = first + DRIFT_COUNTER + reading // compass.drift_readings * _DRIFT_DRAWS
    before, _ = draw_normals(key, knot)
    after, _ = draw_normals(key, knot + _DRIFT_DRAWS)
    way = 0.5 * math.pi * (reading % compass.drift_readings) / compass.drift_readings
    slow = math.cos(way) * before + math.sin(way) * after
    shown = heading - compass.meridian + compass.noise * error + compass.drift * slow
    if draw_uniform(key, counter + 2) < compass.flipped:
        shown += math.pi
    return wrap_angle(shown)
