"""Actions: what an agent's numbers in [-1, 1] ask of the robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from albot_core.errors import InputError


@dataclass(frozen=True, kw_only=True)
class ActionConfig:
    """Speed and turn rate that actions of 1 ask for."""

    speed: float = 1.0
    """Speed at 1 (m/s); as fast backwards at -1."""
    turn_rate: float = 2.0
    """Turn rate at 1, counter-clockwise (rad/s); clockwise at -1."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < np.inf:
                raise InputError(f"ActionConfig.{name}", "a positive number", str(value))

    @property
    def space(self) -> spaces.Box:
        """The space of actions: speed, turn rate."""
        return spaces.Box(-1, 1, (2,), np.float32)

    def command(self, action: Any, environment: str) -> tuple[float, float]:
        """Speed (m/s) and turn rate (rad/s) that an action asks for.

        Args:
            action: Two numbers in [-1, 1].
            environment: Id of the environment, for the error.

        Raises:
            InputError: The action has another shape, is not finite or out of range. It is
                never clipped in silence: an agent that asks for more is told.
        """
        expected = "2 numbers in [-1, 1] (speed, turn rate)"
        try:
            numbers = np.asarray(action, np.float64)
        except (TypeError, ValueError):
            raise InputError(environment, expected, repr(action), place="action") from None
        if numbers.shape != (2,):
            raise InputError(environment, expected, f"shape {numbers.shape}", place="action")
        if not (np.abs(numbers) <= 1).all():
            raise InputError(environment, expected, str(numbers.tolist()), place="action")
        return self.speed * float(numbers[0]), self.turn_rate * float(numbers[1])
