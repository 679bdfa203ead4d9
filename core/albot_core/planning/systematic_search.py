"""Systematic search: loops of growing size around the place where the nest should be.

The third strategy of the desert ant (Wehner and Srinivasan 1981; Müller and Wehner 1994; Hossain's
thesis, section 2.3.1): the searching ant "immediately starts a non-random systematic search"; the
"paths are perfectly centred about the fictive position of the nest" and "do not show any azimuthal
bias". The loops' shape and growth are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Points
from albot_core.ranges import FROM_ONE, POSITIVE, check_fields

GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
"""Angle (rad) from the direction of one loop to that of the next: any number of successive
directions are spread evenly all round."""
_CORNERS = 8
"""Number of points on a loop."""


@dataclass(frozen=True, kw_only=True)
class SearchConfig:
    """The loops of a search."""

    first: float = 1.0
    """How far the first loop leads away from the nest (m)."""
    growth: float = 0.5
    """By how much farther each further loop leads (m)."""
    largest: float = 8.0
    """How far a loop leads away at the most (m)."""
    reached: float = 0.25
    """Distance at which a point of a loop counts as reached (m)."""
    loops: int = 20
    """Number of loops after which the search is given up."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "first", "growth", "largest", "reached")
        check_fields(self, FROM_ONE, "loops")


class SystematicSearch:
    """A search in loops that begin and end at the expected place of the nest.

    Args:
        config: The loops.
    """

    def __init__(self, config: SearchConfig | None = None) -> None:
        self.config = config or SearchConfig()
        self.begin(np.random.default_rng(0))

    def begin(self, rng: np.random.Generator) -> None:
        """Begin a search. The direction of its first loop, and the sense of all, are drawn."""
        self._direction = float(rng.uniform(-math.pi, math.pi))
        self._sense = 1.0 if rng.random() < 0.5 else -1.0
        self._loop, self._corner = 0, 1

    @property
    def is_over(self) -> bool:
        """Whether all loops are done."""
        return self._loop >= self.config.loops

    def target(self, position: Points) -> Float64[np.ndarray, "2"]:
        """Return the point to drive to; the nest's expected place once the search is over.

        Args:
            position: Where the robot is, from the nest's expected place (m), in a frame that does
                not turn.
        """
        while not self.is_over:
            point = self._point()
            if np.hypot(*(position - point)) > self.config.reached:
                return point
            self.skip()
        return np.zeros(2)

    def skip(self) -> None:
        """Go on to the next point: this one is reached, or cannot be."""
        self._corner += 1
        if self._corner > _CORNERS:
            self._loop, self._corner = self._loop + 1, 1
            self._sense = -self._sense

    def _point(self) -> Float64[np.ndarray, "2"]:
        """Return the present point: on a circle through the nest; the last one is the nest."""
        config = self.config
        radius = min(config.first + self._loop * config.growth, config.largest) / 2.0
        direction = self._direction + self._loop * GOLDEN_ANGLE
        angle = direction + math.pi + self._sense * 2.0 * math.pi * self._corner / _CORNERS
        middle = radius * np.array((math.cos(direction), math.sin(direction)))
        return middle + radius * np.array((math.cos(angle), math.sin(angle)))
