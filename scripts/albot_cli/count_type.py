"""The type of all options that are whole numbers."""

from __future__ import annotations

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
