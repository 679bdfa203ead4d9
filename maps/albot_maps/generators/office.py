"""Offices: corridors that cross and close loops, rows of rooms along them, doors, desks.

`_Office` lays out the corridors; `RoomRows` divides the rows beside them into furnished rooms.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import ClassVar

from albot_core.errors import InputError
from albot_maps.generators.furniture import GAP, OFFICE, Furniture, furnish
from albot_maps.generators.parameters import Parameters, count, fraction, metres, switch
from albot_maps.generators.plan import WALL, Box, Corner, LocalFrame, Plan, Sampler, Side

_ROOMS = 20
"""Number of rooms by default."""
_LEAST_DEPTH, _LEAST_BLOCK = 260, 300
"""Least depth of a row of rooms, and least width of a block between two corridors (cm)."""
_WIDEST_STRIP = 500
"""Largest depth of the rooms along the left and right side of the building (cm)."""


@dataclass(frozen=True, kw_only=True)
class OfficeParameters(Parameters):
    """An office floor."""

    kind: ClassVar[str] = "office"

    rooms: int | None = count(None, 2, 200, usual=_ROOMS)
    """Number of rooms, without corridors; by default 20, more where the loops need them, and fewer
    where the floor has no space."""
    loops: int | None = count(None, 0, 12)
    """Number of loops that the corridors close; by default 0 to 3, as the rooms allow."""
    width: float | None = metres(None, 8, 200)
    """Inner width of the building (m); by default chosen to suit the rooms."""
    depth: float | None = metres(None, 8, 200)
    """Inner depth of the building (m); by default chosen to suit the rooms."""
    corridor_width: float = metres(1.8, 1.2, 5)
    """Width of the corridors (m)."""
    door_width: float = metres(0.9, 0.75, 1.5)
    """Width of the doors (m)."""
    connections: float = fraction(0.1)
    """Share of the walls between neighbouring rooms of a row that have a door."""
    clutter: float = fraction(0.3)
    """Amount of furniture: 0 none, 1 one piece per 2.5 m², or fewer to keep passages open."""
    symmetry: bool = switch(False)
    """Whether all rooms along a corridor are alike and mirrored on its other side."""
    doors: int = count(0, 0, 100)
    """Number of doorways with a door that opens and closes."""


def draw_office(parameters: OfficeParameters, sampler: Sampler, source: str) -> tuple[Plan, Corner]:
    """Return an office floor and its start.

    Raises:
        InputError: The rooms or the loops do not fit.
    """
    return _Office(parameters, sampler, source).draw()


class _Office:
    def __init__(self, parameters: OfficeParameters, sampler: Sampler, source: str) -> None:
        self._asked = parameters
        self._sampler = sampler
        self._source = source
        self._plan = Plan()
        self._corridor = round(100 * parameters.corridor_width)
        self._links = 0
        self._rooms = _ROOMS if parameters.rooms is None else parameters.rooms

    def draw(self) -> tuple[Plan, Corner]:
        """Lay out the corridors, divide the rows into rooms, and furnish these."""
        across, upward = self._choose_corridors()
        rows, start = self._lay_corridors(across, upward)
        if self._asked.rooms is None:
            self._rooms = min(self._rooms, sum(_room_for(rows)))
        filler = RoomRows(
            self._plan,
            self._sampler,
            door=round(100 * self._asked.door_width),
            connections=self._asked.connections,
            clutter=self._asked.clutter,
            alike=self._asked.symmetry,
        )
        filler.fill(rows, self._rooms, self._source)
        return self._plan, start

    def _error(self, place: str, expected: str, found: object) -> InputError:
        return InputError(self._source, expected, str(found), place=place)

    def _choose_corridors(self) -> tuple[int, int]:
        """Return the numbers of corridors along x and along y that close the requested loops."""
        loops = self._asked.loops
        wanted = range(4) if loops is None else (loops,)
        all_ways = [
            (across, upward)
            for across in range(1, 14)
            for upward in range(14)
            if (across - 1) * (max(upward, 1) - 1) in wanted and (across == 1) == (upward == 0)
        ]
        least = min(_rows(*way) for way in all_ways)
        if self._asked.rooms is None:
            self._rooms = max(self._rooms, least)
        rooms = self._rooms
        ways = [way for way in all_ways if _rows(*way) <= rooms]
        if not ways:
            raise self._error("rooms", f"at least {least} for {loops} loops", rooms)
        depths = {way: self._least_depth(way[0]) for way in ways}
        ways = self._fitting("depth", self._asked.depth, depths)
        widths = {way: self._least_width(way[1]) for way in ways}
        ways = self._fitting("width", self._asked.width, widths)
        # Prefer rows of two to eight rooms.
        liked = [way for way in ways if 2 * _rows(*way) <= rooms <= 8 * _rows(*way)]
        return self._sampler.pick(liked or ways[-1:])

    def _fitting(
        self, place: str, asked: float | None, sizes: dict[tuple[int, int], int]
    ) -> list[tuple[int, int]]:
        """Return the corridor layouts that need no more than the requested size `asked` (m)."""
        if asked is None:
            return list(sizes)
        fitting = [way for way, size in sizes.items() if size <= round(100 * asked)]
        if not fitting:
            least = min(sizes.values()) / 100
            raise self._error(place, f"at least {least:.2f} for these corridors", asked)
        return fitting

    def _least_depth(self, across: int) -> int:
        """Return the smallest depth (cm) of a floor with `across` corridors along x."""
        rooms = 2 * across * _LEAST_DEPTH
        return rooms + across * self._corridor + (3 * across - 1) * WALL

    def _least_width(self, upward: int) -> int:
        """Return the smallest width (cm) of a floor with `upward` corridors along y."""
        if upward <= 1:
            return (1 + upward) * _LEAST_BLOCK + upward * (self._corridor + 2 * WALL)
        strips = 2 * _WIDEST_STRIP
        return strips + upward * (self._corridor + 2 * WALL) + (upward - 1) * _LEAST_BLOCK

    def _lay_corridors(self, across: int, upward: int) -> tuple[list[Row], Corner]:
        """Carve the corridors; return the rows of rooms beside them, and a start in the first."""
        strips = [self._sampler.length(350, _WIDEST_STRIP) for _ in range(2 if upward > 1 else 0)]
        depths = self._draw_depths(across)
        block_depths = [sum(depths[i : i + 2]) + WALL for i in range(1, 2 * across - 1, 2)]
        blocks = self._draw_block_widths(upward, strips, block_depths)
        # From left to right: strip, corridor, block, corridor, …, strip, with walls between.
        columns = _columns(strips, blocks, self._corridor, upward)
        rows: list[Row] = []
        y, right = 0, columns[-1][1]
        below: str | None = None
        halls: list[Box] = []
        for level in range(across):
            low = Box(0, y, right, y + depths[2 * level])
            hall = Box(0, low.y2 + WALL, right, low.y2 + WALL + self._corridor)
            name = self._plan.add_room(f"corridor {level + 1}", hall)
            if below is None:
                rows.append(Row(box=low, side=Side.SOUTH, corridor=name))
            else:
                rows += self._carve_links(halls[-1], below, hall, name, columns, upward, low.y1)
            halls.append(hall)
            below = name
            y = hall.y2 + WALL + depths[2 * level + 1] + WALL
        top = Box(0, halls[-1].y2 + WALL, right, y - WALL)
        rows.append(Row(box=top, side=Side.NORTH, corridor=str(below)))
        return rows, (right // 2, halls[0].middle[1])

    def _carve_links(
        self,
        lower: Box,
        below: str,
        upper: Box,
        above: str,
        columns: list[tuple[int, int, str]],
        upward: int,
        cut: int,
    ) -> list[Row]:
        """Carve the links between two corridors; return the rows between, divided at y = `cut`."""
        rows: list[Row] = []
        names: dict[int, str] = {}
        for index, (left, right, what) in enumerate(columns):
            if what == "corridor":
                self._links += 1
                names[index] = self._plan.add_room(
                    f"link {self._links}", Box(left, lower.y2, right, upper.y1)
                )
                for y, other in ((lower.y2, below), (upper.y1, above)):
                    self._plan.add_opening(Box(left, y, right, y), (names[index], other))
        bottom, top = lower.y2 + WALL, upper.y1 - WALL
        for index, (left, right, what) in enumerate(columns):
            if what == "strip":
                west = index == 0
                corridor = names[1 if west else len(columns) - 2]
                box = Box(left, bottom, right, top)
                side = Side.WEST if west else Side.EAST
                rows.append(Row(box=box, side=side, corridor=corridor))
            elif what == "block":
                first, second = Box(left, bottom, right, cut - WALL), Box(left, cut, right, top)
                rows.append(Row(box=first, side=Side.NORTH, corridor=below))
                rows.append(Row(box=second, side=Side.SOUTH, corridor=above))
        return rows

    def _draw_depths(self, across: int) -> list[int]:
        """Return the depth of each row of rooms (cm), from the lowest up."""
        number = 2 * across
        if self._asked.depth is None and self._asked.symmetry:
            return [self._sampler.length(380, 600)] * number
        if self._asked.depth is None:
            return [self._sampler.length(380, 600) for _ in range(number)]
        fixed = self._least_depth(across) - number * _LEAST_DEPTH
        spare = round(100 * self._asked.depth) - fixed
        return self._sampler.partition(spare, number, _LEAST_DEPTH, even=self._asked.symmetry)

    def _draw_block_widths(
        self, upward: int, strips: list[int], block_depths: list[int]
    ) -> list[int]:
        """Return the width of each block between two corridors along y (cm), from the left."""
        number = 2 if upward == 1 else max(1, upward - 1)
        fixed = sum(strips) + upward * (self._corridor + 2 * WALL)
        if self._asked.width is not None:
            spare = round(100 * self._asked.width) - fixed
        else:
            # Wide enough for a front of about four metres per room.
            fronts = self._rooms * self._sampler.length(340, 460)
            fronts -= 2 * sum(block_depths) if upward > 1 else 0
            spare = (fronts - 2 * fixed) // (2 + 2 * len(block_depths))
            spare = max(spare, 2 * number * _LEAST_BLOCK)
        return self._sampler.partition(spare, number, _LEAST_BLOCK, even=self._asked.symmetry)


def _rows(across: int, upward: int) -> int:
    """Return the number of rows of rooms."""
    blocks = 2 if upward == 1 else max(0, upward - 1)
    strips = 2 if upward > 1 else 0
    return 2 + (across - 1) * (2 * blocks + strips)


def _columns(
    strips: list[int], blocks: list[int], corridor: int, upward: int
) -> list[tuple[int, int, str]]:
    """Return left edge, right edge (cm) and kind of the columns between two corridors along x."""
    widths = [(width, "block") for width in blocks]
    if upward == 1:
        widths.insert(1, (corridor, "corridor"))
    elif upward > 1:
        widths = [(strips[0], "strip"), (corridor, "corridor")]
        for width in blocks:
            widths += [(width, "block"), (corridor, "corridor")]
        widths.append((strips[1], "strip"))
    columns, x = [], 0
    for width, what in widths:
        columns.append((x, x + width, what))
        x += width + WALL
    return columns


_LEAST_FRONT = 240
"""The shortest side of a room along its corridor (cm)."""
_FLOOR_PER_PIECE = 25_000
"""Floor area per piece of furniture at full clutter (cm²)."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """Rooms side by side along a corridor."""

    box: Box
    """The rectangle of all its rooms, including the walls between them."""
    side: Side
    """On which side of the corridor the rooms lie."""
    corridor: str
    """The corridor's name."""

    @property
    def frame(self) -> LocalFrame:
        """The row's own frame."""
        return LocalFrame(box=self.box, side=self.side)


class RoomRows:
    """Divide the rows of one office floor into furnished rooms.

    Args:
        plan: Where to draw.
        sampler: Source of random draws.
        door: Width of a door (cm).
        connections: Share of neighbouring rooms with a door between them.
        clutter: Amount of furniture, 0 to 1.
        alike: Whether all rooms of the same size are alike.
    """

    def __init__(
        self,
        plan: Plan,
        sampler: Sampler,
        *,
        door: int,
        connections: float,
        clutter: float,
        alike: bool,
    ) -> None:
        self._plan = plan
        self._sampler = sampler
        self._door = door
        self._connections = connections
        self._clutter = clutter
        self._alike = alike
        self._names = Counter[str]()
        self._layouts: dict[tuple[int, int], tuple[int, Furniture]] = {}

    def fill(self, rows: list[Row], rooms: int, source: str) -> None:
        """Divide the rows into `rooms` rooms in total, and furnish these.

        Raises:
            InputError: The rows are too short for this number.
        """
        for row, number in zip(rows, _share_rooms(rows, rooms, source), strict=True):
            self._fill(row, number)

    def _fill(self, row: Row, number: int) -> None:
        """Divide a row into rooms and give each its door and its furniture."""
        frame = row.frame
        spare = frame.width - (number - 1) * WALL
        # Rooms that must be alike leave a few centimetres for the wall at the row's end.
        fronts = (
            [spare // number] * number
            if self._alike
            else self._sampler.partition(spare, number, _LEAST_FRONT)
        )
        u, joined, last = 0, False, ""
        for index, front in enumerate(fronts):
            box = frame.placed(Box(u, 0, u + front, frame.depth))
            name = self._plan.add_room(self._next_name(front * frame.depth), box)
            if joined:
                middle = frame.depth // 2
                low, high = middle - self._door // 2, middle + self._door - self._door // 2
                opening = frame.placed(Box(u - WALL, low, u, high))
                along_x = row.side in (Side.EAST, Side.WEST)
                self._plan.add_door(opening, (last, name), along_x=along_x)
            onward = index + 1 < number and self._sampler.bernoulli(self._connections)
            offset = self._furnish(LocalFrame(box=box, side=row.side), joined, onward)
            opening = frame.placed(Box(u + offset, -WALL, u + offset + self._door, 0))
            along_x = row.side in (Side.NORTH, Side.SOUTH)
            self._plan.add_door(opening, (name, row.corridor), along_x=along_x)
            u, joined, last = u + front + WALL, onward, name

    def _furnish(self, frame: LocalFrame, joined: bool, onward: bool) -> int:
        """Furnish a room; return where along its front the door begins (cm)."""
        key = (frame.width, frame.depth)
        if not (self._alike and key in self._layouts):
            offset = self._sampler.length(20, frame.width - self._door - 20)
            keep = [Box(offset, 0, offset + self._door, GAP)]
            middle = (frame.depth - self._door) // 2
            keep += [
                Box(left, middle, left + GAP, middle + self._door)
                for left, opened in ((0, joined), (frame.width - GAP, onward))
                if opened or self._alike
            ]
            pieces = self._clutter * frame.width * frame.depth / _FLOOR_PER_PIECE
            wanted = int(pieces + self._sampler.integer(0, 99) / 100)
            furniture = furnish(self._sampler, (frame.width, frame.depth), keep, wanted, OFFICE)
            self._layouts[key] = (offset, furniture)
        offset, furniture = self._layouts[key]
        furniture.put(self._plan, frame)
        return offset

    def _next_name(self, floor: int) -> str:
        """Return the next numbered name for a room of floor area `floor` (cm²)."""
        what = "meeting" if floor > 280_000 else "store" if floor < 90_000 else "office"
        self._names[what] += 1
        return f"{what} {self._names[what]}"


def _room_for(rows: list[Row]) -> list[int]:
    """Return the largest number of rooms of each row."""
    return [(row.frame.width + WALL) // (_LEAST_FRONT + WALL) for row in rows]


def _share_rooms(rows: list[Row], rooms: int, source: str) -> list[int]:
    """Return the number of rooms of each row: at least one, and more for longer rows."""
    fronts = [row.frame.width + WALL for row in rows]
    room_for = _room_for(rows)
    if sum(room_for) < rooms:
        expected = f"at most {sum(room_for)} on this floor"
        raise InputError(source, expected, str(rooms), place="rooms")
    numbers = [1] * len(rows)
    for _ in range(rooms - len(rows)):
        open_rows = [index for index in range(len(rows)) if numbers[index] < room_for[index]]
        numbers[max(open_rows, key=lambda index: fronts[index] / (numbers[index] + 1))] += 1
    return numbers
