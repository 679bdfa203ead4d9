"""The approach: drives to a place round what is in the way, by what is in view alone."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, inverse, transform_points
from albot_core.planning.senses import Senses
from albot_core.planning.steering import (
    DIRECTIONS,
    Command,
    SteeringConfig,
    free_way,
    hold_back,
    steer,
)


class Approach:
    """Heads for a place and, where it comes no nearer, for somewhere else for a while.

    It knows no map: where to go meanwhile is drawn from the directions that are open.

    Args:
        config: How closely to pass things, and how fast.
    """

    _HOPE = 60
    """Steps without coming nearer after which it goes elsewhere."""
    _NEARER = 0.2
    """What counts as coming nearer (m)."""
    _DETOUR = 40
    """Steps of the first detour; each is longer by as many, …"""
    _LONGEST = 400
    """…up to this many."""
    _OPEN = 1.5
    """Free way of a direction that is open (m)."""

    def __init__(self, config: SteeringConfig | None = None) -> None:
        self._config = config or SteeringConfig()

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew."""
        self._rng = rng
        self._nearest = np.inf
        self._in_vain = 0
        self._detours = 0
        self._left = 0
        self._aim = np.zeros(2)

    def command(self, senses: Senses, target: Float64[np.ndarray, "2"]) -> Command:
        """How to drive next towards a target (m, robot's frame)."""
        self._aim = transform_points(inverse(senses.motion), self._aim)
        if self._left:
            self._left -= 1
            if np.hypot(*self._aim) < self._config.lookahead:
                self._turn_aside(senses)
        elif self._is_in_vain(float(np.hypot(*target))):
            self._detours += 1
            self._left = min(self._DETOUR * self._detours, self._LONGEST)
            self._turn_aside(senses)
        wanted = steer(senses.points, self._aim if self._left else target, self._config)
        return hold_back(wanted, senses.points, senses.motion, self._config)

    def _is_in_vain(self, distance: float) -> bool:
        """Take in how far it is now; whether it has not come nearer for too long."""
        self._in_vain += 1
        if distance < self._nearest - self._NEARER:
            self._nearest, self._in_vain = distance, 0
        if self._in_vain <= self._HOPE:
            return False
        self._nearest, self._in_vain = distance, 0
        return True

    def _turn_aside(self, senses: Senses) -> None:
        """Aim at a place drawn from those that can be gone to straight, or behind."""
        ways = free_way(senses.points, self._config.radius)
        open_ways = np.flatnonzero((ways > self._OPEN) & (np.abs(DIRECTIONS) <= np.pi / 2))
        bearing = np.pi
        distance = 2 * self._OPEN
        if len(open_ways):
            chosen = int(self._rng.choice(open_ways))
            bearing, distance = float(DIRECTIONS[chosen]), min(float(ways[chosen]), 6.0)
        ahead = compose(np.array((0.0, 0.0, bearing)), np.array((distance, 0.0, 0.0)))
        self._aim = ahead[:2]
