"""The settings of environments, by name, and the options of a reset."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypedDict, TypeVar, get_type_hints

import numpy as np

from albot_core.errors import InputError, did_you_mean
from albot_core.geometry.types import Pose
from albot_core.mappers.mapper import Mapper, MapperBatch
from albot_core.mappers.registry import check_sensors, make_mapper, make_mappers, mapper_spec
from albot_core.mappers.registry import mapper_config as full_config
from albot_env.sim import Sensors, choose_sensors
from albot_maps import World, WorldSet

Config = TypeVar("Config")

Worlds = str | Path | World | WorldSet
"""A world spec, a world, or worlds (see `albot_maps.load_worlds`)."""

DEFAULT_WORLD = "office-ring"
"""The world where none is named."""
NO_MAPPER = "none"
"""The name for no mapper: the belief is the odometer's, and there is no map."""


class CommonSettings(TypedDict, total=False):
    """What every environment takes by name, single or batched."""

    mapper: str
    """Name of the mapper inside (`albot1`), or `none`: the robot only adds up its odometer."""
    mapper_config: Any
    """The mapper's thresholds: its config, or a mapping of what differs from its default one."""
    odometer: str
    """Name of the odometer's preset (`pioneer`; `albot_env.sim.ODOMETERS`)."""
    laser: str
    """Name of the laser's preset (`lms-200`; `LASERS`), or `none`."""
    sonar: str
    """Name of the sonars' preset (`pioneer`; `SONARS`), or `none`."""
    scenes: str
    """Name of the camera's preset (`SCENES`), or `none`, as is usual. Mappers see its scenes;
    observations do not show them."""
    observation: str
    """`flat`, as is usual, or `dict`."""
    action: str
    """`continuous`, as is usual, or `discrete`: a number of `ActionConfig.choices`."""
    movables: bool
    """Whether doors, boxes and people move in worlds that have any, as is usual; if not, they are
    left out."""


class Settings(CommonSettings, total=False):
    """The same, and what the task itself takes: the keywords of its class."""

    config: Any
    """The task's configuration; None for the usual one."""
    journeys: int
    """How many outward journeys, or tours, there are from a start, of which each reset draws one;
    0, as is usual, for a new one each time. For tasks that have any."""


def settings_of(make: Any, task: type) -> dict[str, Any]:
    """What an environment takes by name: types by name.

    Args:
        make: The environment's constructor. Its `**settings` stand for `CommonSettings`.
        task: The task's class, whose keywords are settings too.
    """
    settings = get_type_hints(CommonSettings)
    for function, kinds in (
        (task.__init__, (inspect.Parameter.KEYWORD_ONLY,)),  # type: ignore[misc]
        (make, (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)),
    ):
        hints = get_type_hints(function)
        for name, parameter in inspect.signature(function).parameters.items():
            if parameter.kind in kinds and name != "self":
                settings[name] = hints[name]
    return settings


def check_settings(given: Iterable[str], known: Iterable[str], environment: str) -> None:
    """Refuse settings that an environment does not have.

    Raises:
        InputError: There is no such setting; the message names the nearest.
    """
    known = sorted(known)
    for name in given:
        if name not in known:
            found = f"{name}{did_you_mean(name, known)}"
            raise InputError(environment, f"settings among {', '.join(known)}", found)


def chosen_config(config: Any, kind: type[Config], environment: str) -> Config:
    """The configuration of a task; the usual one where none is given.

    Raises:
        InputError: It is of another kind.
    """
    if config is None:
        return kind()
    if not isinstance(config, kind):
        raise InputError(environment, f"{kind.__name__} or None", repr(config)[:80], place="config")
    return config


@dataclass(frozen=True, kw_only=True)
class Equipment:
    """What robots set out with."""

    mapper: str
    """Name of the mapper inside each, or `none`."""
    mapper_config: Any = None
    """Its thresholds (see `make_mapper`); None for its default ones."""
    sensors: Sensors
    """What each senses with."""
    movables: bool = True
    """Whether things move in worlds that have any; if not, they are left out."""
    threads: int | None = 1
    """Threads that share the work; None for as many as there are processors. What comes of it is
    the same with any number."""

    def mappers(self, robots: int) -> MapperBatch | None:
        """The mappers of so many robots; None where they have none.

        Raises:
            InputError: There is no such mapper, or its config is none.
        """
        if self.mapper == NO_MAPPER:
            return None
        return make_mappers(self.mapper, robots, config=self.mapper_config)

    def single_mapper(self, rng: np.random.Generator) -> Mapper | None:
        """The mapper of a robot that is alone; None where it has none.

        Raises:
            InputError: As for `mappers`.
        """
        if self.mapper == NO_MAPPER:
            return None
        return make_mapper(self.mapper, config=self.mapper_config, rng=rng)


def equip(
    *,
    mapper: str,
    mapper_config: Any,
    odometer: str,
    laser: str,
    sonar: str,
    scenes: str,
    movables: bool,
    threads: int | None,
) -> Equipment:
    """The equipment of these names.

    Raises:
        InputError: There is no such sensor or mapper, the mapper's config is none, it needs a
            sensor that the robot lacks, or `movables` is neither true nor false.
    """
    if not isinstance(movables, bool | np.bool_):
        raise InputError("movables", "True or False", repr(movables))
    sensors = choose_sensors(
        laser=laser, odometer=odometer, sonar=sonar, scenes=scenes, source="sensors"
    )
    if mapper == NO_MAPPER:
        if mapper_config is not None:
            found = repr(mapper_config)
            raise InputError("mapper_config", "None, for a robot without a mapper", found)
    else:
        try:
            spec = mapper_spec(mapper)
        except InputError as error:
            raise InputError("mapper", f"{NO_MAPPER} or {error.expected}", error.found) from None
        check_sensors(spec, sensors.available, "the robot's sensors")
        # Always as a whole: journeys are known by what the robots set out with.
        mapper_config = full_config(spec, mapper_config)
    return Equipment(
        mapper=mapper,
        mapper_config=mapper_config,
        sensors=sensors,
        movables=movables,
        threads=threads,
    )


def choose_world(
    worlds: WorldSet, rng: np.random.Generator, options: Mapping[str, Any], environment: str
) -> World:
    """The world that the options of a reset ask for; by default one of the set, at random.

    Args:
        worlds: The worlds. Of one alone, nothing is drawn.
        rng: Draws the world.
        options: `{"world": k}` for the k-th of the set, or nothing.
        environment: Id of the environment, for the errors.

    Raises:
        InputError: Another option than `world` and `start`, or there is no such world.
    """
    if not isinstance(options, Mapping):
        raise InputError(environment, "a mapping", repr(options), place="options")
    unknown = sorted(set(options) - {"start", "world"})
    if unknown:
        expected = "the options start and world"
        raise InputError(environment, expected, ", ".join(unknown), place="options")
    number = options.get("world")
    if number is None:
        number = rng.integers(len(worlds)) if len(worlds) > 1 else 0
    if not _is_whole(number) or not 0 <= number < len(worlds):
        expected = f"a world's number below {len(worlds)}"
        raise InputError(environment, expected, repr(number), place="options.world")
    return worlds[int(number)]


def choose_start(
    world: World, rng: np.random.Generator, options: Mapping[str, Any], environment: str
) -> Pose:
    """The start that the options of a reset ask for; by default one of the world's, at random.

    Args:
        world: The world.
        rng: Draws the start.
        options: `{"start": k}` for the world's k-th start, `{"start": (x, y, heading)}` for
            a pose in the world's frame (m, rad), or nothing.
        environment: Id of the environment, for the errors.

    Raises:
        InputError: A start that is neither.
    """
    count = len(world.starts)
    start = options.get("start")
    if start is None:
        return np.asarray(world.starts[rng.integers(count)], np.float64)
    expected = f"a start's index below {count}, or x, y, heading"
    try:
        pose = np.asarray(start, np.float64)
    except (TypeError, ValueError):
        raise InputError(environment, expected, repr(start), place="options.start") from None
    if _is_whole(start) and 0 <= start < count:
        return np.asarray(world.starts[start], np.float64)
    if pose.shape != (3,):
        raise InputError(environment, expected, repr(start), place="options.start")
    return pose


def _is_whole(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
