"""Answers: actions that name an earlier arrival, or none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces

from albot_core.errors import InputError
from albot_env.tasks.action import ActionConfig, Numbers

NEW = 0
"""The answer that the robot was never here before."""


@dataclass(frozen=True, kw_only=True)
class AnswerConfig(ActionConfig):
    """What an answer is: 0 for a new place, k for that of the k-th arrival."""

    names: ClassVar[tuple[str, ...]] = ("answer",)

    most: int
    """How many earlier arrivals there can be."""

    @property
    def space(self) -> spaces.Space[Any]:
        """The space of answers."""
        return spaces.Discrete(1 + self.most)

    @property
    def choice_space(self) -> spaces.Discrete:
        """The same: answers are numbers anyway."""
        return spaces.Discrete(1 + self.most)

    def chosen(self, choices: Any, count: int | None, environment: str) -> Any:
        """The same: answers are numbers anyway."""
        return choices

    def single(self, action: Any, environment: str) -> Numbers:
        """An answer as a batch of one.

        Raises:
            InputError: It is no whole number from 0 to `most`.
        """
        return self._answers(action, (), environment).reshape(1, 1)

    def batch(self, actions: Any, count: int, environment: str) -> Numbers:
        """The answers of a batch of so many.

        Raises:
            InputError: As for `single`.
        """
        return self._answers(actions, (count,), environment)[:, np.newaxis]

    def _answers(self, action: Any, shape: tuple[int, ...], environment: str) -> np.ndarray:
        """Answers as numbers of the shape wanted."""
        expected = f"a whole number from 0 to {self.most}"
        expected = f"{expected} for each of {shape[0]}" if shape else expected
        numbers = np.asarray(action)
        if numbers.shape != shape:
            found = f"shape {numbers.shape}" if numbers.dtype.kind in "biuf" else repr(action)
            raise InputError(environment, expected, found, place="action")
        if numbers.dtype.kind not in "iu" or ((numbers < 0) | (numbers > self.most)).any():
            raise InputError(environment, expected, repr(action), place="action")
        return numbers.astype(np.float64)
