"""Where the way home lies beside the way out, by a particle filter.

The paper does not tell how its robot chooses where to go on its way home: this is ours, and so is
the cue `way` that rests on it. The robot is looked for in the map of the way out by Monte Carlo
localisation (S. Thrun, W. Burgard and D. Fox, Probabilistic Robotics, 2005, section 8.3): each
particle is a pose there, moved as the odometer says, and weighed by how near the echoes of the way
home come to those of the way out. Neither map is corrected, and what the odometer errs in the
long run is of no weight.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from jaxtyping import Float64, Int64
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree
from shapely import STRtree

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse, relative, transform_points
from albot_core.geometry.types import Points, Pose, Poses, Segments
from albot_core.mappers.albot0.localisation import Confidences
from albot_core.mappers.albot0.paths import ECHOES, Steps
from albot_core.mappers.albot0.regions import Regions
from albot_core.mappers.stored_arrays import Shape, check_finite, check_shapes
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, Range, check_fields

_COUNT = Range("a whole number from 1 to 100000", 1.0, 1e5, whole=True)
_GAP = 0.5
"""The way out is given by points so far apart (m)."""
_BESIDE = 1.5
"""Between two points of the way out no farther apart (m) the robot can go straight, if there is no
surface between."""
_LEAST = 1e-12
"""The least weight of a particle, as a share of the greatest."""
_SUM = 1e-6
"""By so much the sum of all weights may be off 1."""
_LOOP = 0.99
"""Of the ASRs that a place is equally near to, the one nearest home wins by this: loops of the way
out, such as a room looked into, are left out."""

NO_STATE: Mapping[str, np.ndarray] = {
    "way_back.poses": np.empty((0, 3)),
    "way_back.weights": np.empty(0),
    "way_back.latest": np.empty((0, 3)),
}
"""The state of a robot on its way out."""


@dataclass(frozen=True, kw_only=True)
class WayBackConfig:
    """How the robot is looked for on its way out, where the odometer's errors count twice."""

    particles: int = 300
    """How many poses are kept."""
    drift: float = 0.05
    """Standard deviation of the heading's error after one metre (rad/√m)…"""
    turned: float = 0.03
    """…and after one radian of turn (rad/rad)."""
    slip: float = 0.06
    """Standard deviation of the place's error after one metre (m/√m)."""
    spread: float = 0.25
    """Standard deviation of an echo's distance from the nearest one of the way out (m)."""
    farthest: float = 0.75
    """Echoes that are farther away (m) are of nothing heard on the way out; all are as unlikely."""
    same: float = 0.75
    """Where the way out comes by that much farther away (m) than where it is nearest, or less, the
    robot may be on either part of it: it knows its position no better."""
    through_surface: float = 0.05
    """Factor of the weight of a particle that moved through a surface of the way out. It is not 0:
    that map is inexact, and small gaps in it are closed."""
    near: float = 0.5
    """Standard deviation of how much farther away than the nearest an ASR is that the robot may be
    in (m). So two are about as likely where they meet."""
    loop: float = 20.0
    """Loops of the way out no longer than this (m) are cut off on the way home. How far apart the
    ends of longer ones are the odometer does not tell well enough to go straight from one to the
    other."""
    ahead: float = 1.5
    """The robot is shown a point so far ahead (m)."""

    def __post_init__(self) -> None:
        check_fields(self, _COUNT, "particles")
        check_fields(self, NOT_NEGATIVE, "drift", "turned", "slip", "same")
        positive = "spread", "farthest", "through_surface", "near", "loop", "ahead"
        check_fields(self, POSITIVE, *positive)


class WayBack:
    """The way out, and where on it the robot may be on its way home.

    Attributes:
        frame: The frame of the way out, as it lies beside the way home.

    Args:
        out: The steps of the way out, one at least.
        config: How the robot is looked for.
        rng: What draws the particles' errors.
    """

    def __init__(self, out: Steps, config: WayBackConfig, rng: np.random.Generator) -> None:
        self._out = out
        self._config = config
        self._rng = rng
        self._points, self._steps = _points_along(out.lines, _GAP)
        self._poses: Poses = np.repeat(_end(out.lines[-1])[None], config.particles, axis=0)
        self._weights = np.full(config.particles, 1.0 / config.particles)
        self._latest = self._poses[0]
        self.frame = np.zeros(3)

    @cached_property
    def _echoes(self) -> KDTree:
        """Where the echoes of the way out came from."""
        return KDTree(self._out.echo_points)

    @cached_property
    def _walls(self) -> STRtree:
        """The surfaces of the way out."""
        return STRtree(shapely.linestrings(self._out.surfaces.reshape(-1, 2, 2)))

    def locate(self, home: Steps) -> None:
        """Follow the robot along the next steps of its way home, and lay the way out beside it.

        It sets out from where the way out ends, in the direction in which it came there.
        """
        for step in range(len(home.lines)):
            pose = _end(home.lines[step])
            self._move(relative(self._latest, pose))
            self._latest = pose
            echoes = home.part(slice(step, step + 1)).echo_points
            self._weigh(transform_points(inverse(pose), echoes))
            self._resample()
        east, north = self._weights @ self._poses[:, :2]
        heading = np.angle(self._weights @ np.exp(1j * self._poses[:, 2]))
        self.frame = compose(self._latest, inverse(np.array((east, north, heading))))

    def _move(self, motion: Pose) -> None:
        """Move all particles, each with errors of its own."""
        config, errors = self._config, self._rng.standard_normal(self._poses.shape)
        root = np.sqrt(np.hypot(motion[0], motion[1]))
        errors[:, :2] *= config.slip * root
        errors[:, 2] *= np.hypot(config.drift * root, config.turned * motion[2])
        # The robot first errs in its heading, then goes.
        before = self._poses[:, :2].copy()
        self._poses[:, 2] += errors[:, 2]
        self._poses = compose(self._poses, motion)
        self._poses[:, :2] += errors[:, :2]
        moves = shapely.linestrings(np.stack((before, self._poses[:, :2]), axis=1))
        crossing = self._walls.query(moves, predicate="intersects")[0]
        self._weights[np.unique(crossing)] *= config.through_surface
        weights = np.maximum(self._weights, _LEAST * self._weights.max())
        self._weights = weights / weights.sum()

    def _weigh(self, points: Points) -> None:
        """Weigh the particles by how near to echoes of the way out points seen from them are."""
        config = self._config
        if not len(points) or not self._echoes.n:
            return
        cos, sin = np.cos(self._poses[:, 2:]), np.sin(self._poses[:, 2:])
        seen = np.stack(
            (
                self._poses[:, :1] + cos * points[:, 0] - sin * points[:, 1],
                self._poses[:, 1:2] + sin * points[:, 0] + cos * points[:, 1],
            ),
            axis=-1,
        )
        away, _ = self._echoes.query(seen, distance_upper_bound=config.farthest)
        misfit = (np.minimum(away, config.farthest) / config.spread) ** 2
        # The echoes on one side of a step are one measurement.
        total = 0.5 * misfit.sum(axis=1) / ECHOES - np.log(self._weights)
        # The best one is taken off in the exponent, and none is ruled out.
        weights = np.maximum(np.exp(total.min() - total), _LEAST)
        self._weights = weights / weights.sum()

    def _resample(self) -> None:
        """Draw the particles anew where few of them have most of the weight (low variance)."""
        count = len(self._weights)
        if np.square(self._weights).sum() * count < 2.0:
            return
        drawn = (self._rng.random() + np.arange(count)) / count
        chosen = np.searchsorted(np.cumsum(self._weights), drawn)
        self._poses = self._poses[np.minimum(chosen, count - 1)]
        self._weights = np.full(count, 1.0 / count)

    def fit(self, regions: Regions) -> Confidences:
        """How well each ASR of the way out fits where the robot may be; the best one has 1.

        A particle fits the ASRs that are about as near as the nearest one.
        """
        config, starts = self._config, np.searchsorted(self._steps, regions.splits[:-1])
        away = np.hypot(*np.moveaxis(self._poses[:, None, :2] - self._points, -1, 0))
        nearest = np.minimum.reduceat(away, starts, axis=1)
        farther = nearest - nearest.min(axis=1, keepdims=True)
        fits = _LOOP * np.exp(-0.5 * (farther / config.near) ** 2)
        first = (farther <= config.same).argmax(axis=1)
        fits[np.arange(len(fits)), first] = 1.0
        fitted = self._weights @ fits
        return np.asarray(fitted / fitted.max())

    def ahead(self, pose: Pose) -> tuple[Points, float]:
        """A point a little ahead on the way home, and how far it is home along the way (m).

        The point is NaN where home is nearer.

        Args:
            pose: Where the robot is.
        """
        left, towards_home = self._way_home
        away = np.hypot(*(transform_points(inverse(self.frame), pose[:2]) - self._points).T)
        is_near = away <= away.min() + self._config.near
        total = np.where(is_near, away + left, np.inf)
        goal = int(total.argmin())
        length = float(total[goal])
        while goal > 0 and left[goal] > length - self._config.ahead:
            goal = int(towards_home[goal])
        point = self._points[goal] if goal > 0 else np.full(2, np.nan)
        return transform_points(self.frame, point), length

    @cached_property
    def _way_home(self) -> tuple[Float64[np.ndarray, "points"], Int64[np.ndarray, "points"]]:
        """Of each point of the way out, how far it is home (m) and the next point on the way there.

        Where the way out comes by again, and there is no surface between, its loop is cut off if
        it is not too long.
        """
        points, count = self._points, len(self._points)
        pairs = KDTree(points).query_pairs(_BESIDE, output_type="ndarray")
        gone = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
        loops = np.diff(gone[pairs])[:, 0]
        beside = pairs[(pairs[:, 1] - pairs[:, 0] > 1) & (loops <= self._config.loop)]
        barred = self._walls.query(shapely.linestrings(points[beside]), predicate="intersects")[0]
        beside = np.delete(beside, barred, axis=0)
        along = np.stack((np.arange(count - 1), np.arange(1, count)), axis=-1)
        one, other = np.concatenate((along, beside)).T
        lengths = np.maximum(np.hypot(*(points[one] - points[other]).T), _LEAST)
        links = coo_array((lengths, (one, other)), shape=(count, count))
        left, before = dijkstra(links, directed=False, indices=0, return_predecessors=True)
        return left, before.astype(np.int64)

    def state(self) -> dict[str, np.ndarray]:
        """All that changes, as arrays by name (copies)."""
        return {
            "way_back.poses": self._poses.copy(),
            "way_back.weights": self._weights.copy(),
            "way_back.latest": np.stack((self._latest, self.frame)),
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become what gave `state`.

        Raises:
            InputError: The arrays are none that a state holds.
        """
        count = self._config.particles
        shapes: dict[str, Shape] = {
            "way_back.poses": (count, 3),
            "way_back.weights": (count,),
            "way_back.latest": (2, 3),
        }
        check_shapes(state, shapes)
        check_finite(state, *shapes)
        weights = state["way_back.weights"]
        if not (weights > 0).all() or abs(weights.sum() - 1.0) > _SUM:
            raise InputError("way_back.weights", "positive shares that sum to 1", "others")
        self._poses, self._weights = state["way_back.poses"].copy(), weights.copy()
        self._latest, self.frame = state["way_back.latest"].copy()


def _end(line: Float64[np.ndarray, "4"]) -> Pose:
    """The pose at the end of a step, in the direction in which it leads."""
    return np.array((*line[2:], np.arctan2(line[3] - line[1], line[2] - line[0])))


def _points_along(lines: Segments, gap: float) -> tuple[Points, Int64[np.ndarray, "points"]]:
    """Points along line segments, about so far apart (m), and which one each is on."""
    counts = np.maximum(np.round(np.hypot(*(lines[:, 2:] - lines[:, :2]).T) / gap), 1).astype(int)
    index = np.repeat(np.arange(len(lines)), counts)
    place = np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = ((place + 0.5) / counts[index])[:, None]
    return lines[index, :2] + share * (lines[index, 2:] - lines[index, :2]), index
