"""The mapping systems by name."""

from __future__ import annotations

import difflib
import importlib
from typing import Any

import numpy as np

from albot_core.errors import InputError
from albot_core.mappers.looped import LoopedMappers
from albot_core.mappers.mapper import Mapper, MapperBatch, MapperSpec
from albot_core.sensing.reading import Sensor

_HOSSAIN = "Hossain, How Albot1 computes its perceptual map, PhD thesis, AUT 2014"
_LASER: frozenset[Sensor] = frozenset({"laser"})

MAPPERS: dict[str, MapperSpec] = {
    spec.name: spec
    for spec in (
        MapperSpec(
            name="albot1",
            summary="Albot1's perceptual map, with our recognition and localisation.",
            paper=_HOSSAIN,
            sensors=_LASER,
            layers=("segments", "place_graph"),
            factory="albot_core.mappers.albot1.mapper:Albot1",
            config="albot_core.mappers.albot1.config:Albot1Config",
            batch="albot_core.mappers.albot1.batch:Albot1Batch",
        ),
        MapperSpec(
            name="albot1-thesis",
            summary="Albot1's perceptual map to the letter of the thesis (algorithms 1 to 4).",
            paper=_HOSSAIN,
            sensors=_LASER,
            layers=("segments", "place_graph"),
            factory="albot_core.mappers.albot1.mapper:Albot1",
            config="albot_core.mappers.albot1.config:Albot1Config.thesis",
            batch="albot_core.mappers.albot1.batch:Albot1Batch",
        ),
        MapperSpec(
            name="odometry",
            summary="Every view laid down where the odometer says: what the others must better.",
            paper=f"{_HOSSAIN}, chapter 3",
            sensors=_LASER,
            layers=("segments",),
            factory="albot_core.mappers.odometry.mapper:OdometryMapper",
            config="albot_core.mappers.odometry.mapper:OdometryConfig",
        ),
    )
}
"""All mapping systems by name, in the order of the alphabet."""


def register_mapper(spec: MapperSpec) -> None:
    """Make a mapping system known by its name.

    Raises:
        InputError: Another one has this name.
    """
    if MAPPERS.setdefault(spec.name, spec) != spec:
        raise InputError("register_mapper", "a name that no other mapper has", repr(spec.name))


def mapper_names() -> tuple[str, ...]:
    """The names of all mapping systems that are registered."""
    return tuple(MAPPERS)


def mapper_spec(name: str) -> MapperSpec:
    """What is known of a mapping system.

    Args:
        name: Its name; or, as in gymnasium, `module:name`, where `module` is imported first and
            registers it.

    Raises:
        InputError: There is no such module, or no mapper of that name; the message names the
            nearest.
    """
    module, colon, last = str(name).rpartition(":")
    if colon:
        try:
            importlib.import_module(module)
        except ImportError as error:
            expected = "a module that can be imported before the colon"
            raise InputError("mapper", expected, f"{name!r} ({error})") from None
    spec = MAPPERS.get(last)
    if spec is None:
        near = difflib.get_close_matches(last, MAPPERS, n=1, cutoff=0.5)
        hint = f" (did you mean {near[0]}?)" if near else ""
        raise InputError("mapper", f"one of {', '.join(MAPPERS)}", f"{last!r}{hint}")
    return spec


def make_mapper(name: str, *, config: Any = None, rng: np.random.Generator | None = None) -> Mapper:
    """Make a fresh mapper.

    Args:
        name: See `mapper_spec`.
        config: Its thresholds, of its own config class; the default ones where none is given.
        rng: Where it draws its random numbers; a generator of seed 0 where none is given.

    Raises:
        InputError: There is no such mapper, or the config is not of its kind.
    """
    spec = mapper_spec(name)
    mapper: Mapper = _load(spec.factory)(config=mapper_config(spec, config), name=spec.name)
    if rng is not None:
        mapper.reset(rng)
    return mapper


def make_mappers(name: str, count: int, *, config: Any = None) -> MapperBatch:
    """Make fresh mappers of one kind for many robots.

    Raises:
        InputError: As for `make_mapper`.
    """
    spec = mapper_spec(name)
    config = mapper_config(spec, config)
    if spec.batch is None:
        return LoopedMappers([make_mapper(name, config=config) for _ in range(count)])
    mappers: MapperBatch = _load(spec.batch)(count, config=config, name=spec.name)
    return mappers


def mapper_config(spec: MapperSpec, config: Any = None) -> Any:
    """The thresholds that a mapper gets.

    Args:
        spec: Which mapper.
        config: A config of its class; its default where None.

    Raises:
        InputError: The config is of another kind.
    """
    default = _load(spec.config)()
    if config is None:
        return default
    if not isinstance(config, type(default)):
        expected = f"a {type(default).__name__}"
        raise InputError(f"mapper {spec.name}, config", expected, repr(config))
    return config


def _load(where: str) -> Any:
    """What stands at `module:name`, imported now."""
    module, name = where.split(":")
    loaded: Any = importlib.import_module(module)
    for part in name.split("."):
        loaded = getattr(loaded, part)
    return loaded
