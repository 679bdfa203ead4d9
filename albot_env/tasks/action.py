"""Actions: what an agent's numbers in [-1, 1] ask of the robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.ranges import POSITIVE, check_fields

_EXPECTED = "2 numbers in [-1, 1] (speed, turn rate)"


@dataclass(frozen=True, kw_only=True)
class ActionConfig:
    """Speed and turn rate that actions of 1 ask for."""

    speed: float = 1.0
    """Speed at 1 (m/s); as fast backwards at -1."""
    turn_rate: float = 2.0
    """Turn rate at 1, counter-clockwise (rad/s); clockwise at -1."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, *vars(self))

    @property
    def space(self) -> spaces.Box:
        """The space of actions: speed, turn rate."""
        return spaces.Box(-1, 1, (2,), np.float32)

    def command(self, action: Any, environment: str) -> Float64[np.ndarray, "1 2"]:
        """Speed (m/s) and turn rate (rad/s) that an action asks for, in a batch of one.

        Args:
            action: Two numbers in [-1, 1].
            environment: Id of the environment, for the error.

        Raises:
            InputError: The action has another shape, is not finite or out of range. It is
                never clipped in silence: an agent that asks for more is told.
        """
        numbers = _numbers(action, (2,), environment)
        speed, turn_rate = numbers.tolist()
        if not (-1 <= speed <= 1 and -1 <= turn_rate <= 1):
            raise InputError(environment, _EXPECTED, str([speed, turn_rate]), place="action")
        return np.array(((speed * self.speed, turn_rate * self.turn_rate),))

    def commands(
        self, actions: Any, count: int, environment: str
    ) -> Float64[np.ndarray, "environments 2"]:
        """Speeds (m/s) and turn rates (rad/s) that the actions of a batch ask for.

        Raises:
            InputError: As for `command`; it names the first environment that is wrong.
        """
        numbers = _numbers(actions, (count, 2), environment)
        right = (np.abs(numbers) <= 1).all(axis=1)
        if not right.all():
            wrong = int(np.argmin(right))
            found = str(numbers[wrong].tolist())
            raise InputError(environment, _EXPECTED, found, place=f"action of environment {wrong}")
        return numbers * (self.speed, self.turn_rate)


def _numbers(action: Any, shape: tuple[int, ...], environment: str) -> np.ndarray:
    """An action as numbers of the shape wanted."""
    expected = _EXPECTED if len(shape) == 1 else f"{_EXPECTED} for each of {shape[0]}"
    try:
        numbers = np.asarray(action)
        if np.iscomplexobj(numbers):
            raise TypeError
        numbers = numbers.astype(np.float64)
    except (TypeError, ValueError):
        raise InputError(environment, expected, repr(action), place="action") from None
    if numbers.shape != shape:
        raise InputError(environment, expected, f"shape {numbers.shape}", place="action")
    return numbers
