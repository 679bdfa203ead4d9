"""The survey of one world: what its robots cover and enter, and what they observe."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int64

from albot_core.perception.reading import LaserGeometry
from albot_env.tasks.ground import map_coverage, world_coverage
from albot_env.tasks.observation import ObservationConfig
from albot_env.tasks.rooms import outlines_of
from albot_env.tasks.survey_kernel import Findings, Ground, Rooms, Senses, survey
from albot_maps import World


class Survey:
    """Follows some robots in a world.

    Args:
        world: The world.
        rows: Which rows of the arrays are theirs.
        config: How they observe, and which ground counts as covered.
        laser: Their laser.
    """

    def __init__(
        self,
        world: World,
        rows: Int64[np.ndarray, "robots"],
        config: ObservationConfig,
        laser: LaserGeometry,
    ) -> None:
        self.rows = rows
        self._slots = np.arange(len(rows))
        self._directions = laser.directions
        self._scales = config.scales(laser)
        count = len(rows)
        truth = world_coverage(world, config.coverage)
        belief = map_coverage(world, config.coverage)
        self._covered = Ground(np.zeros((count, *truth.shape), np.uint64), truth.centre)
        self._believed = Ground(np.zeros((count, *belief.shape), np.uint64), belief.centre)
        corners, ends = outlines_of(world.rooms)
        self._rooms = Rooms(corners, ends, np.zeros((count, len(ends)), np.bool_))

    def clear(self, row: int) -> None:
        """Forget what a robot has covered and entered."""
        slot = int(np.searchsorted(self.rows, row))
        for array in (self._covered.grids, self._believed.grids, self._rooms.entered):
            array[slot] = 0

    @property
    def rooms_entered(self) -> Int64[np.ndarray, "robots"]:
        """How many rooms each of them has been in."""
        return np.asarray(self._rooms.entered.sum(axis=1), np.int64)

    def look(
        self, rows: Int64[np.ndarray, "some"] | None, senses: Senses, findings: Findings
    ) -> None:
        """Note what all robots here, or those of them among `rows`, find out by a reading."""
        here, slots = self.rows, self._slots
        if rows is not None:
            here, _, slots = np.intersect1d(rows, here, return_indices=True)
        survey(
            here,
            slots,
            self._directions,
            self._covered,
            self._believed,
            self._rooms,
            self._scales,
            senses,
            findings,
        )
