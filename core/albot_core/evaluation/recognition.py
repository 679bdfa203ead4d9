"""How well places are recognised by what is seen there: precision and recall, and detection.

Along a log whose true poses are known the robot keeps, every few metres of its way, an outlook:
what it saw in the last part of it, laid together by how it believed to move. Each is held
against all those from at least APART of way before, wherever the map has them and however turned
(`agreement`).

**Places.** Every outlook claims to be where the one is with which it agrees best. A claim is
right where the two true positions are within NEAR of each other, whatever the headings. An
outlook is a *query* where any of those that it is held against is so near: it could be
recognised. With claims counted only from some agreement on, *precision* is the share of them
that is right, false alarms at places never seen before included, and *recall* the share of
queries with a right claim.

**Pairs.** Every pair of outlooks is a test, as in Granström et al. (2009, 2011), who tell pairs of
laser scans taken within 3 m of each other from others. The *detection rate* is the share found
of the pairs that are within NEAR, the *false alarm rate* the share taken for such of all others.
There is no gap between: the others begin just beyond NEAR.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.geometry.poses import relative
from albot_core.geometry.types import Poses
from albot_core.matching.lines import MatchConfig
from albot_core.matching.submaps import local_submaps, match_submaps
from albot_core.sensing.reading import Reading

APART = 10.0
"""Outlooks nearer along the way are not compared (m)."""
NEAR = 3.0
"""True positions no farther apart than this are one place (m)."""
SURELY = 0.9 * NEAR
"""Two are taken for one only where they seem to be no farther apart than this (m)."""
LEAP = 0.5
"""Where belief and odometer differ by more from one reading to the next (m), the robot did not
move so but found out where it was: there the odometer is believed."""
NEVER = -9.0
"""What is not taken for the same agrees so well, which is less than any that is."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recognition:
    """All claims, how many queries there were, and all pairs."""

    scores: Float64[np.ndarray, "claims"]
    """How well each claim's outlooks agree."""
    right: Bool[np.ndarray, "claims"]
    """Whether it is right."""
    queries: int
    """How many outlooks could be recognised."""
    pair_scores: Float64[np.ndarray, "pairs"]
    """How well each pair of outlooks agrees."""
    pair_near: Bool[np.ndarray, "pairs"]
    """Whether they truly are of one place."""

    @property
    def curve(self) -> Float64[np.ndarray, "thresholds 2"]:
        """Recall and precision with ever less agreement asked for; a row for each score."""
        counts = _counted(self.scores, self.right)
        return np.stack((counts[:, 0] / max(self.queries, 1), counts[:, 0] / counts.sum(1)), -1)

    def recall_at(self, precision: float) -> float:
        """The greatest recall at which the precision is at least this; 0 where it never is."""
        recalls = [recall for recall, reached in self.curve.tolist() if reached >= precision]
        return max(recalls, default=0.0)

    @property
    def pair_curve(self) -> Float64[np.ndarray, "thresholds 2"]:
        """Detection and false alarm rate of pairs with ever less agreement asked for."""
        near = int(self.pair_near.sum())
        totals = np.maximum((near, len(self.pair_near) - near), 1)
        return _counted(self.pair_scores, self.pair_near) / totals

    def detection_at(self, false_alarms: float) -> float:
        """The greatest detection rate with no more than this share of false alarms."""
        rates = [found for found, wrong in self.pair_curve.tolist() if wrong <= false_alarms]
        return max(rates, default=0.0)


def _counted(
    scores: Float64[np.ndarray, "all"], right: Bool[np.ndarray, "all"]
) -> Float64[np.ndarray, "thresholds 2"]:
    """How many are right, and how many wrong, from each score on, the greatest first."""
    order = np.argsort(-scores, kind="stable")
    scores, hits = scores[order], np.cumsum(right[order])
    last = np.flatnonzero(np.append(scores[1:] != scores[:-1], True)[: len(scores)])
    return np.stack((hits[last], last + 1 - hits[last]), -1).astype(float)


def measure_recognition(
    readings: Sequence[Reading], truth: Poses, believed: Poses | None = None
) -> Recognition:
    """Measure how well the places of a log are recognised.

    Args:
        readings: What the robot sensed.
        truth: Where it truly was at each reading (m, rad). It tells right from wrong alone.
        believed: Where a mapper believed it to be, in its map's frame; by default as its
            odometer says.
    """
    config = MatchConfig(max_shift=NEAR, max_turn=np.pi)
    submaps = local_submaps(readings, _motions(readings, believed), config)
    where = truth[[submap.reading for submap in submaps], :2]
    ways = np.array([submap.way for submap in submaps])
    claims, right, queries = [], [], 0
    all_scores, all_near = [np.empty(0)], [np.empty(0, np.bool_)]
    for k, mine in enumerate(submaps):
        earlier = np.flatnonzero(ways <= ways[k] - APART)
        if not len(earlier):
            continue
        near = np.hypot(*(where[earlier] - where[k]).T) <= NEAR
        scores = np.empty(len(earlier))
        for i, j in enumerate(earlier.tolist()):
            match = match_submaps(mine, submaps[j], config)
            scores[i] = match.score if np.hypot(*match.pose[:2]) <= SURELY else NEVER
        queries += bool(near.any())
        best = int(np.argmax(scores))
        if scores[best] > NEVER:
            claims.append(scores[best])
            right.append(near[best])
        all_scores.append(scores)
        all_near.append(near)
    return Recognition(
        scores=np.array(claims, float),
        right=np.array(right, bool),
        queries=queries,
        pair_scores=np.concatenate(all_scores),
        pair_near=np.concatenate(all_near),
    )


def _motions(readings: Sequence[Reading], believed: Poses | None) -> Poses:
    """How the robot believed to move to each reading from the one before (m, rad)."""
    motions = np.array([reading.motion for reading in readings])
    if believed is None:
        return motions
    steps = motions.copy()
    steps[1:] = relative(believed[:-1], believed[1:])
    leaps = np.hypot(*(steps - motions)[:, :2].T) > LEAP
    steps[leaps] = motions[leaps]
    return steps
