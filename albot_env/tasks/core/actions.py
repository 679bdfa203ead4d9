"""Actions: the meaning of an agent's numbers in [-1, 1]."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from jaxtyping import Bool, Float32, Float64

from albot_core.errors import InputError
from albot_core.ranges import POSITIVE, Range, check_fields

_BELOW_ONE = Range("a number from -1, below 1", -1.0, math.nextafter(1.0, 0.0))
"""What a number of an action can be above."""

Numbers = Float64[np.ndarray, "robots numbers"]

DRIVING = (
    (1.0, 0.0),
    (0.4, 0.0),
    (0.6, 0.25),
    (0.6, -0.25),
    (0.25, 0.5),
    (0.25, -0.5),
    (0.0, 0.5),
    (0.0, -0.5),
    (-0.25, 0.0),
    (0.0, 0.0),
)
"""Speed and turn rate of the discrete actions, as shares of the maximum: fast and slow ahead,
wide and narrow curves to the left and right, turns on the spot, backwards, and stop."""


@dataclass(frozen=True, kw_only=True)
class ActionConfig:
    """Speed and turn rate that an action value of 1 stands for."""

    names: ClassVar[tuple[str, ...]] = ("speed", "turn rate")
    """Meaning of the numbers of an action."""

    speed: float = 1.0
    """Speed at 1 (m/s); -1 is the same speed backwards."""
    turn_rate: float = 2.0
    """Counter-clockwise turn rate at 1 (rad/s); -1 is clockwise."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "speed", "turn_rate")

    @property
    def space(self) -> spaces.Space[Any]:
        """The space of continuous actions, whose numbers are `names`."""
        return spaces.Box(-1, 1, (len(self.names),), np.float32)

    @property
    def choices(self) -> Float64[np.ndarray, "choices numbers"]:
        """The discrete actions.

        The rows of `DRIVING`; then, for each further number, a stop with that number at 1.
        """
        rows = np.full((len(DRIVING) + len(self.names) - 2, len(self.names)), -1.0)
        rows[:, :2] = 0.0
        rows[: len(DRIVING), :2] = DRIVING
        for k in range(2, len(self.names)):
            rows[len(DRIVING) + k - 2, k] = 1.0
        return rows

    @property
    def choice_space(self) -> spaces.Discrete:
        """The space of discrete actions: indices of rows of `choices`."""
        return spaces.Discrete(len(self.choices))

    def chosen(self, choices: Any, count: int | None, environment: str) -> Any:
        """Return the actions with these numbers, for `single` (count None) or `batch`.

        Raises:
            InputError: They are not whole numbers in range, or not one per environment.
        """
        table = self.choices
        expected = f"a whole number from 0 to {len(table) - 1}"
        expected += "" if count is None else f" for each of {count}"
        numbers = np.asarray(choices)
        if numbers.dtype.kind not in "iu" or numbers.shape != (() if count is None else (count,)):
            raise InputError(environment, expected, repr(choices), place="action")
        wrong = np.flatnonzero((numbers < 0) | (numbers >= len(table)))
        if len(wrong):
            place = "action" if count is None else f"action of environment {wrong[0]}"
            raise InputError(environment, expected, str(numbers.ravel()[wrong[0]]), place=place)
        return table[numbers]

    def single(self, action: Any, environment: str) -> Numbers:
        """Return an action as a batch of one.

        Args:
            action: As many numbers as there are `names`. Numbers beyond ±1, as normal
                distributions yield them, are clipped.
            environment: Id of the environment, for the error.

        Raises:
            InputError: The action has another shape, or is not finite.
        """
        numbers = self._numbers(action, (len(self.names),), environment)
        return self._within_limits(numbers[np.newaxis], environment, lambda _: "action")

    def batch(self, actions: Any, count: int, environment: str) -> Numbers:
        """Return the actions of a batch of `count` environments.

        Raises:
            InputError: As for `single`; it names the first environment with an invalid action.
        """
        numbers = self._numbers(actions, (count, len(self.names)), environment)
        return self._within_limits(numbers, environment, "action of environment {}".format)

    def commands(self, numbers: Numbers) -> Float64[np.ndarray, "robots 2"]:
        """Return the speeds (m/s) and turn rates (rad/s) that actions stand for."""
        return numbers[:, :2] * (self.speed, self.turn_rate)

    def shares(self, command: Float64[np.ndarray, "2"]) -> Float32[np.ndarray, "2"]:
        """Return the action numbers, clipped, for a speed (m/s) and a turn rate (rad/s)."""
        shares = command / (self.speed, self.turn_rate)
        return np.asarray(np.clip(shares, -1, 1), np.float32)

    def flagged(self, numbers: Numbers, name: str) -> Bool[np.ndarray, "robots"]:
        """Return which actions say what a number of this name stands for; none without one."""
        return np.zeros(len(numbers), np.bool_)

    @property
    def _expected(self) -> str:
        return f"{len(self.names)} finite numbers ({', '.join(self.names)})"

    def _within_limits(
        self, numbers: Numbers, environment: str, place: Callable[[int], str]
    ) -> Numbers:
        """Return the actions clipped to ±1; `place` names the action of a row, for the error."""
        if (np.abs(numbers) <= 1).all():
            return numbers
        finite = np.isfinite(numbers).all(axis=1)
        if not finite.all():
            wrong = int(np.argmin(finite))
            found = str(numbers[wrong].tolist())
            raise InputError(environment, self._expected, found, place=place(wrong))
        return np.asarray(np.clip(numbers, -1, 1))

    def _numbers(self, action: Any, shape: tuple[int, ...], environment: str) -> np.ndarray:
        """Return an action as an array of the given shape."""
        try:
            numbers = np.asarray(action)
            if np.iscomplexobj(numbers):
                raise TypeError
            numbers = numbers.astype(np.float64)
        except (TypeError, ValueError, OverflowError):
            found = _shown(action)
        else:
            if numbers.shape == shape:
                return numbers
            found = f"shape {numbers.shape}"
        expected = self._expected if len(shape) == 1 else f"{self._expected} for each of {shape[0]}"
        raise InputError(environment, expected, found, place="action")


def _shown(action: Any) -> str:
    """Return an action as an error shows it."""
    try:
        return reprlib.repr(action)
    except ValueError:  # Python writes no whole number of more than some thousand digits.
        return "numbers that are too large"


@dataclass(frozen=True, kw_only=True)
class FlaggingActionConfig(ActionConfig):
    """Speed and turn rate, and further numbers, each of which says something if it is high."""

    threshold: float = 0.5
    """A further number says what it is named after if it is above this."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, _BELOW_ONE, "threshold")

    def flagged(self, numbers: Numbers, name: str) -> Bool[np.ndarray, "robots"]:
        """Return which actions say what a number of this name stands for; none without one."""
        if name not in self.names:
            return super().flagged(numbers, name)
        return np.asarray(numbers[:, self.names.index(name)] > self.threshold)


@dataclass(frozen=True, kw_only=True)
class DeclaringActionConfig(FlaggingActionConfig):
    """Speed and turn rate, and a third number that declares that the robot is home."""

    names: ClassVar[tuple[str, ...]] = ("speed", "turn rate", "declare")


@dataclass(frozen=True, kw_only=True)
class ClaimingActionConfig(FlaggingActionConfig):
    """Speed and turn rate, and a third number that claims that the present place is known."""

    names: ClassVar[tuple[str, ...]] = ("speed", "turn rate", "claim")


@dataclass(frozen=True, kw_only=True)
class MissionActionConfig(FlaggingActionConfig):
    """Speed and turn rate, and two numbers: one declares home, one claims to know the place."""

    names: ClassVar[tuple[str, ...]] = ("speed", "turn rate", "declare", "claim")
