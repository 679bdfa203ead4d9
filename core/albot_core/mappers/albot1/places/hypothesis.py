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
from albot_core.matching.line_matching import LineMatch

PRIOR = -3.20
"""Log odds of a hypothesis that has nothing for it, to unknown ground."""
OF_MATCH = 0.52
"""Added for each surface that is the same."""
OF_SHARE = 1.98
"""Added if all of the smaller description is the same."""
OF_MISSING = -18.74
"""Added if all known walls that should be in view are missing."""
OF_ACROSS = -0.94
"""Added for each piece of a wall seen that lies across a way known to be free."""


class Hypothesis(NamedTuple):
    """An alignment of what a lost robot has seen with a place that it knows."""

    place: int
    """The id of the place."""
    match: LineMatch
    """How their surfaces match."""
    map_to_graph: Pose
    """Where the graph frame would lie in the map (m, rad)."""
    missing: float
    """The share of the known walls that are missing in view."""
    across: int
    """How many pieces of the walls seen since it is lost lie across ways known to be free."""
    probability: float = 0.0
    """How probable it is, among all hypotheses."""

    @property
    def log_odds(self) -> float:
        """Its log odds to unknown ground."""
        return (
            PRIOR
            + OF_MATCH * self.match.matches
            + OF_SHARE * self.match.share
            + OF_MISSING * self.missing
            + OF_ACROSS * self.across
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
