"""Random draws in whole centimetres, the same on every machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Item = TypeVar("Item")

STEP = 5
"""Lengths are drawn in steps of so many centimetres."""


class Dice:
    """Draws from a generator's uniform numbers, by arithmetic that is exact everywhere.

    Args:
        rng: Where the numbers come from.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._uniform = rng.random

    def whole(self, least: int, most: int) -> int:
        """A whole number from `least` to `most`, both included."""
        return least + int(self._uniform() * (most - least + 1))

    def length(self, least: int, most: int) -> int:
        """A length (cm) from `least` to about `most`, in steps of 5 cm from `least`."""
        return least + STEP * self.whole(0, max(0, most - least) // STEP)

    def chance(self, probability: float) -> bool:
        """True with a probability."""
        return self._uniform() < probability

    def pick(self, items: Sequence[Item]) -> Item:
        """One of the items."""
        return items[self.whole(0, len(items) - 1)]

    def shuffled(self, items: Sequence[Item]) -> list[Item]:
        """The items in any order."""
        rest = list(items)
        return [rest.pop(self.whole(0, len(rest) - 1)) for _ in items]

    def parts(self, total: int, number: int, least: int, *, even: bool = False) -> list[int]:
        """A length (cm) cut into so many parts of at least `least`, alike or not.

        What is over after cutting even parts goes to the last.
        """
        spare = total - number * least
        weights = [1 if even else self.whole(4, 12) for _ in range(number)]
        whole = sum(weights)
        parts = [least + spare * weight // whole for weight in weights]
        parts[-1] += total - sum(parts)
        return parts
