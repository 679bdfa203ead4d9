"""Writing our own world file: YAML, `albot-world` version 1 (docs/worlds.md)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import yaml

from albot_core.geometry.types import Points, Segments
from albot_maps.formats.world_movables import movable_lines
from albot_maps.formats.yaml_numbers import angle, flow
from albot_maps.world import World


def world_text(world: World) -> str:
    """The world as the text of an `albot-world` file; read again it is the same world.

    Chains of walls are written as polylines, those of glass last. Its `source` is not part
    of a file.
    """
    lines = ["albot-world: 1", f"name: {_quoted(world.name)}"]
    sections = {
        "notes": [f"- {_quoted(note)}" for note in world.notes],
        "walls": [f"- {flow(line)}" for line in _chains(world.opaque)],
        "glass": [f"- {flow(line)}" for line in _chains(world.walls[world.glass])],
        "rooms": [f"{_quoted(room.name)}: {flow(room.boundary)}" for room in world.rooms],
        "exits": [
            f"{_quoted(opening.name)}: {{line: {flow(opening.segment.reshape(2, 2))}, "
            f"rooms: [{', '.join(map(_quoted, opening.rooms))}]}}"
            for opening in world.exits
        ],
        "starts": [
            f"- {{at: {flow(start[:2])}, {angle('heading', float(start[2]))}}}"
            for start in world.starts
        ],
        "tours": [f"{_quoted(name)}: {flow(line)}" for name, line in world.tours.items()],
        "movables": movable_lines(world.movables),
    }
    for name, entries in sections.items():
        if entries:
            lines += ["", f"{name}:", *(f"  {entry}" for entry in entries)]
    return "\n".join(lines) + "\n"


def _chains(walls: Segments) -> Iterator[Points]:
    """Runs of walls each of which begins where the last one ended."""
    if not len(walls):
        return
    breaks = np.flatnonzero((walls[1:, :2] != walls[:-1, 2:]).any(axis=1)) + 1
    for run in np.split(walls, breaks):
        yield np.concatenate((run[:1, :2], run[:, 2:]))


def _quoted(text: str) -> str:
    if text.replace("-", "").replace("_", "").isalnum() and text.isascii() and text[0].isalpha():
        return text if text.lower() not in {"true", "false", "null"} else f'"{text}"'
    dumped = yaml.safe_dump(text, default_style='"', allow_unicode=True, width=10**9)
    return str(dumped).strip()
