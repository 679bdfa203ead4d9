"""Quantities with units that faults have: a range from which a number is drawn at each strike."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

import numpy as np

from albot_core.errors import InputError

METRES, SECONDS, METRES_PER_SECOND, DEGREES, PERCENT = "m", "s", "m/s", "deg", "%"
UNITS = {
    METRES: 1.0,
    SECONDS: 1.0,
    METRES_PER_SECOND: 1.0,
    DEGREES: math.pi / 180.0,
    PERCENT: 0.01,
}
"""Units, and what one of each is in metres, seconds, radians, or as a share."""
_NUMBER = r"-?(?:\d+(?:\.\d+)?|\.\d+)(?:[eE]-?\d+)?"
_SPAN = re.compile(rf"({_NUMBER})(?:\.\.({_NUMBER}))?([a-z%/]*)")


class Span(NamedTuple):
    """A range of numbers in a unit; both ends are the same for one number."""

    low: float
    """The smallest number, in the unit."""
    high: float
    """The largest number, in the unit."""
    unit: str
    """One of `UNITS`."""

    def draw(self, rng: np.random.Generator) -> float:
        """Draw a number uniformly (m, s, rad, or a share)."""
        return float(rng.uniform(self.low, self.high)) * UNITS[self.unit]

    def __str__(self) -> str:
        """Return the text that `parse_span` reads: `20m`, `0.5..5s`."""
        low, high = _text(self.low), _text(self.high)
        return f"{low}{self.unit}" if low == high else f"{low}..{high}{self.unit}"


def _text(number: float) -> str:
    return str(int(number)) if number == int(number) and abs(number) < 1e15 else repr(number)


def parse_span(text: str, source: str, place: str) -> Span:
    """Return the quantity that a text such as `20m` or `0.5..5s` tells.

    Args:
        text: The text.
        source: What it is given to, for the error.
        place: Name of the parameter, for the error.

    Raises:
        InputError: It is no number with a unit, is not finite, or its range is empty.
    """
    expected = f"a number or a range with a unit, one of {', '.join(UNITS)}, as 20m or 0.5..5s"
    found = _SPAN.fullmatch(text.strip())
    if found is None or found[3] not in UNITS:
        raise InputError(source, expected, repr(text), place=place)
    low = float(found[1])
    high = low if found[2] is None else float(found[2])
    if not (math.isfinite(low) and math.isfinite(high)):
        raise InputError(source, "finite numbers", repr(text), place=place)
    if low > high:
        raise InputError(source, "a range from a smaller to a larger number", text, place=place)
    return Span(low, high, found[3])
