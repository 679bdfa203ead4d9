"""The route explorer: takes each route that it sees, in both directions.

Milford, Prasser and Wyeth, Experience Mapping (2005): their robot is "set loose […] using its own
exploration algorithm, which attempts to learn all the possible routes through the environment"
(section 6), and exploration should "encourage 'turn arounds' in long narrow environments", that
transitions are learned in either direction of travel (section 7). They tell no more of it, so all
of this is ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.geometry.pose_kernels import bearings_of
from albot_core.geometry.poses import compose, wrap_angle
from albot_core.geometry.types import Points, Poses
from albot_core.planning.explorer import Explorer
from albot_core.planning.percept import Percept
from albot_core.planning.steering import DIRECTIONS, SteeringConfig, free_distances
from albot_core.ranges import POSITIVE, check_fields

Route = Float64[np.ndarray, "4"]
"""Where a route begins and its heading (m, rad), and the largest difference of heading at which a
trail over its end takes it (rad): pi where it is not narrow."""
Routes = Float64[np.ndarray, "routes 4"]
_LEFT, _RIGHT = len(DIRECTIONS) * 3 // 4, len(DIRECTIONS) // 4
"""Which directions point to the sides."""


@dataclass(frozen=True, kw_only=True)
class RouteExplorerConfig:
    """Parameters of the route explorer. All of them are ours."""

    length: float = 2.5
    """Free distance that makes a direction the beginning of a route (m)."""
    width: float = math.radians(90.0)
    """Largest angle between two directions of one route; a wider opening has several (rad)."""
    taken: float = 1.25
    """A route is taken if the robot has been this near to its end (m)…"""
    aligned: float = math.radians(75.0)
    """…in a narrow environment with a heading that differs by less than this from the route's, and
    elsewhere with any (rad)."""
    straight: float = 0.8
    """The way that it came is a route back if its ends are so far apart at least, as a share of its
    length."""
    unseen: float = math.radians(10.0)
    """Angle at either edge of the laser's view in which no route is looked for (rad)."""
    narrow: float = 1.5
    """An environment is narrow if the robot can move so far at most from side to side (m)."""
    trail_spacing: float = 0.25
    """Distance between the poses of its own trail that it remembers (m)."""
    turn_cost: float = 2.0
    """Cost of a turn towards a route (m of path per radian). So it drives straight on at junctions,
    and turns round only where no other route is near."""
    steering: SteeringConfig = field(default_factory=SteeringConfig)
    """The steering parameters."""

    def __post_init__(self) -> None:
        names = (each.name for each in fields(self))
        check_fields(self, POSITIVE, *(name for name in names if name != "steering"))


class RouteExplorer(Explorer):
    """Drives along one route after another that it has not taken yet in that direction.

    A *route* begins where the robot saw an open direction, and leads `length` along it. In a narrow
    environment, as a corridor, the way back is a route of its own, so the robot turns round at the
    end and drives back unless another untaken route is nearer. Of all untaken routes it takes the
    one with the shortest way to it. When all are taken, it begins anew.

    Args:
        config: The parameters.
    """

    _LOOK_EVERY = 3
    """Steps between two searches for routes."""
    _AT_HAND = 1.0
    """A route begins here if the robot is this near to its beginning (m)."""

    def __init__(self, config: RouteExplorerConfig = RouteExplorerConfig()) -> None:
        super().__init__(config.length, config.steering)
        self._config = config

    def reset(self, rng: np.random.Generator) -> None:
        """Reset all state, and begin with a full turn to look around."""
        super().reset(rng)
        self.rounds = 0
        """How many times all routes that it had seen were taken."""
        self._begin()

    def _begin(self) -> None:
        """Forget all routes, and which of them were taken."""
        self._trail: Poses = np.empty((0, 3))
        self._routes: Routes = np.empty((0, 4))  # Those not taken yet.
        self._given_up: Routes = np.empty((0, 4))
        self._chosen: Route | None = None
        self._is_on_route = False
        self._goal = None

    def _observe(self, percept: Percept) -> None:
        """Integrate the scan, and update the untaken routes."""
        self._grid.integrate(percept)
        self._extend_trail(percept)
        if self._steps % self._LOOK_EVERY == 0:
            self._add_routes(percept)
        self._steps += 1

    def _extend_trail(self, percept: Percept) -> None:
        """Remember the robot's pose, and drop the routes that it takes by being there."""
        pose = percept.pose
        if len(self._trail):
            if np.hypot(*(pose - self._trail[-1])[:2]) < self._config.trail_spacing:
                return
            # A robot that turns on the spot takes no route: only the direction of travel counts.
            heading = math.atan2(*(pose - self._trail[-1])[1::-1])
            pose = np.array((*pose[:2], heading))
        self._trail = np.vstack((self._trail, pose))
        self._routes = self._routes[~self._are_taken(self._routes, pose[None])]

    def _add_routes(self, percept: Percept) -> None:
        """Add the open directions in view, and the way back, unless they are known or taken."""
        config = self._config
        points = self._grid.obstacles_around(percept)
        free = free_distances(points, config.steering.radius)
        is_narrow = free[_LEFT] + free[_RIGHT] < config.narrow
        free[np.abs(DIRECTIONS) > percept.laser.bearings.max() - config.unseen] = 0.0
        bearings = open_directions(free, config.length, config.width)
        if is_narrow:
            bearings += self._way_back(percept)
        for bearing in bearings:
            pose = compose(percept.pose, np.array((0.0, 0.0, bearing)))
            route = np.array((*pose, config.aligned if is_narrow else math.pi))[None]
            known = np.concatenate((self._routes, self._given_up))
            others = np.concatenate((self._trail, ends(known, config.length)))
            if not self._are_taken(route, others)[0]:
                self._routes = np.vstack((self._routes, route))

    def _way_back(self, percept: Percept) -> list[float]:
        """Return the bearing of the way that it came, if it was straight for a route's length."""
        config = self._config
        before = self._trail[-round(config.length / config.trail_spacing) :][:1, :2]
        back = percept.to_robot(before)[0]
        is_straight = np.hypot(*back) > config.straight * config.length
        return [math.atan2(back[1], back[0])] if is_straight else []

    def _are_taken(self, routes: Routes, trail: Poses) -> Bool[np.ndarray, "routes"]:
        """Return whether a trail leads over the end of each route, in its direction."""
        apart = ends(routes, self._config.length)[:, None] - trail
        near = np.hypot(apart[..., 0], apart[..., 1]) < self._config.taken
        aligned = np.abs(wrap_angle(apart[..., 2])) <= routes[:, 3:]
        return np.asarray((near & aligned).any(axis=1))

    def _give_up(self, goal: Points) -> None:
        """Drop the chosen route; it is not offered again in this round."""
        assert self._chosen is not None
        given = self._chosen[None]
        self._given_up = np.vstack((self._given_up, given))
        end = ends(given, self._config.length)
        self._routes = self._routes[~self._are_taken(self._routes, end)]
        self._chosen = self._goal = None

    def _maybe_drop_goal(self, percept: Percept) -> None:
        """Drop the chosen route if it is taken, or cannot be taken."""
        if self._chosen is None or self._goal is None:
            return
        if not (self._routes == self._chosen).all(axis=1).any():
            self._chosen = self._goal = None
            return
        has_arrived = np.hypot(*(self._goal - percept.pose[:2])) < self._ARRIVED
        if self._stall.update(percept.pose):
            self._give_up(self._goal)
            self._stall.start_recovery(self._rng)
        elif has_arrived and self._is_on_route:  # At its end, but with another heading.
            self._give_up(self._goal)
        elif has_arrived:
            self._goal = None  # At its beginning: now along it.

    def _plan(self, percept: Percept) -> None:
        """Search the path to the beginning of the chosen route, or along it; or choose a route."""
        grid, paths = self._grid, self._grid.shortest_paths(percept.pose)
        if self._chosen is None:
            there = ends(self._routes, self._config.length)
            is_narrow = self._routes[:, 3:] < math.pi
            aims = np.where(is_narrow, self._routes[:, :3], there)[:, :2]
            lengths = np.array([grid.length(paths, aim) for aim in aims])
            if not np.isfinite(lengths).any():
                self.rounds += 1
                self._begin()
                self._look_round.begin()
                return
            turns = np.abs(bearings_of(percept.to_robot(there[:, :2])))
            best = int((lengths + self._config.turn_cost * turns).argmin())
            self._chosen, self._is_on_route = self._routes[best], not is_narrow[best]
            self._stall.start(float(lengths[best]) + self._config.length)
        begin, end = self._chosen[:2], ends(self._chosen[None], self._config.length)[0, :2]
        self._is_on_route |= bool(np.hypot(*(begin - percept.pose[:2])) < self._AT_HAND)
        self._goal = end if self._is_on_route else begin
        self._route = grid.route(paths, self._goal)


def ends(routes: Routes, length: float) -> Poses:
    """Return the poses at the ends of routes of a length (m)."""
    return compose(routes[:, :3], np.array((length, 0.0, 0.0)))


def open_directions(
    free: Float64[np.ndarray, "directions"], length: float, width: float
) -> list[float]:
    """Return a bearing for each opening: the middle of it, or several if it is wide.

    Args:
        free: Free distance in each of `DIRECTIONS` (m).
        length: Least free distance of an opening (m).
        width: Largest angle between two bearings (rad).
    """
    is_open = free >= length
    count = len(DIRECTIONS)
    if is_open.all():
        parts = math.ceil(2 * math.pi / width)
        return [float(wrap_angle(2 * math.pi * k / parts)) for k in range(parts)]
    # Begin behind a closed direction, so that no opening is cut in two.
    shift = int(np.flatnonzero(~is_open)[0])
    edges = np.diff(np.roll(is_open, -shift).astype(int), append=0)
    starts, stops = np.flatnonzero(edges == 1) + 1, np.flatnonzero(edges == -1) + 1
    bearings = []
    for start, stop in zip(starts, stops, strict=True):
        parts = max(1, math.ceil((stop - start) * 2 * math.pi / count / width))
        for k in range(parts):
            middle = start + (stop - start) * (k + 0.5) / parts - 0.5
            bearing = DIRECTIONS[0] + (middle + shift) * 2 * math.pi / count
            bearings.append(float(wrap_angle(bearing)))
    return bearings
