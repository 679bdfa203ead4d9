"""The journey: a robot that drives, a mapper that listens, and a recorder that takes it down."""

from __future__ import annotations

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.mapper import Mapper
from albot_core.perception.reading import Reading
from albot_env.sim import ODOMETERS, Simulator
from albot_maps import World


class Journey:
    """What every task does at a step: drive, sense, map.

    Args:
        world: The world to drive in.
        mapper: The mapper inside.
        odometer: Name of the odometer's preset.

    Raises:
        InputError: There is no such odometer.
    """

    def __init__(self, world: World, mapper: Mapper, odometer: str) -> None:
        if odometer not in ODOMETERS:
            raise InputError("odometer", f"one of {', '.join(ODOMETERS)}", odometer)
        self.simulator = Simulator(world, odometer=ODOMETERS[odometer])
        self.mapper = mapper
        self.odometer = odometer
        self.updated = False
        """Whether the last reading added a view to the map."""
        self.path_length = 0.0
        """Distance truly driven (m)."""
        self.elapsed = 0.0
        """Time between the last two readings (s)."""

    def begin(self, rng: np.random.Generator, start: Pose) -> Reading:
        """Set out from `start` (world frame) with an empty map."""
        self.path_length = 0.0
        self.elapsed = 0.0
        self.mapper.reset()
        return self._take_in(self.simulator.reset(rng, start))

    def drive(self, speed: float, turn_rate: float) -> Reading:
        """One control step with a speed (m/s) and a turn rate (rad/s)."""
        before, began = self.simulator.pose, self.simulator.time
        reading = self.simulator.step(speed, turn_rate)
        after, self.elapsed = self.simulator.pose, self.simulator.time - began
        self.path_length += float(np.hypot(after[0] - before[0], after[1] - before[1]))
        return self._take_in(reading)

    def _take_in(self, reading: Reading) -> Reading:
        self.updated = self.mapper.update(reading)
        return reading
