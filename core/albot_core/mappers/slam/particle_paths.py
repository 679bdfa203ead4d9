"""Particles: weighted hypotheses of the robot's path, each with the map that follows from it.

A Rao-Blackwellised particle filter (A. Doucet et al., UAI 2000; K. Murphy, NIPS 1999). Each
particle holds a whole path of the robot and a map; subclasses say what the maps are. Paths share
their common beginning.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.types import Poses
from albot_core.mappers.schema import Arrays, Field, Schema
from albot_core.mappers.slam.grid import LogOddsGrid
from albot_core.mappers.stored import Stored
from albot_core.sensing.reading import LaserScan


class ParticlePaths(Stored, ABC):
    """The paths and weights of particles, which start at the origin of the map.

    Args:
        count: Number of particles.
    """

    SCHEMA = Schema(
        Field("particles.poses", "updates+1 particles 3", at=None),
        Field("particles.parents", "updates+1 particles", int, at=None, least=0, below="particles"),
        Field("particles.log_weights", "particles", at="log_weights"),
    )

    def __init__(self, count: int) -> None:
        self.count = count
        self.clear()

    def clear(self) -> None:
        """Reset all particles to the origin, with empty maps."""
        self.poses: Poses = np.zeros((self.count, 3))
        """The robot's pose by each particle (map frame), (particles, 3)."""
        self.log_weights: Float64[np.ndarray, "particles"] = np.zeros(self.count)
        """Log-weight of each particle, up to a common constant."""
        self._parents: Int64[np.ndarray, "particles"] = np.arange(self.count)
        self._way: list[Poses] = []
        self._lineage: list[np.ndarray] = []

    @abstractmethod
    def integrate(self, scan: LaserScan) -> None:
        """Enter a scan into each map, at its particle's pose."""

    @abstractmethod
    def grid(self, particle: int) -> LogOddsGrid:
        """Return the grid of a particle; it is valid until the next scan or resampling."""

    @abstractmethod
    def _take_maps(self, chosen: Int64[np.ndarray, "particles"]) -> None:
        """Replace the map of each particle by that of the chosen one."""

    @property
    def best(self) -> int:
        """Index of the particle with the largest weight; of several equal ones, the first.

        After a resampling all weights are equal, so it is particle 0. GMapping's program chooses by
        the sum of all log-weights along a particle's path instead.
        """
        return int(np.argmax(self.log_weights))

    @property
    def updates(self) -> int:
        """Number of calls of `remember`."""
        return len(self._way)

    def weights(self, gain: float = 1.0) -> Float64[np.ndarray, "particles"]:
        """Return the particles' weights; they sum to 1.

        Args:
            gain: Factor of the log-weights; below 1 it makes the weights more equal.
        """
        raised = np.exp(gain * (self.log_weights - self.log_weights.max()))
        normalised: Float64[np.ndarray, "particles"] = raised / raised.sum()
        return normalised

    def remember(self) -> None:
        """Append the current poses to the particles' paths."""
        self._way.append(self.poses.copy())
        self._lineage.append(self._parents.copy())
        self._parents = np.arange(self.count)

    def trajectory(self, particle: int) -> Float64[np.ndarray, "updates 3"]:
        """Return the path of a particle: its poses at each `remember`, in order."""
        way = np.empty((self.updates, 3))
        particle = int(self._parents[particle])
        for update in range(self.updates - 1, -1, -1):
            way[update] = self._way[update][particle]
            particle = int(self._lineage[update][particle])
        return way

    def resample(self, weights: Float64[np.ndarray, "particles"], rng: np.random.Generator) -> None:
        """Resample: draw the same number of particles, with probabilities equal to the weights.

        Systematic resampling (J. Carpenter et al., IEE Proceedings 1999): one random number shifts
        an even comb. All weights are equal afterwards.
        """
        teeth = (rng.random() + np.arange(self.count)) / self.count
        chosen = np.minimum(np.searchsorted(np.cumsum(weights), teeth), self.count - 1)
        self._take_maps(chosen)
        self.poses = self.poses[chosen]
        self.log_weights = np.zeros(self.count)
        self._parents = self._parents[chosen]

    def _sizes(self) -> dict[str, Any]:
        return {"particles": self.count}

    def _stored(self) -> dict[str, Any]:
        return {
            "particles.poses": np.stack((*self._way, self.poses)),
            "particles.parents": np.stack((*self._lineage, self._parents)),
        }

    def _restored(self, state: Arrays) -> None:
        *self._way, self.poses = state["particles.poses"].copy()
        *self._lineage, self._parents = state["particles.parents"].copy()
