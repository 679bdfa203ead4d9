"""Frontiers: where the ground that was covered borders on ground that was not."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64, Int
from scipy import ndimage

from albot_core.planning.explorer import Explorer
from albot_core.planning.senses import Senses
from albot_core.planning.sketch import Ways
from albot_core.planning.sketch_kernels import BLOCKED, FREE, STEP
from albot_core.planning.steering import SteeringConfig

_NEIGHBOURS = np.ones((3, 3), np.bool_)
_FAR = np.iinfo(np.int32).max


def find_frontiers(
    grid: Int[np.ndarray, "rows columns"],
    covered: Bool[np.ndarray, "rows columns"],
    least: int,
) -> Int[np.ndarray, "rows columns"]:
    """The frontiers: cells, free and covered, beside one that is neither covered nor blocked.

    Each connected group of them has a number; all other cells are 0.

    Args:
        grid: `FREE`, `BLOCKED` or `UNKNOWN` for each cell.
        covered: Which cells are covered.
        least: Connected groups of fewer cells are no frontiers.
    """
    open_ground = ~covered & (grid != BLOCKED)
    edge = covered & (grid == FREE) & ndimage.binary_dilation(open_ground, _NEIGHBOURS)
    groups, _ = ndimage.label(edge, _NEIGHBOURS)
    return np.asarray(np.where(np.bincount(groups.ravel())[groups] >= least, groups, 0))


class FrontierExplorer(Explorer):
    """Goes to the nearest frontier that it can come to, over and over.

    After B. Yamauchi, A frontier-based approach for autonomous exploration, IEEE International
    Symposium on Computational Intelligence in Robotics and Automation (1997). There, cells are
    known that the sensors reach. Here, known is what is covered, since that is what counts.

    Args:
        near: Ground in view and no farther away than this is covered (m).
        config: How closely to pass things, and how fast.
    """

    _LEAST = 0.6
    """A frontier narrower than this is none (m): the robot does not fit through."""
    _NEAR_BY = 0.4
    """A frontier no farther than this from where the robot can come to is one it can reach (m)."""
    _ARRIVED = 0.3
    """How near to a frontier the robot is there (m)."""
    _APART = 0.8
    """No frontier so near to one that was given up is gone to (m)."""

    def __init__(self, near: float = 2.0, config: SteeringConfig | None = None) -> None:
        super().__init__(near, config or SteeringConfig())

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew, by looking all around."""
        super().reset(rng)
        self._given_up: Float64[np.ndarray, "places 2"] = np.empty((0, 2))

    def _give_up_where_vain(self, senses: Senses) -> None:
        """Drop a goal that cannot be come nearer, or that is no nearer to what is new."""
        if self._goal is None:
            return
        stuck = self._patience.lost(senses.pose)
        if stuck or np.hypot(*(self._route[-1] - senses.pose[:2])) < self._ARRIVED:
            self._given_up = np.vstack((self._given_up, self._goal))
            self._goal = None
        if stuck:
            self._patience.recover(self._rng)

    def _plan(self, senses: Senses) -> None:
        """Go on to the frontier chosen, else to the nearest; where none is left look round."""
        ways = self._sketch.ways(senses.pose)
        places, lengths, groups = self._frontiers(ways)
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
            self._patience.begin(float(lengths[chosen]))
        ours = places[groups == groups[chosen]]
        self._goal = ours[np.hypot(*(ours - ours.mean(axis=0)).T).argmin()]
        self._route = self._sketch.route(ways, self._goal)

    def _frontiers(
        self, ways: Ways
    ) -> tuple[
        Float64[np.ndarray, "cells 2"], Float64[np.ndarray, "cells"], Int[np.ndarray, "cells"]
    ]:
        """Cells of frontiers that can be come to.

        Where they are (m, map frame), how long the ways are (m), and their frontiers' numbers.
        """
        sketch, cell = self._sketch, self._sketch.cell
        groups = find_frontiers(*sketch.part(ways), least=round(self._LEAST / cell))
        reached = np.where(ways.lengths < 0, _FAR, ways.lengths)
        reached = ndimage.minimum_filter(reached, 2 * round(self._NEAR_BY / cell) + 1)
        rows, columns = np.nonzero((groups > 0) & (reached < _FAR))
        places = sketch.middles(np.stack((rows, columns), axis=1) + ways.corner)
        apart = places[:, np.newaxis] - self._given_up
        kept = (np.hypot(apart[..., 0], apart[..., 1]) > self._APART).all(axis=1)
        rows, columns = rows[kept], columns[kept]
        return places[kept], reached[rows, columns] / STEP * cell, groups[rows, columns]
