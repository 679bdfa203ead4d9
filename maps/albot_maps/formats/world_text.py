"""Writing our own world file: YAML, `albot-world` version 1 (docs/worlds.md)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import yaml

from albot_core.geometry.types import Points, Segments
from albot_maps.world import World


def world_text(world: World) -> str:
    """The world as the text of an `albot-world` file; read again it is the same world.

    Chains of walls are written as polylines, those of glass last. Its `source` is not part
    of a file.
    """
    lines = ["albot-world: 1", f"name: {_quoted(world.name)}"]
    sections = {
        "notes": [f"- {_quoted(note)}" for note in world.notes],
        "walls": [f"- {_flow(line)}" for line in _chains(world.opaque)],
        "glass": [f"- {_flow(line)}" for line in _chains(world.walls[world.glass])],
        "rooms": [f"{_quoted(room.name)}: {_flow(room.boundary)}" for room in world.rooms],
        "exits": [
            f"{_quoted(opening.name)}: {{line: {_flow(opening.segment.reshape(2, 2))}, "
            f"rooms: [{', '.join(map(_quoted, opening.rooms))}]}}"
            for opening in world.exits
        ],
        "starts": [
            f"- {{at: {_flow(start[:2])}, {_heading(float(start[2]))}}}" for start in world.starts
        ],
        "tours": [f"{_quoted(name)}: {_flow(line)}" for name, line in world.tours.items()],
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


def _flow(values: np.ndarray) -> str:
    if values.ndim > 1:
        return f"[{', '.join(map(_flow, values))}]"
    return f"[{', '.join(map(_number, values.tolist()))}]"


def _number(value: float) -> str:
    return repr(value).removesuffix(".0")


def _heading(heading: float) -> str:
    """In degrees where they say exactly the same angle, else in radians."""
    degrees = float(np.rad2deg(heading))
    for candidate in (round(degrees, 6), degrees):
        if np.deg2rad(candidate) == heading:
            return f"heading: {_number(candidate)}"
    return f"heading_rad: {_number(heading)}"


def _quoted(text: str) -> str:
    if text.replace("-", "").replace("_", "").isalnum() and text.isascii() and text[0].isalpha():
        return text if text.lower() not in {"true", "false", "null"} else f'"{text}"'
    dumped = yaml.safe_dump(text, default_style='"', allow_unicode=True, width=10**9)
    return str(dumped).strip()
