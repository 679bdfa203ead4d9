"""Breadcrumbs: points of the robot's past path, and the way home along them.

The thesis's places describe what was seen. To find the way from one exit of a large place to the
next, the robot must also know where it can drive. This is ours: the robot drops a breadcrumb at
regular distances, and links it with those that it can reach straight from there. On a long journey
the breadcrumbs used last are kept, with the paths home from them, so that memory stays bounded.
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
"""The robot drops a breadcrumb after driving this far (m)…"""
CRUMB_TURN = np.radians(45.0)
"""…or turning this far (rad), because other breadcrumbs come into view then."""
WAYPOINT_AHEAD = 2.0
"""Distance of the waypoint along the way home (m)."""
START_RANGE = 1.0
"""Maximum distance of a breadcrumb of the present place at which the way home may start (m)."""


class NearbyCrumbs(NamedTuple):
    """The breadcrumbs as seen from the robot's pose."""

    nearest: int
    """The nearest breadcrumb of the present place, -1 for none."""
    distances: Float64[np.ndarray, "points"]
    """The distance of each breadcrumb from the robot (m)."""
    reachable: Bool[np.ndarray, "points"]
    """Whether the robot can drive straight to each breadcrumb."""


class PathHome(NamedTuple):
    """A path home along the breadcrumbs."""

    points: list[int]
    """The breadcrumbs on the path, the nearest first; empty if no path leads home."""
    length: float
    """The path's length (m), with the way to its first breadcrumb; infinite if there is no path."""


class Breadcrumbs:
    """The breadcrumbs of one robot, each in one of its places."""

    def __init__(self) -> None:
        self.tree = ShortestPathTree()
        """The links between breadcrumbs, and the paths home over the links."""
        self.crumbs = _empty_crumbs(len(self.tree.graph.distances))
        """The breadcrumbs' arrays, which are replaced by larger ones when they are full."""

    def clear(self) -> None:
        """Forget all breadcrumbs."""
        self.tree.graph.counts[:] = 0
        self.crumbs.last[:] = -1, 0, 0

    @property
    def points(self) -> Float64[np.ndarray, "points 2"]:
        """The position of each breadcrumb, in the graph frame of the network of places (m)."""
        points: Float64[np.ndarray, "points 2"] = self.crumbs.points[: self._count]
        return points

    @property
    def places(self) -> Int64[np.ndarray, "points"]:
        """The id of each breadcrumb's place."""
        places: Int64[np.ndarray, "points"] = self.crumbs.places[: self._count]
        return places

    @property
    def last_used(self) -> Int64[np.ndarray, "points"]:
        """The time of each breadcrumb's last use, counted in breadcrumbs dropped."""
        last_used: Int64[np.ndarray, "points"] = self.crumbs.last_used[: self._count]
        return last_used

    @property
    def readings(self) -> Int64[np.ndarray, "points"]:
        """The number of the reading at which each breadcrumb was first dropped."""
        readings: Int64[np.ndarray, "points"] = self.crumbs.readings[: self._count]
        return readings

    @property
    def last(self) -> int:
        """The breadcrumb used last; -1 if the robot did not drive from it to where it is."""
        return int(self.crumbs.last[0])

    @property
    def _count(self) -> int:
        return int(self.tree.graph.counts[0])

    def break_off(self) -> None:
        """Record that the robot did not drive from the last breadcrumb to where it is now."""
        self.crumbs.last[0] = -1

    def ensure_room(self) -> bool:
        """Make room for one more breadcrumb; return whether the arrays were replaced."""
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
        """Drop a breadcrumb, or use again one that lies here.

        Args:
            place: The id of the present place.
            pose: The robot's pose in the graph frame.
            walls: The surfaces in view, in the robot's frame (m).
            reading: The number of the present reading.
        """
        self.ensure_room()
        self.crumbs.last[2] = reading
        drop_crumb(self.crumbs, self.tree.graph, place, pose, walls)

    def nearby(self, place: int, pose: Pose, walls: Segments) -> NearbyCrumbs:
        """Return the breadcrumbs as seen from a pose; the arguments are as for `drop`."""
        distances, reachable = np.empty(len(self.points)), np.empty(len(self.points), np.bool_)
        nearest = find_reachable(self.points, self.places, place, pose, walls, distances, reachable)
        return NearbyCrumbs(int(nearest), distances, reachable)

    def move(self, which: Bool[np.ndarray, "points"], motion: Pose, place: int | None) -> None:
        """Move breadcrumbs rigidly, so that a point at the origin comes to lie at `motion`.

        Args:
            which: The breadcrumbs to be moved.
            motion: A pose in the graph frame.
            place: The id of the place to which they turned out to belong; None to leave it
                unchanged.
        """
        self.points[which] = transform_points(motion, self.points[which])
        if place is not None:
            self.places[which] = place

    def path_home(self, distances: Float64[np.ndarray, "points"]) -> PathHome:
        """Return the shortest path home.

        Args:
            distances: The distance of each breadcrumb (m); infinity if the path may not start
                there.
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
        """Return the next point to drive to on the way home; the arguments are as for `drop`.

        Returns:
            The first breadcrumb WAYPOINT_AHEAD on the path (graph frame; NaN if home is nearer),
            and the path's length (m; infinite if there is no path).
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
    """Return the breadcrumbs with these properties and links (see `ShortestPathTree.links`)."""
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
