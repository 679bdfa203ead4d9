"""Effects: what a strike of a fault of readings does, reading by reading."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from albot_core.geometry.poses import compose
from albot_core.sensing.faults.fault import Fault, Strikes
from albot_core.sensing.reading import Reading


class Moment(NamedTuple):
    """What an effect may know besides the reading."""

    interval: float
    """Time since the reading before (s)."""
    contact: bool
    """Whether the robot touched something since then."""
    number: int
    """Number of the reading, counted from 0."""


class Effect(ABC):
    """One strike. What it keeps of earlier readings is in `held`, and nowhere else.

    Args:
        strikes: The strike under way: its quantities and random numbers.
    """

    def __init__(self, strikes: Strikes) -> None:
        self._values = strikes.values
        self.held: list[Reading] = []
        """Readings that are kept back, or remembered."""

    @abstractmethod
    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        """Return what arrives instead of a reading: nothing, or one reading or more."""

    def finish(self, reading: Reading) -> Sequence[Reading]:
        """Return what arrives with the first reading after the strike, which is whole."""
        return (reading,)


class ReadingFault(Fault, ABC):
    """A fault that changes readings, or how they arrive."""

    @abstractmethod
    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""


@dataclass(frozen=True)
class Chance:
    """Decides, reading by reading, by random numbers that depend on the reading's number alone."""

    seed: int
    """Selects the random stream."""
    share: float
    """The probability."""

    def __contains__(self, number: int) -> bool:
        """Whether the reading with a number is chosen."""
        return bool(np.random.default_rng((self.seed, number)).random() < self.share)


def carried(first: Reading, last: Reading) -> Reading:
    """Return a reading whose motion is that of two in a row."""
    return replace(last, motion=compose(first.motion, last.motion))
