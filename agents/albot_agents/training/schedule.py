"""Schedules: numbers that change in the course of a training."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from albot_core.errors import InputError

_LINEAR = re.compile(r"lin_([^_]+)(?:_([^_]+))?")


@dataclass(frozen=True)
class Schedule:
    """A number that goes evenly from one value to another."""

    first: float
    """Its value at the beginning…"""
    last: float
    """…and at the end."""

    def __call__(self, remaining: float | int) -> float:
        """The value when this share of the training is still to come."""
        return self.last + (self.first - self.last) * remaining


def parse_schedule(value: float | str, name: str) -> Schedule:
    """The schedule that a number stands for, or `lin_A` (from A to 0), or `lin_A_B`.

    Args:
        value: What is written.
        name: What is scheduled, for the error.

    Raises:
        InputError: It is none of these, or a value of it is negative or not finite.
    """
    expected = "a number from 0, lin_A or lin_A_B"
    try:
        if isinstance(value, str):
            found = _LINEAR.fullmatch(value)
            if found is None:
                raise ValueError
            schedule = Schedule(float(found[1]), float(found[2] or 0))
        else:
            schedule = Schedule(value, value)
    except ValueError:
        raise InputError(name, expected, str(value)) from None
    if not (0 <= schedule.first < math.inf and 0 <= schedule.last < math.inf):
        raise InputError(name, expected, str(value))
    return schedule
