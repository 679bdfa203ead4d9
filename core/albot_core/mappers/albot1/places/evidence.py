"""How probable it is that two places are one: the evidence for a loop closure, weighed.

This is ours. Rooms are alike, and two rooms side by side share walls: from a doorway both are seen,
and a place next door matches just where it is expected. So four things are weighed together: how
much of the structure is the same, whether the robot stands in sight of where it has been in the
other place, whether so does its way in the present visit, and how far the match lies from where it
is expected. What hides a breadcrumb is a wall, an exit or a doorway between. A place that was often
visited, and not recognised as the other, is probably a place of its own: otherwise every visit
would be one more chance to take it for another.

The weights are those of a logistic regression. The misfit counts as in Student's t distribution:
mostly the map is where it is expected, but where it was aligned wrongly it is far off.
docs/places.md says what they were fitted to; `albot experiment study place-evidence` fits them
again.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.poses import compose, relative, transform_points, transform_segments
from albot_core.geometry.segment_kernels import crosses_line
from albot_core.geometry.types import Pose, Segments
from albot_core.kernels.compiled import ZERO, kernel
from albot_core.mappers.albot1.places.exits import ASLANT, WALL
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import DEVIATIONS, LearnedPlace, Lines
from albot_core.matching.line_matching import LineMatch

PRIOR = -2.98
"""Log odds of a candidate that has nothing for it."""
OF_SHARE = 4.31
"""Added if all of the smaller description is the same."""
OF_NEAREST = 2.63
"""Added if all of the nearest breadcrumbs are in sight of the robot."""
OF_VISIT = 2.16
"""Added if all of the present visit is in sight of breadcrumbs of the other place."""
FREEDOM = 3.0
"""Degrees of freedom of the misfit's distribution."""
NEAREST = 5
"""So many of the breadcrumbs in the other place, the nearest to the robot, are looked for."""
UNKNOWN = 0.5
"""The share in sight where no breadcrumb of the other place is left: it says nothing."""
LATEST = 32
"""So many of the present visit's breadcrumbs are looked at, the latest."""
DOORSTEP = 0.3
"""Breadcrumbs nearer to an exit of their place than this (m), or up to 1 m beyond it, do not count:
they are seen from next door."""
BESIDE = 0.25
"""Exits hide what is behind them so far beyond their ends, too (m): where a jamb is seen is
uncertain."""
NARROW, DOORWAY = 0.65, 1.35
"""A gap between two walls in line is a doorway if it is no narrower and no wider than this (m)."""
ASIDE = 0.25
"""A wall so near beside a gap fills it (m)."""
MOST_DOORWAYS = 256
"""So many doorways near the way are looked at."""


class Evidence(NamedTuple):
    """What speaks for two places being one."""

    share: float
    """The share of the smaller description that is the same."""
    nearest_in_sight: float
    """The share of the breadcrumbs in the other place nearest to the robot that it has in sight."""
    visit_in_sight: float
    """The share of the present visit's breadcrumbs in sight of one in the other place."""
    misfit: float
    """How far the match is from where it is expected, in standard deviations of the drift."""
    through_doorway: bool = False
    """Whether the robot has come through a doorway in the present visit that it did not notice.
    Then what it has seen is of two places, and is neither."""
    visits: int = 1
    """How many visits to the present place are remembered, with this one. The odds are divided by
    it, as in the rule of succession; it is not among what was fitted."""

    @property
    def probability(self) -> float:
        """How probable it is that the two places are one."""
        if self.through_doorway:
            return 0.0
        log_odds = (
            PRIOR
            + OF_SHARE * self.share
            + OF_NEAREST * self.nearest_in_sight
            + OF_VISIT * self.visit_in_sight
            + log_likelihood(self.misfit)
            - math.log(self.visits)
        )
        return 1.0 / (1.0 + math.exp(-log_odds))

    @property
    def weighed(self) -> dict[str, float]:
        """What an event keeps of it, with the probability, by name."""
        numbers = dict(zip(self._fields, map(float, self), strict=True))
        del numbers["visits"]
        return numbers | {"probability": self.probability}


def log_likelihood(misfit: float) -> float:
    """How much less likely a misfit is than none, as a logarithm (Student's t distribution)."""
    return -0.5 * (FREEDOM + 1.0) * math.log1p(misfit * misfit / FREEDOM)


def weigh(
    network: PlaceNetwork,
    match: LineMatch,
    place: LearnedPlace,
    guess: Pose,
    seen: Segments,
    exits: Lines,
    pose: Pose,
) -> Evidence:
    """Weigh a match of the present place with another.

    Args:
        network: The network of places.
        match: How the structures match.
        place: The other place.
        guess: Where its frame is expected in the map.
        seen: The surfaces of the map that were seen in the present visit (m).
        exits: The exits that the robot remembers to have seen, in the map's frame (m).
        pose: Where the robot is in the map.
    """
    crumbs = network.breadcrumbs
    # All as the match lays it, in the other place's frame.
    to_place, from_graph = relative(match.pose, np.zeros(3)), relative(place.frame, np.zeros(3))
    here = relative(match.pose, pose)[:2]
    is_present = (crumbs.places == network.current) & (crumbs.readings >= network.stays[-1][0])
    way = transform_points(
        compose(to_place, network.map_to_graph), crumbs.points[is_present][-LATEST:]
    )
    way = np.concatenate((way, here[None]))
    walls = np.concatenate((place.surfaces, transform_segments(to_place, seen)))
    away = np.hypot(*(here - relative(guess, pose)[:2]))
    misfit = float(away) * DEVIATIONS / network.drift_at(pose)
    doorways = find_doorways(walls, way)
    if crosses_any(doorways, way):
        return Evidence(match.share, 0.0, 0.0, misfit, through_doorway=True)
    there = transform_points(from_graph, crumbs.points[crumbs.places == place.id])
    own, visits = place.exit_lines, network.visits.count(network.current)
    there = there[~on_doorstep(own, there)]
    if not len(there):
        return Evidence(match.share, UNKNOWN, UNKNOWN, misfit, visits=visits)
    mine = transform_segments(to_place, np.concatenate((network.predicted_exits, exits)))
    lines = np.concatenate((walls, lengthened(own), lengthened(mine), doorways))
    nearest = there[np.argsort(np.hypot(*(there - here).T), kind="stable")[:NEAREST]]
    return Evidence(
        share=match.share,
        nearest_in_sight=share_in_sight(lines, nearest, here[None]),
        visit_in_sight=share_in_sight(lines, way, there),
        misfit=misfit,
        visits=visits,
    )


def lengthened(exits: Lines) -> Lines:
    """Exits (n, 4), BESIDE longer at both ends."""
    along = exits[:, 2:] - exits[:, :2]
    beside = BESIDE * along / np.hypot(*along.T)[:, None]
    return np.concatenate((exits[:, :2] - beside, exits[:, 2:] + beside), axis=1)


@kernel(arrays=True)
def on_doorstep(exits: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Which points (n, 2) of a place lie in an exit of it (k, 4), or just beyond."""
    found = np.zeros(points.shape[0], np.bool_)
    for k in range(points.shape[0]):
        for line in exits:
            dx, dy = line[2] - line[0], line[3] - line[1]
            width = np.sqrt(dx * dx + dy * dy)
            x = points[k, 0] - 0.5 * (line[0] + line[2])
            y = points[k, 1] - 0.5 * (line[1] + line[3])
            inward, aside = (dx * y - dy * x) / width, abs(dx * x + dy * y) / width
            if -1.0 < inward < DOORSTEP and aside < 0.5 * width + DOORSTEP:
                found[k] = True
    return found


@kernel(arrays=True)
def share_in_sight(lines: np.ndarray, points: np.ndarray, others: np.ndarray) -> float:
    """The share of points (n, 2) that have one of the others (m, 2) in sight.

    In sight means that none of the lines (k, 4) lies between.
    """
    count, nearby, before = 0, 0, ZERO
    for point in points:
        # What the last point saw, and what hid it, is likely to be so for the next.
        for k in range(others.shape[0]):
            other = others[(nearby + k) % others.shape[0]]
            before = _line_between(lines, point, other, before)
            if before < 0:
                count, nearby, before = count + 1, (nearby + k) % others.shape[0], ZERO
                break
    return float(count / points.shape[0])


@kernel()
def _line_between(lines: np.ndarray, one: np.ndarray, other: np.ndarray, first: int) -> int:
    """A line that lies between two points, looked for from `first` on; -1 for none."""
    for k in range(lines.shape[0]):
        which = first + k if first + k < lines.shape[0] else first + k - lines.shape[0]
        if crosses_line(lines[which], one[0], one[1], other[0], other[1]):
            return which
    return -1


@kernel(arrays=True)
def find_doorways(walls: np.ndarray, way: np.ndarray) -> np.ndarray:
    """The lines (m, 4) across the doorways near a way (n, 2): gaps between two walls in line."""
    ends, line = np.empty((2 * walls.shape[0], 4)), np.empty(4)
    count, found = _ends_near(walls, way, ends), 0
    lines = np.empty((MOST_DOORWAYS, 4))
    for j in range(count):
        for k in range(j):
            line[0], line[1], line[2], line[3] = ends[j, 0], ends[j, 1], ends[k, 0], ends[k, 1]
            if (
                found < MOST_DOORWAYS
                and _is_doorway(line, ends[j], ends[k])
                and not _is_filled(line, walls)
            ):
                lines[found] = line
                found += 1
    return lines[:found]


@kernel(arrays=True)
def crosses_any(lines: np.ndarray, way: np.ndarray) -> bool:
    """Whether a way (n, 2) crosses one of the lines (m, 4)."""
    for line in lines:
        for i in range(way.shape[0] - 1):
            if crosses_line(line, way[i, 0], way[i, 1], way[i + 1, 0], way[i + 1, 1]):
                return True
    return False


@kernel()
def _is_filled(line: np.ndarray, walls: np.ndarray) -> bool:
    """Whether a wall runs along a gap or across it, in the middle or halfway to its ends.

    A description that has grown over a long time has walls twice, beside each other.
    """
    dx, dy = line[2] - line[0], line[3] - line[1]
    scale = ASIDE / np.sqrt(dx * dx + dy * dy)
    nx, ny = -dy * scale, dx * scale
    for k in range(-1, 2):
        share = 0.5 + 0.25 * k
        x, y = line[0] + share * dx, line[1] + share * dy
        for wall in walls:
            if crosses_line(wall, x - nx, y - ny, x + nx, y + ny):
                return True
    return False


@kernel()
def _ends_near(walls: np.ndarray, way: np.ndarray, ends: np.ndarray) -> int:
    """Write the ends (n, 4) of walls that are near a way: where, and the direction of the wall.

    Returns how many. A wall is long enough to be one; near is within two widths of a doorway.
    """
    count, reach = 0, 4.0 * DOORWAY * DOORWAY
    for k in range(walls.shape[0]):
        wall = walls[k]
        ux, uy = wall[2] - wall[0], wall[3] - wall[1]
        length = np.sqrt(ux * ux + uy * uy)
        if length < WALL:
            continue
        for end in range(2):
            x, y, sign = wall[2 * end], wall[2 * end + 1], (1.0 - 2.0 * end) / length
            for i in range(way.shape[0]):
                dx, dy = way[i, 0] - x, way[i, 1] - y
                if dx * dx + dy * dy < reach:
                    ends[count, 0], ends[count, 1] = x, y
                    ends[count, 2], ends[count, 3] = sign * ux, sign * uy
                    count += 1
                    break
    return count


@kernel()
def _is_doorway(line: np.ndarray, one: np.ndarray, other: np.ndarray) -> bool:
    """Whether the line (4,) from one end of a wall to another closes a doorway.

    Both walls run along the line, away from it.
    """
    dx, dy = line[2] - line[0], line[3] - line[1]
    width = np.sqrt(dx * dx + dy * dy)
    least = np.cos(ASLANT) * width
    return bool(
        NARROW <= width <= DOORWAY
        and -(one[2] * dx + one[3] * dy) >= least
        and other[2] * dx + other[3] * dy >= least
    )
