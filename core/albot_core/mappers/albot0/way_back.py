"""The way home along the way out, and the ASRs of the way out in which the robot may be.

The paper does not say how its robot chooses where to go on its way home: this is ours, and so is
the cue `way` that rests on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree
from shapely import STRtree

from albot_core.geometry.poses import inverse, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.albot0.localisation import Confidences
from albot_core.mappers.albot0.particles import Particles
from albot_core.mappers.albot0.regions import Regions
from albot_core.mappers.albot0.steps import Steps
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, check_fields

_GAP = 0.5
"""Spacing of the points that represent the way out (m)."""
_BESIDE = 1.5
"""The robot can go straight between two points of the way out that are no farther apart (m), if no
surface is between them."""
_AROUND = 3.0
"""Points of the way out nearer to the robot than this (m) are ignored if they are behind a surface,
unless all of them are."""
_LEAST = 1e-9
"""Minimum distance between two points of the way out (m)."""
_LOOP = 0.99
"""Of several ASRs equally near to a point, the one nearest home gets 1 and the others this value,
so that loops of the way out, such as a room looked into, are left out."""


@dataclass(frozen=True, kw_only=True)
class WayBackConfig:
    """Thresholds of the way home along the way out."""

    same: float = 0.75
    """The robot may be on any part of the way out that is at most this much farther away (m) than
    the nearest part, because its position is no better known."""
    near: float = 0.5
    """Standard deviation of the excess distance of the robot's ASR over the nearest one (m). It
    makes two ASRs about equally likely where they meet."""
    ahead: float = 1.5
    """Distance of the point ahead that is shown to the robot (m)."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, "same")
        check_fields(self, POSITIVE, "near", "ahead")


class WayBack:
    """The way home from where the robot may be.

    Args:
        out: The steps of the way out, at least one.
        surfaces: The surfaces beside the way out, and beside the way home so far (m).
        particles: The robot's possible poses, in the frame of the way out.
        frame: The pose of that frame in the odometer's frame.
        config: Thresholds of the way home.
    """

    def __init__(
        self,
        out: Steps,
        surfaces: Segments,
        particles: Particles,
        frame: Pose,
        config: WayBackConfig,
    ) -> None:
        self._out = out
        self._surfaces = surfaces
        self._particles = particles
        self._frame = frame
        self._config = config

    @cached_property
    def _laid(self) -> tuple[Points, Int64[np.ndarray, "points"]]:
        """The points along the way out, and the step of each point."""
        return _points_along(self._out.lines, _GAP)

    def border(self, step: int) -> Segments:
        """Return the line across the way out where a step begins, in the odometer's frame (m)."""
        line = self._out.part(slice(step, step + 1)).swaths[:, :2].reshape(1, 4)
        return transform_segments(self._frame, line)

    def fit(self, regions: Regions) -> Confidences:
        """Return how well each ASR of the way out fits where the robot may be; the best one has 1.

        A particle fits the ASRs that are about as near as the nearest one.
        """
        config, (points, steps) = self._config, self._laid
        starts = np.searchsorted(steps, regions.splits[:-1])
        away = np.hypot(*np.moveaxis(self._particles.poses[:, None, :2] - points, -1, 0))
        nearest = np.minimum.reduceat(away, starts, axis=1)
        farther = nearest - nearest.min(axis=1, keepdims=True)
        fits = _LOOP * np.exp(-0.5 * (farther / config.near) ** 2)
        first = (farther <= config.same).argmax(axis=1)
        fits[np.arange(len(fits)), first] = 1.0
        fitted = self._particles.weights @ fits
        return np.asarray(fitted / fitted.max())

    def ahead(self, pose: Pose) -> tuple[Points, float]:
        """Return a point a little ahead on the way home, and the length of the way home (m).

        The way home begins at the nearest point of the way out without a surface in between. The
        point ahead is NaN if home is nearer.

        Args:
            pose: The robot's pose by the odometer.
        """
        (left, towards_home), (points, _) = self._way_home, self._laid
        robot = transform_points(inverse(self._frame), pose[:2])
        away = np.hypot(*(robot - points).T)
        around = np.flatnonzero(away <= _AROUND)
        barred = self._barred(np.broadcast_to(robot, (len(around), 2)), points[around])
        if not barred.all():
            # A trail that bends passes behind walls. If all points are barred, a surface is wrong.
            away[around[barred]] = np.inf
        is_near = away <= away.min() + self._config.near
        total = np.where(is_near, away + left, np.inf)
        goal = int(total.argmin())
        length = float(total[goal])
        while goal > 0 and left[goal] > length - self._config.ahead:
            goal = int(towards_home[goal])
        point = points[goal] if goal > 0 else np.full(2, np.nan)
        return transform_points(self._frame, point), length

    def _barred(self, places: Points, others: Points) -> Bool[np.ndarray, "ways"]:
        """Return whether a surface lies between each place and the same one of `others` (m)."""
        ways = shapely.linestrings(np.stack((places, others), axis=1))
        barred = np.zeros(len(ways), np.bool_)
        barred[self._walls.query(ways, predicate="intersects")[0]] = True
        return barred

    @cached_property
    def _walls(self) -> STRtree:
        return STRtree(shapely.linestrings(self._surfaces.reshape(-1, 2, 2)))

    @cached_property
    def _way_home(self) -> tuple[Float64[np.ndarray, "points"], Int64[np.ndarray, "points"]]:
        """The length of the way home from each point of the way out (m), and the next point on it.

        Where the way out passes again, with no surface in between, its loop is cut off.
        """
        points, count = self._laid[0], len(self._laid[0])
        pairs = KDTree(points).query_pairs(_BESIDE, output_type="ndarray")
        beside = pairs[pairs[:, 1] - pairs[:, 0] > 1]
        beside = beside[~self._barred(*points[beside].swapaxes(0, 1))]
        along = np.stack((np.arange(count - 1), np.arange(1, count)), axis=-1)
        one, other = np.concatenate((along, beside)).T
        lengths = np.maximum(np.hypot(*(points[one] - points[other]).T), _LEAST)
        links = coo_array((lengths, (one, other)), shape=(count, count))
        left, before = dijkstra(links, directed=False, indices=0, return_predecessors=True)
        return left, before.astype(np.int64)


def _points_along(lines: Segments, gap: float) -> tuple[Points, Int64[np.ndarray, "points"]]:
    """Return points along line segments, about `gap` apart (m), and the segment of each point."""
    counts = np.maximum(np.round(np.hypot(*(lines[:, 2:] - lines[:, :2]).T) / gap), 1).astype(int)
    index = np.repeat(np.arange(len(lines)), counts)
    place = np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = ((place + 0.5) / counts[index])[:, None]
    return lines[index, :2] + share * (lines[index, 2:] - lines[index, :2]), index
