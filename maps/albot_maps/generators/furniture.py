"""Furniture, placed so that a robot still gets everywhere.

What stands against a wall touches that wall, or a corner, and nothing else; between any
other two things, walls included, there are at least `GAP`. Widened by the robot's radius
they stay apart, and no chain of them can part the floor.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

from albot_maps.generators.plan import Box, Corner, Frame, Plan, Sampler, Side

GAP = 75
"""The narrowest way (cm) left between two things: the robot is 50 wide."""
_TRIES = 4
"""How often a place is sought for each piece that is wanted."""

# Exact turns: cosine and sine are a / c and b / c.
_TURNS = ((1, 0, 1), (0, 1, 1), (4, 3, 5), (3, 4, 5), (12, 5, 13), (24, 7, 25), (15, -8, 17))
_ROUND = ((12, 5), (5, 12), (-5, 12), (-12, 5), (-12, -5), (-5, -12), (5, -12), (12, -5))
"""An octagon's corners at 13."""


@dataclass(frozen=True, kw_only=True)
class Piece:
    """A kind of furniture (cm)."""

    width: int
    """Along the wall."""
    depth: int
    """Away from the wall."""
    chair: int = 0
    """Side of the chair in front of it; 0: none."""
    free: bool = False
    """Whether it stands in the open, turned any way, and not against a wall."""
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
    """What stands in one room, in its frame."""

    blocks: list[Box] = field(default_factory=list)
    outlines: list[list[Corner]] = field(default_factory=list)

    def put(self, plan: Plan, frame: Frame) -> None:
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
    """Furniture for a room of a size (cm), at most so many pieces.

    Args:
        sampler: Where chance comes from.
        size: The room's width and depth; its walls are at 0 and there.
        keep: What must stay free: the floor before doors, and where there is no wall.
        wanted: How many pieces to seek a place for; fewer where the ways would close.
        pieces: What there is to choose from.
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
    """Whether a gap or more lies between a box and all others, along x or along y."""
    x1, y1, x2, y2 = box.grown(gap)
    return not any(
        x1 < other_x2 and other_x1 < x2 and y1 < other_y2 and other_y1 < y2
        for other_x1, other_y1, other_x2, other_y2 in others
    )


class _Place(NamedTuple):
    """Where a piece could stand."""

    bounds: Box
    outline: list[Corner]
    """Its corners where it stands in the open."""
    side: Side = Side.NORTH
    """Where it lies as seen from the wall at its back."""


def _place_at_wall(sampler: Sampler, size: Corner, piece: Piece) -> _Place | None:
    """A piece against any of the four walls; None where too little would be left."""
    along_u, far = sampler.chance(0.5), sampler.chance(0.5)
    run, reach = size if along_u else size[::-1]
    spare, depth = run - piece.width, piece.depth + piece.chair
    if reach - depth < GAP or spare < GAP:
        return None
    offset = sampler.length(0, spare)
    # Too near a corner to pass behind: into the corner.
    offset = 0 if offset < GAP else spare if spare - offset < GAP else offset
    low, high = (reach - depth, reach) if far else (0, depth)
    if along_u:
        bounds = Box(offset, low, offset + piece.width, high)
        return _Place(bounds, [], Side.SOUTH if far else Side.NORTH)
    bounds = Box(low, offset, high, offset + piece.width)
    return _Place(bounds, [], Side.WEST if far else Side.EAST)


def _blocks(piece: Piece, bounds: Box, side: Side) -> list[Box]:
    """A piece and its chair, within its bounds."""
    frame = Frame(box=bounds, side=side)
    blocks = [frame.placed(Box(0, 0, piece.width, piece.depth))]
    if piece.chair:
        left, front = (piece.width - piece.chair) // 2, piece.depth
        chair = Box(left, front, left + piece.chair, front + piece.chair)
        blocks.append(frame.placed(chair))
    return blocks


def _place_freely(sampler: Sampler, size: Corner, piece: Piece) -> _Place | None:
    """A piece away from all walls, turned; None where the room is too small."""
    corners, around = _turned(piece, sampler.pick(_TURNS))
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
    """A piece's corners about its middle, and their bounds."""
    cosine, sine, norm = turn
    half_u, half_v = piece.width // 2, piece.depth // 2
    rectangle = ((-half_u, -half_v), (half_u, -half_v), (half_u, half_v), (-half_u, half_v))
    corners = tuple(
        [(half_u * u // 13, half_u * v // 13) for u, v in _ROUND]
        if piece.round
        else [
            ((u * cosine - v * sine) // norm, (u * sine + v * cosine) // norm) for u, v in rectangle
        ]
    )
    us, vs = [corner[0] for corner in corners], [corner[1] for corner in corners]
    return corners, Box(min(us), min(vs), max(us), max(vs))
