"""Read houses of HouseExpo: one outline, and boxes that label the rooms.

The format is that of https://github.com/TeaganLi/HouseExpo (Li et al. 2019). `verts` is the
house's outline in metres, which runs along inner walls too. `room_category` lists for each
label the boxes x1, y1, x2, y2 of its rooms. `id` names the house. There are no doors.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import shapely

from albot_core.errors import InputError
from albot_core.file_kinds import kind_of
from albot_core.geometry.types import Points
from albot_core.json_document import read_json
from albot_maps.formats.reachable import reachable_world
from albot_maps.world import LARGEST_COORDINATE, METRES, SHORTEST_WALL, Room, World

_NUMBER = (int, float)


def read_house_json(path: Path, robot_radius: float) -> World:
    """Return the world in a HouseExpo file, for a robot of this radius (m).

    A room is the part of its box inside the house. Where boxes overlap, a point belongs to
    the smallest. Rooms that a robot cannot reach are left out, and a note names them.

    Raises:
        InputError: The file cannot be read, is truncated or is not a HouseExpo house.
    """
    house = _parse(path)
    corners = _rows(house, "verts", 2, path)
    steps = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)
    corners = corners[steps > SHORTEST_WALL]
    if len(corners) < 3:
        raise InputError(path, "an outline of 3 corners or more", str(len(corners)), place="verts")
    drawn = shapely.Polygon(corners)
    outline = shapely.make_valid(drawn)
    rooms = _rooms(house, outline, path)
    notes: tuple[str, ...] = ()
    if not rooms:
        rooms, notes = _whole_house(drawn, outline, path)
    name = house.get("id")
    return reachable_world(
        name=name if isinstance(name, str) and name.strip() else path.stem,
        walls=np.concatenate((corners, np.roll(corners, -1, axis=0)), axis=1),
        rooms=rooms,
        exits=(),
        notes=notes,
        source=str(path),
        robot_radius=robot_radius,
    )


def _rooms(house: dict[str, Any], outline: shapely.Geometry, path: Path) -> tuple[Room, ...]:
    """Return the rooms, the smallest first; rooms that share a label are numbered."""
    labels = house.get("room_category", {})
    if not isinstance(labels, dict):
        raise InputError(path, "boxes by label", type(labels).__name__, place="room_category")
    found: list[tuple[float, str, Points]] = []
    for label in labels:
        boxes = _rows(labels, label, 4, path, within="room_category.")
        for number, (x1, y1, x2, y2) in enumerate(boxes.tolist(), 1):
            box = shapely.box(min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2))
            part = _largest(outline.intersection(box))
            if part is not None:
                name = label if len(boxes) == 1 else f"{label} {number}"
                found.append((part.area, name, np.array(part.exterior.coords[:-1])))
    found.sort(key=lambda room: room[0])
    return tuple(Room(name=name, boundary=boundary) for _, name, boundary in found)


def _whole_house(
    drawn: shapely.Polygon, outline: shapely.Geometry, path: Path
) -> tuple[tuple[Room, ...], tuple[str, ...]]:
    """Return the only room of a house without labels, and notes about it.

    Args:
        drawn: The outline as it is in the file.
        outline: The same without crossings.
        path: The file.
    """
    if drawn.is_valid:
        return (Room(name="house", boundary=np.array(drawn.exterior.coords[:-1])),), ()
    part = _largest(outline)
    if part is None:
        raise InputError(path, "an outline that encloses an area", "none", place="verts")
    note = "the outline crosses or touches itself; the room house is its largest part"
    return (Room(name="house", boundary=np.array(part.exterior.coords[:-1])),), (note,)


def _largest(shape: shapely.Geometry) -> shapely.Polygon | None:
    parts = shapely.get_parts(shape)
    polygons = [part for part in parts if part.geom_type == "Polygon" and part.area > 0]
    return max(polygons, key=lambda part: float(part.area), default=None)


def _parse(path: Path) -> dict[str, Any]:
    house = read_json(path)
    if not isinstance(house, dict) or "verts" not in house:
        raise InputError(path, "a HouseExpo house with verts", kind_of(path) or "none")
    return house


def _rows(
    holder: dict[str, Any], key: str, width: int, path: Path, *, within: str = ""
) -> np.ndarray:
    """Return the list at `key` as an array of rows of `width` finite numbers."""
    rows = holder[key]
    place = f"{within}{key}"
    if not isinstance(rows, list):
        raise InputError(path, "a list", type(rows).__name__, place=place)
    for index, row in enumerate(rows):
        numbers = isinstance(row, list) and len(row) == width
        if not numbers or not all(type(item) in _NUMBER for item in row):
            raise InputError(path, f"{width} numbers", str(row)[:40], place=f"{place}[{index}]")
        if not (np.abs(np.array(row, dtype=np.float64)) <= LARGEST_COORDINATE).all():
            raise InputError(path, METRES, str(row), place=f"{place}[{index}]")
    return np.array(rows, dtype=np.float64).reshape(-1, width)
