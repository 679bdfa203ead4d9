"""The visits to places, and the comparison of one with another by their local maps."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.kernels.compiled import kernel
from albot_core.mappers.hssh.config import HsshConfig
from albot_core.mappers.hssh.gateways import FREE, WALL, Ground, continuations
from albot_core.mappers.hssh.map_tree import Common, TopologicalMap, Travel
from albot_core.mappers.hssh.star import Star
from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.schema import Arrays, Field, Schema
from albot_core.mappers.stored import Stored

_STEPS = 8
"""Steps of the alignment of the local maps."""
_DIFFERS = 0.6
"""Overlap below which two local maps are not of one place."""
_SPACING = 0.3
"""Distance of the points that are kept of the free ground (m)."""


class Visit(NamedTuple):
    """What was perceived of a place on one visit, in the frame of the odometry."""

    entered: int
    """Number of the reading at which the robot came."""
    way: float
    """Distance driven until then (m)."""
    arrived: int
    """The gateway through which it came; -1 at the first visit."""
    left: int
    """The gateway through which it left; -1 while it is there."""
    middle: Points
    """The middle of the most open ground of the place (m)."""
    gateways: Segments
    """The gateways, counter-clockwise, each with the place to its left (m)."""
    unknown: tuple[int, ...]
    """Where more gateways may lie, as nothing was seen: k for between gateway k and the one
    before."""
    surface: Points
    """Points on the walls of the place (m)."""
    open_ground: Points
    """Points on its free ground (m)."""

    @property
    def middles(self) -> Points:
        """The middles of the gateways (m)."""
        return np.asarray((self.gateways[:, :2] + self.gateways[:, 2:]) / 2)

    def star(self, straight: float) -> Star:
        """Return the local topology."""
        return Star(*continuations(self.gateways, straight), unknown=self.unknown)


class Alignment(NamedTuple):
    """How one visit's local map lies on that of another."""

    pose: Pose
    """The pose of the later odometry frame in the earlier one."""
    error: float
    """Root mean square distance of the gateways' ends (m)."""
    overlap: float
    """Share of the points on walls that are found again, of those that the other map knows: where
    it has neither a wall nor free ground, nothing was seen. 1 if there are none."""
    evidence: int
    """Number of the points on walls that the other map knows, of both maps."""


def surface_of(
    ground: Ground, middle: Float64[np.ndarray, "2"], reach: float, most: int
) -> Float64[np.ndarray, "points 2"]:
    """Return points on the walls around a place, evenly chosen (m).

    Args:
        ground: The part of the local map.
        middle: The middle of the place (m).
        reach: Largest distance from there (m).
        most: Largest number of points.
    """
    points = ground.centres(np.argwhere(ground.states == WALL))
    points = points[np.hypot(*(points - middle).T) <= reach]
    step = max(math.ceil(len(points) / max(most, 1)), 1)
    return np.asarray(points[::step][:most], np.float64)


def open_ground_of(
    ground: Ground, middle: Float64[np.ndarray, "2"], reach: float
) -> Float64[np.ndarray, "points 2"]:
    """Return points on the free ground around a place, in a grid of `_SPACING` (m).

    Args:
        ground: The part of the local map.
        middle: The middle of the place (m).
        reach: Largest distance from there (m).
    """
    step = max(round(_SPACING / ground.cell), 1)
    points = ground.centres(step * np.argwhere(ground.states[::step, ::step] == FREE))
    # The walls beside the outermost points must be within reach.
    inside = np.hypot(*(points - middle).T) <= reach - _SPACING
    return np.asarray(points[inside], np.float64)


@kernel(arrays=True)
def rigid_fit(points: Points, onto: Points) -> tuple[Pose, float]:
    """Return the pose that moves points onto others, and the root mean square distance left (m).

    K. Arun, T. Huang and S. Blostein, Least-squares fitting of two 3-D point sets, PAMI 1987, in
    the plane.
    """
    count = len(points)
    middle, target = np.zeros(2), np.zeros(2)
    for k in range(count):
        for axis in range(2):
            middle[axis] += points[k, axis] / count
            target[axis] += onto[k, axis] / count
    sine = cosine = 0.0
    for k in range(count):
        x, y = points[k, 0] - middle[0], points[k, 1] - middle[1]
        right, up = onto[k, 0] - target[0], onto[k, 1] - target[1]
        sine += x * up - y * right
        cosine += x * right + y * up
    turn = math.atan2(sine, cosine)
    cos, sin = math.cos(turn), math.sin(turn)
    left = 0.0
    for k in range(count):
        x, y = points[k, 0] - middle[0], points[k, 1] - middle[1]
        right, up = onto[k, 0] - target[0], onto[k, 1] - target[1]
        left += (cos * x - sin * y - right) ** 2 + (sin * x + cos * y - up) ** 2
    pose = np.empty(3)
    pose[0] = target[0] - cos * middle[0] + sin * middle[1]
    pose[1] = target[1] - sin * middle[0] - cos * middle[1]
    pose[2] = turn
    return pose, math.sqrt(left / count)


def align(later: Visit, earlier: Visit, common: Common, reach: float) -> Alignment:
    """Align two visits' local maps: by the gateways, and then by the points on walls near by.

    Args:
        later: The later visit.
        earlier: The earlier one.
        common: The pairs of gateways, of the later and of the earlier one, that are the same.
        reach: Largest distance of a point from the same wall (m).
    """
    lines, onto = _paired(later, earlier, common)
    pose, error = rigid_fit(lines, onto)
    starts = [pose]
    if error > reach:  # Some gateways lie elsewhere in the place than on the other visit.
        starts += [rigid_fit(lines[k : k + 2], onto[k : k + 2])[0] for k in range(0, len(lines), 2)]
    if not len(later.surface) or not len(earlier.surface):
        return Alignment(pose, error, 1.0, 0)
    maps = later.surface, later.open_ground, earlier.surface, earlier.open_ground
    found = [_laid_on(*maps, start, reach) for start in starts]
    pose, overlap, evidence = max(found, key=lambda each: each[1])
    return Alignment(pose, error, overlap, evidence)


def _paired(later: Visit, earlier: Visit, common: Common) -> tuple[Points, Points]:
    """Return the ends of the common gateways of two visits; without any the places' middles."""
    if not common:
        return later.middle[None], earlier.middle[None]
    ours, theirs = (list(chosen) for chosen in zip(*common, strict=True))
    return later.gateways[ours].reshape(-1, 2), earlier.gateways[theirs].reshape(-1, 2)


@kernel(arrays=True)
def _laid_on(
    walls: np.ndarray,
    free: np.ndarray,
    other_walls: np.ndarray,
    other_free: np.ndarray,
    pose: np.ndarray,
    reach: float,
) -> tuple[np.ndarray, float, int]:
    """Return pose, overlap and evidence of local maps, by the points on walls near one another.

    P. Besl and N. McKay, A method for registration of 3-D shapes, PAMI 1992 (ICP).

    Args:
        walls: Points on the walls of the later visit (points, 2) (m).
        free: Points on its free ground (points, 2) (m).
        other_walls: Those of the earlier visit.
        other_free: Those of the earlier visit.
        pose: The pose of the later visit's frame in the other one to begin with.
        reach: Largest distance of a point from the same wall (m).
    """
    close, onto = np.empty_like(walls), np.empty_like(walls)
    for _ in range(_STEPS):
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        count = 0
        for k in range(len(walls)):
            x = pose[0] + cos * walls[k, 0] - sin * walls[k, 1]
            y = pose[1] + sin * walls[k, 0] + cos * walls[k, 1]
            nearest, away = _nearest(other_walls, x, y)
            if away < 2.0 * reach:
                close[count, 0], close[count, 1] = walls[k, 0], walls[k, 1]
                onto[count, 0], onto[count, 1] = other_walls[nearest, 0], other_walls[nearest, 1]
                count += 1
        if count < 3:
            break
        pose, _ = rigid_fit(close[:count], onto[:count])
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    back = np.empty(3)
    back[0] = -cos * pose[0] - sin * pose[1]
    back[1] = sin * pose[0] - cos * pose[1]
    back[2] = -pose[2]
    found, missed = _agreement(walls, other_walls, other_free, pose, reach)
    more, fewer = _agreement(other_walls, walls, free, back, reach)
    known = found + more + missed + fewer
    return pose, (found + more) / max(known, 1), known


@kernel()
def _agreement(
    points: np.ndarray, walls: np.ndarray, free: np.ndarray, pose: np.ndarray, reach: float
) -> tuple[int, int]:
    """Return how many points on walls another map has as a wall, and how many as free ground.

    Args:
        points: The points (points, 2) (m).
        walls: The other map's points on walls (points, 2) (m).
        free: Its points on free ground (points, 2) (m).
        pose: The pose of the points' frame in that of the other map.
        reach: Largest distance of a point from the same wall (m).
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    found = missed = 0
    for k in range(len(points)):
        x = pose[0] + cos * points[k, 0] - sin * points[k, 1]
        y = pose[1] + sin * points[k, 0] + cos * points[k, 1]
        if _nearest(walls, x, y)[1] < reach:
            found += 1
        elif _nearest(free, x, y)[1] < _SPACING * math.sqrt(0.5):
            missed += 1
    return found, missed


@kernel()
def _nearest(points: np.ndarray, x: float, y: float) -> tuple[int, float]:
    """Return the point nearest to x, y, and its distance (m); -1 and infinity without any.

    Of the few points of a place all are looked at.
    """
    nearest, least = -1, np.inf
    for k in range(len(points)):
        across, up = points[k, 0] - x, points[k, 1] - y
        away = across * across + up * up
        if away < least:
            nearest, least = k, away
    return nearest, math.sqrt(least)


class Visits(Stored):
    """All visits in order; the last one is the present one, or the last before the present way.

    Args:
        config: All parameters.
    """

    SCHEMA = Schema(parts=("_table", "_gateways", "_arms", "_surfaces", "_open"))

    def __init__(self, config: HsshConfig) -> None:
        self._config = config
        self._table = Table(
            "visits",
            Field("entered", "", int, least=0),
            Field("way", "", least=0),
            Field("arrived", "", int, least=-1),
            Field("left", "", int, least=-1),
            Field("middle", "2"),
            Field("gateways", "", int, least=0, sums="gateways"),
            Field("arms", "", int, least=0, sums="arms"),
            Field("surface", "", int, least=0, sums="surfaces"),
            Field("free", "", int, least=0, sums="open"),
        )
        self._gateways = Table("gateways", Field("line", "4"))
        self._arms = Table("arms", Field("before", "", int, least=0))
        self._surfaces = Table("surfaces", Field("point", "2"))
        self._open = Table("open", Field("point", "2"))
        self.clear()

    def clear(self) -> None:
        """Forget all visits."""
        for table in (self._table, self._gateways, self._arms, self._surfaces, self._open):
            table.clear()
        self._visits: list[Visit] = []
        self._stars: list[Star] = []
        self._alignments: dict[tuple[int, int, Common], Alignment] = {}

    def __len__(self) -> int:
        return len(self._visits)

    def __getitem__(self, number: int) -> Visit:
        return self._visits[number]

    def star(self, number: int) -> Star:
        """Return the star of a visit."""
        return self._stars[number]

    def travel(self, number: int) -> Travel:
        """Return the travel that led to a visit."""
        visit = self._visits[number]
        return Travel(self._visits[number - 1].left, self._stars[number], visit.arrived)

    def begin(self, visit: Visit) -> None:
        """Begin a visit."""
        self._visits.append(visit)
        self._stars.append(visit.star(self._config.gateways.straight))

    def cancel(self) -> None:
        """Forget the present visit: it was to no place."""
        self._visits.pop()
        self._stars.pop()
        self._alignments = {k: v for k, v in self._alignments.items() if len(self) not in k[:2]}

    def amend(self, visit: Visit) -> bool:
        """Replace what is known of the present visit; return whether its star has changed."""
        before = self._stars[-1], self._visits[-1].arrived
        number = len(self._visits) - 1
        self._alignments = {k: v for k, v in self._alignments.items() if number not in k[:2]}
        self._visits[-1] = visit
        self._stars[-1] = visit.star(self._config.gateways.straight)
        return before != (self._stars[-1], visit.arrived)

    def alignment(self, later: int, earlier: int, common: Common) -> Alignment:
        """Return how a visit's local map lies on that of an earlier visit."""
        key = later, earlier, common
        if key not in self._alignments:
            reach = self._config.places.surface_error
            self._alignments[key] = align(self[later], self[earlier], common, reach)
        return self._alignments[key]

    def is_alike(self, found: Alignment) -> bool:
        """Return whether two visits' gateways and local maps lie on one another."""
        places = self._config.places
        return found.error <= places.gateway_error and found.overlap >= places.overlap

    def judge(self, first: int, common: Common, closes_loop: bool) -> bool:
        """Return whether the last visit can be to the place that was first visited at `first`.

        Between places that were not seen whole, one common gateway is too little evidence to close
        a loop, and so is a small common part of the local maps (ours). Where no loop is closed,
        only local maps that differ widely, or lie too far from one another, tell that it cannot: a
        gateway was taken for another one, or a place was passed without being perceived (ours).
        """
        places, last = self._config.places, len(self) - 1
        is_seen = self._stars[last].is_whole and self._stars[first].is_whole
        needs_more = places.overlap > 0.0 and not is_seen
        least = places.evidence if needs_more else 0
        if not closes_loop:
            found = self.alignment(last, first, common)
            is_like = found.overlap >= min(places.overlap, _DIFFERS) and found.evidence >= least
            return is_like and self._drift(found.pose, first) <= 0.0
        if needs_more and len(common) < 2:
            return False
        # The gateways first: laying the local maps on one another takes far longer.
        pose, error = rigid_fit(*_paired(self[last], self[first], common))
        if error > places.gateway_error or self._drift(pose, first) > 1.0:
            return False
        found = self.alignment(last, first, common)
        is_close = self._drift(found.pose, first) <= 0.0
        return self.is_alike(found) and is_close and found.evidence >= least

    def _drift(self, pose: Pose, first: int) -> float:
        """Return by how much the odometry's error would be too large (m)."""
        places, last = self._config.places, self[len(self) - 1]
        if math.isinf(places.drift):
            return 0.0
        moved = transform_points(pose, last.middle) - last.middle
        most = 1.0 + places.drift * (last.way - self[first].way)
        return float(np.hypot(*moved)) - most

    def _stored(self) -> dict[str, np.ndarray]:
        for table in (self._table, self._gateways, self._arms, self._surfaces, self._open):
            table.clear()
        for visit in self._visits:
            fields = visit._asdict()
            self._table.append(
                **{k: fields[k] for k in ("entered", "way", "arrived", "left", "middle")},
                gateways=len(visit.gateways),
                arms=len(visit.unknown),
                surface=len(visit.surface),
                free=len(visit.open_ground),
            )
            for line in visit.gateways:
                self._gateways.append(line=line)
            for arm in visit.unknown:
                self._arms.append(before=arm)
            for point in visit.surface:
                self._surfaces.append(point=point)
            for point in visit.open_ground:
                self._open.append(point=point)
        return {}

    def _restored(self, state: Arrays) -> None:
        self._visits, self._stars, self._alignments = [], [], {}
        for visit in visits_of(state):
            self.begin(visit)


def visits_of(state: Arrays) -> list[Visit]:
    """Return the visits that a state holds."""

    def parts(array: str, counts: str) -> list[np.ndarray]:
        return [part.copy() for part in np.split(state[array], np.cumsum(state[counts])[:-1])]

    if not len(state["visits.entered"]):
        return []
    lines = parts("gateways.line", "visits.gateways")
    arms = parts("arms.before", "visits.arms")
    walls = parts("surfaces.point", "visits.surface")
    free = parts("open.point", "visits.free")
    return [
        Visit(
            entered=int(state["visits.entered"][k]),
            way=float(state["visits.way"][k]),
            arrived=int(state["visits.arrived"][k]),
            left=int(state["visits.left"][k]),
            middle=state["visits.middle"][k].copy(),
            gateways=lines[k],
            unknown=tuple(arms[k].tolist()),
            surface=walls[k],
            open_ground=free[k],
        )
        for k in range(len(lines))
    ]


def frames_of(visits: Visits, leaf: TopologicalMap) -> Float64[np.ndarray, "visits 3"]:
    """Return the metric layout of a map: the pose of each visit's odometry frame in the map.

    A place lies where the odometry put it at its first visit; a later visit is laid on it. Where
    their gateways do not lie alike, the odometry since the last visit counts (ours).

    Args:
        visits: The visits.
        leaf: The map.
    """
    frames = np.zeros((len(leaf.visits), 3))
    for number, visit in enumerate(leaf.visits):
        first = leaf.firsts[visit.place]
        frames[number] = frames[number - 1] if number else 0.0
        if first != number:
            found = visits.alignment(number, first, leaf.common(number))
            if visits.is_alike(found):
                frames[number] = compose(frames[first], found.pose)
    return frames


def gateways_of(
    visits: Visits, leaf: TopologicalMap, frames: Float64[np.ndarray, "visits 3"]
) -> list[Float64[np.ndarray, "gateways 4"]]:
    """Return the gateways of each place in its order, in the map's frame (m).

    A gateway lies where it was seen first.

    Args:
        visits: The visits.
        leaf: The map.
        frames: Its layout.
    """
    lines = [np.zeros((star.gateways, 4)) for star in leaf.stars]
    for number in range(len(leaf.visits) - 1, -1, -1):
        place, gateways = leaf.visits[number]
        lines[place][list(gateways)] = transform_segments(frames[number], visits[number].gateways)
    return lines
