"""Where the robot has gone: the ground in its places that it knows to be passable.

The thesis's places are descriptions of what was seen; finding the way from one exit of a large
place to the next wants to know where one can go as well. This is ours: the robot remembers,
place by place, the points that it has come through, as far apart as a stride, and which of
them follow on one another.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64
from numba import njit
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Points, Pose

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


class Trail:
    """The points that one robot has come through, each in the frame of its place."""

    def __init__(self) -> None:
        self.points: Float64[np.ndarray, "points 2"] = np.empty((0, 2))
        self.places: Int64[np.ndarray, "points"] = np.empty(0, np.int64)
        self.links: dict[tuple[int, int], float] = {}
        """Pairs of points (the less first) that follow on one another, and how far apart (m)."""
        self.last = -1
        """The point trodden on last; -1 where the robot did not walk from there."""
        self._ways: tuple[Float64[np.ndarray, "points"], Int64[np.ndarray, "points"]] | None = None

    def tread(self, place: int, point: Points) -> None:
        """The robot is at a point of a place, in the place's frame, a stride from the last."""
        near = self._near(place, point, NEAR)
        if near and near[0][0] < SAME:
            here = near[0][1]
        else:
            here = len(self.points)
            self.points = np.concatenate((self.points, [point]))
            self.places = np.append(self.places, place)
            self._ways = None
            for away, other in near:
                self._link(other, here, away)
        if self.last >= 0:
            self._link(self.last, here, self._length(self.last, here))
        self.last = here

    def merge(self, kept: int, gone: int, pose: Pose) -> None:
        """A place is another, in whose frame its own lies at `pose`."""
        moved = np.flatnonzero(self.places == gone).tolist()
        for k in moved:
            point = transform_points(pose, self.points[k])
            near = self._near(kept, point, NEAR)
            self.points[k] = point
            for away, other in near:
                self._link(other, k, away)
        self.places[moved] = kept
        self._ways = None

    def sees(self, ends: Int64[np.ndarray, "n"], lengths: Float64[np.ndarray, "n"]) -> None:
        """From the point trodden on last, others can be gone to straight, so far away (m)."""
        for end, length in zip(ends.tolist(), lengths.tolist(), strict=True):
            self._link(self.last, end, length)

    def way(self, away: Float64[np.ndarray, "points"]) -> list[int]:
        """The points on the way home, to the first one trodden on.

        None where no trail leads home.

        Args:
            away: How far away each point is from which one may set out (m), infinity for others.
        """
        lengths, towards = self._homewards()
        here = int(np.argmin(away + lengths))
        if not np.isfinite(away[here] + lengths[here]):
            return []
        way = [here]
        while way[-1] != 0:
            way.append(int(towards[way[-1]]))
        return way

    def _near(self, place: int, point: Points, reach: float) -> list[tuple[float, int]]:
        """The points of a place within reach, nearest first, with how far away they are (m)."""
        which = np.flatnonzero(self.places == place)
        away = np.hypot(*(self.points[which] - point).T)
        order = np.flatnonzero(away <= reach)
        order = order[np.argsort(away[order], kind="stable")]
        return list(zip(away[order].tolist(), which[order].tolist(), strict=True))

    def _length(self, one: int, other: int) -> float:
        if self.places[one] != self.places[other]:
            return STRIDE
        return float(np.hypot(*(self.points[one] - self.points[other])))

    def _link(self, one: int, other: int, length: float) -> None:
        pair = (min(one, other), max(one, other))
        if one != other and pair not in self.links:
            self.links[pair] = max(length, 1e-3)
            self._ways = None

    def _homewards(self) -> tuple[Float64[np.ndarray, "points"], Int64[np.ndarray, "points"]]:
        """From each point, the length of the way home (m) and the next point on it."""
        if self._ways is None:
            count = len(self.points)
            pairs = np.array(list(self.links), np.int64).reshape(-1, 2)
            lengths = np.array(list(self.links.values()))
            graph = csr_array((lengths, (pairs[:, 0], pairs[:, 1])), shape=(count, count))
            self._ways = dijkstra(graph, directed=False, indices=0, return_predecessors=True)
        return self._ways


@njit(cache=True, error_model="numpy")
def can_go_straight(
    surfaces: np.ndarray, count: int, points: np.ndarray, clear: np.ndarray
) -> None:
    """Say of points (n, 2; robot's frame) before the robot whether nothing in view is in the way.

    `surfaces` (count, 4) are those in view. `clear` (n,) bool receives the answer.
    """
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        length = np.sqrt(x * x + y * y)
        clear[k] = x > 0.0 and SAME < length < SIGHT
        for j in range(count):
            if not clear[k]:
                break
            clear[k] = _passes_clear(surfaces[j], x / length, y / length, length)


@njit(cache=True, error_model="numpy")
def _passes_clear(wall: np.ndarray, ux: float, uy: float, length: float) -> bool:
    """Whether a straight way from the origin along (ux, uy) leaves a wall aside."""
    ax, ay = ux * wall[0] + uy * wall[1], ux * wall[1] - uy * wall[0]
    bx, by = ux * wall[2] + uy * wall[3], ux * wall[3] - uy * wall[2]
    # The part of the wall in the strip beside the way: does any of it lie before its end?
    low, high = 0.0, 1.0
    if ay != by:
        first, second = (-CLEARANCE - ay) / (by - ay), (CLEARANCE - ay) / (by - ay)
        low, high = max(low, min(first, second)), min(high, max(first, second))
    elif abs(ay) > CLEARANCE:
        return True
    if low > high:
        return True
    nearest = min(ax + low * (bx - ax), ax + high * (bx - ax))
    farthest = max(ax + low * (bx - ax), ax + high * (bx - ax))
    return bool(farthest < 0.0 or nearest > length + CLEARANCE)
