"""Rewards as named terms: their weights, and how the terms are stored."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from albot_core.kernels.compiled import kernel
from albot_core.ranges import FINITE, check_fields
from albot_env.tasks.core.state import EpisodeStats


@dataclass(frozen=True, kw_only=True)
class Weights:
    """Weights of a reward's terms, each in the field of its name."""

    terms: ClassVar[Any]
    """The terms in order: a NamedTuple of numbers, in the form that compiled code takes."""

    def __post_init__(self) -> None:
        check_fields(self, FINITE, *vars(self))

    @property
    def values(self) -> Any:
        """The weights in the form that compiled code takes."""
        return self.terms(*(float(getattr(self, name)) for name in self.terms._fields))


@kernel()
def set_reward(i: int, terms: tuple[float, ...], stats: EpisodeStats) -> None:
    """Set the terms of robot i's reward, and their sum, added in order."""
    total = 0.0
    for k in range(len(terms)):
        stats.terms[i, k] = terms[k]
        total += terms[k]
    stats.rewards[i] = total
