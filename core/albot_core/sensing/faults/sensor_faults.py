"""Faults of the laser and of the sonars."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from albot_core.sensing.faults.effect import Effect, Moment, ReadingFault
from albot_core.sensing.faults.fault import LastingFault, Need, Strikes, quantity
from albot_core.sensing.faults.span import DEGREES, PERCENT, Span
from albot_core.sensing.reading import LaserScan, Reading

_LASER: tuple[Need, ...] = ("laser",)


def _with_ranges(reading: Reading, ranges: np.ndarray) -> Reading:
    scan = reading.required_laser("a fault")
    return replace(reading, laser=LaserScan(ranges=ranges, geometry=scan.geometry))


@dataclass(frozen=True, kw_only=True)
class LaserDropout(LastingFault, ReadingFault):
    """The laser returns nothing."""

    name: ClassVar[str] = "laser-dropout"
    summary: ClassVar[str] = "No beam of the laser returns."
    needs: ClassVar[tuple[Need, ...]] = _LASER

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _Dropout(strikes)


class _Dropout(Effect):
    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        beams = reading.required_laser("a fault").geometry.beams
        return (_with_ranges(reading, np.full(beams, np.inf)),)


@dataclass(frozen=True, kw_only=True)
class StuckBeams(LastingFault, ReadingFault):
    """Some beams go on reporting the range that they had when the fault struck."""

    name: ClassVar[str] = "stuck-beams"
    summary: ClassVar[str] = "Some beams, drawn at random, keep the range that they had."
    needs: ClassVar[tuple[Need, ...]] = _LASER
    lasting: Span = quantity("5..30s", "m", "s", least=1e-3)
    share: Span = quantity("5..30%", PERCENT, most=100.0)
    """Share of the beams that are stuck."""

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _Stuck(strikes)


class _Stuck(Effect):
    def __init__(self, strikes: Strikes) -> None:
        super().__init__(strikes)
        self._draws = int(strikes.rng.integers(2**63))

    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        if not self.held:
            self.held = [reading]
        scan, first = reading.required_laser("a fault"), self.held[0].required_laser("a fault")
        order = np.random.default_rng(self._draws).permutation(scan.geometry.beams)
        stuck = order[: round(self._values["share"] * scan.geometry.beams)]
        ranges = scan.ranges.copy()
        ranges[stuck] = first.ranges[stuck]
        return (_with_ranges(reading, ranges),)


@dataclass(frozen=True, kw_only=True)
class BlindSector(LastingFault, ReadingFault):
    """No beam of a sector returns: dirt, or sunlight."""

    name: ClassVar[str] = "blind-sector"
    summary: ClassVar[str] = "No beam of a sector, in a random direction, returns."
    needs: ClassVar[tuple[Need, ...]] = _LASER
    lasting: Span = quantity("5..30s", "m", "s", least=1e-3)
    width: Span = quantity("30..120deg", DEGREES, most=360.0)
    """Angle of the sector."""

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _Blind(strikes)


class _Blind(Effect):
    def __init__(self, strikes: Strikes) -> None:
        super().__init__(strikes)
        self._middle = float(strikes.rng.random())

    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        scan = reading.required_laser("a fault")
        bearings = scan.geometry.bearings
        middle = bearings[0] + self._middle * (bearings[-1] - bearings[0])
        is_blind = np.abs(bearings - middle) <= self._values["width"] / 2
        return (_with_ranges(reading, np.where(is_blind, np.inf, scan.ranges)),)


@dataclass(frozen=True, kw_only=True)
class FrozenScan(LastingFault, ReadingFault):
    """The laser reports the same scan again and again, while the robot moves on."""

    name: ClassVar[str] = "frozen-scan"
    summary: ClassVar[str] = "The laser reports one scan again and again."
    needs: ClassVar[tuple[Need, ...]] = _LASER
    lasting: Span = quantity("1..5s", "m", "s", least=1e-3)

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _Frozen(strikes)


class _Frozen(Effect):
    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        if not self.held:
            self.held = [reading]
        return (replace(reading, laser=self.held[0].laser),)


@dataclass(frozen=True, kw_only=True)
class SaturatedSonars(LastingFault, ReadingFault):
    """Sonars hear nothing but noise, and report their minimum range at once."""

    name: ClassVar[str] = "saturated-sonars"
    summary: ClassVar[str] = "Some sonars, drawn at random, report their minimum range."
    needs: ClassVar[tuple[Need, ...]] = ("sonar",)
    share: Span = quantity("50..100%", PERCENT, most=100.0)
    """Share of the sonars that are saturated; at least one is."""

    def effect(self, strikes: Strikes) -> Effect:
        """Return the effect of the strike that begins."""
        return _Saturated(strikes)


class _Saturated(Effect):
    def __init__(self, strikes: Strikes) -> None:
        super().__init__(strikes)
        self._draws = int(strikes.rng.integers(2**63))

    def pass_on(self, reading: Reading, moment: Moment) -> Sequence[Reading]:
        scan = reading.required_sonar("a fault")
        count = len(scan.ranges)
        order = np.random.default_rng(self._draws).permutation(count)
        ranges = scan.ranges.copy()
        ranges[order[: max(1, math.ceil(self._values["share"] * count - 1e-9))]] = (
            scan.geometry.min_range
        )
        return (replace(reading, sonar=replace(scan, ranges=ranges)),)
