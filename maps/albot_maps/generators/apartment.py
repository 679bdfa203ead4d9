"""Apartments: a rectangle cut into rooms, doors between neighbours, furniture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from albot_core.counts import many
from albot_core.errors import InputError
from albot_maps.generators.furniture import GAP, HOME, furnish
from albot_maps.generators.parameters import Parameters, count, fraction, metres
from albot_maps.generators.plan import WALL, Box, Corner, LocalFrame, Plan, Sampler

_ROOMS = 5
"""Number of rooms by default."""
_LEAST_SIDE = 200
"""The shortest side of a room (cm)."""
_JAMB = 15
"""A door's least distance (cm) from a corner."""
_FLOOR_PER_PIECE = 22_000
"""Floor area per piece of furniture at full clutter (cm²)."""
_TRIES = 60
"""Number of divisions tried before the rooms are reported not to fit."""


@dataclass(frozen=True, kw_only=True)
class ApartmentParameters(Parameters):
    """An apartment."""

    kind: ClassVar[str] = "apartment"

    rooms: int | None = count(None, 1, 20, usual=_ROOMS)
    """Number of rooms; by default 5, or as many as fit if that is less."""
    loops: int | None = count(None, 0, 20)
    """Number of doors beyond those needed to reach every room; by default one per three rooms."""
    width: float | None = metres(None, 3, 60)
    """Inner width (m); by default chosen to suit the rooms."""
    depth: float | None = metres(None, 3, 60)
    """Inner depth (m); by default chosen to suit the rooms."""
    door_width: float = metres(0.85, 0.75, 1.5)
    """Width of the doors (m)."""
    clutter: float = fraction(0.4)
    """Amount of furniture: 0 none, 1 one piece per 2.2 m², or fewer to keep passages open."""
    doors: int = count(0, 0, 100)
    """Number of doorways with a door that opens and closes."""


@dataclass(frozen=True, kw_only=True)
class _Doorway:
    """Where two rooms could have a door."""

    rooms: tuple[int, int]
    wall: Box
    """The part of the wall that the rooms share."""
    along_x: bool


def draw_apartment(
    parameters: ApartmentParameters, sampler: Sampler, source: str
) -> tuple[Plan, Corner]:
    """Return an apartment and its start, which is in the room with the most doors.

    Raises:
        InputError: The rooms or the loops do not fit.
    """
    door = round(100 * parameters.door_width)
    boxes, doorways = _fit_rooms(parameters, sampler, source, door)
    names = _names(boxes, doorways)
    plan = Plan()
    for name, box in zip(names, boxes, strict=True):
        plan.add_room(name, box)
    openings: list[Box] = []
    for doorway in doorways:
        opening = _draw_opening(sampler, doorway, door)
        first, second = doorway.rooms
        plan.add_door(opening, (names[first], names[second]), along_x=doorway.along_x)
        openings.append(opening)
    start = boxes[names.index("living room")].middle
    openings.append(Box(start[0], start[1], start[0], start[1]))
    for box in boxes:
        # Keep the floor in front of each door and around the start free, in the room's frame.
        x, y = box.x1, box.y1
        kept = [opening.grown(GAP) for opening in openings]
        keep = [Box(near.x1 - x, near.y1 - y, near.x2 - x, near.y2 - y) for near in kept]
        wanted = round(parameters.clutter * box.width * box.depth / _FLOOR_PER_PIECE)
        furniture = furnish(sampler, (box.width, box.depth), keep, wanted, HOME)
        furniture.put(plan, LocalFrame(box=box))
    return plan, start


def _fit_rooms(
    parameters: ApartmentParameters, sampler: Sampler, source: str, door: int
) -> tuple[list[Box], list[_Doorway]]:
    """Return what `_cut_rooms` does, for fewer rooms than by default if these do not fit."""
    if parameters.rooms is not None:
        return _cut_rooms(parameters, parameters.rooms, sampler, source, door)
    for rooms in range(_ROOMS, 1, -1):
        try:
            return _cut_rooms(parameters, rooms, sampler, source, door)
        except InputError as error:
            if error.place != "rooms":
                raise
    return _cut_rooms(parameters, 1, sampler, source, door)


def _cut_rooms(
    parameters: ApartmentParameters, rooms: int, sampler: Sampler, source: str, door: int
) -> tuple[list[Box], list[_Doorway]]:
    """Return the rooms, and doorways that connect them and close the requested loops."""
    loops = rooms // 3 if parameters.loops is None else parameters.loops
    most, cut = 0, False
    for _ in range(_TRIES):
        boxes = _split(sampler, _draw_outline(parameters, rooms, sampler), rooms)
        if boxes is None:
            continue
        cut = True
        ways = sampler.shuffled(_doorways(boxes, door))
        tree = _spanning_tree(ways, rooms)
        rest = [way for way in ways if way not in tree]
        if len(tree) < rooms - 1:
            continue
        most = max(most, len(rest))
        if parameters.loops is None or len(rest) >= loops:
            return boxes, [*tree, *rest[:loops]]
    if not cut:
        size = f"{parameters.width or 'any'} x {parameters.depth or 'any'} m"
        expected = f"rooms that fit into {size}, each side {_LEAST_SIDE / 100:g} m or more"
        raise InputError(source, expected, str(rooms), place="rooms")
    expected = f"at most {most} in an apartment of {many(rooms, 'room')}"
    raise InputError(source, expected, str(loops), place="loops")


def _draw_outline(parameters: ApartmentParameters, rooms: int, sampler: Sampler) -> Box:
    """Return the floor to divide: about 13 m² per room and nearly square."""
    area = rooms * sampler.length(110, 160) * 1000
    width = parameters.width and round(100 * parameters.width)
    depth = parameters.depth and round(100 * parameters.depth)
    if not width:
        # The side of the square of that area, in integer arithmetic.
        side = 300
        while side * side < area:
            side += 5
        width = area // depth if depth else side * sampler.integer(80, 125) // 100
        width = max(300, width)
    return Box(0, 0, width, depth or max(300, area // width))


def _split(sampler: Sampler, box: Box, number: int) -> list[Box] | None:
    """Return a floor divided into `number` rooms by walls; None if one would be too small."""
    if number == 1:
        return [box] if min(box.width, box.depth) >= _LEAST_SIDE else None
    first = sampler.integer(max(1, number // 3), number - max(1, number // 3))
    across = box.width >= box.depth
    room = (box.width if across else box.depth) - WALL
    part = room * first * sampler.integer(85, 115) // (100 * number)
    if part < _LEAST_SIDE or room - part < _LEAST_SIDE:
        return None
    if across:
        halves = box._replace(x2=box.x1 + part), box._replace(x1=box.x1 + part + WALL)
    else:
        halves = box._replace(y2=box.y1 + part), box._replace(y1=box.y1 + part + WALL)
    left = _split(sampler, halves[0], first)
    right = _split(sampler, halves[1], number - first)
    return left + right if left and right else None


def _doorways(boxes: Sequence[Box], door: int) -> list[_Doorway]:
    """Return every pair of rooms whose shared wall has space for a door."""
    found = []
    for i, one in enumerate(boxes):
        for j, other in enumerate(boxes):
            beside = Box(one.x2, max(one.y1, other.y1), other.x1, min(one.y2, other.y2))
            above = Box(max(one.x1, other.x1), one.y2, min(one.x2, other.x2), other.y1)
            if beside.width == WALL and beside.depth >= door + 2 * _JAMB:
                found.append(_Doorway(rooms=(i, j), wall=beside, along_x=False))
            if above.depth == WALL and above.width >= door + 2 * _JAMB:
                found.append(_Doorway(rooms=(i, j), wall=above, along_x=True))
    return found


def _spanning_tree(ways: Sequence[_Doorway], number: int) -> list[_Doorway]:
    """Return doors that join all rooms without a loop, grown from the room with most neighbours."""
    neighbours = [sum(room in way.rooms for way in ways) for room in range(number)]
    reached = [neighbours.index(max(neighbours))]
    tree: list[_Doorway] = []
    for room in reached:
        for way in ways:
            if room in way.rooms:
                (other,) = set(way.rooms) - {room}
                if other not in reached:
                    reached.append(other)
                    tree.append(way)
    return tree


def _draw_opening(sampler: Sampler, doorway: _Doorway, door: int) -> Box:
    wall = doorway.wall
    if doorway.along_x:
        left = wall.x1 + _JAMB + sampler.length(0, wall.width - door - 2 * _JAMB)
        return wall._replace(x1=left, x2=left + door)
    low = wall.y1 + _JAMB + sampler.length(0, wall.depth - door - 2 * _JAMB)
    return wall._replace(y1=low, y2=low + door)


def _names(boxes: Sequence[Box], doorways: Sequence[_Doorway]) -> list[str]:
    """Return each room's name: the living room has the most doors, the bath is the smallest."""
    doors = [sum(room in way.rooms for way in doorways) for room in range(len(boxes))]
    floor = [box.width * box.depth for box in boxes]
    living = max(range(len(boxes)), key=lambda room: (doors[room], floor[room]))
    others = sorted((room for room in range(len(boxes)) if room != living), key=floor.__getitem__)
    titles = ["bath", "kitchen", *(f"bedroom {number}" for number in range(1, len(boxes)))]
    names = [""] * len(boxes)
    names[living] = "living room"
    for room, title in zip(others, titles, strict=False):
        names[room] = title
    return names
