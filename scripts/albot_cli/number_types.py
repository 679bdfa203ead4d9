"""The types of all options that are numbers."""

from __future__ import annotations

import math
from decimal import Decimal, InvalidOperation
from typing import Any

import click


class CountType(click.IntRange):
    """A whole number within a range, also as `1e6` or `1_000_000`."""

    name = "whole number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number; fail as `click.IntRange` does."""
        try:
            number = Decimal(value)
            # Of a number with a large exponent no `int` is made: it would have as many digits.
            if number.is_finite() and number.adjusted() < 100 and number == int(number):
                value = int(number)
        except (InvalidOperation, TypeError, ValueError):
            pass  # The message of the range says what is wrong.
        return super().convert(value, param, ctx)


class RealType(click.FloatRange):
    """A number within a range; NaN is in none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number; fail as `click.FloatRange` does."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value} is not in the range {self._describe_range()}.", param, ctx)
        return number
