"""The frontier explorer: drives to the nearest frontier of the covered ground."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64, Int
from scipy import ndimage

from albot_core.planning.explorer import Explorer
from albot_core.planning.grid_search import BLOCKED, FREE, STEP
from albot_core.planning.occupancy_grid import ShortestPaths
from albot_core.planning.percept import Percept
from albot_core.planning.steering import SteeringConfig

_NEIGHBOURS = np.ones((3, 3), np.bool_)
_FAR = np.iinfo(np.int32).max


def find_frontiers(
    grid: Int[np.ndarray, "rows columns"],
    covered: Bool[np.ndarray, "rows columns"],
    least: int,
) -> Int[np.ndarray, "rows columns"]:
    """Return the frontiers: free, covered cells beside a cell that is neither covered nor blocked.

    The cells of each connected group have its number; all other cells are 0.

    Args:
        grid: `FREE`, `BLOCKED` or `UNKNOWN` for each cell.
        covered: Whether each cell is covered.
        least: Least number of cells of a frontier.
    """
    open_ground = ~covered & (grid != BLOCKED)
    edge = covered & (grid == FREE) & ndimage.binary_dilation(open_ground, _NEIGHBOURS)
    groups, _ = ndimage.label(edge, _NEIGHBOURS)
    return np.asarray(np.where(np.bincount(groups.ravel())[groups] >= least, groups, 0))


class FrontierExplorer(Explorer):
    """Drives to the nearest reachable frontier, again and again.

    After B. Yamauchi, A frontier-based approach for autonomous exploration, IEEE International
    Symposium on Computational Intelligence in Robotics and Automation (1997). There, a cell is
    known if a sensor has reached it. Here, a cell is known if it is covered, because coverage is
    the task.

    Args:
        coverage_range: Largest distance at which visible ground counts as covered (m).
        config: The steering parameters.
    """

    _SPARE = 0.1
    """Least width of a frontier beyond the robot's own (m); it does not fit through narrower
    ones."""
    _NEAR_BY = 0.4
    """Distance from a frontier at which it counts as reached (m)."""
    _APART = 0.8
    """Least distance of a frontier from those given up (m)."""

    def __init__(self, coverage_range: float = 2.0, config: SteeringConfig | None = None) -> None:
        super().__init__(coverage_range, config or SteeringConfig())

    def reset(self, rng: np.random.Generator) -> None:
        """Reset all state, and begin with a full turn to look around."""
        super().reset(rng)
        self._given_up: Float64[np.ndarray, "places 2"] = np.empty((0, 2))

    def _give_up(self, goal: Float64[np.ndarray, "2"]) -> None:
        """Exclude the frontiers around a goal."""
        self._given_up = np.vstack((self._given_up, goal))

    def _plan(self, percept: Percept) -> None:
        """Plan the path to the chosen frontier, or to the nearest; look around if none is left."""
        paths = self._grid.shortest_paths(percept.pose)
        places, lengths, groups = self._frontiers(paths)
        if not len(places):
            self._goal, self._given_up = None, np.empty((0, 2))
            self._look_round.begin()
            return
        if self._goal is not None:
            apart = np.hypot(*(places - self._goal).T)
            chosen = int(apart.argmin())
            if apart[chosen] > self._APART:
                self._goal = None
        if self._goal is None:
            chosen = int(lengths.argmin())
            self._stall.start(float(lengths[chosen]))
        ours = places[groups == groups[chosen]]
        self._goal = ours[np.hypot(*(ours - ours.mean(axis=0)).T).argmin()]
        self._route = self._grid.route(paths, self._goal)

    def _frontiers(
        self, paths: ShortestPaths
    ) -> tuple[
        Float64[np.ndarray, "cells 2"], Float64[np.ndarray, "cells"], Int[np.ndarray, "cells"]
    ]:
        """Return the cells of reachable frontiers.

        These are their positions (m, map frame), path lengths (m) and frontier numbers.
        """
        grid, cell = self._grid, self._grid.cell
        width = 2 * self._steering.robot.radius + self._SPARE
        groups = find_frontiers(*grid.window(paths), least=round(width / cell))
        reached = np.where(paths.lengths < 0, _FAR, paths.lengths)
        reached = ndimage.minimum_filter(reached, 2 * round(self._NEAR_BY / cell) + 1)
        rows, columns = np.nonzero((groups > 0) & (reached < _FAR))
        places = grid.centres(np.stack((rows, columns), axis=1) + paths.corner)
        apart = places[:, np.newaxis] - self._given_up
        kept = (np.hypot(apart[..., 0], apart[..., 1]) > self._APART).all(axis=1)
        rows, columns = rows[kept], columns[kept]
        return places[kept], reached[rows, columns] / STEP * cell, groups[rows, columns]
