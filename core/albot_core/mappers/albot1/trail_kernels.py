"""The compiled loops of the trail: treading on it, and looking for its points in view."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.homewards import HOME, Graph, add_point, keep_points, link_all
from albot_core.mappers.albot1.search import sort

SAME = 0.35
"""A point of the same place no farther away than this is trodden on again (m)."""
NEAR = 0.6
"""Between points of one place no farther apart than this one can go (m): a robot's body and a
wall do not fit between."""
SIGHT = 8.0
"""Points no farther away than this are looked for in view (m)."""
CLEARANCE = 0.3
"""What is left to either side of a straight way to a point in view, at least (m)."""

MOST_POINTS, MOST_LINKS = 1024, 16_384
"""With more points or links than these the trail is too long: half of the points are forgotten,
but not where the ways home from the others lead over them."""
LOOKED_AFTER = 32
"""At each so many points it is seen to whether the trail is too long."""


class Steps(NamedTuple):
    """The points of a trail, in arrays that have room for more (see `Graph`)."""

    points: np.ndarray
    """(points, 2) float64: in the enduring frame of the network of places (m)."""
    places: np.ndarray
    """(points,) int64: in which place each is."""
    strides: np.ndarray
    """(points,) int64: the stride, counted from 0, at which each was trodden on last."""
    last: np.ndarray
    """(2,) int64: the point trodden on last, -1 where the robot did not walk from there; and
    the next stride."""


@kernel()
def has_room(graph: Graph) -> bool:
    """Whether there is room for a stride: a point, and links to all others."""
    points, links = graph.counts[0], graph.counts[1]
    return bool(points < graph.lengths.shape[0] and links + points < graph.spans.shape[0])


@kernel(arrays=True)
def tread_on(steps: Steps, graph: Graph, place: int, pose: np.ndarray, view: np.ndarray) -> None:
    """`Trail.tread`, where there is room for a stride."""
    count = graph.counts[0]
    away, can_go = np.empty(count + 1), np.empty(count + 1, np.bool_)
    points, places = steps.points[:count], steps.places[:count]
    here = look_about(points, places, place, pose, view, away, can_go)
    is_new = here < 0 or away[here] >= SAME
    if is_new:
        here = count
        steps.points[here, 0], steps.points[here, 1] = pose[0], pose[1]
        steps.places[here] = place
        add_point(graph)
    last = steps.last[0]
    if last >= 0:
        dx = steps.points[here, 0] - steps.points[last, 0]
        dy = steps.points[here, 1] - steps.points[last, 1]
        away[last] = np.sqrt(dx * dx + dy * dy)
        can_go[last] = True
    link_all(graph, here, can_go[:count], away[:count])
    steps.strides[here] = steps.last[1]
    steps.last[0] = here
    steps.last[1] += 1
    if is_new and graph.counts[0] % LOOKED_AFTER == 0:
        _look_after(steps, graph)


@kernel(arrays=True)
def _look_after(steps: Steps, graph: Graph) -> None:
    """Where the trail is too long, forget the points on which it has not trodden for longest."""
    count = graph.counts[0]
    if count <= MOST_POINTS and graph.counts[1] <= MOST_LINKS:
        return
    ages = steps.strides[:count].copy()
    sort(ages, count)
    kept = np.zeros(count, np.bool_)
    kept[HOME] = True
    for point in range(count):
        if steps.strides[point] >= ages[count // 2]:
            on = point
            while on >= 0 and not kept[on]:
                kept[on] = True
                on = graph.towards[on]
    places = np.full(count, -1)
    staying = 0
    for point in range(count):
        if kept[point]:
            steps.points[staying, 0] = steps.points[point, 0]
            steps.points[staying, 1] = steps.points[point, 1]
            steps.places[staying] = steps.places[point]
            steps.strides[staying] = steps.strides[point]
            places[point] = staying
            staying += 1
    keep_points(graph, places)
    steps.last[0] = places[steps.last[0]]


@kernel()
def look_about(
    points: np.ndarray,
    places: np.ndarray,
    place: int,
    pose: np.ndarray,
    view: np.ndarray,
    away: np.ndarray,
    can_go: np.ndarray,
) -> int:
    """Say of each point how far away it is (m), and whether the robot can go straight to it.

    It can where it stands on it, where that is near in its own place, and where it is in view.
    Returns the nearest point of its place, -1 where there is none.
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    nearest, best = -1, np.inf
    for k in range(points.shape[0]):
        dx, dy = points[k, 0] - pose[0], points[k, 1] - pose[1]
        length = np.sqrt(dx * dx + dy * dy)
        away[k] = length
        own = places[k] == place
        if own and length < best:
            nearest, best = k, length
        can_go[k] = length < SAME or (own and length < NEAR)
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        if not can_go[k] and x > 0.0 and length < SIGHT:
            can_go[k] = _is_in_sight(view, x / length, y / length, length)
    return nearest


@kernel()
def _is_in_sight(view: np.ndarray, ux: float, uy: float, length: float) -> bool:
    """Whether a robot at the origin can see that it can go so far along (ux, uy).

    No surface stands in its way, and one is seen beyond: where none is seen there may be one
    that is too small in view.
    """
    seen = False
    for wall in view:
        near, far = _span(wall, ux, uy)
        if near <= length + CLEARANCE and far >= 0.0:
            return False
        seen = seen or length <= near < np.inf
    return seen


@kernel()
def _span(wall: np.ndarray, ux: float, uy: float) -> tuple[float, float]:
    """From where to where (m) a wall is beside a way from the origin along (ux, uy).

    Infinitely far, where it nowhere is.
    """
    ax, ay = ux * wall[0] + uy * wall[1], ux * wall[1] - uy * wall[0]
    bx, by = ux * wall[2] + uy * wall[3], ux * wall[3] - uy * wall[2]
    low, high = 0.0, 1.0
    if ay != by:
        first, second = (-CLEARANCE - ay) / (by - ay), (CLEARANCE - ay) / (by - ay)
        low, high = max(low, min(first, second)), min(high, max(first, second))
    elif abs(ay) > CLEARANCE:
        return np.inf, np.inf
    if low > high:
        return np.inf, np.inf
    one, other = ax + low * (bx - ax), ax + high * (bx - ax)
    return min(one, other), max(one, other)
