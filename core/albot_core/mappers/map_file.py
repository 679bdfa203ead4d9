"""A mapper's whole memory as one file: its name, its config and every array of its state."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from albot_core.archive import HEADER, ArchiveFormat
from albot_core.errors import InputError
from albot_core.mappers.mapper import Mapper
from albot_core.mappers.registry import MAPPERS, make_mapper, mapper_config, mapper_spec
from albot_core.mappers.result_checks import check_state
from albot_core.mappers.schema import Schema
from albot_core.plain_data import Location, changed_fields
from albot_core.yaml_document import YamlDocument

FORMAT = "albot-map"
VERSION = 11

_FILE = ArchiveFormat(name=FORMAT, version=VERSION, kind="map file", largest=1 << 28)


def save_map(mapper: Mapper, path: str | Path) -> None:
    """Write everything that `mapper` remembers to `path`, completely or not at all.

    Raises:
        InputError: The file cannot be written, or the mapper's state is not one of numeric arrays.
        OSError: The disk is full.
    """
    spec, state = mapper.spec, mapper.state()
    check_state(state, spec)
    changed = changed_fields(mapper.config, mapper_config(spec))
    header = {"mapper": spec.name, "config": yaml.safe_dump(changed)}
    _FILE.write(Path(path), header, state)


def load_map(path: str | Path) -> Mapper:
    """Return the mapper that was saved to `path`; its run continues as if never stopped.

    A mapper from outside the project must be registered: import its module before. No name in a
    file makes this import a module.

    Raises:
        InputError: The file is missing or damaged, is not a map, is of another version, or holds
            arrays that do not fit its mapper; or its mapper is not registered.
    """
    path = Path(path)
    header, state = _FILE.read(path)
    name, text = _mapper_name(path, header), header.get("config")
    if not isinstance(text, str):
        raise InputError(path, "the mapper's config as YAML", repr(text), place=HEADER)
    document = YamlDocument(text, f"{path}, {HEADER}, config")
    where = Location(f"{path}, {HEADER}, config", place=document.place)
    changed = {} if document.data is None else document.data
    mapper = make_mapper(name, config=mapper_config(mapper_spec(name), changed, where))
    try:
        Schema.like(mapper.state()).check_types(state)
        mapper.restore(state)
    except InputError as error:
        place = f"{error.source}.npy"
        raise InputError(path, error.expected, error.found, place=place) from None
    return mapper


def _mapper_name(path: Path, header: dict[str, Any]) -> str:
    """Return the mapper's name in the header."""
    name = header.get("mapper")
    if not isinstance(name, str) or name not in MAPPERS:
        expected = f"a mapper, one of {', '.join(MAPPERS)}"
        found = f"{name!r} (one from outside is known once its module is imported)"
        raise InputError(path, expected, found, place=HEADER)
    return name
