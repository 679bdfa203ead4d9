"""Rectangles in whole centimetres, and the frames in which rooms are drawn."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

Corner = tuple[int, int]
"""x, y (cm)."""


class Box(NamedTuple):
    """A rectangle along x and y (cm)."""

    x1: int
    y1: int
    x2: int
    y2: int

    @property
    def width(self) -> int:
        """The side along x."""
        return self.x2 - self.x1

    @property
    def depth(self) -> int:
        """The side along y."""
        return self.y2 - self.y1

    @property
    def middle(self) -> Corner:
        """The middle, rounded down."""
        return (self.x1 + self.x2) // 2, (self.y1 + self.y2) // 2

    def grown(self, by: int) -> Box:
        """The box with so much more on every side."""
        return Box(self.x1 - by, self.y1 - by, self.x2 + by, self.y2 + by)


class Side(Enum):
    """On which side of its corridor a room lies."""

    NORTH = "north"
    SOUTH = "south"
    EAST = "east"
    WEST = "west"


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A room's own coordinates: u along its front, v away from it, from 0 at its corner."""

    box: Box
    """The room on the plan."""
    side: Side = Side.NORTH
    """Where the room lies as seen from its front."""

    @property
    def width(self) -> int:
        """The room's front."""
        return self.box.width if self.side in (Side.NORTH, Side.SOUTH) else self.box.depth

    @property
    def depth(self) -> int:
        """How far the room reaches from its front."""
        return self.box.depth if self.side in (Side.NORTH, Side.SOUTH) else self.box.width

    def corner(self, u: int, v: int) -> Corner:
        """A point of the room on the plan."""
        match self.side:
            case Side.NORTH:
                return self.box.x1 + u, self.box.y1 + v
            case Side.SOUTH:
                return self.box.x1 + u, self.box.y2 - v
            case Side.EAST:
                return self.box.x1 + v, self.box.y1 + u
            case Side.WEST:
                return self.box.x2 - v, self.box.y1 + u

    def placed(self, part: Box) -> Box:
        """A rectangle of the room on the plan."""
        (xa, ya), (xb, yb) = self.corner(part.x1, part.y1), self.corner(part.x2, part.y2)
        return Box(min(xa, xb), min(ya, yb), max(xa, xb), max(ya, yb))
