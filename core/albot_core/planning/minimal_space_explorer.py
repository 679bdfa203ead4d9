"""The explorer of landmark association: short moves to gaps of the minimal bounded space.

Yeap and others, Autonomous robot mapping by landmark association (2015), section "Autonomous
exploration". It remembers nothing: at each stop it looks for gaps anew. Its moves are short, so
that successive views overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from albot_core.geometry.poses import inverse, transform_points
from albot_core.planning.gap_explorer import Gap, find_gaps
from albot_core.planning.percept import Percept
from albot_core.planning.steering import Command, SteeringConfig, admissible_command, steer
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, check_fields


@dataclass(frozen=True, kw_only=True)
class MinimalSpaceConfig:
    """How the explorer chooses gaps, and how far it moves at a time."""

    gap_width: float = 0.6
    """A gap is wider than this (m), as in the paper."""
    turn: float = np.radians(30.0)
    """It turns no more than this at a time (rad), as in the paper…"""
    drive: float = 3.0
    """…and drives no farther (m), as in the paper."""
    nearest: float = 1.0
    """A gap is drawn among the nearest one and those no more than this farther away (m). The paper
    says "a random gap closest to the robot"; how close is ours."""
    steering: SteeringConfig = field(default_factory=SteeringConfig)
    """How closely to pass things, and how fast: ours."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "gap_width", "turn", "drive")
        check_fields(self, NOT_NEGATIVE, "nearest")


class MinimalSpaceExplorer:
    """Turns to a gap and drives towards it, a little at a time.

    Args:
        config: How it chooses gaps, and how far it moves at a time.
    """

    _REACH = 30.0
    """Gaps are looked for as far as the laser sees (m)."""
    _RATE, _GAIN = 1.0, 4.0
    """How fast it turns on the spot (rad/s), and for each radian that is left (1/s)."""
    _TURNED = np.radians(2.0)
    """A turn is over when no more is left (rad)."""
    _ARRIVED = 0.2
    """It stops so near to the middle of a gap (m)."""
    _BARRED = 10
    """A move is over after so many steps without headway: the way is barred."""
    _HEADWAY = 0.005
    """Less than this in a step, in m or rad, is none."""

    def __init__(self, config: MinimalSpaceConfig = MinimalSpaceConfig()) -> None:
        self._config = config

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew."""
        self._rng = rng
        self._target = np.zeros(2)
        self._turn_left, self._way_left = 0.0, 0.0
        self._standing = 0
        self._side = 0.0

    def command(self, percept: Percept) -> Command:
        """How to drive next, by what is sensed now."""
        self._note_motion(percept)
        if abs(self._turn_left) <= self._TURNED and self._way_left <= 0.0:
            self._begin_move(percept)
        if abs(self._turn_left) > self._TURNED:
            rate = float(np.clip(self._GAIN * self._turn_left, -self._RATE, self._RATE))
            wanted = np.array((0.0, rate))
        else:
            wanted = steer(percept.points, self._target, self._config.steering)
        return admissible_command(wanted, percept.points, percept.motion, self._config.steering)

    def _note_motion(self, percept: Percept) -> None:
        """Take off what the last step brought; end the move where it has led to its end."""
        motion = percept.motion
        self._target = transform_points(inverse(motion), self._target)
        way, turn = float(np.hypot(*motion[:2])), float(motion[2])
        self._standing = 0 if max(way, abs(turn)) >= self._HEADWAY else self._standing + 1
        if abs(self._turn_left) > self._TURNED:
            self._turn_left -= turn
        else:
            self._way_left -= way
        if np.hypot(*self._target) < self._ARRIVED or self._standing >= self._BARRED:
            self._turn_left, self._way_left = 0.0, 0.0

    def _begin_move(self, percept: Percept) -> None:
        """Steps (b) to (e): gaps, the minimal bounded space, a gap of it, and how to move there.

        Where there is no gap, or the way is barred, it turns to one side until there is one; the
        paper does not tell of that.
        """
        config = self._config
        seen = find_gaps(percept.points, narrowest=config.gap_width, reach=self._REACH)
        # It stands in a gap that is nearer.
        gaps = [gap for gap in minimal_space(seen) if np.hypot(*gap.centre) > 2 * self._ARRIVED]
        if gaps and self._standing < self._BARRED:
            distances = np.array([np.hypot(*gap.centre) for gap in gaps])
            near = np.flatnonzero(distances <= distances.min() + config.nearest)
            self._target = gaps[int(self._rng.choice(near))].centre
            self._side = 0.0
        else:
            self._side = self._side or float(self._rng.choice((-1.0, 1.0)))
            self._target = np.array((0.0, self._side))
        bearing = float(np.arctan2(self._target[1], self._target[0]))
        self._turn_left = float(np.clip(bearing, -config.turn, config.turn))
        self._way_left = config.drive if self._turn_left == bearing else 0.0
        self._standing = 0


def minimal_space(gaps: Sequence[Gap]) -> list[Gap]:
    """The gaps that bound the minimal bounded space: those that no other one covers.

    A gap covers another one if the robot must cross it on the way to that (Yeap and Jefferies,
    Computing a representation of the local environment, Artificial Intelligence 107, 1999): here,
    on the straight way to its middle.
    """
    return [gap for gap in gaps if not any(_covers(other, gap) for other in gaps)]


def _covers(gap: Gap, other: Gap) -> bool:
    """Whether the straight way from the robot to the middle of another gap crosses this one."""
    along = np.array((gap.outward[1], -gap.outward[0]))
    x, y = other.centre
    # Where the way, from 0 at the robot to 1 at the other gap, meets the line of this one.
    towards = float(x * gap.outward[0] + y * gap.outward[1])
    away = float(gap.centre @ gap.outward)
    if towards <= away + _SAME:
        return False
    aside = float((away / towards * other.centre - gap.centre) @ along)
    return abs(aside) < gap.width / 2


_SAME = 0.1
"""Gaps whose lines are no farther apart lie beside each other, or are the same one (m)."""
