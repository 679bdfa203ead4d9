"""How well places are recognised by their structure: precision and recall.

Along a log whose true poses are known the robot describes, every SPACING of its way, where it
is: the surfaces within SIGHT of it in the views of the last TRAIL, laid together by its
odometer. Each description is compared (`albot1.structure.compare`, wherever and however turned)
with all of those from at least APART of its way before, and claims that it is the one with
which it has most surfaces in common; of equals the one with the greater share of length.

A claim is right where the two true positions are within NEAR of each other, whatever the
headings. A description is a *query* where any of those that it is compared with is so near:
it could be recognised. With claims counted only from some score on, *precision* is the share of
them that is right, false alarms at places never seen before included, and *recall* the share of
queries with a right claim. Granström et al. (2011) measure pairs of laser scans likewise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.albot1.config import Alike, PlacesConfig
from albot_core.albot1.structure import compare, joined
from albot_core.geometry.poses import inverse, transform_segments
from albot_core.geometry.types import Poses, Segments
from albot_core.perception.reading import Reading
from albot_core.perception.view import ViewConfig, construct_view

SPACING = 3.0
"""A description is made so often (m)…"""
SIGHT = 8.0
"""…of what is no farther than this from the robot (m), and was seen in the last…"""
TRAIL = 8.0
"""…of its way (m)."""
APART = 10.0
"""Descriptions nearer along the way are not compared (m)."""
NEAR = 3.0
"""True positions no farther apart than this are one place (m)."""
LARGEST = 28
"""Of a description only so many surfaces are kept, the longest."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recognition:
    """All claims, and how many queries there were."""

    scores: Float64[np.ndarray, "claims"]
    """Matching surfaces of each claim, and as a fraction the share of length, below 1."""
    right: Bool[np.ndarray, "claims"]
    """Whether it is right."""
    queries: int
    """How many descriptions could be recognised."""

    @property
    def curve(self) -> Float64[np.ndarray, "thresholds 2"]:
        """Recall and precision with ever fewer surfaces asked for; a row for each score."""
        order = np.argsort(-self.scores, kind="stable")
        scores, right = self.scores[order], np.cumsum(self.right[order])
        last = np.flatnonzero(np.append(scores[1:] != scores[:-1], True)[: len(scores)])
        claims = last + 1.0
        return np.stack((right[last] / max(self.queries, 1), right[last] / claims), -1)

    def recall_at(self, precision: float) -> float:
        """The greatest recall at which the precision is at least this; 0 where it never is."""
        recalls = [recall for recall, reached in self.curve.tolist() if reached >= precision]
        return max(recalls, default=0.0)


def measure_recognition(
    readings: Sequence[Reading], truth: Poses, alike: Alike | None = None
) -> Recognition:
    """Measure how well the places of a log are recognised.

    Args:
        readings: What the robot sensed.
        truth: Where it truly was at each reading (m, rad).
        alike: What is taken for the same; by default the default mapper's thresholds, with
            the place looked for anywhere.
    """
    alike = alike or PlacesConfig.improved().alike._replace(shift=np.inf, turn=np.pi)
    at, ways, described = _describe(readings, alike)
    where = truth[at, :2]
    nowhere = np.zeros(3)
    scores, right, queries = [], [], 0
    for k, mine in enumerate(described):
        earlier = np.flatnonzero(ways <= ways[k] - APART)
        if not len(earlier):
            continue
        near = np.hypot(*(where[earlier] - where[k]).T) <= NEAR
        queries += bool(near.any())
        found = [compare(mine, described[j], nowhere, nowhere, alike) for j in earlier]
        score = np.array([likeness.matches + 0.999 * min(likeness.share, 1) for likeness in found])
        best = int(np.argmax(score))
        scores.append(score[best])
        right.append(near[best])
    return Recognition(scores=np.array(scores, float), right=np.array(right, bool), queries=queries)


def _describe(
    readings: Sequence[Reading], alike: Alike
) -> tuple[list[int], Float64[np.ndarray, "descriptions"], list[Segments]]:
    """The readings at which a description is made, the way to them (m), and what it is."""
    config = ViewConfig(fit_lines=True)
    steps = [float(np.hypot(*reading.motion[:2])) for reading in readings]
    ways = np.cumsum([0.0, *steps[1:]])
    seen, since = np.empty((0, 4)), np.empty(0)
    at: list[int] = []
    described = []
    for k, reading in enumerate(readings):
        if k:
            seen = transform_segments(inverse(reading.motion), seen)
        view = construct_view(reading.laser, config).surfaces
        seen, since = _laid(seen, since, view, float(ways[k]), alike)
        if ways[k] >= (ways[at[-1]] + SPACING if at else 0.0):
            at.append(k)
            described.append(_longest(seen))
    return at, ways[at], described


def _laid(
    seen: Float64[np.ndarray, "old 4"],
    since: Float64[np.ndarray, "old"],
    view: Float64[np.ndarray, "new 4"],
    way: float,
    alike: Alike,
) -> tuple[Float64[np.ndarray, "kept 4"], Float64[np.ndarray, "kept"]]:
    """The surfaces near and not long seen, with a view; and where on the way each was seen."""
    both = joined(seen, view, alike)
    known = {surface.tobytes(): when for surface, when in zip(seen, since, strict=True)}
    when = np.array([known.get(surface.tobytes(), way) for surface in both])
    middles = 0.5 * (both[:, :2] + both[:, 2:])
    kept = (np.hypot(middles[:, 0], middles[:, 1]) <= SIGHT) & (when >= way - TRAIL)
    return both[kept], when[kept]


def _longest(surfaces: Float64[np.ndarray, "all 4"]) -> Float64[np.ndarray, "kept 4"]:
    """The longest surfaces, as many as are kept."""
    lengths = np.hypot(*(surfaces[:, 2:] - surfaces[:, :2]).T)
    return surfaces[np.sort(np.argsort(-lengths, kind="stable")[:LARGEST])]
