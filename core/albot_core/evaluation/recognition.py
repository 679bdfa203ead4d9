"""Place recognition by structure: precision and recall of places, detection rate of pairs.

Along a log with known true poses, a local submap is built every few metres: the scans of the last
part of the path, joined by the estimated motion. Each submap is matched with all submaps at least
MIN_PATH_APART earlier on the path, at any position in the map and any rotation (`match_submaps`).

**Places.** Every submap claims the place of the submap that it matches best. A claim is right if
the two true positions are within NEAR of each other, at any heading. A submap is a *query* if any
submap that it is matched with is within NEAR, so that it could be recognised. If only claims above
a match score count, *precision* is the share of right claims among them (false alarms at new places
included), and *recall* is the share of queries with a right claim.

**Pairs.** Every pair of submaps is a test, as in Granström et al. (2009, 2011), who distinguish
pairs of laser scans taken within 3 m of each other from others. The *detection rate* is the share
of pairs within NEAR that are found, the *false alarm rate* the share of all other pairs that are
found. There is no margin between the two classes: the others begin just beyond NEAR.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.drawing.palette import BELIEVED, RULE
from albot_core.geometry.poses import relative
from albot_core.geometry.types import Poses
from albot_core.matching.line_matching import MatchConfig
from albot_core.matching.submaps import local_submaps, match_submaps
from albot_core.sensing.reading import Reading

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MIN_PATH_APART = 10.0
"""Least path length between two submaps that are matched (m)."""
NEAR = 3.0
"""Largest distance of true positions of the same place (m)."""
MAX_SHIFT = 0.9 * NEAR
"""Largest distance of the frames of two matching submaps, after alignment (m)."""
MAX_MOTION_DIFFERENCE = 0.5
"""Difference between estimated and odometer motion (m) above which the mapper has corrected its
pose; the odometer's motion is used there."""
NO_MATCH = -9.0
"""Score of pairs that do not match; lower than the score of any matching pair."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recognition:
    """All claims, the number of queries, and all pairs."""

    scores: Float64[np.ndarray, "claims"]
    """The match score of each claim."""
    right: Bool[np.ndarray, "claims"]
    """Whether each claim is right."""
    queries: int
    """Number of submaps that could be recognised."""
    pair_scores: Float64[np.ndarray, "pairs"]
    """The match score of each pair of submaps."""
    pair_near: Bool[np.ndarray, "pairs"]
    """Whether the true positions of each pair are the same place."""

    @property
    def curve(self) -> Float64[np.ndarray, "thresholds 2"]:
        """Recall and precision, one row per threshold on the match score, in falling order."""
        counts = _counted(self.scores, self.right)
        return np.stack((counts[:, 0] / max(self.queries, 1), counts[:, 0] / counts.sum(1)), -1)

    def recall_at(self, precision: float) -> float:
        """Return the largest recall at a precision of at least `precision`; 0 if there is none."""
        recalls = [recall for recall, reached in self.curve.tolist() if reached >= precision]
        return max(recalls, default=0.0)

    @property
    def pair_curve(self) -> Float64[np.ndarray, "thresholds 2"]:
        """Detection rate and false alarm rate of pairs, one row per threshold, in falling order."""
        near = int(self.pair_near.sum())
        totals = np.maximum((near, len(self.pair_near) - near), 1)
        return _counted(self.pair_scores, self.pair_near) / totals

    def detection_at(self, false_alarms: float) -> float:
        """Return the largest detection rate at a false alarm rate of at most `false_alarms`."""
        rates = [found for found, wrong in self.pair_curve.tolist() if wrong <= false_alarms]
        return max(rates, default=0.0)


def _counted(
    scores: Float64[np.ndarray, "all"], right: Bool[np.ndarray, "all"]
) -> Float64[np.ndarray, "thresholds 2"]:
    """Return how many are right and wrong at or above each score, in falling order of scores."""
    order = np.argsort(-scores, kind="stable")
    scores, hits = scores[order], np.cumsum(right[order])
    last = np.flatnonzero(np.append(scores[1:] != scores[:-1], True)[: len(scores)])
    return np.stack((hits[last], last + 1 - hits[last]), -1).astype(float)


def measure_recognition(
    readings: Sequence[Reading], truth: Poses, believed: Poses | None = None
) -> Recognition:
    """Measure how well the places of a log are recognised.

    Args:
        readings: The log's readings.
        truth: The true pose at each reading (m, rad); used only to score.
        believed: A mapper's estimated poses, in the map's frame (m, rad); by default those by
            odometry.
    """
    config = MatchConfig(max_shift=NEAR, max_turn=np.pi)
    submaps = local_submaps(readings, _motions(readings, believed), config)
    where = truth[[submap.reading for submap in submaps], :2]
    ways = np.array([submap.way for submap in submaps])
    claims, right, queries = [], [], 0
    all_scores, all_near = [np.empty(0)], [np.empty(0, np.bool_)]
    for k, mine in enumerate(submaps):
        earlier = np.flatnonzero(ways <= ways[k] - MIN_PATH_APART)
        if not len(earlier):
            continue
        near = np.hypot(*(where[earlier] - where[k]).T) <= NEAR
        scores = np.empty(len(earlier))
        for i, j in enumerate(earlier.tolist()):
            match = match_submaps(mine, submaps[j], config)
            scores[i] = match.score if np.hypot(*match.pose[:2]) <= MAX_SHIFT else NO_MATCH
        queries += bool(near.any())
        best = int(np.argmax(scores))
        if scores[best] > NO_MATCH:
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
    """Return the estimated motion to each reading from the one before (m, rad)."""
    motions = np.array([reading.motion for reading in readings])
    if believed is None:
        return motions
    steps = motions.copy()
    steps[1:] = relative(believed[:-1], believed[1:])
    leaps = np.hypot(*(steps - motions)[:, :2].T) > MAX_MOTION_DIFFERENCE
    steps[leaps] = motions[leaps]
    return steps


def precision_recall_figure(title: str, curve: Float64[np.ndarray, "thresholds 2"]) -> Figure:
    """Return the figure of a precision-recall curve."""
    # Imported here because it is slow to load and most runs draw nothing.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 5.0), layout="constrained")
    axes = figure.add_subplot(
        xlim=(0.0, 1.0), ylim=(0.0, 1.03), xlabel="recall", ylabel="precision", title=title
    )
    axes.grid(color=RULE, linewidth=0.6)
    axes.plot(curve[:, 0], curve[:, 1], color=BELIEVED, linewidth=1.6, marker=".")
    return figure
