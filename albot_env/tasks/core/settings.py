"""The settings of environments, by name, and the options of `reset`."""

from __future__ import annotations

import inspect
import reprlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypedDict, TypeVar, get_args, get_type_hints

import numpy as np

from albot_core.errors import InputError, did_you_mean
from albot_core.geometry.types import Pose
from albot_core.mappers.mapper import Mapper, MapperBatch, MapperSpec
from albot_core.mappers.registry import (
    NO_MAPPER,
    check_sensors,
    config_for_radius,
    make_mapper,
    make_mappers,
    mapper_spec,
)
from albot_core.mappers.registry import mapper_config as full_config
from albot_core.plain_data import Location, check_types, read_config, to_plain
from albot_core.robot import PIONEER_3DX, RobotConfig, choose_robot
from albot_core.sensing.faults.fault import Fault
from albot_env.faults.registry import choose_faults
from albot_env.sim import Sensors, choose_sensors
from albot_env.sim.thread_pool import check_threads
from albot_maps import World, WorldSet

Config = TypeVar("Config")

Worlds = str | Path | World | WorldSet
"""A world spec, a world, or a set of worlds (see `albot_maps.load_worlds`)."""

DEFAULT_WORLD = "office-ring"
"""The default world."""
LARGEST_SEED = 2**128 - 1
"""Largest seed of an episode: numpy draws seeds of 128 bits, and recordings hold them."""


class UnknownSettingError(InputError, TypeError):
    """The error for a setting that an environment does not have.

    It is a TypeError too, as for any unknown keyword. Libraries rely on this: torchrl passes
    `frameskip` to every environment, and tries again without it if a TypeError says that this is
    "an unexpected keyword argument".

    Args:
        source: Id of the environment. Without the other arguments, the text of such an error with
            an addition: `gymnasium.make` raises any TypeError anew with the keywords appended,
            which are left out here.
        expected: The known settings.
        found: The unknown one.
        place: See `InputError`.
    """

    def __init__(
        self, source: object, expected: str = "", found: str = "", *, place: str = ""
    ) -> None:
        super().__init__(source, expected, found, place=place)
        if not expected:
            self.args = (str(source).partition(_ADDED)[0],)

    def __reduce__(self) -> tuple[type[UnknownSettingError], tuple[str, ...]]:
        """Return what pickling needs, to send the error from worker processes."""
        return UnknownSettingError, (str(self),)


_ADDED = " was raised from the environment creator"
"""Begin of what `gymnasium.make` appends to the text of a TypeError."""


class CommonSettings(TypedDict, total=False):
    """Settings that every environment takes, single or batched."""

    mapper: str
    """Name of the mapper (`albot1`), or `none`: the robot only integrates its odometry."""
    mapper_config: Any
    """The mapper's parameters: its config, or a mapping of those that differ from the default."""
    odometer: str
    """Name of the odometer's preset (`pioneer`; `albot_env.sim.ODOMETERS`)."""
    laser: str
    """Name of the laser's preset (`lms-200`; `LASERS`), or `none`."""
    sonar: str
    """Name of the sonars' preset (`pioneer`; `SONARS`), or `none`."""
    scenes: str
    """Name of the camera's preset (`SCENES`), or `none` (default). Mappers receive its scenes;
    observations do not contain them."""
    compass: str
    """Name of the compass's preset (`COMPASSES`), or `none` (default). Mappers receive its heading;
    observations contain it on request: the part `compass`."""
    observation: str
    """`flat` (default) or `dict`."""
    action: str
    """`continuous` (default) or `discrete`: the index of a row of `ActionConfig.choices`."""
    movables: bool
    """Whether doors, boxes and people are simulated in worlds that have them (default: true)."""
    reveal: bool
    """Whether the truth is observed, too (default: false): the parts `true_home` and `true_patch`.
    The revealed twin of an environment has an id of its own, such as `Albot/HomingRevealed-v0`."""
    faults: Any
    """What goes wrong, and when: specs of faults (`laser-dropout:at=20m`, see docs/faults.md), as
    text, joined by `+`, or in a list; nothing by default."""
    saved_map: str | Path | None
    """File of a map of this mapper (`albot map --out`, `save_map`), in which the robot localises
    itself; None (default) for an empty map. The map must have been begun at the world's first
    start: there is home, and the map's frame. The robot may start elsewhere."""
    extend_map: bool
    """Whether a robot that has localised itself adds to its saved map (default: false)."""
    robot: Any
    """The robot's body and drive: a name (`pioneer-3dx`; `albot_env.sim.ROBOTS`), a `RobotConfig`,
    or a mapping of its fields that differ from the default. Worlds are made and checked for it."""


class Settings(CommonSettings, total=False):
    """`CommonSettings` and the task's own settings: the keywords of its class."""

    config: Any
    """The task's configuration; or a mapping, as read from JSON or YAML, of the values that differ
    from the default; or None for the default."""
    journeys: int
    """Number of outward journeys, or tours, per start, from which each reset draws one; 0
    (default) for a new one each time. Only for tasks that have journeys."""


def settings_of(make: Any, task: type) -> dict[str, Any]:
    """Return the types of an environment's settings, by name.

    Args:
        make: The environment's constructor. Its `**settings` stands for `CommonSettings`.
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
    """Raise UnknownSettingError if an environment does not have one of the given settings.

    Raises:
        UnknownSettingError: A setting is unknown; the message suggests the most similar one.
    """
    known = sorted(known)
    for name in given:
        if name not in known:
            found = f"an unexpected keyword argument '{name}'{did_you_mean(name, known)}"
            raise UnknownSettingError(environment, f"settings among {', '.join(known)}", found)


def config_class(task: type) -> type[Any]:
    """Return the class of a task's configuration."""
    kinds: tuple[type[Any], ...] = get_args(get_type_hints(task.__init__)["config"])  # type: ignore[misc]
    return next(kind for kind in kinds if kind is not type(None))


def chosen_config(config: Any, kind: type[Config], environment: str) -> Config:
    """Return a task's configuration; the default one if none is given.

    Args:
        config: An instance of `kind`; or a mapping, as `to_plain` makes and as JSON and YAML hold,
            of the fields that differ from the default; or None.
        kind: The class of the task's configuration.
        environment: Id of the environment, for errors.

    Raises:
        InputError: `config`, or a configuration within it, is of another class; or the mapping
            has an unknown key or an invalid value, which the error names.
    """
    if config is None:
        return kind()
    if isinstance(config, Mapping):
        return read_config(kind, to_plain(config), Location(environment, ("config",)), kind())
    if not isinstance(config, kind):
        expected = f"{kind.__name__}, a mapping of its fields, or None"
        raise InputError(environment, expected, repr(config)[:80], place="config")
    check_types(config)
    return config


@dataclass(frozen=True, kw_only=True)
class Equipment:
    """The equipment of robots: mapper, sensors, and simulation settings."""

    mapper: str
    """Name of each robot's mapper, or `none`."""
    mapper_config: Any = None
    """The mapper's parameters (see `make_mapper`); None for the default."""
    robot: RobotConfig = PIONEER_3DX
    """Body and drive of each robot."""
    sensors: Sensors
    """The sensors of each robot."""
    movables: bool = True
    """Whether doors, boxes and people are simulated in worlds that have them."""
    reveal: bool = False
    """Whether the truth is observed, too."""
    faults: tuple[Fault, ...] = ()
    """What goes wrong in an episode."""
    saved_map: str | None = None
    """File of the map in which robots localise themselves; None for empty maps."""
    map_digest: str = ""
    """Digest of that file."""
    extend_map: bool = False
    """Whether robots add to it."""
    threads: int | None = 1
    """Threads that share the work; None for one per processor. The results do not depend on
    the number."""

    @property
    def spec(self) -> MapperSpec | None:
        """Spec of the mapper; None without one."""
        return None if self.mapper == NO_MAPPER else mapper_spec(self.mapper)

    def mappers(self, robots: int) -> MapperBatch | None:
        """Return the mappers of `robots` robots; None if they have none.

        Raises:
            InputError: The mapper is unknown, or its config is invalid.
        """
        if self.mapper == NO_MAPPER:
            return None
        return make_mappers(
            self.mapper,
            robots,
            config=self.mapper_config,
            map=self.saved_map,
            extend=self.extend_map,
        )

    def single_mapper(self, rng: np.random.Generator) -> Mapper | None:
        """Return the mapper of a single robot; None if it has none.

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
    compass: str,
    movables: bool,
    reveal: bool,
    faults: Any,
    saved_map: Any,
    extend_map: bool,
    robot: Any,
    threads: int | None,
    environment: str,
) -> Equipment:
    """Return the equipment with these names.

    Raises:
        InputError: A robot, a sensor, a fault or the mapper is unknown, the mapper's config is
            invalid, it or a fault needs a sensor that the robot lacks, `movables` is neither true
            nor false, `threads` is no number of threads, or the saved map cannot be read.
    """
    check_threads(threads)
    if not isinstance(movables, bool | np.bool_):
        raise InputError("movables", "True or False", repr(movables))
    if not isinstance(reveal, bool | np.bool_):
        raise InputError("reveal", "True or False", repr(reveal))
    digest = _map_digest(saved_map, extend_map, mapper)
    robot_config = choose_robot(robot, environment)
    sensors = choose_sensors(
        laser=laser,
        odometer=odometer,
        sonar=sonar,
        scenes=scenes,
        compass=compass,
        source="sensors",
    )
    if mapper == NO_MAPPER:
        if mapper_config is not None:
            found = repr(mapper_config)
            raise InputError("mapper_config", "None, for a robot without a mapper", found)
    else:
        try:
            spec = mapper_spec(mapper)
        except InputError as error:
            if error.source != "mapper":  # The module that registers it refuses something.
                raise
            raise InputError("mapper", f"{NO_MAPPER} or {error.expected}", error.found) from None
        check_sensors(spec, sensors.available, "the robot's sensors")
        # Always the complete config: it identifies the equipment in the keys of journeys.
        if isinstance(mapper_config, Mapping):
            mapper_config = to_plain(mapper_config)
        if saved_map is None or mapper_config is not None:
            mapper_config = config_for_radius(full_config(spec, mapper_config), robot_config.radius)
    return Equipment(
        mapper=mapper,
        mapper_config=mapper_config,
        robot=robot_config,
        sensors=sensors,
        movables=movables,
        reveal=bool(reveal),
        faults=choose_faults(faults, sensors.available, environment, movables=bool(movables)),
        saved_map=None if saved_map is None else str(saved_map),
        map_digest=digest,
        extend_map=bool(extend_map),
        threads=threads,
    )


def _map_digest(saved_map: Any, extend_map: Any, mapper: str) -> str:
    """Return the digest of the map file of a robot with this mapper; empty without one.

    Raises:
        InputError: It is no path, or the file cannot be read; or there is no map to extend, or no
            mapper to use it.
    """
    if not isinstance(extend_map, bool | np.bool_):
        raise InputError("extend_map", "True or False", repr(extend_map))
    if saved_map is None:
        if extend_map:
            raise InputError("extend_map", "False, without a saved_map to extend", "True")
        return ""
    has_mapper = mapper != NO_MAPPER
    if not has_mapper:
        raise InputError("saved_map", "None, for a robot without a mapper", repr(saved_map))
    if not isinstance(saved_map, str | Path):
        raise InputError("saved_map", "the path of a map file, or None", repr(saved_map)[:80])
    from albot_core.localisation.saved_maps import map_digest  # slow to load

    return map_digest(saved_map)


def check_seed(seed: Any, environment: str, place: str = "seed") -> int:
    """Return the seed of an episode as a plain integer.

    Args:
        seed: The seed.
        environment: Id of the environment, for the error.
        place: Place of the seed, for the error.

    Raises:
        InputError: The seed is not a whole number from 0 to `LARGEST_SEED`.
    """
    if not _is_whole(seed) or not 0 <= int(seed) <= LARGEST_SEED:
        bits = int(seed).bit_length() if _is_whole(seed) else 0
        found = f"one of {bits} bits" if bits > LARGEST_SEED.bit_length() else reprlib.repr(seed)
        raise InputError(environment, "a whole number from 0 to 2¹²⁸ − 1", found, place=place)
    return int(seed)


def choose_world(
    worlds: WorldSet, rng: np.random.Generator, options: Mapping[str, Any], environment: str
) -> tuple[World, int]:
    """Return the world that the options of a reset select, and its number in the set.

    By default it is a random one.

    Args:
        worlds: The worlds. If there is only one, no random number is drawn.
        rng: Draws the world.
        options: `{"world": k}` for the k-th of the set, or nothing.
        environment: Id of the environment, for the errors.

    Raises:
        InputError: An option other than `world` and `start`, or there is no such world.
    """
    if not isinstance(options, Mapping):
        raise InputError(environment, "a mapping", repr(options), place="options")
    unknown = [str(name) for name in options if name not in ("start", "world")]
    if unknown:
        expected = "the options start and world"
        raise InputError(environment, expected, ", ".join(unknown), place="options")
    number = options.get("world")
    if number is None:
        number = rng.integers(len(worlds)) if len(worlds) > 1 else 0
    if not _is_whole(number) or not 0 <= number < len(worlds):
        expected = f"a world's number below {len(worlds)}"
        raise InputError(environment, expected, repr(number), place="options.world")
    return worlds[int(number)], int(number)


def choose_start(
    world: World, rng: np.random.Generator, options: Mapping[str, Any], environment: str
) -> Pose:
    """Return the start that the options of a reset select; by default a random one of the world's.

    Args:
        world: The world.
        rng: Draws the start.
        options: `{"start": k}` for the world's k-th start, `{"start": (x, y, heading)}` for
            a pose in the world's frame (m, rad), or nothing.
        environment: Id of the environment, for the errors.

    Raises:
        InputError: The start is neither an index in range nor a pose.
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
