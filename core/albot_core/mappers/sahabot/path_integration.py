"""Path integration: where the nest is, by headings and distances (thesis, figure 2.11b).

`CompassHeading` tells the heading by compass, `exact_step` adds a step to a position, and
`approximate_step` is the ant's own integration after Müller and Wehner (*Path integration in desert
ants*, PNAS 85, 1988).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from albot_core.geometry.pose_kernels import wrap_angle
from albot_core.geometry.types import Pose
from albot_core.mappers.schema import Field, Pack, Schema
from albot_core.mappers.stored import Stored

LARGEST_TURN = 90.0
"""The ant's sine, `ant_sine`, is scaled to this largest value (degrees)."""
_SINE_SCALE = LARGEST_TURN / (2.0 / 3.0**1.5 * 180.0**3)
"""k of the paper, 4.009e-5 per square degree: x (180² - x²) is largest at x = 180 / √3."""


class CompassHeading(Stored):
    """The heading since the start, by a compass with the wheels as its check.

    The compass's pattern is the same for a heading and its opposite. Sahabot's ambient light tells
    the two apart, and is at times wrong; here the one that agrees with the wheels' turn since the
    last reading counts. This, and what is done if the compass stands still, is ours.

    Args:
        stuck: See `SahabotConfig.stuck`.
        uses_compass: Whether there is a compass; without one the wheels tell the heading.
    """

    SCHEMA = Schema(
        Pack("heading", float, *(Field(name) for name in ("now", "shown", "offset", "since"))),
    )

    def __init__(self, stuck: float, *, uses_compass: bool) -> None:
        self._stuck, self._uses_compass = stuck, uses_compass
        self.begin(0.0)

    def begin(self, shown: float) -> None:
        """Begin with heading 0, where the compass shows `shown` (rad)."""
        self._now = self._since = 0.0
        self._shown = self._offset = shown

    @property
    def heading(self) -> float:
        """Heading since the start (rad), in [-pi, pi)."""
        return self._now

    @property
    def is_stuck(self) -> bool:
        """Whether the compass shows the very same number although the wheels have turned far."""
        return self._uses_compass and abs(self._since) > self._stuck

    def update(self, turn: float, shown: float) -> None:
        """Update with the wheels' turn since the last reading and what the compass shows (rad)."""
        expected = wrap_angle(self._now + turn)
        if not self._uses_compass:
            self._now = expected
            return
        self._since = self._since + turn if shown == self._shown else 0.0
        self._shown = shown
        heading = shown - self._offset
        if math.cos(heading + self._since - expected) < 0.0:  # The opposite heading.
            heading += math.pi
        self._now = wrap_angle(heading + self._since if self.is_stuck else heading)


def exact_step(position: tuple[float, float], heading: float, motion: Pose) -> tuple[float, float]:
    """Return the position after a step.

    Args:
        position: Position before it, from the nest (m).
        heading: Heading before it (rad): "directional information from the previous step".
        motion: The step by the wheels (m, m, rad), in the robot's frame before it.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    ahead, aside = float(motion[0]), float(motion[1])
    return position[0] + cos * ahead - sin * aside, position[1] + sin * ahead + cos * aside


class HomeVector(NamedTuple):
    """The ant's state: the mean direction φ of its steps, and its distance l from the nest."""

    direction: float
    """φ (rad): the direction from the nest to the ant."""
    length: float
    """l (m)."""

    @property
    def position(self) -> tuple[float, float]:
        """The position from the nest (m)."""
        return self.length * math.cos(self.direction), self.length * math.sin(self.direction)

    @classmethod
    def to(cls, position: tuple[float, float]) -> HomeVector:
        """Return the vector to a position (m)."""
        return cls(math.atan2(position[1], position[0]), math.hypot(*position))


def ant_sine(angle: float) -> float:
    """Return the turn (rad) that stands for the sine: k (180° - δ)(180° + δ) δ of the paper."""
    degrees = math.degrees(angle)
    return math.radians(_SINE_SCALE * (180.0 - degrees) * (180.0 + degrees) * degrees)


def ant_cosine(angle: float) -> float:
    """Return what stands for the cosine: 1 - |δ| / 90°."""
    return 1.0 - abs(math.degrees(angle)) / 90.0


def approximate_step(vector: HomeVector, direction: float, distance: float) -> HomeVector:
    """Return the home vector after a step, as the ant finds it (Müller and Wehner 1988).

    φ' = φ + k (180° + δ)(180° - δ) δ / l and l' = l + 1 - |δ| / 90°, with δ the angle from φ to
    the step, in [-180°, 180°), for steps of length 1; a step of length s counts s times. Ours, at
    the nest, where the paper's fraction has no value: a vector shorter than the step, or one that
    would turn beyond the step's direction, takes the sum of the two instead.

    Args:
        vector: The vector before it.
        direction: Direction of the step (rad).
        distance: Its length (m), at least 0.
    """
    if distance == 0.0:
        return vector
    delta = wrap_angle(direction - vector.direction)
    length = vector.length + distance * ant_cosine(delta)
    turn = distance * ant_sine(delta)
    if vector.length <= distance or length <= 0.0 or abs(turn) > vector.length * abs(delta):
        x, y = vector.position
        end = x + distance * math.cos(direction), y + distance * math.sin(direction)
        return HomeVector.to(end)
    return HomeVector(wrap_angle(vector.direction + turn / vector.length), length)
