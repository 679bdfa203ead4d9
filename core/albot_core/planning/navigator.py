"""The navigator: drives to targets, and maps the ground on the way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, inverse, transform_points
from albot_core.geometry.types import Points, Pose
from albot_core.planning.occupancy_grid import OccupancyGrid, OccupancyGridConfig
from albot_core.planning.percept import Percept
from albot_core.planning.steering import (
    DIRECTIONS,
    Command,
    SteeringConfig,
    admissible_command,
    free_distances,
    steer,
)

JUMP = 0.4
"""Difference (m) between estimated and odometer motion after which a new grid begins."""
WORTH = 1.5
"""Ratio of a known way's length to the planned path's above which the known way is left."""


class KnownWay(NamedTuple):
    """A way that the robot has driven before."""

    ahead: Points
    """The next point on it (m, robot's frame)."""
    length: float
    """Its length (m)."""


class Navigator:
    """Drives to a target by the shortest path over the ground known so far.

    Unseen ground counts as free, and the path is planned again as more is seen (as in A. Stentz,
    Optimal and efficient path planning for partially-known environments, ICRA 1994). The robot
    leaves a known way if the planned path is much shorter, and returns to it if the path turns out
    not to be. It also leaves one that is barred, until it has passed what bars it. Without a path
    it heads for the target (`GoalSeeker`).

    Args:
        config: The steering parameters.
    """

    _PLAN_EVERY = 5
    """Steps between two path searches."""
    _AT_HAND = 0.7
    """Distance (m) within which a target is approached straight; paths end about there."""
    _BARRED = 10
    """Number of searches that find the known way barred, after which it is left."""
    _FARTHER = 0.5
    """Decrease of the known way's length that counts as progress on it (m)."""
    _FARTHEST = 25.0
    """Largest planning distance (m); a farther target is replaced by the point in its direction."""

    def __init__(self, config: SteeringConfig | None = None) -> None:
        self._config = config or SteeringConfig()
        self._seeker = GoalSeeker(self._config)

    def reset(self, rng: np.random.Generator) -> None:
        """Reset all state, with an empty grid."""
        self._seeker.reset(rng)
        self._grid = self._empty_grid()
        self._pose: Pose | None = None
        self._route: Float64[np.ndarray, "cells 2"] = np.empty((0, 2))
        self._steps = 0
        self._leaves_known_way = False
        self._least, self._times_barred = np.inf, 0

    def command(self, percept: Percept, target: Points, known: KnownWay | None = None) -> Command:
        """Return the next drive command.

        Args:
            percept: The current percept.
            target: The target (m, robot's frame).
            known: A known way to the target; None for none.
        """
        self._update_grid(percept)
        if self._steps % self._PLAN_EVERY == 0:
            self._plan(percept, target, known)
        self._steps += 1
        if known is not None and not self._leaves_known_way:
            target = known.ahead
        if not len(self._route):
            return self._seeker.command(percept, target)
        ahead = target
        if np.hypot(*target) > self._AT_HAND:
            ahead = percept.to_robot(
                self._grid.lookahead_point(percept.pose, self._route, unknown_is_free=True)
            )
        wanted = steer(self._grid.obstacles_around(percept), ahead, self._config)
        return admissible_command(wanted, percept.points, percept.motion, self._config)

    def _plan(self, percept: Percept, target: Points, known: KnownWay | None) -> None:
        """Plan the path to the target, or along the known way if that is not much longer."""
        self._route, length = self._find_route(percept, target)
        self._leaves_known_way = False
        if known is None:
            return
        route, to_ahead = self._find_route(percept, known.ahead)
        is_barred = self._is_barred(known, to_ahead)
        self._leaves_known_way = is_barred or WORTH * length < known.length < np.inf
        if not self._leaves_known_way:
            self._route = route

    def _is_barred(self, known: KnownWay, to_ahead: float) -> bool:
        """Return whether the known way is barred: by a door that was shut meanwhile, for example.

        It is once its next point could often only be reached by a detour, and the robot has come
        no farther on it; until the robot has come farther. Where the point lies varies.

        Args:
            known: The known way.
            to_ahead: Length of the path to its next point (m).
        """
        if known.length < self._least - self._FARTHER:
            self._least, self._times_barred = known.length, 0
        straight = float(np.hypot(*known.ahead))
        self._times_barred += to_ahead > WORTH * straight + self._AT_HAND
        return self._times_barred >= self._BARRED

    def _find_route(
        self, percept: Percept, target: Points
    ) -> tuple[Float64[np.ndarray, "cells 2"], float]:
        """Return the path to a target (m, map frame) and its length (m); infinite without one."""
        distance = float(np.hypot(*target))
        goal = percept.to_map(target * min(1.0, self._FARTHEST / max(distance, 1e-9)))
        self._grid.grow_to(goal)
        paths = self._grid.shortest_paths(percept.pose, unknown_is_free=True, goal=goal)
        beyond = max(0.0, distance - self._FARTHEST)
        return self._grid.route(paths, goal), self._grid.length(paths, goal) + beyond

    def _update_grid(self, percept: Percept) -> None:
        """Integrate the scan into the grid; begin a new grid if the estimated pose has jumped."""
        if self._pose is not None:
            expected = compose(self._pose, percept.motion)
            if np.hypot(*(percept.pose - expected)[:2]) > JUMP:
                self._grid = self._empty_grid()
                self._steps = 0
        self._pose = percept.pose
        self._grid.integrate(percept)

    def _empty_grid(self) -> OccupancyGrid:
        radius = self._config.robot.radius
        return OccupancyGrid(OccupancyGridConfig(robot_radius=radius, extent=30.0))


class GoalSeeker:
    """Heads straight for a target, and makes a detour if it comes no nearer.

    It has no map; the detour's direction is drawn from the open directions.

    Args:
        config: The steering parameters.
    """

    _STALL_STEPS = 60
    """Steps without progress after which it makes a detour."""
    _NEARER = 0.2
    """Least decrease in distance that counts as progress (m)."""
    _DETOUR = 40
    """Steps of the first detour; each further one is longer by this number."""
    _LONGEST = 400
    """Largest number of steps of a detour."""
    _OPEN = 1.5
    """Least free distance in an open direction (m)."""

    def __init__(self, config: SteeringConfig | None = None) -> None:
        self._config = config or SteeringConfig()

    def reset(self, rng: np.random.Generator) -> None:
        """Reset all state."""
        self._rng = rng
        self._nearest = np.inf
        self._steps_without_progress = 0
        self._detours = 0
        self._left = 0
        self._aim = np.zeros(2)

    def command(self, percept: Percept, target: Float64[np.ndarray, "2"]) -> Command:
        """Return the next drive command towards a target (m, robot's frame)."""
        self._aim = transform_points(inverse(percept.motion), self._aim)
        if self._left:
            self._left -= 1
            if np.hypot(*self._aim) < self._config.lookahead:
                self._start_detour(percept)
        elif self._update_progress(float(np.hypot(*target))):
            self._detours += 1
            self._left = min(self._DETOUR * self._detours, self._LONGEST)
            self._start_detour(percept)
        wanted = steer(percept.points, self._aim if self._left else target, self._config)
        return admissible_command(wanted, percept.points, percept.motion, self._config)

    def _update_progress(self, distance: float) -> bool:
        """Update with the current distance (m); return whether progress has stalled."""
        self._steps_without_progress += 1
        if distance < self._nearest - self._NEARER:
            self._nearest, self._steps_without_progress = distance, 0
        if self._steps_without_progress <= self._STALL_STEPS:
            return False
        self._nearest, self._steps_without_progress = distance, 0
        return True

    def _start_detour(self, percept: Percept) -> None:
        """Aim in a random open direction; backward if none is open."""
        ways = free_distances(percept.points, self._config.radius)
        open_ways = np.flatnonzero((ways > self._OPEN) & (np.abs(DIRECTIONS) <= np.pi / 2))
        bearing = np.pi
        distance = 2 * self._OPEN
        if len(open_ways):
            chosen = int(self._rng.choice(open_ways))
            bearing, distance = float(DIRECTIONS[chosen]), min(float(ways[chosen]), 6.0)
        ahead = compose(np.array((0.0, 0.0, bearing)), np.array((distance, 0.0, 0.0)))
        self._aim = ahead[:2]
