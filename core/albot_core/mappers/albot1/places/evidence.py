"""How probable it is that two places are one: the evidence for a loop closure, weighed.

This is ours. Rooms are alike, and two rooms side by side share walls: from a doorway both are seen,
and a place next door matches just where it is expected. So four things are weighed together: how
much of the structure is the same, whether the robot stands in sight of where it has been in the
other place, whether so does its way in the present visit, and how far the match lies from where it
is expected. What hides a breadcrumb is a wall or an exit between.

The weights are those of a logistic regression; that of the misfit is the normal distribution's.
`scripts/place_evidence.py` fits them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.poses import compose, relative, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.places.exits import ASLANT, WALL, crosses_line
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import DEVIATIONS, LearnedPlace, Lines
from albot_core.matching.lines import LineMatch

PRIOR = -3.70
"""Log odds of a candidate that has nothing for it."""
OF_SHARE = 4.06
"""Added if all of the smaller description is the same."""
OF_NEAREST = 3.57
"""Added if all of the nearest breadcrumbs are in sight of the robot."""
OF_VISIT = 2.26
"""Added if all of the present visit is in sight of breadcrumbs of the other place."""
NEAREST = 5
"""So many of the breadcrumbs in the other place, the nearest to the robot, are looked for."""
UNKNOWN = 0.5
"""The share in sight where no breadcrumb of the other place is left: it says nothing."""
LATEST = 32
"""So many of the present visit's breadcrumbs are looked at, the latest."""
DOORWAY = 1.35
"""A gap between two walls in line is a doorway if it is no wider than this (m)."""


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
            - 0.5 * self.misfit * self.misfit
        )
        return 1.0 / (1.0 + math.exp(-log_odds))

    @property
    def weighed(self) -> dict[str, float]:
        """All of it, with the probability, by name."""
        numbers = zip(self._fields, map(float, self), strict=True)
        return dict(numbers) | {"probability": self.probability}


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
    there = transform_points(from_graph, crumbs.points[crumbs.places == place.id])
    is_present = (crumbs.places == network.current) & (crumbs.readings >= network.stays[-1][0])
    way = transform_points(
        compose(to_place, network.map_to_graph), crumbs.points[is_present][-LATEST:]
    )
    way = np.concatenate((way, here[None]))
    mine = np.concatenate((seen, network.predicted_exits, exits))
    own = np.reshape([door.line for door in place.exits], (-1, 4))
    lines = np.concatenate((place.surfaces, own, transform_segments(to_place, mine)))
    walls = np.concatenate((place.surfaces, transform_segments(to_place, seen)))
    away = np.hypot(*(here - relative(guess, pose)[:2]))
    return Evidence(
        share=match.share,
        nearest_in_sight=_nearest_in_sight(lines, here, there),
        visit_in_sight=share_in_sight(lines, way, there) if len(there) else UNKNOWN,
        misfit=float(away) * DEVIATIONS / network.drift_at(pose),
        through_doorway=bool(passes_doorway(walls, way)),
    )


def _nearest_in_sight(lines: Segments, here: Points, crumbs: Points) -> float:
    """The share of those crumbs that are nearest to `here` that it has in sight."""
    if not len(crumbs):
        return UNKNOWN
    nearest = np.argsort(np.hypot(*(crumbs - here).T), kind="stable")[:NEAREST]
    return float(np.mean([share_in_sight(lines, here[None], crumbs[k : k + 1]) for k in nearest]))


@kernel(arrays=True)
def share_in_sight(lines: np.ndarray, points: np.ndarray, others: np.ndarray) -> float:
    """The share of points (n, 2) that have one of the others (m, 2) in sight.

    In sight means that none of the lines (k, 4) lies between.
    """
    count = 0
    for point in points:
        for other in others:
            if _is_clear(lines, point, other):
                count += 1
                break
    return count / points.shape[0]


@kernel()
def _is_clear(lines: np.ndarray, one: np.ndarray, other: np.ndarray) -> bool:
    """Whether no line lies between two points."""
    for line in lines:  # noqa: SIM110 (compiled code has no generators)
        if crosses_line(line, one[0], one[1], other[0], other[1]):
            return False
    return True


@kernel(arrays=True)
def passes_doorway(walls: np.ndarray, way: np.ndarray) -> bool:
    """Whether a way (n, 2) passes between two walls (k, 4) in line, the ends of a doorway."""
    line = np.empty(4)
    for j in range(walls.shape[0]):
        for k in range(j):
            for end in range(2):
                for other in range(2):
                    line[0], line[1] = walls[j, 2 * end], walls[j, 2 * end + 1]
                    line[2], line[3] = walls[k, 2 * other], walls[k, 2 * other + 1]
                    if not _is_doorway(line, walls[j], end, walls[k], other):
                        continue
                    for i in range(way.shape[0] - 1):
                        if crosses_line(line, way[i, 0], way[i, 1], way[i + 1, 0], way[i + 1, 1]):
                            return True
    return False


@kernel()
def _is_doorway(line: np.ndarray, wall: np.ndarray, end: int, other: np.ndarray, at: int) -> bool:
    """Whether the line from an end of a wall to one of another closes a doorway.

    Both walls run along the line, away from it.
    """
    dx, dy = line[2] - line[0], line[3] - line[1]
    if dx * dx + dy * dy > DOORWAY * DOORWAY:
        return False
    return _leads_away(wall, end, -dx, -dy) and _leads_away(other, at, dx, dy)


@kernel()
def _leads_away(wall: np.ndarray, end: int, dx: float, dy: float) -> bool:
    """Whether a wall that is long enough runs from its `end` in about the direction (dx, dy)."""
    ux, uy = wall[2] - wall[0], wall[3] - wall[1]
    along = (ux * dx + uy * dy) * (1.0 if end == 0 else -1.0)
    square = ux * ux + uy * uy
    return bool(
        square >= WALL * WALL
        and along > 0.0
        and along * along >= np.cos(ASLANT) ** 2 * square * (dx * dx + dy * dy)
    )
