"""Faults of the odometer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from albot_core.geometry.poses import compose
from albot_core.sensing.faults.effect import Effect, Moment, ReadingFault
from albot_core.sensing.faults.fault import LastingFault, Need, Strikes, quantity
from albot_core.sensing.faults.span import DEGREES, METRES, METRES_PER_SECOND, Span
from albot_core.sensing.reading import Reading


@dataclass(frozen=True, kw_only=True)
class OdometerJump(ReadingFault):
    """The odometer jumps once, and counts on from there."""

    name: ClassVar[str] = "odometer-jump"
    summary: ClassVar[str] = (
        "One motion is wrong by a length in a random direction, and by a turn to either side."
    )
    length: Span = quantity("1..10m", METRES, most=1000.0)
    """Length of the jump."""
    turn: Span = quantity("0..180deg", DEGREES, most=180.0)
    """Angle by which the heading jumps, to either side."""

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _Jump(strikes)


class _Jump(Effect):
    def __init__(self, strikes: Strikes) -> None:
        super().__init__(strikes)
        way, side = strikes.rng.uniform(-math.pi, math.pi), strikes.rng.integers(2)
        length, turn = self._values["length"], self._values["turn"]
        self._jump = np.array(
            (length * math.cos(way), length * math.sin(way), turn if side else -turn)
        )

    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        return (replace(reading, motion=compose(self._jump, reading.motion)),)


@dataclass(frozen=True, kw_only=True)
class FrozenOdometer(LastingFault, ReadingFault):
    """The odometer counts nothing; what was driven meanwhile is never told."""

    name: ClassVar[str] = "frozen-odometer"
    summary: ClassVar[str] = "The odometer counts nothing."
    lasting: Span = quantity("1..5s", "m", "s", least=1e-3)

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _NoMotion(strikes)


class _NoMotion(Effect):
    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        return (replace(reading, motion=np.zeros(3)),)


@dataclass(frozen=True, kw_only=True)
class WheelSlip(LastingFault, ReadingFault):
    """While the robot pushes against something, one wheel spins."""

    name: ClassVar[str] = "wheel-slip"
    summary: ClassVar[str] = (
        "While the robot touches something, the odometer counts what one wheel spins."
    )
    needs: ClassVar[tuple[Need, ...]] = ("contact",)
    at: Span = quantity("0..5m", "m", "s")
    lasting: Span = quantity("60..120s", "m", "s", least=1e-3)
    speed: Span = quantity("0.1..0.5m/s", METRES_PER_SECOND, most=5.0)
    """Speed at which the wheel spins, besides what it drives."""
    base: Span = quantity("0.33m", METRES, least=0.01, most=5.0)
    """Distance between the wheels."""

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _Slip(strikes)


class _Slip(Effect):
    def __init__(self, strikes: Strikes) -> None:
        super().__init__(strikes)
        self._side = 1.0 if strikes.rng.integers(2) else -1.0

    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        if not moment.contact:
            return (reading,)
        way = self._values["speed"] * moment.interval
        slip = np.array((way / 2, 0.0, self._side * way / self._values["base"]))
        return (replace(reading, motion=compose(reading.motion, slip)),)
