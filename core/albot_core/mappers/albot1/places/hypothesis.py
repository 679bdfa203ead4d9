"""Where a robot that was carried away may be, and how probable that is.

This is ours. Such a robot may be anywhere: in a place that it knows, at one of many poses, or on
ground that it has never seen. So each alignment of what it sees with what it knows is a
hypothesis, and that it is none of them is one, too. Their odds are weighed against each other:
where two alignments explain as much, neither is probable.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Pose
from albot_core.matching.lines import LineMatch

PRIOR = -1.21
"""Log odds of a hypothesis that has nothing for it, to unknown ground."""
OF_MATCH = 0.50
"""Added for each surface that is the same."""
OF_SEEN = -7.32
"""Added if all that was seen since is contradicted by what is known."""
OF_KNOWN = -20.90
"""Added if all that is known there is contradicted by what is in view."""


class Hypothesis(NamedTuple):
    """An alignment of what a lost robot has seen with a place that it knows."""

    place: int
    """The id of the place."""
    match: LineMatch
    """How their surfaces match."""
    map_to_graph: Pose
    """Where the graph frame would lie in the map (m, rad)."""
    seen_contradicted: float
    """The share of the walls seen since it is lost that what is known contradicts."""
    known_contradicted: float
    """The share of the known walls that what is in view contradicts."""
    probability: float = 0.0
    """How probable it is, among all hypotheses."""

    @property
    def log_odds(self) -> float:
        """Its log odds to unknown ground."""
        return (
            PRIOR
            + OF_MATCH * self.match.matches
            + OF_SEEN * self.seen_contradicted
            + OF_KNOWN * self.known_contradicted
        )


def weighed(hypotheses: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the hypotheses with their probabilities, which add up to less than 1.

    The rest is the probability that the robot is on unknown ground.
    """
    probabilities = _softmax(np.array([0.0, *(one.log_odds for one in hypotheses)]))[1:]
    return tuple(
        one._replace(probability=float(probability))
        for one, probability in zip(hypotheses, probabilities, strict=True)
    )


def _softmax(log_odds: Float64[np.ndarray, "all"]) -> Float64[np.ndarray, "all"]:
    odds = np.exp(log_odds - log_odds.max())
    return np.asarray(odds / odds.sum())
