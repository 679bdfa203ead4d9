"""Where the robot has gone: the ground in its places that it knows to be passable.

The thesis's places are descriptions of what was seen; finding the way from one exit of a large
place to the next wants to know where one can go as well. This is ours: the robot remembers,
place by place, the points that it has come through, as far apart as a stride, and which of
them follow on one another.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64
from numba import njit

from albot_core.albot1.homewards import HOME, Homewards
from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Pose, Segments

STRIDE = 0.5
"""The robot treads on the trail this often (m)."""
LOOK_ROUND = np.radians(45.0)
"""Having turned so far it looks for points of the trail anew (rad)."""
SAME = 0.35
"""A point of the same place no farther away than this is trodden on again (m)."""
NEAR = 0.6
"""Between points of one place no farther apart than this one can go (m): a robot's body and a
wall do not fit between."""
AHEAD = 2.0
"""How far ahead on the trail the point is that is shown as the way (m)."""
REACH = 1.0
"""From a point of the present place no farther away than this one may set out (m)."""
SIGHT = 8.0
"""Points no farther away than this are looked for in view (m)."""
CLEARANCE = 0.3
"""What is left to either side of a straight way to a point in view, at least (m)."""


class About(NamedTuple):
    """The points of the trail as seen from where the robot is."""

    nearest: int
    """The nearest of its place, -1 for none."""
    away: Float64[np.ndarray, "points"]
    """How far away each is (m)."""
    can_go: Bool[np.ndarray, "points"]
    """Whether the robot can go straight there."""


class Way(NamedTuple):
    """A way along the trail."""

    points: list[int]
    """The points on it, the nearest first; none where no trail leads there."""
    length: float
    """How long it is, the way to the nearest included (m); infinite where there is none."""


class Trail:
    """The points that one robot has come through, each in one of its places."""

    def __init__(self) -> None:
        self.points: Float64[np.ndarray, "points 2"] = np.empty((0, 2))
        """In the enduring frame of the network of places (m)."""
        self.places: Int64[np.ndarray, "points"] = np.empty(0, np.int64)
        self.homewards = Homewards()
        """Which points follow on one another, and the ways home over them."""
        self.last = -1
        """The point trodden on last; -1 where the robot did not walk from there."""

    def tread(self, place: int, pose: Pose, view: Segments) -> None:
        """The robot has come a stride farther, or turned to look elsewhere.

        Args:
            place: The place that it believes to be in.
            pose: Where it is in the enduring frame.
            view: The surfaces in view, in its own frame (m).
        """
        about = self.look(place, pose, view)
        here = about.nearest
        if here < 0 or about.away[here] >= SAME:
            here = len(self.points)
            self.points = np.concatenate((self.points, [pose[:2]]))
            self.places = np.append(self.places, place)
            self.homewards.add_point()
        if self.last >= 0:
            follows = np.arange(len(self.points)) == self.last
            x, y = (self.points[here] - self.points[self.last]).tolist()
            self.homewards.link(here, follows, np.full(len(follows), math.hypot(x, y)))
        self.last = here
        self.homewards.link(here, about.can_go, about.away)

    def look(self, place: int, pose: Pose, view: Segments) -> About:
        """What of the trail is about the robot; the arguments are as for `tread`."""
        away, can_go = np.empty(len(self.points)), np.empty(len(self.points), np.bool_)
        nearest = look_about(self.points, self.places, place, pose, view, away, can_go)
        return About(int(nearest), away, can_go)

    def move(self, which: Bool[np.ndarray, "points"], motion: Pose, place: int | None) -> None:
        """Move points that were learned elsewhere; they may be of another place than was thought.

        What was at the origin of the enduring frame comes to be at `motion`.
        """
        self.points[which] = transform_points(motion, self.points[which])
        if place is not None:
            self.places[which] = place

    def way(self, away: Float64[np.ndarray, "points"]) -> Way:
        """The way home, to the first point trodden on.

        Args:
            away: How far away each point is from which one may set out (m), infinity for others.
        """
        lengths, towards = self.homewards.lengths, self.homewards.towards
        here = int(np.argmin(away + lengths))
        length = float(away[here] + lengths[here])
        if not np.isfinite(length):
            return Way([], length)
        points = [here]
        while points[-1] != HOME:
            points.append(int(towards[points[-1]]))
        return Way(points, length)


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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
