"""The navigator: when it leaves the way that it knows."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.planning.navigator import KnownWay, Navigator
from albot_core.planning.percept import Percept
from albot_core.sensing.reading import LaserGeometry

LASER = LaserGeometry()
LEFT = np.array((0.0, 2.0))
TARGET = np.array((5.0, 0.0))


def _before_a_wall(away: float, right: float, left: float) -> Percept:
    """A robot in the open that faces a wall so far away, which ends so far to either side (m)."""
    ahead = np.cos(LASER.bearings) > 1e-9
    ranges = np.full(len(LASER.bearings), LASER.max_range)
    ranges[ahead] = away / np.cos(LASER.bearings[ahead])
    aside = ranges * np.sin(LASER.bearings)
    ranges[(aside < -right) | (aside > left)] = LASER.max_range
    return Percept(ranges=ranges, laser=LASER, pose=np.zeros(3), motion=np.zeros(3))


def _first(percept: Percept, known: KnownWay | None) -> tuple[float, float]:
    navigator = Navigator()
    navigator.reset(np.random.default_rng(0))
    speed, turn_rate = navigator.command(percept, TARGET, known)
    return float(speed), float(turn_rate)


OPEN, WALL = _before_a_wall(20.0, 0.5, 0.5), _before_a_wall(1.5, 3.0, 6.0)


@pytest.mark.parametrize(
    ("percept", "length", "leaves"),
    [
        (OPEN, 6.0, False),  # 5 m straight on: hardly shorter.
        (OPEN, 8.0, True),
        (WALL, 10.0, False),  # Round the right end of the wall it is about 8 m.
        (WALL, 15.0, True),
        (OPEN, math.inf, False),  # Lost: it does not know how long the way is.
    ],
)
def test_it_leaves_the_way_that_it_knows_for_one_that_may_be_much_shorter(
    percept: Percept, length: float, leaves: bool
) -> None:
    known = KnownWay(LEFT, length)
    straight, back = _first(percept, None), _first(percept, KnownWay(LEFT, 0.0))
    assert straight != back
    assert _first(percept, known) == (straight if leaves else back)
