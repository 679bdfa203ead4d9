"""How far from the ideal a robot and its laser may be before something is wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Ranges
from albot_core.ranges import NOT_NEGATIVE, check_fields
from albot_maps.world import ROBOT_RADIUS


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a step may show. The defaults are those of the default robot and its laser."""

    radius: float = ROBOT_RADIUS
    """Radius of the robot's body (m)."""
    overlap: float = 0.055
    """How deep the body may be in a wall (m). Chipmunk finds a contact only once bodies
    overlap: at the 1 m/s that actions ask for at most, 5 cm after one step of 0.05 s."""
    thing_overlap: float = 0.125
    """How deep the body may be in something that moves (m). Both come at each other: a robot
    at 1 m/s and a person at 1.4 m/s, 12 cm in one step of 0.05 s."""
    range_error: float = 0.04
    """Greatest error of a range (m): the outermost of the laser's 4096 errors of 1 cm
    standard deviation is 3.7 cm."""
    max_range: float = 30.0
    """Range shown where nothing came back (m)."""
    dropout: float = 0.001
    """Probability that a beam which meets a wall brings nothing back."""
    echo_noise: float = 0.005
    """Standard deviation of a sonar's range (m)…"""
    echo_share: float = 0.01
    """…and of a further error of it, as a share of the range."""
    echo_deviations: float = 3.7
    """Greatest error of a sonar's range, in standard deviations: the outermost of 4096."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, *vars(self))
        if self.dropout >= 1:
            raise InputError("Limits.dropout", "below 1", str(self.dropout))

    def echo_error(self, ranges: Ranges) -> Ranges:
        """Greatest error (m) of echoes from these distances (m)."""
        finite = np.where(np.isfinite(ranges), ranges, 0.0)
        return self.echo_deviations * np.hypot(self.echo_noise, self.echo_share * finite)

    def most_lost(self, beams: int) -> int:
        """How many of so many beams may be lost by chance: more is less likely than 1e-12."""
        odds = self.dropout / (1 - self.dropout)
        share = (1 - self.dropout) ** beams
        beyond, lost = 1 - share, 0
        while beyond > 1e-12 and lost < beams:
            share *= odds * (beams - lost) / (lost + 1)
            beyond, lost = beyond - share, lost + 1
        return lost
