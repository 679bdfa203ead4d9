"""The wayfarer: drives to places over ground that it sketches as it goes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose
from albot_core.geometry.types import Points, Pose
from albot_core.planning.approach import Approach
from albot_core.planning.following import things_around, waypoint
from albot_core.planning.senses import Senses
from albot_core.planning.sketch import Sketch, SketchConfig
from albot_core.planning.steering import Command, SteeringConfig, hold_back, steer

JUMP = 0.4
"""A belief that moves farther than this (m) from what the odometer says begins a new sheet."""
WORTH = 1.5
"""A known way is left where it is so many times as long as one over ground not seen yet."""


class KnownWay(NamedTuple):
    """A way that the robot has been before."""

    ahead: Points
    """A point that is next on it (m, robot's frame)."""
    length: float
    """How long it is (m)."""


class Wayfarer:
    """Goes to one target after another, the shortest way as far as it can tell.

    Ground that it has not seen yet it takes for free, and finds the way anew as it sees more
    (A. Stentz, Optimal and efficient path planning for partially-known environments, ICRA
    1994, plans so). A way that it knows it leaves where that would be much shorter, and comes
    back to it where it was not. Where no way is left it takes detours as they come (`Approach`).

    Args:
        config: How closely to pass things, and how fast.
    """

    _PLAN_EVERY = 5
    """Steps between two searches for the way."""
    _AT_HAND = 0.7
    """A target no farther away than this (m) is gone for straight: ways end about so near."""
    _FARTHEST = 25.0
    """Targets farther away are gone for as if so far (m)."""

    def __init__(self, config: SteeringConfig | None = None) -> None:
        self._config = config or SteeringConfig()
        self._approach = Approach(self._config)

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew, on an empty sheet."""
        self._approach.reset(rng)
        self._sketch = Sketch(SketchConfig(extent=30.0))
        self._pose: Pose | None = None
        self._route: Float64[np.ndarray, "cells 2"] = np.empty((0, 2))
        self._steps = 0
        self._leaves = False

    def command(self, senses: Senses, target: Points, known: KnownWay | None = None) -> Command:
        """How to drive next.

        Args:
            senses: What the robot senses, and believes.
            target: Where to (m, robot's frame).
            known: The way there that it knows, if any.
        """
        self._look(senses)
        if self._steps % self._PLAN_EVERY == 0:
            self._plan(senses, target, known)
        self._steps += 1
        if known is not None and not self._leaves:
            target = known.ahead
        if not len(self._route):
            return self._approach.command(senses, target)
        ahead = target
        if np.hypot(*target) > self._AT_HAND:
            ahead = senses.to_robot(waypoint(self._sketch, senses, self._route, hopeful=True))
        wanted = steer(things_around(self._sketch, senses), ahead, self._config)
        return hold_back(wanted, senses.points, senses.motion, self._config)

    def _plan(self, senses: Senses, target: Points, known: KnownWay | None) -> None:
        """Find the way to the target or, where a known way is not much longer, on along that."""
        self._route, length = self._find(senses, target)
        self._leaves = known is not None and WORTH * length < known.length < np.inf
        if known is not None and not self._leaves:
            self._route, _ = self._find(senses, known.ahead)

    def _find(self, senses: Senses, target: Points) -> tuple[Float64[np.ndarray, "cells 2"], float]:
        """The way to a target (m, map frame), and its length (m); none is infinitely long."""
        distance = float(np.hypot(*target))
        goal = senses.to_map(target * min(1.0, self._FARTHEST / max(distance, 1e-9)))
        self._sketch.make_room(goal)
        ways = self._sketch.ways(senses.pose, hopeful=True, goal=goal)
        beyond = max(0.0, distance - self._FARTHEST)
        return self._sketch.route(ways, goal), self._sketch.length(ways, goal) + beyond

    def _look(self, senses: Senses) -> None:
        """Draw what is in view, on a new sheet where the belief has jumped."""
        if self._pose is not None:
            expected = compose(self._pose, senses.motion)
            if np.hypot(*(senses.pose - expected)[:2]) > JUMP:
                self._sketch = Sketch(SketchConfig(extent=30.0))
                self._steps = 0
        self._pose = senses.pose
        self._sketch.draw(senses)
