"""Rows of office rooms: cut, named, given doors to their corridor, and furnished."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from albot_core.errors import InputError
from albot_maps.generators.boxes import Box, Frame, Side
from albot_maps.generators.dice import Dice
from albot_maps.generators.furniture import GAP, OFFICE, Furniture, furnish
from albot_maps.generators.plan import WALL, Plan

_LEAST_FRONT = 240
"""The shortest side of a room along its corridor (cm)."""
_FLOOR_PER_PIECE = 25_000
"""At full clutter one piece of furniture is wanted for so much floor (cm²)."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """Rooms side by side along a corridor."""

    box: Box
    """All of them, walls between them included."""
    side: Side
    """Where they lie as seen from the corridor."""
    corridor: str
    """The corridor's name."""

    @property
    def frame(self) -> Frame:
        """The row's own coordinates."""
        return Frame(box=self.box, side=self.side)


class RoomRows:
    """Fills the rows of one office floor.

    Args:
        plan: Where to draw.
        dice: Where chance comes from.
        door: Width of a door (cm).
        connections: Share of neighbours with a door between them.
        clutter: How much furniture, 0 to 1.
        alike: Whether the rooms of a size are all alike.
    """

    def __init__(
        self,
        plan: Plan,
        dice: Dice,
        *,
        door: int,
        connections: float,
        clutter: float,
        alike: bool,
    ) -> None:
        self._plan = plan
        self._dice = dice
        self._door = door
        self._connections = connections
        self._clutter = clutter
        self._alike = alike
        self._names = Counter[str]()
        self._layouts: dict[tuple[int, int], tuple[int, Furniture]] = {}

    def fill(self, rows: list[Row], rooms: int, source: str) -> None:
        """Cut the rows into so many rooms together, and furnish them.

        Raises:
            InputError: The rows are too short for so many.
        """
        for row, number in zip(rows, _shared_out(rows, rooms, source), strict=True):
            self._fill(row, number)

    def _fill(self, row: Row, number: int) -> None:
        """Cut a row into rooms and give each its door and its furniture."""
        frame = row.frame
        spare = frame.width - (number - 1) * WALL
        # Rooms that are to be alike leave a few centimetres to the wall at the row's end.
        fronts = (
            [spare // number] * number
            if self._alike
            else self._dice.parts(spare, number, _LEAST_FRONT)
        )
        u, joined, last = 0, False, ""
        for index, front in enumerate(fronts):
            box = frame.placed(Box(u, 0, u + front, frame.depth))
            name = self._plan.room(self._named(front * frame.depth), box)
            if joined:
                middle = frame.depth // 2
                low, high = middle - self._door // 2, middle + self._door - self._door // 2
                opening = frame.placed(Box(u - WALL, low, u, high))
                along_x = row.side in (Side.EAST, Side.WEST)
                self._plan.door(opening, (last, name), along_x=along_x)
            onward = index + 1 < number and self._dice.chance(self._connections)
            offset = self._furnish(Frame(box=box, side=row.side), joined, onward)
            opening = frame.placed(Box(u + offset, -WALL, u + offset + self._door, 0))
            along_x = row.side in (Side.NORTH, Side.SOUTH)
            self._plan.door(opening, (name, row.corridor), along_x=along_x)
            u, joined, last = u + front + WALL, onward, name

    def _furnish(self, frame: Frame, joined: bool, onward: bool) -> int:
        """Furnish a room; where along its front the door begins."""
        key = (frame.width, frame.depth)
        if not (self._alike and key in self._layouts):
            offset = self._dice.length(20, frame.width - self._door - 20)
            keep = [Box(offset, 0, offset + self._door, GAP)]
            middle = (frame.depth - self._door) // 2
            keep += [
                Box(left, middle, left + GAP, middle + self._door)
                for left, opened in ((0, joined), (frame.width - GAP, onward))
                if opened or self._alike
            ]
            pieces = self._clutter * frame.width * frame.depth / _FLOOR_PER_PIECE
            wanted = int(pieces + self._dice.whole(0, 99) / 100)
            furniture = furnish(self._dice, (frame.width, frame.depth), keep, wanted, OFFICE)
            self._layouts[key] = (offset, furniture)
        offset, furniture = self._layouts[key]
        furniture.put(self._plan, frame)
        return offset

    def _named(self, floor: int) -> str:
        """A name for a room of so much floor (cm²)."""
        what = "meeting" if floor > 280_000 else "store" if floor < 90_000 else "office"
        self._names[what] += 1
        return f"{what} {self._names[what]}"


def _shared_out(rows: list[Row], rooms: int, source: str) -> list[int]:
    """How many rooms each row has: at least one, and more the longer it is."""
    fronts = [row.frame.width + WALL for row in rows]
    room_for = [front // (_LEAST_FRONT + WALL) for front in fronts]
    if sum(room_for) < rooms:
        expected = f"at most {sum(room_for)} on this floor"
        raise InputError(source, expected, str(rooms), place="rooms")
    numbers = [1] * len(rows)
    for _ in range(rooms - len(rows)):
        open_rows = [index for index in range(len(rows)) if numbers[index] < room_for[index]]
        numbers[max(open_rows, key=lambda index: fronts[index] / (numbers[index] + 1))] += 1
    return numbers
