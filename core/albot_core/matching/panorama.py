"""Panoramas: the distances to obstacles around a point in all directions, and their matching."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.pose_kernels import length_of, rotate_back, transform_point
from albot_core.geometry.types import Points, Pose
from albot_core.kernels.compiled import kernel

DIRECTIONS = 180
"""Number of directions of a panorama, evenly over the full turn."""
TOLERANCE, SLANT = 0.15, 0.03
"""Two distances agree in part if they differ by less than the first (m) plus this share of the
distance; otherwise they do not agree."""
REACH, GRID = 1.0, 0.5
"""Largest shift from a guess that is searched along each axis, and the grid's step (m)."""
TURN, TURN_STEP = math.radians(20.0), math.radians(5.0)
"""Largest turn from a guess that is searched, and the grid's step (rad)."""
FINEST = 0.03
"""Refinement halves its steps until they are no larger than this (m)."""
THINNED = 3
"""On the grid, only one in this many directions is compared."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Panorama:
    """Distances (m) around a point; direction k begins at the angle 2πk / `DIRECTIONS`."""

    ranges: Float64[np.ndarray, "directions"]
    """Distance in every direction (m); 0 where nothing was seen."""

    @classmethod
    def of(cls, points: Points) -> Panorama:
        """Return the panorama of points seen from the origin (m); the nearest ones count."""
        ranges = np.zeros(DIRECTIONS)
        _fill_ranges(np.ascontiguousarray(points), ranges)
        return cls(ranges=ranges)


@dataclass(frozen=True, kw_only=True, eq=False)
class PanoramaMatch:
    """Best alignment of one panorama with another."""

    pose: Pose
    """Pose of the other one's frame in this one's."""
    agreed: float
    """Share of the directions, of both, in which one panorama shows what the other does."""
    contradicted: float
    """Share of the directions, of both, in which one panorama shows an obstacle where the other saw
    free space."""
    sight: float
    """Distance that each panorama sees beyond the other's origin, the smaller of the two (m);
    negative if an obstacle is in between."""


def match_panoramas(mine: Panorama, theirs: Panorama, *guesses: Pose) -> PanoramaMatch:
    """Align one panorama with another, near guesses of the pose of its frame in mine.

    All shifts up to 1 m and turns up to 20° from each guess are tried on a grid. The best pose is
    refined until the score no longer grows (the search of E. Olson, Real-time correlative scan
    matching, ICRA 2009). The score is agreement less contradiction: if a wall of one panorama lies
    before the wall of the other, the other would have seen it. A wall that lies behind is hidden;
    it neither agrees nor contradicts.
    """
    pose, best = np.zeros(3), _Quality(-np.inf, 0.0, 0.0, 0.0)
    for guess in guesses:
        tried = np.array(guess, np.float64)
        found = _search(mine.ranges, theirs.ranges, tried)
        if found.score > best.score:
            pose, best = tried, found
    return PanoramaMatch(
        pose=pose, agreed=best.agreed, contradicted=best.contradicted, sight=best.sight
    )


class _Quality(NamedTuple):
    """How well two panoramas match under a pose (see `PanoramaMatch`)."""

    score: float
    """Score that the search maximises: agreement less contradiction."""
    agreed: float
    contradicted: float
    sight: float


@kernel(arrays=True)
def _search(mine: np.ndarray, theirs: np.ndarray, pose: np.ndarray) -> _Quality:
    """Find the best pose of `theirs` in `mine` (directions,) near `pose`; set `pose` to it."""
    spans = np.empty((mine.shape[0], 2)), np.empty((theirs.shape[0], 2))
    _range_spans(mine, spans[0])
    _range_spans(theirs, spans[1])
    points = _points(mine), _points(theirs)
    counts, tried, guess = np.zeros(3), np.empty(3), pose.copy()
    best = -math.inf
    for i in range(-int(REACH / GRID), int(REACH / GRID) + 1):
        for j in range(-int(REACH / GRID), int(REACH / GRID) + 1):
            for k in range(-int(TURN / TURN_STEP + 0.5), int(TURN / TURN_STEP + 0.5) + 1):
                tried[0], tried[1] = guess[0] + i * GRID, guess[1] + j * GRID
                tried[2] = guess[2] + k * TURN_STEP
                score = _score(spans, points, tried, THINNED, counts)
                if score > best:
                    best = score
                    pose[:] = tried
    best = _refine(spans, points, pose, counts)
    total = max(counts[0] + counts[1] + counts[2], 1.0)
    return _Quality(best, counts[0] / total, counts[1] / total, _sight(spans, pose))


@kernel()
def _range_spans(ranges: np.ndarray, spans: np.ndarray) -> None:
    """Fill `spans` (directions, 2): least and greatest range of a direction and its neighbours.

    Between two beams, a wall lies somewhere between their ranges. 0 where nothing was seen.
    """
    count = ranges.shape[0]
    for k in range(count):
        least, most = math.inf, 0.0
        for beside in (k - 1, k, (k + 1) % count):
            distance = ranges[beside]
            if distance > 0.0:
                least, most = min(least, distance), max(most, distance)
        spans[k, 0], spans[k, 1] = (least, most) if ranges[k] > 0.0 else (0.0, 0.0)


@kernel(arrays=True)
def _points(ranges: np.ndarray) -> np.ndarray:
    """Return the end points of the ranges (n, 2)."""
    points = np.empty((ranges.shape[0], 2))
    seen = 0
    for k in range(ranges.shape[0]):
        if ranges[k] > 0.0:
            angle = (k + 0.5) * 2.0 * math.pi / ranges.shape[0]
            points[seen, 0] = ranges[k] * math.cos(angle)
            points[seen, 1] = ranges[k] * math.sin(angle)
            seen += 1
    return points[:seen]


@kernel()
def _score(
    spans: tuple[np.ndarray, np.ndarray],
    points: tuple[np.ndarray, np.ndarray],
    pose: np.ndarray,
    step: int,
    counts: np.ndarray,
) -> float:
    """Return agreement less contradiction of both under a pose; tally them in `counts`."""
    counts[:] = 0.0
    _tally(spans[0], points[1], pose[0], pose[1], pose[2], step, counts)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = rotate_back(cos, sin, -pose[0], -pose[1])
    _tally(spans[1], points[0], x, y, -pose[2], step, counts)
    total = counts[0] + counts[1] + counts[2]
    return (counts[0] - counts[1]) / total if total > 0.0 else 0.0


@kernel()
def _tally(
    spans: np.ndarray,
    points: np.ndarray,
    x: float,
    y: float,
    turn: float,
    step: int,
    counts: np.ndarray,
) -> None:
    """Add to `counts` the points that agree with, contradict, or are hidden from a panorama.

    `x`, `y` and `turn` are the pose of the points' frame in the frame of `spans`.
    """
    cos, sin = math.cos(turn), math.sin(turn)
    count = spans.shape[0]
    for k in range(0, points.shape[0], step):
        u, v = transform_point((x, y, turn), cos, sin, points[k, 0], points[k, 1])
        direction = _direction(u, v, count)
        least, most = spans[direction, 0], spans[direction, 1]
        if most == 0.0:
            continue
        distance = length_of(u, v)
        slack = TOLERANCE + SLANT * distance
        if distance < least - slack:
            counts[1] += 1.0
        else:
            # Agreement falls with the distance, so that the search can climb.
            off = max(least - distance, distance - most, 0.0)
            counts[0] += max(0.0, 1.0 - off / slack)
            counts[2] += min(1.0, off / slack)


@kernel()
def _refine(
    spans: tuple[np.ndarray, np.ndarray],
    points: tuple[np.ndarray, np.ndarray],
    pose: np.ndarray,
    counts: np.ndarray,
) -> float:
    """Move to the best pose nearby in ever smaller steps; return its score."""
    best = _score(spans, points, pose, 1, counts)
    step = 0.5 * GRID
    while step > FINEST:
        better = False
        for axis in range(3):
            for sign in (-1.0, 1.0):
                before = pose[axis]
                pose[axis] = before + sign * step * (TURN_STEP / GRID if axis == 2 else 1.0)
                score = _score(spans, points, pose, 1, counts)
                if score > best:
                    best, better = score, True
                else:
                    pose[axis] = before
        if not better:
            step *= 0.5
    return _score(spans, points, pose, 1, counts)


@kernel()
def _sight(spans: tuple[np.ndarray, np.ndarray], pose: np.ndarray) -> float:
    """Return how far each panorama sees beyond the other's origin, the smaller of the two (m)."""
    apart = length_of(pose[0], pose[1])
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = rotate_back(cos, sin, -pose[0], -pose[1])
    past = math.inf
    for k in range(2):
        to_x, to_y = (pose[0], pose[1]) if k == 0 else (x, y)
        span = spans[k][_direction(to_x, to_y, spans[k].shape[0])]
        if span[1] > 0.0:
            past = min(past, span[0] - apart)
    return past


@kernel()
def _fill_ranges(points: np.ndarray, ranges: np.ndarray) -> None:
    """Set the ranges (directions,) to those of the nearest points (n, 2); the rest stay zero."""
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        direction = _direction(x, y, ranges.shape[0])
        distance = length_of(x, y)
        if ranges[direction] == 0.0 or distance < ranges[direction]:
            ranges[direction] = distance


@kernel()
def _direction(x: float, y: float, count: int) -> int:
    """Return the direction in which a point lies."""
    angle = math.atan2(y, x)
    share = angle / (2.0 * math.pi)
    return int((share - math.floor(share)) * count) % count
