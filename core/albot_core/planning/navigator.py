"""The navigator: drives to places over ground that it maps as it goes."""

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
"""A belief that moves farther than this (m) from what the odometer says begins a new grid."""
WORTH = 1.5
"""A known way is left when it is so many times as long as the planned path."""


class KnownWay(NamedTuple):
    """A way that the robot has been before."""

    ahead: Points
    """A point that is next on it (m, robot's frame)."""
    length: float
    """How long it is (m)."""


class Navigator:
    """Goes to one target after another, the shortest way as far as it can tell.

    Ground that it has not seen yet counts as free, and the path is planned anew as it sees more
    (as in A. Stentz, Optimal and efficient path planning for partially-known environments, ICRA
    1994). It leaves a way that it knows where the planned path is much shorter, and returns to it
    where that turns out not to be so. Without a path it heads for the target (`GoalSeeker`).

    Args:
        config: How closely to pass things, and how fast.
    """

    _PLAN_EVERY = 5
    """Steps between two searches for the path."""
    _AT_HAND = 0.7
    """A target no farther away than this (m) is gone for straight: paths end about so near."""
    _FARTHEST = 25.0
    """A target farther away is replaced by the point so far (m) in its direction."""

    def __init__(self, config: SteeringConfig | None = None) -> None:
        self._config = config or SteeringConfig()
        self._seeker = GoalSeeker(self._config)

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew, on an empty grid."""
        self._seeker.reset(rng)
        self._grid = OccupancyGrid(OccupancyGridConfig(extent=30.0))
        self._pose: Pose | None = None
        self._route: Float64[np.ndarray, "cells 2"] = np.empty((0, 2))
        self._steps = 0
        self._leaves = False

    def command(self, percept: Percept, target: Points, known: KnownWay | None = None) -> Command:
        """How to drive next.

        Args:
            percept: What the robot senses and believes.
            target: Where to (m, robot's frame).
            known: The way there that it knows, if any.
        """
        self._update_grid(percept)
        if self._steps % self._PLAN_EVERY == 0:
            self._plan(percept, target, known)
        self._steps += 1
        if known is not None and not self._leaves:
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
        """Plan the path to the target or, where a known way is not much longer, along that."""
        self._route, length = self._find_route(percept, target)
        self._leaves = known is not None and WORTH * length < known.length < np.inf
        if known is not None and not self._leaves:
            self._route, _ = self._find_route(percept, known.ahead)

    def _find_route(
        self, percept: Percept, target: Points
    ) -> tuple[Float64[np.ndarray, "cells 2"], float]:
        """The path to a target (m, map frame), and its length (m), infinite where there is none."""
        distance = float(np.hypot(*target))
        goal = percept.to_map(target * min(1.0, self._FARTHEST / max(distance, 1e-9)))
        self._grid.grow_to(goal)
        paths = self._grid.shortest_paths(percept.pose, unknown_is_free=True, goal=goal)
        beyond = max(0.0, distance - self._FARTHEST)
        return self._grid.route(paths, goal), self._grid.length(paths, goal) + beyond

    def _update_grid(self, percept: Percept) -> None:
        """Mark what is in view, on a new grid where the belief has jumped."""
        if self._pose is not None:
            expected = compose(self._pose, percept.motion)
            if np.hypot(*(percept.pose - expected)[:2]) > JUMP:
                self._grid = OccupancyGrid(OccupancyGridConfig(extent=30.0))
                self._steps = 0
        self._pose = percept.pose
        self._grid.integrate(percept)


class GoalSeeker:
    """Heads straight for a place and, where it comes no nearer, makes a detour.

    It has no map: the detour's direction is drawn from those that are open.

    Args:
        config: How closely to pass things, and how fast.
    """

    _PATIENCE = 60
    """Steps without coming nearer after which it makes a detour."""
    _NEARER = 0.2
    """What counts as coming nearer (m)."""
    _DETOUR = 40
    """Steps of the first detour; each is longer by as many, …"""
    _LONGEST = 400
    """…up to this many."""
    _OPEN = 1.5
    """Free way of a direction that is open (m)."""

    def __init__(self, config: SteeringConfig | None = None) -> None:
        self._config = config or SteeringConfig()

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew."""
        self._rng = rng
        self._nearest = np.inf
        self._steps_in_vain = 0
        self._detours = 0
        self._left = 0
        self._aim = np.zeros(2)

    def command(self, percept: Percept, target: Float64[np.ndarray, "2"]) -> Command:
        """How to drive next towards a target (m, robot's frame)."""
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
        """Take in how far it is now; return whether it has not come nearer for too long."""
        self._steps_in_vain += 1
        if distance < self._nearest - self._NEARER:
            self._nearest, self._steps_in_vain = distance, 0
        if self._steps_in_vain <= self._PATIENCE:
            return False
        self._nearest, self._steps_in_vain = distance, 0
        return True

    def _start_detour(self, percept: Percept) -> None:
        """Aim at a place drawn from those that can be gone to straight, else behind."""
        ways = free_distances(percept.points, self._config.radius)
        open_ways = np.flatnonzero((ways > self._OPEN) & (np.abs(DIRECTIONS) <= np.pi / 2))
        bearing = np.pi
        distance = 2 * self._OPEN
        if len(open_ways):
            chosen = int(self._rng.choice(open_ways))
            bearing, distance = float(DIRECTIONS[chosen]), min(float(ways[chosen]), 6.0)
        ahead = compose(np.array((0.0, 0.0, bearing)), np.array((distance, 0.0, 0.0)))
        self._aim = ahead[:2]
