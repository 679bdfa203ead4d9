"""The movable things in our own world file (docs/worlds.md): read and written."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from albot_core.errors import InputError
from albot_maps.formats.yaml_document import YamlDocument
from albot_maps.formats.yaml_numbers import angle, flow, number
from albot_maps.movables import Box, Door, Movables, Walker

Thing = TypeVar("Thing", Door, Box, Walker)

_ANGLES = ("heading", "opening")


class MovablesReader:
    """Reads them from a document whose form has been checked; `source` names it in errors."""

    def __init__(self, document: YamlDocument, source: str) -> None:
        self._document = document
        self._source = source

    def read(self) -> Movables:
        """The things, if there are any.

        Raises:
            InputError: One is not as it may be; with the line.
        """
        return Movables(
            doors=self._all("doors", Door),
            boxes=self._all("boxes", Box),
            walkers=self._all("walkers", Walker),
        )

    def _all(self, key: str, make: Callable[..., Thing]) -> tuple[Thing, ...]:
        entries = self._document.data.get("movables", {}).get(key, ())
        things = []
        for index, entry in enumerate(entries):
            try:
                things.append(make(**_fields(entry)))
            except InputError as error:
                name = next((name for name in entry if name.startswith(error.place)), error.place)
                place = self._document.place(("movables", key, index, name))
                raise InputError(self._source, error.expected, error.found, place=place) from None
        return tuple(things)


def _fields(entry: dict[str, Any]) -> dict[str, Any]:
    """An entry's values as the fields of a thing: lists are tuples, angles radians."""
    fields = {name: _tuples(value) for name, value in entry.items()}
    for name in _ANGLES:
        if name in fields:
            fields[name] = float(np.deg2rad(fields[name]))
        if f"{name}_rad" in fields:
            fields[name] = fields.pop(f"{name}_rad")
    return fields


def _tuples(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(map(_tuples, value))
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def movable_lines(movables: Movables) -> list[str]:
    """The lines of the section `movables`, indented as within it."""
    parts = {
        "doors": [_door(door) for door in movables.doors],
        "boxes": [_box(box) for box in movables.boxes],
        "walkers": [_walker(walker) for walker in movables.walkers],
    }
    return [
        line
        for name, entries in parts.items()
        if entries
        for line in (f"{name}:", *(f"  - {{{entry}}}" for entry in entries))
    ]


def _door(door: Door) -> str:
    parts = [
        f"hinge: {_pair(door.hinge)}",
        angle("heading", door.heading),
        f"width: {number(door.width)}",
        angle("opening", door.opening),
        f"turn_rate: {number(door.turn_rate)}",
        f"open_for: {_pair(door.open_for)}",
        f"shut_for: {_pair(door.shut_for)}",
    ]
    return ", ".join(parts)


def _box(box: Box) -> str:
    parts = [f"at: {_pair(box.at)}", angle("heading", box.heading)]
    parts += [f"{name}: {number(getattr(box, name))}" for name in ("length", "width", "mass")]
    return ", ".join(parts)


def _walker(walker: Walker) -> str:
    closed = "true" if walker.closed else "false"
    route, speed = flow(np.array(walker.route)), _pair(walker.speed)
    radius = number(walker.radius)
    return f"route: {route}, closed: {closed}, speed: {speed}, radius: {radius}"


def _pair(values: tuple[float, float]) -> str:
    return flow(np.array(values))
