"""The mapping systems by name."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Callable
from dataclasses import dataclass

from albot_core.errors import InputError
from albot_core.mappers.mapper import LoopedMappers, Mapper, MapperBatch


@dataclass(frozen=True, kw_only=True)
class MapperEntry:
    """A mapping system that can be made by name."""

    name: str
    """The name in commands, files and results."""
    summary: str
    """What it does, in one line."""
    paper: str
    """Where it is described."""
    factory: str
    """What makes it, `module:name`, imported when it is first made."""
    batch: str | None = None
    """What makes a batch from a count of robots, `module:name`; None where nothing does, and
    they are led one after the other."""


_HOSSAIN = "Hossain, How Albot1 computes its perceptual map, PhD thesis, AUT 2014"

MAPPERS = {
    entry.name: entry
    for entry in (
        MapperEntry(
            name="albot1",
            summary="Albot1's perceptual map, with our recognition and localisation.",
            paper=_HOSSAIN,
            factory="albot_core.mappers.albot1.mapper:Albot1",
            batch="albot_core.mappers.albot1.batch:Albot1Batch",
        ),
        MapperEntry(
            name="albot1-thesis",
            summary="Albot1's perceptual map to the letter of the thesis (algorithms 1 to 4).",
            paper=_HOSSAIN,
            factory="albot_core.mappers.albot1.mapper:Albot1.thesis",
            batch="albot_core.mappers.albot1.batch:Albot1Batch.thesis",
        ),
        MapperEntry(
            name="odometry",
            summary="Every view laid down where the odometer says: what the others must better.",
            paper=f"{_HOSSAIN}, chapter 3",
            factory="albot_core.mappers.odometry.mapper:OdometryMapper",
        ),
    )
}
"""All mapping systems by name, in the order of the alphabet."""


def mapper_names() -> tuple[str, ...]:
    """The names of all mapping systems."""
    return tuple(MAPPERS)


def make_mapper(name: str) -> Mapper:
    """Make a fresh mapper.

    Raises:
        InputError: There is none of that name; the message names the nearest.
    """
    entry = _entry(name)
    mapper = _maker(entry.factory)()
    assert isinstance(mapper, Mapper)
    return mapper


def make_mappers(name: str, count: int) -> MapperBatch:
    """Make fresh mappers of one kind for many robots.

    Raises:
        InputError: As for `make_mapper`.
    """
    entry = _entry(name)
    if entry.batch is None:
        return LoopedMappers([make_mapper(name) for _ in range(count)])
    mappers = _maker(entry.batch)(count)
    assert isinstance(mappers, MapperBatch)
    return mappers


def _entry(name: str) -> MapperEntry:
    """The mapping system of a name."""
    entry = MAPPERS.get(name)
    if entry is None:
        near = difflib.get_close_matches(str(name), MAPPERS, n=1, cutoff=0.5)
        hint = f" (did you mean {near[0]}?)" if near else ""
        raise InputError("mapper", f"one of {', '.join(MAPPERS)}", f"{name!r}{hint}")
    return entry


def _maker(where: str) -> Callable[..., object]:
    """What stands at `module:name`, imported now."""
    module, name = where.split(":")
    made: object = importlib.import_module(module)
    for part in name.split("."):
        made = getattr(made, part)
    assert callable(made)
    return made
