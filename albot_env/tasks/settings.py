"""What environments take by name, single or batched."""

from __future__ import annotations

from typing import Any, TypedDict, TypeVar

from albot_core.errors import InputError

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
