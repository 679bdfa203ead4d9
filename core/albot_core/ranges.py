"""Ranges of numeric fields of configurations."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Iterable
from contextvars import ContextVar
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

from albot_core.errors import InputError


@dataclass(frozen=True)
class Range:
    """Numbers from `least` to `most`; True and False are none."""

    expected: str
    """The range as text, for the error."""
    least: float
    """Smallest number."""
    most: float = math.inf
    """Largest number."""
    beyond: bool = False
    """Whether `least` itself is excluded."""
    whole: bool = False
    """Whether only integers are allowed."""
    infinite: bool = False
    """Whether infinity is allowed where `most` is infinite."""

    def __contains__(self, value: object) -> bool:
        if isinstance(value, bool) or not isinstance(value, Integral if self.whole else Real):
            return False
        try:
            number = float(value)
        except OverflowError:  # An integer too large for a float.
            return False
        within = self.least < number <= self.most or (number == self.least and not self.beyond)
        return within and (self.infinite or math.isfinite(number))


FINITE = Range("a finite number", -math.inf)
POSITIVE = Range("a positive number", 0.0, beyond=True)
NOT_NEGATIVE = Range("a number from 0", 0.0)
COUNT = Range("a whole number from 0", 0.0, whole=True)
FROM_ONE = Range("a whole number from 1", 1.0, whole=True)
FROM_TWO = Range("a whole number from 2", 2.0, whole=True)
SHARE = Range("a number within [0, 1]", 0.0, 1.0)
LENGTH = Range("a length above 0, at most 1000 (m)", 0.0, 1000.0, beyond=True)
"""Lengths in a building (m)."""
CELL = Range("a side from 0.01 to 100 (m)", 0.01, 100.0)
"""Sides of the cells of a grid (m): smaller ones would fill all memory."""
CELLS = Range("a whole number from 2 to 1,024", 2.0, 1024.0, whole=True)
"""Numbers of cells along a side of a patch that is observed."""


_RECORDED: ContextVar[tuple[object, dict[str, Range]] | None] = ContextVar("ranges", default=None)
"""The configuration whose ranges `checked_ranges` is recording, and those recorded."""


def check_fields(config: object, allowed: Range, *names: str) -> None:
    """Check that fields of a configuration are numbers within a range.

    Args:
        config: The configuration, a dataclass.
        allowed: The range.
        names: Names of the fields.

    Raises:
        InputError: A field is not a number or out of range; the error names the first.
    """
    for name in names:
        value = getattr(config, name)
        if value not in allowed:
            raise InputError(f"{type(config).__name__}.{name}", allowed.expected, shown(value))
    recorded = _RECORDED.get()
    if recorded is not None and recorded[0] is config:
        recorded[1].update(dict.fromkeys(names, allowed))


def checked_ranges(config: Any) -> dict[str, Range]:
    """Return the ranges in which a configuration checks its fields, by the fields' names.

    They are recorded while the configuration checks itself once more. A field that is only checked
    if it is not None, and is None, has no range here.
    """
    found: dict[str, Range] = {}
    token = _RECORDED.set((config, found))
    try:
        if hasattr(config, "__post_init__"):
            config.__post_init__()
    finally:
        _RECORDED.reset(token)
    return found


def are_numbers(values: object, count: int | None = None) -> bool:
    """Whether it is a sequence of finite numbers, so many if a count is given."""
    if not isinstance(values, Iterable):
        return False
    numbers = list(values)
    return count in (None, len(numbers)) and all(number in FINITE for number in numbers)


def shown(value: object) -> str:
    """A value as an error shows it; of what is no number, such as the text "1.5", also its kind."""
    return str(value) if isinstance(value, Real) else reprlib.repr(value)
