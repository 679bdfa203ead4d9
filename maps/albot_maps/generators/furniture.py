"""Place furniture so that a robot can still reach every part of the floor.

A piece against a wall touches only that wall, or the two walls of a corner. Any other two
objects, walls included, are at least `GAP` apart. Widened by the robot's radius they still do
not touch, so no chain of objects can divide the floor.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

from albot_maps.generators.plan import Box, Corner, LocalFrame, Plan, Sampler, Side

GAP = 75
"""Narrowest passage (cm) between two objects; the Pioneer is 50 cm wide."""
_TRIES = 4
"""Number of attempts to place each requested piece."""

# Exact rotations (a, b, c): cosine a / c and sine b / c.
_ROTATIONS = ((1, 0, 1), (0, 1, 1), (4, 3, 5), (3, 4, 5), (12, 5, 13), (24, 7, 25), (15, -8, 17))
_OCTAGON = ((12, 5), (5, 12), (-5, 12), (-12, 5), (-12, -5), (-5, -12), (5, -12), (12, -5))
"""Corners of an octagon with circumradius 13."""


@dataclass(frozen=True, kw_only=True)
class Piece:
    """A kind of furniture (cm)."""

    width: int
    """Along the wall."""
    depth: int
    """Distance from the wall to its front."""
    chair: int = 0
    """Side of the chair in front of it; 0 means no chair."""
    free: bool = False
    """Whether it stands away from walls, at any orientation."""
    round: bool = False
    """Whether it is a pillar or a round table, of this width."""


OFFICE = (
    Piece(width=160, depth=80, chair=50),
    Piece(width=140, depth=70, chair=50),
    Piece(width=100, depth=45),
    Piece(width=200, depth=40),
    Piece(width=80, depth=60),
    Piece(width=180, depth=90, free=True),
    Piece(width=110, depth=110, round=True, free=True),
)
HOME = (
    Piece(width=200, depth=90),
    Piece(width=160, depth=200),
    Piece(width=120, depth=60, chair=45),
    Piece(width=150, depth=60),
    Piece(width=60, depth=60),
    Piece(width=160, depth=85, free=True),
    Piece(width=90, depth=90, round=True, free=True),
)
HALL = (
    Piece(width=180, depth=80, free=True),
    Piece(width=120, depth=60, free=True),
    Piece(width=250, depth=30, free=True),
    Piece(width=60, depth=60, round=True, free=True),
    Piece(width=150, depth=150, round=True, free=True),
    Piece(width=200, depth=60),
    Piece(width=90, depth=90),
)
PASSAGE = (Piece(width=100, depth=40), Piece(width=60, depth=35), Piece(width=180, depth=40))
PALLETS = (Piece(width=120, depth=80), Piece(width=80, depth=60))


@dataclass(frozen=True)
class Furniture:
    """The furniture of one room, in the room's frame (cm)."""

    blocks: list[Box] = field(default_factory=list)
    outlines: list[list[Corner]] = field(default_factory=list)

    def put(self, plan: Plan, frame: LocalFrame) -> None:
        """Draw it on a plan."""
        for block in self.blocks:
            plan.add_block(frame.placed(block))
        for outline in self.outlines:
            plan.add_outline([frame.corner(*corner) for corner in outline])


def furnish(
    sampler: Sampler,
    size: Corner,
    keep: Sequence[Box],
    wanted: int,
    pieces: Sequence[Piece],
) -> Furniture:
    """Return at most `wanted` pieces of furniture for a room.

    Args:
        sampler: Source of random draws.
        size: The room's width and depth (cm); its walls are at 0 and at these.
        keep: Areas that must stay free: the floor in front of doors and of openings.
        wanted: Number of pieces to place; fewer are placed if passages would close.
        pieces: The kinds to choose from.
    """
    furniture = Furniture()
    taken: list[Box] = []
    for _ in range(_TRIES * wanted):
        if len(taken) == wanted:
            break
        piece = sampler.pick(pieces)
        place = (
            _place_freely(sampler, size, piece)
            if piece.free
            else _place_at_wall(sampler, size, piece)
        )
        if place is None or not _is_apart(place.bounds, taken, GAP):
            continue
        if not _is_apart(place.bounds, keep, 0):
            continue
        taken.append(place.bounds)
        if place.outline:
            furniture.outlines.append(place.outline)
        else:
            furniture.blocks.extend(_blocks(piece, place.bounds, place.side))
    return furniture


def _is_apart(box: Box, others: Iterable[Box], gap: int) -> bool:
    """Return whether a box is at least `gap` away from every other one, along x or along y."""
    x1, y1, x2, y2 = box.grown(gap)
    return not any(
        x1 < other_x2 and other_x1 < x2 and y1 < other_y2 and other_y1 < y2
        for other_x1, other_y1, other_x2, other_y2 in others
    )


class _Place(NamedTuple):
    """A position for a piece."""

    bounds: Box
    outline: list[Corner]
    """The corners of a piece away from walls; empty against a wall."""
    side: Side = Side.NORTH
    """On which side of the wall at its back it lies."""


def _place_at_wall(sampler: Sampler, size: Corner, piece: Piece) -> _Place | None:
    """Place a piece against a random wall; None if no passage would be left."""
    along_u, far = sampler.bernoulli(0.5), sampler.bernoulli(0.5)
    run, reach = size if along_u else size[::-1]
    spare, depth = run - piece.width, piece.depth + piece.chair
    if reach - depth < GAP or spare < GAP:
        return None
    offset = sampler.length(0, spare)
    # A gap to the corner that is too narrow to pass is closed: the piece moves into the corner.
    offset = 0 if offset < GAP else spare if spare - offset < GAP else offset
    low, high = (reach - depth, reach) if far else (0, depth)
    if along_u:
        bounds = Box(offset, low, offset + piece.width, high)
        return _Place(bounds, [], Side.SOUTH if far else Side.NORTH)
    bounds = Box(low, offset, high, offset + piece.width)
    return _Place(bounds, [], Side.WEST if far else Side.EAST)


def _blocks(piece: Piece, bounds: Box, side: Side) -> list[Box]:
    """Return the boxes of a piece and its chair, within its bounds."""
    frame = LocalFrame(box=bounds, side=side)
    blocks = [frame.placed(Box(0, 0, piece.width, piece.depth))]
    if piece.chair:
        left, front = (piece.width - piece.chair) // 2, piece.depth
        chair = Box(left, front, left + piece.chair, front + piece.chair)
        blocks.append(frame.placed(chair))
    return blocks


def _place_freely(sampler: Sampler, size: Corner, piece: Piece) -> _Place | None:
    """Place a rotated piece away from all walls; None if the room is too small."""
    corners, around = _turned(piece, sampler.pick(_ROTATIONS))
    spare_u, spare_v = size[0] - around.width - 2 * GAP, size[1] - around.depth - 2 * GAP
    if spare_u < 0 or spare_v < 0:
        return None
    u, v = (
        GAP - around.x1 + sampler.length(0, spare_u),
        GAP - around.y1 + sampler.length(0, spare_v),
    )
    bounds = Box(around.x1 + u, around.y1 + v, around.x2 + u, around.y2 + v)
    return _Place(bounds, [(corner[0] + u, corner[1] + v) for corner in corners])


@cache
def _turned(piece: Piece, turn: tuple[int, int, int]) -> tuple[tuple[Corner, ...], Box]:
    """Return a rotated piece's corners relative to its centre, and their bounds."""
    cosine, sine, norm = turn
    half_u, half_v = piece.width // 2, piece.depth // 2
    rectangle = ((-half_u, -half_v), (half_u, -half_v), (half_u, half_v), (-half_u, half_v))
    corners = tuple(
        [(half_u * u // 13, half_u * v // 13) for u, v in _OCTAGON]
        if piece.round
        else [
            ((u * cosine - v * sine) // norm, (u * sine + v * cosine) // norm) for u, v in rectangle
        ]
    )
    us, vs = [corner[0] for corner in corners], [corner[1] for corner in corners]
    return corners, Box(min(us), min(vs), max(us), max(vs))
