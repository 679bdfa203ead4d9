"""Dropping a breadcrumb, and which breadcrumbs the robot can reach straight. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import rotate_back
from albot_core.kernels.compiled import kernel
from albot_core.kernels.sorting import sort
from albot_core.mappers.albot1.trail.path_tree import (
    HOME,
    PathGraph,
    add_point,
    keep_points,
    link_point,
)

SAME_CRUMB = 0.35
"""A breadcrumb of the same place is used again if it is no farther away than this (m)."""
NEAR = 0.6
"""Between breadcrumbs of one place the way is free up to this distance (m): a robot's body and a
wall do not both fit between them."""
VIEW_RANGE = 8.0
"""Maximum distance of breadcrumbs that are looked for in view (m)."""
CLEARANCE = 0.3
"""Minimum free space on either side of a straight way to a breadcrumb in view (m)."""

MAX_CRUMBS, MAX_LINKS = 1024, 16_384
"""With more breadcrumbs or links than these, half of the breadcrumbs are forgotten, except those on
the paths home from the others."""
PRUNE_EVERY = 32
"""Interval, in breadcrumbs, at which these limits are checked."""


class Crumbs(NamedTuple):
    """Breadcrumbs in arrays that have room for more (`PathGraph` has their number)."""

    points: np.ndarray
    """(points, 2) float64: each breadcrumb's position, in the graph frame of the places (m)."""
    places: np.ndarray
    """(points,) int64: the id of each breadcrumb's place."""
    last_used: np.ndarray
    """(points,) int64: the time of each breadcrumb's last use, counted in breadcrumbs dropped."""
    readings: np.ndarray
    """(points,) int64: the number of the reading at which each breadcrumb was first dropped."""
    last: np.ndarray
    """(3,) int64: the breadcrumb used last, -1 if the robot did not drive from it to where it is;
    the number of breadcrumbs dropped; and the number of the present reading."""


@kernel()
def has_room(graph: PathGraph) -> bool:
    """Return whether there is room for a breadcrumb and links to all others."""
    points, links = graph.counts[0], graph.counts[1]
    return bool(points < graph.distances.shape[0] and links + points < graph.lengths.shape[0])


@kernel(arrays=True)
def drop_crumb(
    crumbs: Crumbs, graph: PathGraph, place: int, pose: np.ndarray, walls: np.ndarray
) -> None:
    """Drop a breadcrumb as `Breadcrumbs.drop` does; there must be room (see `has_room`)."""
    count = graph.counts[0]
    distances, reachable = np.empty(count + 1), np.empty(count + 1, np.bool_)
    points, places = crumbs.points[:count], crumbs.places[:count]
    here = find_reachable(points, places, place, pose, walls, distances, reachable)
    is_new = here < 0 or distances[here] >= SAME_CRUMB
    if is_new:
        here = count
        crumbs.points[here, 0], crumbs.points[here, 1] = pose[0], pose[1]
        crumbs.places[here] = place
        crumbs.readings[here] = crumbs.last[2]
        add_point(graph)
    last = crumbs.last[0]
    if last >= 0:
        dx = crumbs.points[here, 0] - crumbs.points[last, 0]
        dy = crumbs.points[here, 1] - crumbs.points[last, 1]
        distances[last] = np.sqrt(dx * dx + dy * dy)
        reachable[last] = True
    link_point(graph, here, reachable[:count], distances[:count])
    crumbs.last_used[here] = crumbs.last[1]
    crumbs.last[0] = here
    crumbs.last[1] += 1
    if is_new and graph.counts[0] % PRUNE_EVERY == 0:
        _prune(crumbs, graph)


@kernel(arrays=True)
def _prune(crumbs: Crumbs, graph: PathGraph) -> None:
    """Forget the breadcrumbs that were not used for longest, if there are more than the limits."""
    count = graph.counts[0]
    if count <= MAX_CRUMBS and graph.counts[1] <= MAX_LINKS:
        return
    ages = crumbs.last_used[:count].copy()
    sort(ages, count)
    kept = np.zeros(count, np.bool_)
    kept[HOME] = True
    for point in range(count):
        if crumbs.last_used[point] >= ages[count // 2]:
            ancestor = point
            while ancestor >= 0 and not kept[ancestor]:
                kept[ancestor] = True
                ancestor = graph.parents[ancestor]
    numbers = np.full(count, -1)
    staying = 0
    for point in range(count):
        if kept[point]:
            crumbs.points[staying, 0] = crumbs.points[point, 0]
            crumbs.points[staying, 1] = crumbs.points[point, 1]
            crumbs.places[staying] = crumbs.places[point]
            crumbs.last_used[staying] = crumbs.last_used[point]
            crumbs.readings[staying] = crumbs.readings[point]
            numbers[point] = staying
            staying += 1
    keep_points(graph, numbers)
    crumbs.last[0] = numbers[crumbs.last[0]]


@kernel()
def find_reachable(
    points: np.ndarray,
    places: np.ndarray,
    place: int,
    pose: np.ndarray,
    walls: np.ndarray,
    distances: np.ndarray,
    reachable: np.ndarray,
) -> int:
    """Set each breadcrumb's distance (m), and whether the robot can drive straight to it.

    It can if it stands on the breadcrumb, if that is near and in its own place, or if the straight
    way there is in view and free. Returns the nearest breadcrumb of the robot's place, -1 if there
    is none.
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    nearest, best = -1, np.inf
    for k in range(points.shape[0]):
        dx, dy = points[k, 0] - pose[0], points[k, 1] - pose[1]
        distance = np.sqrt(dx * dx + dy * dy)
        distances[k] = distance
        own = places[k] == place
        if own and distance < best:
            nearest, best = k, distance
        reachable[k] = distance < SAME_CRUMB or (own and distance < NEAR)
        x, y = rotate_back(cos, sin, dx, dy)
        if not reachable[k] and x > 0.0 and distance < VIEW_RANGE:
            reachable[k] = _is_clear(walls, x / distance, y / distance, distance)
    return nearest


@kernel()
def _is_clear(walls: np.ndarray, ux: float, uy: float, length: float) -> bool:
    """Return whether a robot at the origin sees that the way along (ux, uy) is free.

    No wall may stand in the way, and a wall must be seen beyond it; otherwise a wall too small to
    be seen may stand in the way.
    """
    seen = False
    for wall in walls:
        near, far = _strip_overlap(wall, ux, uy)
        if near <= length + CLEARANCE and far >= 0.0:
            return False
        seen = seen or length <= near < np.inf
    return seen


@kernel()
def _strip_overlap(wall: np.ndarray, ux: float, uy: float) -> tuple[float, float]:
    """Return from where to where (m) a wall is within CLEARANCE of the ray along (ux, uy).

    Both are infinite if the wall is nowhere so near.
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
