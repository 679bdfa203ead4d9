"""Looking round: a full turn on the spot."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Pose
from albot_core.planning.steering import Command


class LookRound:
    """Turns the robot until it has looked everywhere; it begins with that."""

    _RATE = 1.6
    """How fast it turns (rad/s)."""

    def __init__(self) -> None:
        self._heading: float | None = None
        self.begin()

    def begin(self) -> None:
        """Turn all round once more."""
        self._left = 2 * np.pi

    def command(self, pose: Pose) -> Command | None:
        """Take in the next step's pose; the command of turning, or None when done."""
        heading = float(pose[2])
        if self._heading is not None:
            self._left -= abs(float(wrap_angle(heading - self._heading)))
        self._heading = heading
        return np.array((0.0, self._RATE)) if self._left > 0 else None
