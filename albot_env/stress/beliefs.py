"""Beliefs are a function of readings alone: a second mapper, given the same, believes the same."""

from __future__ import annotations

from typing import Any

import numpy as np

from albot_core.geometry.types import Poses
from albot_core.mappers.registry import NO_MAPPER, make_mappers
from albot_core.sensing.reading import Readings
from albot_env.stress.checks import Finding
from albot_env.tasks.core.driving import MAPPER_STREAM
from albot_env.tasks.core.state import integrate_odometry
from albot_env.tasks.core.vector import VectorEnv


class BeliefChecker:
    """Gives the readings of a batch's robots to mappers of its own, and compares the beliefs.

    They stand in the opposite order, so that nothing can pass from one robot to the next unseen.

    Args:
        batch: The batch, without faults that delay readings, in a task that tells its mappers
            nothing else.
        rows: The environments whose beliefs are compared.
    """

    def __init__(self, batch: VectorEnv[Any], rows: np.ndarray) -> None:
        self._batch = batch
        self._rows = rows[::-1].copy()
        self._all = np.arange(len(rows))
        mapper, config = batch.mapper
        self._mappers = (
            None if mapper == NO_MAPPER else make_mappers(mapper, len(rows), config=config)
        )
        self._poses: Poses = (
            np.zeros((len(rows), 3)) if self._mappers is None else self._mappers.poses
        )
        self._travels = np.zeros(len(rows))

    def after_reset(self, beliefs: Poses) -> dict[int, list[Finding]]:
        """Begin with the first readings; return what is wrong, by environment."""
        if self._mappers is not None:
            for k, row in enumerate(self._rows.tolist()):
                simulator = self._batch.get_state(row).robot.simulator
                assert simulator is not None, "a robot that drives has a body"
                key = simulator.placement.key
                self._mappers.reset(k, np.random.default_rng((key, MAPPER_STREAM)))
        return self.after_step(beliefs)

    def after_step(self, beliefs: Poses) -> dict[int, list[Finding]]:
        """Take in the latest readings, and compare; return what is wrong, by environment.

        Args:
            beliefs: The poses that all environments of the batch say are believed.
        """
        readings = _chosen(self._batch.readings, self._rows)
        if self._mappers is None:
            integrate_odometry(self._all, readings.motions, self._poses, self._travels)
        else:
            self._mappers.update(self._all, readings)
        theirs = beliefs[self._rows]
        differ = (theirs != self._poses).any(axis=1) & np.isfinite(theirs).all(axis=1)
        return {
            int(self._rows[k]): [
                Finding(
                    "beliefs",
                    f"the mapper believes {theirs[k].tolist()}, "
                    f"another one with the same readings {self._poses[k].tolist()}",
                )
            ]
            for k in np.flatnonzero(differ).tolist()
        }


def _chosen(readings: Readings, rows: np.ndarray) -> Readings:
    """Return copies of the readings of some robots."""
    return Readings(
        stamps=readings.stamps[rows],
        motions=readings.motions[rows],
        laser=readings.laser,
        ranges=None if readings.ranges is None else readings.ranges[rows],
        sonar=readings.sonar,
        echoes=None if readings.echoes is None else readings.echoes[rows],
        scenes=None if readings.scenes is None else readings.scenes[rows],
    )
