"""The mapping systems by name."""

from __future__ import annotations

import difflib
import importlib
from dataclasses import dataclass

from albot_core.errors import InputError
from albot_core.mapper import LoopedMappers, Mapper, MapperBatch


@dataclass(frozen=True, kw_only=True)
class MapperEntry:
    """A mapping system that can be made by name."""

    name: str
    """The name in commands, files and results."""
    summary: str
    """What it does, in one line."""
    paper: str
    """Where it is described."""
    module: str
    """The module that is imported when it is first made."""
    factory: str
    """What in the module makes it: a class, or a class method after a dot."""


_HOSSAIN = "Hossain, How Albot1 computes its perceptual map, PhD thesis, AUT 2014"

MAPPERS = {
    entry.name: entry
    for entry in (
        MapperEntry(
            name="albot1",
            summary="Albot1's perceptual map, with our recognition and localisation.",
            paper=_HOSSAIN,
            module="albot_core.albot1.mapper",
            factory="Albot1.default",
        ),
        MapperEntry(
            name="albot1-thesis",
            summary="Albot1's perceptual map to the letter of the thesis (algorithms 1 to 4).",
            paper=_HOSSAIN,
            module="albot_core.albot1.mapper",
            factory="Albot1.thesis",
        ),
        MapperEntry(
            name="odometry",
            summary="Every view laid down where the odometer says: what the others must better.",
            paper=f"{_HOSSAIN}, chapter 3",
            module="albot_core.odometry.mapper",
            factory="OdometryMapper",
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
    entry = MAPPERS.get(name)
    if entry is None:
        near = difflib.get_close_matches(name, MAPPERS, n=1, cutoff=0.5)
        hint = f" (did you mean {near[0]}?)" if near else ""
        raise InputError("mapper", f"one of {', '.join(MAPPERS)}", f"{name!r}{hint}")
    made: object = importlib.import_module(entry.module)
    for part in entry.factory.split("."):
        made = getattr(made, part)
    assert callable(made)
    mapper = made()
    assert isinstance(mapper, Mapper)
    return mapper


def make_mappers(name: str, count: int) -> MapperBatch:
    """Make fresh mappers of one kind for many robots.

    Raises:
        InputError: As for `make_mapper`.
    """
    return LoopedMappers([make_mapper(name) for _ in range(count)])
