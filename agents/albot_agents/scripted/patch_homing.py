"""An agent that drives home by what `map_patch` shows, without hints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from gymnasium.spaces import Space
from jaxtyping import Float64
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from albot_agents.agent import Action, EnvironmentConfigs
from albot_agents.scripted.homing import MapHoming
from albot_core.errors import InputError
from albot_core.geometry.poses import inverse, relative, transform_points
from albot_core.geometry.types import Points, Pose
from albot_core.planning.navigator import KnownWay
from albot_env.tasks.core.parts.beliefs import HOME
from albot_env.tasks.core.parts.map_patch import MAP_PATCH, MapPatch


class PatchHoming(MapHoming):
    """Drives home over the cells of the smallest patch of its map, back along its own trail.

    The way leads over cells in which it has been before or which it knows to be free. Within the
    patch it ends at home; if home is beyond it, at the oldest part of the trail that the patch
    shows. It does not lead over surfaces that the laser saw lately, if the patch shows them. What
    holds the robot up is avoided for a while. Else it drives as `map-homing`.

    Args:
        configs: The environment's configurations of observations and actions.

    Raises:
        InputError: Observations lack the part `map_patch`, or its channel `trail`.
    """

    name: ClassVar[str] = "patch-homing"

    COSTS: ClassVar[dict[str, float]] = {
        "free": 2.0,
        "walls": 40.0,
        "trail": 1.0,
        "obstacles": 400.0,
    }
    """Length of a way through a cell, divided by its side: free cells, those with a wall, through
    which a doorway may lead, those of the trail, and those in which the laser saw a surface lately.
    Where a cell shows several, the last counts."""
    UNKNOWN = 8.0
    """The same for cells of which nothing is known."""
    AHEAD = 1.8
    """Distance of the point on the way to which it drives (m)."""
    PLAN_EVERY = 5
    """Number of steps between two searches."""
    MOVED = 0.5
    """The robot is held up until it has moved so far (m)."""
    HELD_UP = 60
    """Number of steps of being held up after which what is ahead is avoided."""
    AVOIDED = 1.0
    """Radius of what is avoided (m)."""
    AVOIDING = 900
    """Number of steps for which it is avoided."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        super().__init__(configs)
        configs.observations.require((MAP_PATCH.name,), self.name)
        channels = configs.observations.map_patch.shown
        if "trail" not in channels:
            expected = "a map_patch with the channel trail"
            raise InputError(self.name, expected, ", ".join(channels))

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode."""
        super().reset(rng, actions)
        self._steps, self._since = 0, 0
        self._held_at = np.full(2, np.inf)
        self._way: _Way | None = None
        self._avoided: list[tuple[Points, int]] = []

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the action that drives on towards home, or declares home."""
        percept = self._decode(observation)
        pose, home = percept.pose, inverse(percept.pose)[:2]
        if np.hypot(*home) < self.ARRIVED:
            return self._declare()
        if self._steps % self.PLAN_EVERY == 0:
            self._way = self._search(observation, pose)
        self._steps += 1
        self._notice_hold_up(pose)
        known = None
        if self._way is not None:
            ahead = transform_points(relative(pose, self._way.pose), self._way.ahead)
            known = KnownWay(ahead, self._way.length)
        return self._drive(self._driver.command(percept, home, known), observation)

    def _notice_hold_up(self, pose: Pose) -> None:
        """Avoid what is ahead on the way if the robot has not moved for a while."""
        if math.dist(pose[:2], self._held_at) > self.MOVED:
            self._held_at, self._since = pose[:2].copy(), self._steps
        elif self._steps - self._since > self.HELD_UP and self._way is not None:
            point = transform_points(self._way.pose, self._way.ahead)
            self._avoided.append((point, self._steps + self.AVOIDING))
            self._since = self._steps

    def _search(self, observation: Any, pose: Pose) -> _Way | None:
        """Return the way over the smallest patch; None if it leads nowhere."""
        config = self._observation_config
        patch = config.decode(MAP_PATCH, observation)
        home = config.decode(HOME, observation)
        costs, cell = self._costs(patch, pose), patch.sides[0] / config.map_patch.cells
        goal = _goal(patch, np.asarray(home, np.float64), cell)
        if goal is None:
            return None
        cells = shortest_path(costs, goal)
        if cells is None or len(cells) < 2:
            return None
        half = (len(costs) - 1) / 2
        points = (half - cells) * cell
        length = float(np.hypot(*np.diff(points, axis=0).T).sum())
        beyond = np.hypot(*points[-1] - home)
        away = np.hypot(*points.T)
        ahead = points[np.argmax(away >= self.AHEAD)] if (away >= self.AHEAD).any() else points[-1]
        return _Way(pose.copy(), ahead, length + float(beyond))

    def _costs(self, patch: MapPatch, pose: Pose) -> Float64[np.ndarray, "cells cells"]:
        """Return the cost of each cell of the smallest patch."""
        shown = {name: square[0] > -1 for name, square in patch.channels.items()}
        cells = shown["trail"].shape
        costs = np.full(cells, self.UNKNOWN)
        for name, cost in self.COSTS.items():
            if name in shown:
                costs[shown[name]] = cost
        half, cell = (cells[0] - 1) / 2, patch.sides[0] / cells[0]
        rows, columns = np.indices(cells)
        self._avoided = [(point, end) for point, end in self._avoided if end > self._steps]
        for point, _ in self._avoided:
            ahead, left = transform_points(inverse(pose), point)
            away = np.hypot((half - rows) * cell - ahead, (half - columns) * cell - left)
            costs[away < self.AVOIDED] = 10 * self.COSTS["walls"]
        return costs


class _Way(NamedTuple):
    """A way over a patch."""

    pose: Pose
    """Pose of the robot at the search (frame of home)."""
    ahead: Points
    """The point ahead (m, the robot's frame then)."""
    length: float
    """Length of the way (m)."""


def _goal(patch: MapPatch, home: Points, cell: float) -> tuple[int, int] | None:
    """Return the cell of the smallest patch to drive to; None if no home or trail is shown."""
    cells = patch.channels["trail"].shape[1]
    if np.abs(home).max() < 0.5 * patch.sides[0]:
        row, column = (cells / 2 - home / cell).astype(int)
        return min(int(row), cells - 1), min(int(column), cells - 1)
    trail = np.where(patch.channels["trail"][0] > -1, patch.channels["trail"][0], np.inf)
    if not np.isfinite(trail).any():
        return None
    row, column = np.unravel_index(int(np.argmin(trail)), trail.shape)
    return int(row), int(column)


def shortest_path(
    costs: Float64[np.ndarray, "cells cells"], goal: tuple[int, int]
) -> Points | None:
    """Return the cells (row, column) of the cheapest way from the middle to a goal, in its order.

    None if there is none. `grid_graph` says what a step costs.
    """
    side = len(costs)
    start = side // 2 * (side + 1)
    target = goal[0] * side + goal[1]
    _, before = dijkstra(
        grid_graph(costs), directed=False, indices=target, return_predecessors=True
    )
    way = [start]
    while way[-1] != target:
        ahead = int(before[way[-1]])
        if ahead < 0:
            return None
        way.append(ahead)
    return np.stack(np.unravel_index(way, costs.shape), axis=1).astype(np.float64)


def grid_graph(costs: Float64[np.ndarray, "cells cells"]) -> csr_array:
    """Return the graph of steps between the cells of a square, by their flat indices.

    A step to one of eight neighbours costs its length times the mean of the two cells' costs.
    """
    side = len(costs)
    number = np.arange(side * side).reshape(side, side)
    starts, ends, lengths = [], [], []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        one = number[: side - down, max(0, -right) : side - max(0, right)]
        other = number[down:, max(0, right) : side - max(0, -right)]
        starts.append(one.ravel())
        ends.append(other.ravel())
        mean = 0.5 * (costs.ravel()[one] + costs.ravel()[other])
        lengths.append((math.hypot(down, right) * mean).ravel())
    return csr_array(
        (np.concatenate(lengths), (np.concatenate(starts), np.concatenate(ends))),
        shape=(side * side, side * side),
    )
