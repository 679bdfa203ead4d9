"""The spaces of an agent's answers and of its observations of arrivals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from jaxtyping import Float32

from albot_core.errors import InputError
from albot_core.ranges import COUNT, check_fields
from albot_env.tasks.core.actions import ActionConfig, Numbers
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.observation_kernels import Layout

NEW = 0
"""The answer for a place where the robot never was before."""


@dataclass(frozen=True, kw_only=True)
class AnswerActionConfig(ActionConfig):
    """Answers: 0 for a new place, k for the place of the k-th arrival."""

    names: ClassVar[tuple[str, ...]] = ("answer",)

    most: int
    """Maximum number of earlier arrivals."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, COUNT, "most")

    @property
    def space(self) -> spaces.Space[Any]:
        """The space of answers."""
        return spaces.Discrete(1 + self.most)

    @property
    def choice_space(self) -> spaces.Discrete:
        """The space of answers, which are discrete in any case."""
        return spaces.Discrete(1 + self.most)

    def chosen(self, choices: Any, count: int | None, environment: str) -> Any:
        """Return the answers unchanged, because they are discrete in any case."""
        return choices

    def single(self, action: Any, environment: str) -> Numbers:
        """Return an answer as a batch of one.

        Raises:
            InputError: The answer is not a whole number from 0 to `most`.
        """
        return self._answers(action, (), environment).reshape(1, 1)

    def batch(self, actions: Any, count: int, environment: str) -> Numbers:
        """Return the answers of a batch of `count` environments.

        Raises:
            InputError: As for `single`.
        """
        return self._answers(actions, (count,), environment)[:, np.newaxis]

    def _answers(self, action: Any, shape: tuple[int, ...], environment: str) -> np.ndarray:
        """Return answers as an array of the given shape."""
        expected = f"a whole number from 0 to {self.most}"
        expected = f"{expected} for each of {shape[0]}" if shape else expected
        numbers = np.asarray(action)
        if numbers.shape != shape:
            found = f"shape {numbers.shape}" if numbers.dtype.kind in "biuf" else repr(action)
            raise InputError(environment, expected, found, place="action")
        if numbers.dtype.kind not in "iu" or ((numbers < 0) | (numbers > self.most)).any():
            raise InputError(environment, expected, repr(action), place="action")
        return numbers.astype(np.float64)


FEATURES = (
    "distance", "agreed", "contradicted", "sight", "shift", "turn", "matches", "share", "place",
    "recency", "way",
)  # fmt: skip
"""Features of an earlier arrival, in order (see `arrivals.PlaceDatabase`)."""


def arrivals_observation(
    candidates: Float32[np.ndarray, "arrivals features"], most: int
) -> Float32[np.ndarray, "length"]:
    """Return the observation for these earlier arrivals, of which there can be `most`.

    It holds the features of all arrivals, 0 for missing ones, and then the mask (1 or -1).
    """
    features, mask = np.zeros((most, len(FEATURES)), np.float32), np.full(most, -1, np.float32)
    features[: len(candidates)], mask[: len(candidates)] = candidates, 1
    return np.concatenate((features.ravel(), mask))


@dataclass(frozen=True, kw_only=True)
class ArrivalsObservationConfig(ObservationConfig):
    """The observation of the earlier arrivals."""

    most: int
    """Maximum number of earlier arrivals."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, COUNT, "most")

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The shape of each part, in the order of the flat observation.

        `arrivals` has one row per arrival with the `FEATURES`, 0 for missing ones; `mask` tells
        which rows exist (1 or -1).
        """
        return {"arrivals": (self.most, len(FEATURES)), "mask": (self.most,)}

    @property
    def layout(self) -> Any:
        """Empty: none of the parts of driving robots is observed."""
        return Layout(*[-1] * len(Layout._fields))
