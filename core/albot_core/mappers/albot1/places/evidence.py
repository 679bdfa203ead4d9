"""The probability that two places are one: the evidence for a loop closure, weighed.

This is ours. Rooms look alike, and two rooms side by side share walls: from a doorway both are
seen, and a place next door matches just where it is expected. So four things are weighed together:
the share of the structure that matches, whether the robot stands in sight of its breadcrumbs in the
other place, whether its way in the present visit does, and the distance of the match from where it
is expected. A breadcrumb is hidden by a wall, an exit or a doorway in between. A place that was
often visited, and not recognised as the other, is probably a different place: otherwise every visit
would be one more chance to confuse the two.

The weights are those of a logistic regression. The misfit counts as in Student's t distribution:
mostly the map is where it is expected, but after a wrong alignment it is far off. docs/places.md
says what they were fitted to; `albot experiment study place-evidence` fits them again.
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
"""Log odds of a candidate without any evidence for it."""
OF_SHARE = 4.31
"""Added to the log odds if all of the smaller description matches."""
OF_NEAREST = 2.63
"""Added to the log odds if all of the nearest breadcrumbs are in sight of the robot."""
OF_VISIT = 2.16
"""Added to the log odds if all of the present visit is in sight of the other place's
breadcrumbs."""
FREEDOM = 3.0
"""Degrees of freedom of the misfit's distribution."""
NEAREST = 5
"""Number of breadcrumbs in the other place, the nearest to the robot, that are looked for."""
UNKNOWN = 0.5
"""The share in sight if no breadcrumb of the other place is left, so that it is unknown."""
LATEST = 32
"""Number of the present visit's breadcrumbs that are used, the latest ones."""
DOORSTEP = 0.3
"""Breadcrumbs nearer to an exit of their place than this (m), or up to 1 m beyond it, do not count,
because they are seen from the next place."""
BESIDE = 0.25
"""Exits hide what is behind them up to this far beyond their ends (m), because the position of a
jamb is uncertain."""
NARROW, DOORWAY = 0.65, 1.35
"""Minimum and maximum width of a doorway, a gap between two walls in line (m)."""
ASIDE = 0.25
"""A wall at most this far beside a gap fills it (m)."""
MOST_DOORWAYS = 256
"""Maximum number of doorways near the way that are used."""


class Evidence(NamedTuple):
    """The evidence that two places are one."""

    share: float
    """The share of the smaller description that matches."""
    nearest_in_sight: float
    """The share of the other place's breadcrumbs nearest to the robot that are in its sight."""
    visit_in_sight: float
    """The share of the present visit's breadcrumbs in sight of one of the other place's."""
    misfit: float
    """The distance of the match from where it is expected, in standard deviations of the drift."""
    through_doorway: bool = False
    """Whether the robot has come through a doorway in the present visit without noticing it. Then
    what it has seen belongs to two places, and matches neither."""
    visits: int = 1
    """Number of remembered visits to the present place, including this one. The odds are divided by
    it, as in the rule of succession; it was not part of the fit."""

    @property
    def probability(self) -> float:
        """The probability that the two places are one."""
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
        """The values that an event keeps, with the probability, by name."""
        numbers = dict(zip(self._fields, map(float, self), strict=True))
        del numbers["visits"]
        return numbers | {"probability": self.probability}


def log_likelihood(misfit: float) -> float:
    """Return the log likelihood of a misfit relative to none (Student's t distribution)."""
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
    """Weigh a match of the present place with another place.

    Args:
        network: The network of places.
        match: How the structures match.
        place: The other place.
        guess: The expected pose of the other place's frame in the map.
        seen: The surfaces of the map that were seen in the present visit (m).
        exits: The remembered exits that the robot has seen, in the map's frame (m).
        pose: The robot's pose in the map.
    """
    crumbs = network.breadcrumbs
    # All in the other place's frame, as the match places it.
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
    """Return exits (n, 4) extended by BESIDE at both ends."""
    along = exits[:, 2:] - exits[:, :2]
    beside = BESIDE * along / np.hypot(*along.T)[:, None]
    return np.concatenate((exits[:, :2] - beside, exits[:, 2:] + beside), axis=1)


@kernel(arrays=True)
def on_doorstep(exits: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return which points (n, 2) of a place lie in one of its exits (k, 4), or just beyond."""
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
    """Return the share of points (n, 2) that have one of the others (m, 2) in sight.

    In sight means that none of the lines (k, 4) lies in between.
    """
    count, nearby, before = 0, 0, ZERO
    for point in points:
        # A point's neighbour is likely to see the same point, and to be hidden by the same line.
        for k in range(others.shape[0]):
            other = others[(nearby + k) % others.shape[0]]
            before = _line_between(lines, point, other, before)
            if before < 0:
                count, nearby, before = count + 1, (nearby + k) % others.shape[0], ZERO
                break
    return float(count / points.shape[0])


@kernel()
def _line_between(lines: np.ndarray, one: np.ndarray, other: np.ndarray, first: int) -> int:
    """Return a line that lies between two points, searched from index `first` on; -1 for none."""
    for k in range(lines.shape[0]):
        which = first + k if first + k < lines.shape[0] else first + k - lines.shape[0]
        if crosses_line(lines[which], one[0], one[1], other[0], other[1]):
            return which
    return -1


@kernel(arrays=True)
def find_doorways(walls: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Return the lines (m, 4) across doorways near a way (n, 2): gaps between two walls in line."""
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
    """Return whether a way (n, 2) crosses one of the lines (m, 4)."""
    for line in lines:
        for i in range(way.shape[0] - 1):
            if crosses_line(line, way[i, 0], way[i, 1], way[i + 1, 0], way[i + 1, 1]):
                return True
    return False


@kernel()
def _is_filled(line: np.ndarray, walls: np.ndarray) -> bool:
    """Return whether a wall runs along a gap or across it, in the middle or halfway to its ends.

    A description that has grown over a long time may hold a wall twice, side by side.
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
    """Write the ends (n, 4) of walls near a way: the end's position, and the wall's direction.

    Returns their number. Only walls long enough to bound a gap count; near means within two widths
    of a doorway.
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
    """Return whether the line (4,) from one wall's end to another's closes a doorway.

    Both walls must run along the line, away from it.
    """
    dx, dy = line[2] - line[0], line[3] - line[1]
    width = np.sqrt(dx * dx + dy * dy)
    least = np.cos(ASLANT) * width
    return bool(
        NARROW <= width <= DOORWAY
        and -(one[2] * dx + one[3] * dy) >= least
        and other[2] * dx + other[3] * dy >= least
    )
