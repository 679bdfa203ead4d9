"""Patience: notices when the robot gets nowhere."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.types import Pose
from albot_core.planning.steering import Command


class Patience:
    """Allows a target so many steps, and fewer where the robot does not move at all."""

    _STANDSTILL_STEPS = 45
    """Steps within a hand's breadth after which the robot is stuck: longer than any turn."""
    _STANDSTILL = 0.15
    """That hand's breadth (m)."""
    _STEPS_PER_METRE = 40
    """Steps allowed for each metre of the way."""
    _RECOVERY_STEPS = 12
    """Steps of turning away."""

    def __init__(self) -> None:
        self._allowed = 0
        self._anchor: np.ndarray | None = None
        self._still = 0
        self._recovering = 0
        self._spin = 0.0

    def begin(self, way: float) -> None:
        """Set out for a target; `way` is how far it is (m)."""
        self._allowed = 100 + int(self._STEPS_PER_METRE * way)
        self._anchor = None

    def lost(self, pose: Pose) -> bool:
        """Take in the next step's pose; true once patience is at its end."""
        self._allowed -= 1
        if self._anchor is None or np.hypot(*(pose[:2] - self._anchor)) > self._STANDSTILL:
            self._anchor, self._still = pose[:2], 0
        self._still += 1
        return self._allowed < 0 or self._still > self._STANDSTILL_STEPS

    def recover(self, rng: np.random.Generator) -> None:
        """Turn for a while, to a side drawn at random."""
        self._recovering = self._RECOVERY_STEPS
        self._spin = float(rng.choice((-1.0, 1.0)))

    def recovery(self) -> Command | None:
        """The next command of turning away; None when done."""
        if self._recovering == 0:
            return None
        self._recovering -= 1
        return np.array((0.0, self._spin))
