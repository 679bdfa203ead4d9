"""Rewards as named terms: what each is worth stands in one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.errors import InputError


@dataclass(frozen=True, kw_only=True)
class ExploreWeights:
    """What the terms of the exploration reward are worth. A reward is their sum."""

    coverage: float = 0.02
    """For every square metre of ground truly covered for the first time (1/m²)."""
    room: float = 1.0
    """For every room truly entered for the first time."""
    collision: float = -0.1
    """For every step in contact with something."""
    time: float = -0.01
    """For every second that passes (1/s)."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not np.isfinite(value):
                raise InputError(f"ExploreWeights.{name}", "a finite number", str(value))

    def terms(
        self,
        *,
        new_ground: Float64[np.ndarray, "robots"],
        new_room: Bool[np.ndarray, "robots"],
        collided: Bool[np.ndarray, "robots"],
        elapsed: float,
    ) -> dict[str, Float64[np.ndarray, "robots"]]:
        """The weighted terms of one step, for each robot.

        Args:
            new_ground: Ground covered for the first time (m²).
            new_room: Whether a room was entered for the first time.
            collided: Whether the robot touched something.
            elapsed: Time that has passed (s).
        """
        return {
            "coverage": self.coverage * new_ground,
            "room": np.where(new_room, self.room, 0.0),
            "collision": np.where(collided, self.collision, 0.0),
            "time": np.full(len(new_ground), self.time * elapsed),
        }
