"""Start-stop motion: the robot turns, goes straight, stops and looks (thesis, section 3.1.2)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Points
from albot_core.sensing.reading import Reading
from albot_env.sim.simulator import Simulator


@dataclass(frozen=True, kw_only=True)
class StartStop:
    """How far the robot is sent at a time before it stops and looks (thesis, section 3.1.2)."""

    move: float = 1.0
    """Longest move (m)."""
    turn: float = np.radians(45.0)
    """Largest turn (rad)."""

    def __post_init__(self) -> None:
        if not (self.move > 0 and self.turn > 0):
            raise InputError("StartStop", "a move and a turn above 0", f"{self.move}, {self.turn}")


THESIS_STEPS = StartStop()
"""A metre or 45° at a time."""


def follow_leg(simulator: Simulator, waypoint: Points, steps: StartStop) -> Iterator[Reading]:
    """Turn towards the waypoint and go there; one reading a step."""
    to = waypoint - simulator.pose[:2]
    turn = float(wrap_angle(math.atan2(to[1], to[0]) - simulator.pose[2]))
    parts = int(np.ceil(abs(turn) / steps.turn - 1e-9))
    for _ in range(parts):
        yield simulator.turn(turn / parts)
    distance = float(np.hypot(*(waypoint - simulator.pose[:2])))
    parts = int(np.ceil(distance / steps.move - 1e-9))
    for _ in range(parts):
        yield simulator.move(distance / parts)
