"""What environments take by name, single or batched."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypedDict, TypeVar

import numpy as np

from albot_core.errors import InputError
from albot_core.mappers.mapper import MapperBatch
from albot_core.mappers.registry import make_mappers
from albot_env.sim import Sensors, choose_sensors

Config = TypeVar("Config")


class Settings(TypedDict, total=False):
    """What every environment takes by name, single or batched."""

    mapper: str
    """Name of the mapper inside, or `none`: the robot only adds up its odometer."""
    odometer: str
    """Name of the odometer's preset (`albot_env.sim.ODOMETERS`)."""
    laser: str
    """Name of the laser's preset (`LASERS`)."""
    sonar: str
    """Name of the sonars' preset (`SONARS`), or `none`."""
    scenes: str
    """Name of the camera's preset (`SCENES`), or `none`. Mappers see its scenes; observations
    do not show them."""
    observation: str
    """`flat` or `dict`."""
    action: str
    """`continuous`, or `discrete`: a number of `ActionConfig.choices`."""
    movables: bool
    """Whether doors, boxes and people move in worlds that have any; if not, they are left out."""


def chosen_config(config: Any, kind: type[Config], task: str) -> Config:
    """The configuration of a task; the usual one where none is given.

    Raises:
        InputError: It is of another kind.
    """
    if config is None:
        return kind()
    if not isinstance(config, kind):
        raise InputError(task, f"{kind.__name__} or None", repr(config)[:80], place="config")
    return config


def wants_flat(observation: str, task: str) -> bool:
    """Whether observations are wanted in one row.

    Raises:
        InputError: In one row, or by part: there is nothing else.
    """
    if observation not in ("flat", "dict"):
        raise InputError(task, "flat or dict", str(observation), place="observation")
    return observation == "flat"


def wants_discrete(action: str, task: str) -> bool:
    """Whether actions are numbers of choices.

    Raises:
        InputError: Continuous, or discrete: there is nothing else.
    """
    if action not in ("continuous", "discrete"):
        raise InputError(task, "continuous or discrete", str(action), place="action")
    return action == "discrete"


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
