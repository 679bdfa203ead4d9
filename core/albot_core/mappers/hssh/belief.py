"""What is believed of the building: the preferred map, laid out, and what follows from it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.poses import compose, transform_points
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.mappers.hssh.layout import frames_of, gateways_of
from albot_core.mappers.hssh.topological_map import OPEN, Gateway, TopologicalMap
from albot_core.mappers.hssh.visits import Visits
from albot_core.mappers.hssh.way_home import Routes, routes_home
from albot_core.mappers.mapper import EXIT, POINT, TRAVEL, WayHome


class Belief:
    """The preferred map of the tree, with the present visit as it is perceived so far.

    Args:
        visits: All visits; later updates change the present one.
        best: The map; None for that of the first place alone.
    """

    def __init__(self, visits: Visits, best: TopologicalMap | None) -> None:
        self._visits, self.best = visits, best
        self.frames: Poses = np.zeros((1, 3))
        """The pose of each visit's odometry frame in the map."""
        self.places = [0]
        """The place of each visit."""
        if best is not None:
            self.frames = frames_of(visits, best)
            self.places = [visit.place for visit in best.visits]
        self._routes: Routes | None = None

    @property
    def map(self) -> TopologicalMap:
        """The map."""
        return self.best or TopologicalMap.beginning(self._visits.star(0))

    @property
    def frame(self) -> Pose:
        """The pose of the odometry's frame in the map, as of the present visit."""
        return np.asarray(self.frames[-1])

    def visit_of_readings(self, count: int) -> Int64[np.ndarray, "readings"]:
        """Return the visit during which, or after which, each of some readings was taken."""
        entered = [self._visits[k].entered for k in range(len(self._visits))]
        return np.searchsorted(entered, np.arange(count), side="right") - 1

    def nearest_reading(self, poses: Sequence[Pose], claim: float) -> int:
        """Return the reading of an earlier visit to this place that was taken nearest to here.

        Args:
            poses: The pose at each reading, in the frame of the odometry; the last one is here.
            claim: Largest distance from here (m). If all are farther, or the robot is at no place,
                the reading is -1.
        """
        number, matched = len(self._visits) - 1, -1
        if self._visits.is_away:
            return matched
        here = compose(self.frames[number], poses[-1])[:2]
        nearest = claim
        for k in range(number):
            if self.places[k] != self.places[number]:
                continue
            span = slice(self._visits[k].entered, self._visits[k + 1].entered)
            stood = np.array(poses[span])[:, :2]
            away = np.hypot(*(transform_points(self.frames[k], stood) - here).T)
            if away.min() < nearest:
                nearest = float(away.min())
                matched = self._visits[k].entered + int(away.argmin())
        return matched

    def way_home(self, here: Float64[np.ndarray, "2"], ahead: float) -> WayHome:
        """Return the shortest way home over gateways and paths: the next gateway, and its length.

        In the place of home it leads straight there.

        Args:
            here: The robot's position in the map (m).
            ahead: Distance of the point that is reported, at least (m).
        """
        way = np.full(7, np.nan)
        way[TRAVEL] = float(np.hypot(*here))
        if not len(self._visits):
            return way
        leaf, is_away = self.map, self._visits.is_away
        if leaf.here.place == 0 and not is_away:
            return way
        lines = gateways_of(self._visits, leaf, self.frames)
        middles = [np.asarray((each[:, :2] + each[:, 2:]) / 2) for each in lines]
        if self._routes is None:
            self._routes = routes_home(self._travelled(leaf), middles, np.zeros(2))
        lengths, onward = self._routes
        choices = [each for each in self._next_gateways(leaf) if each in lengths]
        if not choices:
            way[TRAVEL] = np.inf
            return way

        def length(gateway: Gateway) -> float:
            return lengths[gateway] + float(np.hypot(*(middles[gateway[0]][gateway[1]] - here)))

        target = min(choices, key=length)
        way[TRAVEL] = length(target)
        if not is_away:
            way[EXIT] = lines[target[0]][target[1]]
        at = target
        while at != OPEN:
            point: Points = middles[at[0]][at[1]]
            if np.hypot(*(point - here)) >= ahead:
                way[POINT] = point
                break
            at = onward[at]
        return way

    def _next_gateways(self, leaf: TopologicalMap) -> list[Gateway]:
        """Return the gateways that the robot can go to straight from where it is."""
        if not self._visits.is_away:
            place = leaf.here.place
            return [(place, k) for k in range(leaf.stars[place].gateways)]
        number = len(self._visits) - 1
        behind = leaf.gateway(self._visits[number].left, number)
        ahead = leaf.joined[behind[0]][behind[1]]
        return [behind, *([] if ahead == OPEN else [ahead])]

    def _travelled(self, leaf: TopologicalMap) -> list[tuple[Gateway, Gateway]]:
        """Return the gateways between which the robot has travelled."""
        visits = [self._visits[k] for k in range(len(leaf.visits))]
        return [
            (leaf.gateway(before.left, k), leaf.gateway(after.arrived, k + 1))
            for k, (before, after) in enumerate(pairwise(visits))
        ]
