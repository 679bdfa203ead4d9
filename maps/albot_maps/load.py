"""Worlds by their spec: the one string that names a world everywhere."""

from __future__ import annotations

import difflib
from importlib import resources
from pathlib import Path

from albot_core.errors import InputError
from albot_maps.formats.reader import read_world
from albot_maps.formats.world_yaml import parse_world
from albot_maps.generators.spec import PREFIX, parse_spec
from albot_maps.world import World

_CATALOGUE = resources.files("albot_maps") / "catalogue"


def catalogue_names() -> tuple[str, ...]:
    """The names of the worlds that come with the project."""
    files = (entry.name for entry in _CATALOGUE.iterdir())
    return tuple(sorted(name.removesuffix(".yaml") for name in files if name.endswith(".yaml")))


def load_world(spec: str | Path) -> World:
    """The world that a spec names: one of the catalogue's, a file's, or a random one.

    A random world's spec is `random:KIND:SEED`, followed where wanted by its parameters:
    `random:office:42?rooms=12&clutter=0.3`.

    Raises:
        InputError: There is no such world, its file is wrong, or no such world can be made.
    """
    spec = str(spec)
    if spec.startswith(PREFIX):
        return parse_spec(spec).make()
    names = catalogue_names()
    if spec in names:
        return parse_world((_CATALOGUE / f"{spec}.yaml").read_text(encoding="utf-8"), source=spec)
    path = Path(spec)
    if spec and (path.exists() or path.suffix or path.parent != Path()):
        return read_world(path)
    close = difflib.get_close_matches(spec, names, n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    raise InputError(
        "world",
        f"a file, {PREFIX}KIND:SEED or one of {', '.join(names)}",
        f"{spec or 'nothing'}{hint}",
    )
