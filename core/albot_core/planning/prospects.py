"""Prospects: places seen but not yet covered, kept until they are."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Pose
from albot_core.planning.sketch import Sketch


class Prospects:
    """Ground of the map worth covering, and from where each is to be looked at.

    Args:
        spacing: A prospect nearer than this to one already kept, or given up, is not kept (m).
    """

    def __init__(self, spacing: float = 0.8) -> None:
        self._spacing = spacing
        self.goals: Float64[np.ndarray, "prospects 2"] = np.empty((0, 2))
        """Where to go for them (m, map frame)."""
        self.ground: Float64[np.ndarray, "prospects 2"] = np.empty((0, 2))
        """The ground that each is for (m, map frame)."""
        self._given_up: Float64[np.ndarray, "places 2"] = np.empty((0, 2))

    def note(self, goals: Float64[np.ndarray, "n 2"], ground: Float64[np.ndarray, "n 2"]) -> None:
        """Keep those whose ground is apart from what is kept or given up (m, map frame)."""
        for goal, spot in zip(goals, ground, strict=True):
            known = np.concatenate((self.ground, self._given_up)) - spot
            if not (np.hypot(known[:, 0], known[:, 1]) < self._spacing).any():
                self.goals = np.vstack((self.goals, goal))
                self.ground = np.vstack((self.ground, spot))

    def forget_covered(self, sketch: Sketch, pose: Pose, least: float = 0.0) -> None:
        """Drop those whose ground is covered by now, or on whose goal the robot is.

        It counts as covered, too, where no more of the ground about it is left than `least`.
        """
        here = np.hypot(*(self.goals - pose[:2]).T) < 0.3
        left = sketch.uncovered(self.ground)
        self._keep((left > 0) & (left >= least) & ~here)

    def holds(self, goal: Float64[np.ndarray, "2"]) -> bool:
        """Whether a goal is still one."""
        return bool((self.goals == goal).all(axis=1).any())

    def give_up(self, goal: Float64[np.ndarray, "2"]) -> None:
        """Drop the prospects of a goal and keep nothing on their ground again."""
        given = (self.goals == goal).all(axis=1)
        self._given_up = np.concatenate((self._given_up, self.ground[given]))
        self._keep(~given)

    def pardon(self) -> None:
        """Allow the places given up to be kept again."""
        self._given_up = np.empty((0, 2))

    def _keep(self, kept: np.ndarray) -> None:
        self.goals, self.ground = self.goals[kept], self.ground[kept]
