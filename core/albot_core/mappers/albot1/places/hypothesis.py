"""Hypotheses of where a robot that was carried away may be, and their probabilities.

This is ours. Such a robot may be anywhere: in a known place, at one of many poses, or on unknown
ground. So each alignment of what it sees with what it knows is a hypothesis, and unknown ground is
one more. Their odds are weighed against each other: if two alignments explain equally much, neither
is probable.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Pose
from albot_core.matching.line_matching import LineMatch

PRIOR = -3.20
"""Log odds of a hypothesis without any evidence, relative to unknown ground."""
OF_MATCH = 0.52
"""Added to the log odds for each matching surface."""
OF_SHARE = 1.98
"""Added to the log odds if all of the smaller description matches."""
OF_MISSING = -18.74
"""Added to the log odds if all known walls that should be in view are missing."""
OF_ACROSS = -0.94
"""Added to the log odds for each piece of a seen wall that lies across a way known to be free."""


class Hypothesis(NamedTuple):
    """An alignment of what a lost robot has seen with a known place."""

    place: int
    """The id of the place."""
    match: LineMatch
    """How their surfaces match."""
    map_to_graph: Pose
    """The resulting pose of the graph frame in the map (m, rad)."""
    missing: float
    """The share of missing walls among the known walls that should be in view."""
    across: int
    """Number of pieces of the walls seen since the robot is lost that lie across free ways."""
    probability: float = 0.0
    """The probability among all hypotheses."""

    @property
    def log_odds(self) -> float:
        """The log odds relative to unknown ground."""
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
