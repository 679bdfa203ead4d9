"""What the robots of an expedition set out with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.errors import InputError
from albot_core.mappers.mapper import MapperBatch
from albot_core.mappers.registry import make_mappers
from albot_env.sim import Sensors, choose_sensors

NO_MAPPER = "none"
"""Name of the mapper that is none: the belief is the odometer's, and nothing is remembered."""


@dataclass(frozen=True, kw_only=True)
class Equipment:
    """What the robots of an expedition set out with."""

    mapper: str
    """Name of the mapper inside each, or `none`."""
    sensors: Sensors
    """What each senses with."""
    movables: bool = True
    """Whether things move in worlds that have any; if not, they are left out."""
    threads: int = 1
    """Threads that share the work; 0 for as many as there are processors. What comes of it is
    the same with any number."""

    def mappers(self, robots: int) -> MapperBatch | None:
        """The mappers of so many robots; None where they have none.

        Raises:
            InputError: There is no such mapper.
        """
        if self.mapper == NO_MAPPER:
            return None
        try:
            return make_mappers(self.mapper, robots)
        except InputError as error:
            raise InputError("mapper", f"{NO_MAPPER} or {error.expected}", error.found) from None


def equip(
    *,
    mapper: str,
    odometer: str,
    laser: str,
    sonar: str,
    scenes: str,
    movables: bool,
    threads: int = 1,
) -> Equipment:
    """The equipment of these names.

    Raises:
        InputError: There is no such sensor, or `movables` is neither true nor false.
    """
    if not isinstance(movables, bool | np.bool_):
        raise InputError("movables", "True or False", repr(movables))
    sensors = choose_sensors(
        laser=laser, odometer=odometer, sonar=sonar, scenes=scenes, source="sensors"
    )
    return Equipment(mapper=mapper, sensors=sensors, movables=movables, threads=threads)
