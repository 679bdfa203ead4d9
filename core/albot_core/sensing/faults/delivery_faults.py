"""Faults of how readings arrive: lost, doubled, swapped or late.

An odometer counts on whatever happens to its messages: the motion of a reading is always that since
the reading that arrived before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from albot_core.geometry.poses import inverse
from albot_core.sensing.faults.effect import Chance, Effect, Moment, ReadingFault, carried
from albot_core.sensing.faults.fault import LastingFault, Strikes, quantity
from albot_core.sensing.faults.span import PERCENT, SECONDS, Span
from albot_core.sensing.reading import Reading


@dataclass(frozen=True, kw_only=True)
class LostReadings(LastingFault, ReadingFault):
    """Readings get lost. The next one that arrives has the motion of them all."""

    name: ClassVar[str] = "lost-readings"
    summary: ClassVar[str] = "Readings, drawn at random, never arrive."
    share: Span = quantity("30..100%", PERCENT, most=100.0)
    """Share of the readings that are lost."""

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _Lost(strikes)


class _Lost(Effect):
    def __init__(self, strikes: Strikes) -> None:
        super().__init__(strikes)
        self._chance = Chance(int(strikes.rng.integers(2**63)), self._values["share"])

    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        whole = self._whole(reading)
        if moment.number in self._chance:
            self.held = [whole]
            return ()
        self.held = []
        return (whole,)

    def finish(self, reading: Reading) -> Sequence[Reading]:
        return (self._whole(reading),)

    def _whole(self, reading: Reading) -> Reading:
        return carried(self.held[0], reading) if self.held else reading


@dataclass(frozen=True, kw_only=True)
class DoubledReadings(LastingFault, ReadingFault):
    """Readings arrive twice, the second time without motion."""

    name: ClassVar[str] = "doubled-readings"
    summary: ClassVar[str] = "Readings, drawn at random, arrive twice."
    share: Span = quantity("30..100%", PERCENT, most=100.0)
    """Share of the readings that are doubled."""

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _Doubled(strikes)


class _Doubled(Effect):
    def __init__(self, strikes: Strikes) -> None:
        super().__init__(strikes)
        self._chance = Chance(int(strikes.rng.integers(2**63)), self._values["share"])

    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        again = moment.number in self._chance
        return (reading, replace(reading, motion=np.zeros(3))) if again else (reading,)


@dataclass(frozen=True, kw_only=True)
class SwappedReadings(LastingFault, ReadingFault):
    """Of each two readings the later one arrives first."""

    name: ClassVar[str] = "swapped-readings"
    summary: ClassVar[str] = "Of each two readings the later one arrives first."

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _Swapped(strikes)


class _Swapped(Effect):
    # It holds the reading by whose motion the odometer was ahead of what arrived last, and perhaps
    # one that waits for the next.
    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        if not self.held:
            self.held = [replace(reading, motion=np.zeros(3))]
        if len(self.held) == 1:
            self.held = [*self.held, reading]
            return ()
        ahead, first = self.held
        self.held = [reading]
        later = carried(carried(ahead, first), reading)
        return later, replace(first, motion=inverse(reading.motion))

    def finish(self, reading: Reading) -> Sequence[Reading]:
        if not self.held:
            return (reading,)
        ahead, *waiting = self.held
        following = [*waiting, reading]
        return carried(ahead, following[0]), *following[1:]


@dataclass(frozen=True, kw_only=True)
class LateReadings(LastingFault, ReadingFault):
    """Readings arrive late, in their order; at the end of the strike all that wait arrive."""

    name: ClassVar[str] = "late-readings"
    summary: ClassVar[str] = "Readings arrive late, in their order, and all that wait at the end."
    delay: Span = quantity("0.3..1s", SECONDS, most=60.0)
    """How late they are."""

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _Late(strikes)


class _Late(Effect):
    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        waiting = [*self.held, reading]
        due = reading.stamp - self._values["delay"] + 1e-9
        arrived = 0
        while arrived < len(waiting) and waiting[arrived].stamp <= due:
            arrived += 1
        self.held = waiting[arrived:]
        return waiting[:arrived]

    def finish(self, reading: Reading) -> Sequence[Reading]:
        return (*self.held, reading)
