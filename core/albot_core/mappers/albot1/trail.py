"""Where the robot has gone: the ground in its places that it knows to be passable.

The thesis's places are descriptions of what was seen; finding the way from one exit of a large
place to the next wants to know where one can go as well. This is ours: the robot remembers,
place by place, the points that it has come through, as far apart as a stride, and which of
them follow on one another. Of a long journey it remembers the points trodden on last, and the
ways home from them: what it remembers does not grow for ever.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.albot1.homewards import HOME, Homewards, rebuilt_homewards
from albot_core.mappers.albot1.trail_kernels import Steps, has_room, look_about, tread_on

STRIDE = 0.5
"""The robot treads on the trail this often (m)."""
LOOK_ROUND = np.radians(45.0)
"""Having turned so far it looks for points of the trail anew (rad)."""
AHEAD = 2.0
"""How far ahead on the trail the point is that is shown as the way (m)."""
REACH = 1.0
"""From a point of the present place no farther away than this one may set out (m)."""


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
        self.homewards = Homewards()
        """Which points follow on one another, and the ways home over them."""
        self.steps = _made(len(self.homewards.graph.lengths))
        """The arrays, which are exchanged for larger ones when they are full."""

    def forget(self) -> None:
        """Remember no point."""
        self.homewards.graph.counts[:] = 0
        self.steps.last[:] = -1, 0

    @property
    def points(self) -> Float64[np.ndarray, "points 2"]:
        """In the enduring frame of the network of places (m)."""
        points: Float64[np.ndarray, "points 2"] = self.steps.points[: self._count]
        return points

    @property
    def places(self) -> Int64[np.ndarray, "points"]:
        """In which place each is."""
        places: Int64[np.ndarray, "points"] = self.steps.places[: self._count]
        return places

    @property
    def strides(self) -> Int64[np.ndarray, "points"]:
        """The stride at which each was trodden on last."""
        strides: Int64[np.ndarray, "points"] = self.steps.strides[: self._count]
        return strides

    @property
    def last(self) -> int:
        """The point trodden on last; -1 where the robot did not walk from there."""
        return int(self.steps.last[0])

    @property
    def _count(self) -> int:
        return int(self.homewards.graph.counts[0])

    def leave(self) -> None:
        """The robot did not walk from the last point to where it is now."""
        self.steps.last[0] = -1

    def make_room(self) -> bool:
        """See to it that there is room for a stride; true where there are other arrays now."""
        if has_room(self.homewards.graph):
            return False
        self.homewards.make_room(self._count + 1)
        room = len(self.homewards.graph.lengths)
        if room > len(self.steps.places):
            self.steps = _copied(self.steps, room)
        return True

    def tread(self, place: int, pose: Pose, view: Segments) -> None:
        """The robot has come a stride farther, or turned to look elsewhere.

        Args:
            place: The place that it believes to be in.
            pose: Where it is in the enduring frame.
            view: The surfaces in view, in its own frame (m).
        """
        self.make_room()
        tread_on(self.steps, self.homewards.graph, place, pose, view)

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


def rebuilt_trail(
    points: Float64[np.ndarray, "points 2"],
    places: Int64[np.ndarray, "points"],
    strides: Int64[np.ndarray, "points"],
    last: int,
    links: Float64[np.ndarray, "links 3"],
) -> Trail:
    """The trail with these points and links (see `Trail`, `Homewards.links`)."""
    trail = Trail()
    trail.homewards = rebuilt_homewards(len(points), links)
    trail.steps = steps = _made(len(trail.homewards.graph.lengths))
    for array, kept in zip(steps, (points, places, strides), strict=False):
        array[: len(kept)] = kept
    steps.last[:] = last, strides.max(initial=-1) + 1
    return trail


def _made(room: int) -> Steps:
    """No points, with room for so many."""
    return Steps(
        points=np.zeros((room, 2)),
        places=np.zeros(room, np.int64),
        strides=np.zeros(room, np.int64),
        last=np.array((-1, 0)),
    )


def _copied(steps: Steps, room: int) -> Steps:
    """The same with room for so many points."""
    larger = _made(room)
    for old, new in zip(steps, larger, strict=True):
        new[: len(old)] = old
    return larger
