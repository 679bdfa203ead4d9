"""The explorer: goes for one goal after another, and gives up those that it does not come to."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from jaxtyping import Float64

from albot_core.planning.following import things_around, waypoint
from albot_core.planning.look_round import LookRound
from albot_core.planning.patience import Patience
from albot_core.planning.senses import Senses
from albot_core.planning.sketch import Sketch, SketchConfig
from albot_core.planning.steering import Command, SteeringConfig, hold_back, steer


class Explorer(ABC):
    """Looks round, and then goes from goal to goal. What for, its kinds say.

    Args:
        near: Ground in view and no farther away than this is covered (m).
        steering: How closely to pass things, and how fast.
    """

    _PLAN_EVERY = 9
    """Steps between two searches for the way."""

    def __init__(self, near: float, steering: SteeringConfig) -> None:
        self._near = near
        self._steering = steering

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew, by looking all around."""
        self._rng = rng
        self._sketch = Sketch(SketchConfig(near=self._near))
        self._look_round = LookRound()
        self._patience = Patience()
        self._goal: Float64[np.ndarray, "2"] | None = None
        self._route: Float64[np.ndarray, "cells 2"] = np.empty((0, 2))
        self._steps = 0

    def command(self, senses: Senses) -> Command:
        """How to drive next, after what is sensed now."""
        self._take_in(senses)
        return hold_back(self._wanted(senses), senses.points, senses.motion, self._steering)

    def _wanted(self, senses: Senses) -> Command:
        """The next command but for what the robot must brake for."""
        turning = self._look_round.command(senses.pose)
        if turning is None:
            turning = self._patience.recovery()
        if turning is not None:
            return turning
        self._give_up_where_vain(senses)
        if self._goal is None or self._steps % self._PLAN_EVERY == 0:
            self._plan(senses)
        ahead = senses.to_robot(waypoint(self._sketch, senses, self._route))
        return steer(things_around(self._sketch, senses), ahead, self._steering)

    def _take_in(self, senses: Senses) -> None:
        """Draw what is in view."""
        self._sketch.draw(senses)
        self._steps += 1

    @abstractmethod
    def _give_up_where_vain(self, senses: Senses) -> None:
        """Drop a goal that there is no sense in going for any longer."""

    @abstractmethod
    def _plan(self, senses: Senses) -> None:
        """Find the way to the goal anew; choose a goal where there is none."""
