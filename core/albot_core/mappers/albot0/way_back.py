"""The way home along the way out, and in which of its ASRs the robot may be.

The paper does not tell how its robot chooses where to go on its way home: this is ours, and so is
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
"""The way out is given by points so far apart (m)."""
_BESIDE = 1.5
"""Between two points of the way out no farther apart (m) the robot can go straight, if there is no
surface between."""
_AROUND = 3.0
"""Of the points of the way out nearer to the robot than this (m), those behind a surface do not
count, unless all lie behind one."""
_LEAST = 1e-9
"""No two points of the way out are taken to be nearer to each other than this (m)."""
_LOOP = 0.99
"""Of the ASRs that a place is equally near to, the one nearest home wins by this: loops of the way
out, such as a room looked into, are left out."""


@dataclass(frozen=True, kw_only=True)
class WayBackConfig:
    """How the way home leads along the way out."""

    same: float = 0.75
    """Where the way out comes by that much farther away (m) than where it is nearest, or less, the
    robot may be on either part of it: it knows its position no better."""
    near: float = 0.5
    """Standard deviation of how much farther away than the nearest an ASR is that the robot may be
    in (m). So two are about as likely where they meet."""
    ahead: float = 1.5
    """The robot is shown a point so far ahead (m)."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, "same")
        check_fields(self, POSITIVE, "near", "ahead")


class WayBack:
    """The way home from where the robot may be.

    Args:
        out: The steps of the way out, one at least.
        surfaces: Those beside the way out, and beside the way home so far (m).
        particles: Where the robot may be, in the frame of the way out.
        frame: Where that frame lies in the odometer's.
        config: How the way home leads.
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
        """Points along the way out, and the step that each is on."""
        return _points_along(self._out.lines, _GAP)

    def border(self, step: int) -> Segments:
        """The line across the way out where a step begins, as the odometer has it (m)."""
        line = self._out.part(slice(step, step + 1)).swaths[:, :2].reshape(1, 4)
        return transform_segments(self._frame, line)

    def fit(self, regions: Regions) -> Confidences:
        """How well each ASR of the way out fits where the robot may be; the best one has 1.

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
        """A point a little ahead on the way home, and how far it is home along the way (m).

        The way home begins at the nearest point of the way out with no surface before it. The point
        ahead is NaN where home is nearer.

        Args:
            pose: Where the odometer has the robot.
        """
        (left, towards_home), (points, _) = self._way_home, self._laid
        robot = transform_points(inverse(self._frame), pose[:2])
        away = np.hypot(*(robot - points).T)
        around = np.flatnonzero(away <= _AROUND)
        barred = self._barred(np.broadcast_to(robot, (len(around), 2)), points[around])
        if not barred.all():
            # A trail that bends comes by behind walls. Where all points do, a surface is wrong.
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
        """Whether a surface lies between places and others (m)."""
        ways = shapely.linestrings(np.stack((places, others), axis=1))
        barred = np.zeros(len(ways), np.bool_)
        barred[self._walls.query(ways, predicate="intersects")[0]] = True
        return barred

    @cached_property
    def _walls(self) -> STRtree:
        return STRtree(shapely.linestrings(self._surfaces.reshape(-1, 2, 2)))

    @cached_property
    def _way_home(self) -> tuple[Float64[np.ndarray, "points"], Int64[np.ndarray, "points"]]:
        """Of each point of the way out, how far it is home (m) and the next point on the way there.

        Where the way out comes by again, and there is no surface between, its loop is cut off.
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
    """Points along line segments, about so far apart (m), and which one each is on."""
    counts = np.maximum(np.round(np.hypot(*(lines[:, 2:] - lines[:, :2]).T) / gap), 1).astype(int)
    index = np.repeat(np.arange(len(lines)), counts)
    place = np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = ((place + 0.5) / counts[index])[:, None]
    return lines[index, :2] + share * (lines[index, 2:] - lines[index, :2]), index
