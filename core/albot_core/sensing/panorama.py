"""The panorama: how far it is to what stands around a point, and how well two of them agree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Points, Pose
from albot_core.sensing.panorama_kernel import Agreed, agree_best, draw

DIRECTIONS = 180
"""Directions of a panorama, evenly over the full turn."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Panorama:
    """Distances (m) around a point; direction k begins at the angle 2πk / `DIRECTIONS`."""

    ranges: Float64[np.ndarray, "directions"]
    """How far it is in every direction (m); 0 where nothing was seen."""

    @classmethod
    def of(cls, points: Points) -> Panorama:
        """The panorama of points seen from the origin (m), of which the nearest count."""
        ranges = np.zeros(DIRECTIONS)
        draw(np.ascontiguousarray(points), ranges)
        return cls(ranges=ranges)


@dataclass(frozen=True, kw_only=True, eq=False)
class Agreement:
    """How one panorama lies best on another."""

    pose: Pose
    """Where the other one's frame lies in this one's."""
    agreed: float
    """Share of the directions, of both, in which one shows what the other does."""
    contradicted: float
    """Share of them in which one shows something where the other looks through."""
    sight: float
    """How far (m) each looks past the other's origin, the less of the two; negative where
    something stands between."""


def agreement(mine: Panorama, theirs: Panorama, *guesses: Pose) -> Agreement:
    """Lay one panorama on another, near to guesses of where its frame lies in mine.

    All shifts up to 1 m and turns up to 20° from each guess are tried on a grid, and the best is
    drawn nearer until nothing is gained (E. Olson, Real-time correlative scan matching, ICRA
    2009, searches so). What counts is agreement less contradiction: a wall of one that lies
    before the wall of the other would have been seen by it. What lies behind is hidden, and says
    nothing.
    """
    pose, best = np.zeros(3), Agreed(-np.inf, 0.0, 0.0, 0.0)
    for guess in guesses:
        tried = np.array(guess, np.float64)
        found = agree_best(mine.ranges, theirs.ranges, tried)
        if found.score > best.score:
            pose, best = tried, found
    return Agreement(
        pose=pose, agreed=best.agreed, contradicted=best.contradicted, sight=best.sight
    )
