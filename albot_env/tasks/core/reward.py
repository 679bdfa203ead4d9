"""Rewards as named terms: what each is worth, and how they are kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from albot_core.errors import InputError
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.state import EpisodeStats


@dataclass(frozen=True, kw_only=True)
class Weights:
    """What a reward's terms are worth, each in the field of its name.

    A field `discount`, where there is one, is no term but the learner's discount factor.
    """

    terms: ClassVar[Any]
    """The terms by name, in their order: a NamedTuple of numbers, as compiled code takes them."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not np.isfinite(value):
                raise InputError(f"{type(self).__name__}.{name}", "a finite number", str(value))
        discount = getattr(self, "discount", 1.0)
        if not 0 < discount <= 1:
            place = f"{type(self).__name__}.discount"
            raise InputError(place, "within (0, 1]", str(discount))

    @property
    def values(self) -> Any:
        """The weights as compiled code takes them."""
        return self.terms(*(float(getattr(self, name)) for name in self.terms._fields))


@kernel()
def set_reward(i: int, terms: tuple[float, ...], stats: EpisodeStats) -> None:
    """Set the terms of robot i's reward, and their sum, added in their order."""
    total = 0.0
    for k in range(len(terms)):
        stats.terms[i, k] = terms[k]
        total += terms[k]
    stats.rewards[i] = total
