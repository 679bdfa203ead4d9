"""Breadcrumbs: the points that a robot has come through, and the way home along them.

The thesis's places describe what was seen. To find the way from one exit of a large place to the
next, the robot must know where it can drive as well. This is ours: the robot drops a breadcrumb
every so far, and links it with those that it can reach straight from there. Of a long journey the
breadcrumbs used last are kept, and the paths home from them, so that memory stays bounded.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.albot1.trail.crumb_kernels import (
    Crumbs,
    drop_crumb,
    find_reachable,
    has_room,
)
from albot_core.mappers.albot1.trail.path_tree import HOME, ShortestPathTree, rebuilt_path_tree

CRUMB_SPACING = 0.5
"""The robot drops a breadcrumb after driving so far (m)…"""
CRUMB_TURN = np.radians(45.0)
"""…or turning so far (rad): then others come into view."""
WAYPOINT_AHEAD = 2.0
"""The waypoint is so far ahead on the way home (m)."""
START_RANGE = 1.0
"""The way home may start at a breadcrumb of the present place that is no farther away (m)."""


class NearbyCrumbs(NamedTuple):
    """The breadcrumbs as seen from where the robot is."""

    nearest: int
    """The nearest of its place, -1 for none."""
    distances: Float64[np.ndarray, "points"]
    """How far away each is (m)."""
    reachable: Bool[np.ndarray, "points"]
    """Whether the robot can drive straight there."""


class PathHome(NamedTuple):
    """A path home along the breadcrumbs."""

    points: list[int]
    """The breadcrumbs on it, the nearest first; none where no path leads home."""
    length: float
    """Its length (m), with the way to the nearest; infinite where there is no path."""


class Breadcrumbs:
    """The breadcrumbs of one robot, each in one of its places."""

    def __init__(self) -> None:
        self.tree = ShortestPathTree()
        """Which breadcrumbs are linked, and the paths home over the links."""
        self.crumbs = _empty_crumbs(len(self.tree.graph.distances))
        """The arrays, which are exchanged for larger ones when they are full."""

    def clear(self) -> None:
        """Forget all breadcrumbs."""
        self.tree.graph.counts[:] = 0
        self.crumbs.last[:] = -1, 0, 0

    @property
    def points(self) -> Float64[np.ndarray, "points 2"]:
        """Where each is, in the graph frame of the network of places (m)."""
        points: Float64[np.ndarray, "points 2"] = self.crumbs.points[: self._count]
        return points

    @property
    def places(self) -> Int64[np.ndarray, "points"]:
        """The id of the place that each is in."""
        places: Int64[np.ndarray, "points"] = self.crumbs.places[: self._count]
        return places

    @property
    def last_used(self) -> Int64[np.ndarray, "points"]:
        """When each was used last, counted in breadcrumbs dropped."""
        last_used: Int64[np.ndarray, "points"] = self.crumbs.last_used[: self._count]
        return last_used

    @property
    def readings(self) -> Int64[np.ndarray, "points"]:
        """The number of the reading at which each was dropped first."""
        readings: Int64[np.ndarray, "points"] = self.crumbs.readings[: self._count]
        return readings

    @property
    def last(self) -> int:
        """The breadcrumb used last; -1 where the robot did not drive from there."""
        return int(self.crumbs.last[0])

    @property
    def _count(self) -> int:
        return int(self.tree.graph.counts[0])

    def break_off(self) -> None:
        """Note that the robot did not drive from the last breadcrumb to where it is now."""
        self.crumbs.last[0] = -1

    def ensure_room(self) -> bool:
        """Make room for one more breadcrumb. Returns whether the arrays are new."""
        if has_room(self.tree.graph):
            return False
        self.tree.ensure_room(self._count + 1)
        room = len(self.tree.graph.distances)
        if room > len(self.crumbs.places):
            smaller, self.crumbs = self.crumbs, _empty_crumbs(room)
            for old, new in zip(smaller, self.crumbs, strict=True):
                new[: len(old)] = old
        return True

    def drop(self, place: int, pose: Pose, walls: Segments, reading: int = 0) -> None:
        """Drop a breadcrumb, or use one again that lies here.

        Args:
            place: The id of the place that the robot believes to be in.
            pose: Where it is in the graph frame.
            walls: The surfaces in view, in its own frame (m).
            reading: The number of the present reading.
        """
        self.ensure_room()
        self.crumbs.last[2] = reading
        drop_crumb(self.crumbs, self.tree.graph, place, pose, walls)

    def nearby(self, place: int, pose: Pose, walls: Segments) -> NearbyCrumbs:
        """The breadcrumbs as seen from a pose; the arguments are as for `drop`."""
        distances, reachable = np.empty(len(self.points)), np.empty(len(self.points), np.bool_)
        nearest = find_reachable(self.points, self.places, place, pose, walls, distances, reachable)
        return NearbyCrumbs(int(nearest), distances, reachable)

    def move(self, which: Bool[np.ndarray, "points"], motion: Pose, place: int | None) -> None:
        """Move breadcrumbs so that what was at the origin comes to be at `motion`.

        Args:
            which: Those to be moved.
            motion: A pose in the graph frame.
            place: The id of the place that they turned out to be in; None where that stays.
        """
        self.points[which] = transform_points(motion, self.points[which])
        if place is not None:
            self.places[which] = place

    def path_home(self, distances: Float64[np.ndarray, "points"]) -> PathHome:
        """The shortest path home.

        Args:
            distances: How far away each breadcrumb is (m); infinity where none may start there.
        """
        start = int(np.argmin(distances + self.tree.distances))
        length = float(distances[start] + self.tree.distances[start])
        if not np.isfinite(length):
            return PathHome([], length)
        points = [start]
        while points[-1] != HOME:
            points.append(int(self.tree.parents[points[-1]]))
        return PathHome(points, length)

    def waypoint(self, place: int, pose: Pose, walls: Segments) -> tuple[Points, float]:
        """Where to drive next on the way home; the arguments are as for `drop`.

        Returns:
            The first breadcrumb WAYPOINT_AHEAD on the path (graph frame; NaN where home is
            nearer), and the path's length (m; infinite where there is none).
        """
        nearby = self.nearby(place, pose, walls)
        own = self.places == place
        may_start = nearby.reachable | own & (nearby.distances < START_RANGE)
        distances = np.where(may_start, nearby.distances, np.inf)
        if not np.isfinite(distances).any():
            may_start = own if own.any() else np.ones_like(own)
            distances = np.where(may_start, nearby.distances, np.inf)
        path = self.path_home(distances)
        ahead, before = WAYPOINT_AHEAD, pose[:2].tolist()
        for k in path.points:
            point = self.points[k].tolist()
            ahead -= math.dist(before, point)
            before = point
            if ahead <= 0:
                return self.points[k], path.length
        return np.full(2, np.nan), path.length


def rebuilt_breadcrumbs(
    points: Float64[np.ndarray, "points 2"],
    places: Int64[np.ndarray, "points"],
    last_used: Int64[np.ndarray, "points"],
    readings: Int64[np.ndarray, "points"],
    last: int,
    links: Float64[np.ndarray, "links 3"],
) -> Breadcrumbs:
    """The breadcrumbs with these properties and links (see `ShortestPathTree.links`)."""
    breadcrumbs = Breadcrumbs()
    breadcrumbs.tree = rebuilt_path_tree(len(points), links)
    breadcrumbs.crumbs = crumbs = _empty_crumbs(len(breadcrumbs.tree.graph.distances))
    for array, kept in zip(crumbs, (points, places, last_used, readings), strict=False):
        array[: len(kept)] = kept
    crumbs.last[:] = last, last_used.max(initial=-1) + 1, 0
    return breadcrumbs


def _empty_crumbs(room: int) -> Crumbs:
    return Crumbs(
        points=np.zeros((room, 2)),
        places=np.zeros(room, np.int64),
        last_used=np.zeros(room, np.int64),
        readings=np.zeros(room, np.int64),
        last=np.array((-1, 0, 0)),
    )
