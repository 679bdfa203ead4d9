"""Mappers that go on in a map file."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import Any

from albot_core.errors import InputError
from albot_core.localisation.config import LocaliserConfig
from albot_core.localisation.known_map import KnownMap
from albot_core.localisation.mapper import MapUser, known_map_of
from albot_core.mappers.map_file import load_map
from albot_core.mappers.mapper import Mapper
from albot_core.mappers.registry import mapper_config, mapper_spec


def mapper_in_map(
    name: str,
    path: str | Path | None,
    *,
    config: Any = None,
    localise: bool = False,
    extend: bool = False,
) -> Mapper:
    """Return a mapper that goes on in a map file; the arguments are those of `make_mapper`.

    Raises:
        InputError: See `make_mapper`.
    """
    if path is None:
        raise InputError("make_mapper, map", "a map file, in which to localise", "none")
    if extend and not localise:
        expected = "localise=True, or no extend: without, the map is always extended"
        raise InputError("make_mapper, extend", expected, "localise=False")
    spec, path = mapper_spec(name), Path(path)
    saved = load_map(path)
    if saved.spec.name != spec.name:
        raise InputError(path, f"a map of {spec.name}", f"one of {saved.spec.name}")
    if config is not None and mapper_config(spec, config) != saved.config:
        raise InputError(path, "the config with which the map was made, or none", "another one")
    if not localise:
        return saved
    return MapUser(saved, known=known_map(path), extend=extend, source=path)


def mapper_of(path: str | Path) -> str:
    """Return the name of the mapper that made a map file.

    Raises:
        InputError: The file is not valid.
    """
    return load_map(path).spec.name


def map_digest(path: str | Path) -> str:
    """Return the SHA-256 digest of a map file, by which it is told from others.

    Raises:
        InputError: The file cannot be read.
    """
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(path, "a map file", error.strerror or str(error)) from None


def known_map(path: str | Path) -> KnownMap:
    """Return a map file's map, as localisation uses it; robots on one map share it.

    Raises:
        InputError: The file is not valid, its mapper has no laser, or the map has no walls.
    """
    return _known_map(str(path), map_digest(path))


@lru_cache(maxsize=4)
def _known_map(path: str, digest: str) -> KnownMap:
    """Return the map of a file with this digest, which tells when the file has changed."""
    saved = load_map(path)
    if "laser" not in saved.spec.sensors:
        found = f"one of {saved.spec.name}, which has none"
        raise InputError(path, "a map of a mapper with a laser", found)
    return known_map_of(saved, LocaliserConfig(), path)
