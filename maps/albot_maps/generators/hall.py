"""Halls: one space wider than a sonar's range, with pillars, tables and screens in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from albot_maps.generators.furniture import GAP, HALL, Furniture, furnish
from albot_maps.generators.parameters import Parameters, count, fraction, metres, switch
from albot_maps.generators.plan import WALL, Box, Corner, LocalFrame, Plan, Sampler

_PORCH_WIDTH, _PORCH_DEPTH = 200, 150
_FLOOR_PER_PIECE = 50_000
"""Floor area per piece of furniture at full clutter (cm²)."""


@dataclass(frozen=True, kw_only=True)
class HallParameters(Parameters):
    """A hall."""

    kind: ClassVar[str] = "hall"

    width: float = metres(24.0, 10, 100)
    """Inner width (m)."""
    depth: float = metres(18.0, 10, 100)
    """Inner depth (m)."""
    porches: int = count(3, 0, 8)
    """Number of porches of 2 × 1.5 m behind doors, distributed over both long sides."""
    door_width: float = metres(1.2, 0.75, 1.8)
    """Width of the doors to the porches (m)."""
    pillars: float = metres(6.0, 3, 50, zero=True)
    """Distance between pillars (m), which are 40 cm wide and stand in rows; 0 means none."""
    clutter: float = fraction(0.3)
    """Amount of furniture: 0 none, 1 one piece per 5 m², or fewer to keep passages open."""
    symmetry: bool = switch(False)
    """Whether the right half mirrors the left one; porches are not mirrored."""
    doors: int = count(0, 0, 100)
    """Number of doorways with a door that opens and closes."""


def draw_hall(parameters: HallParameters, sampler: Sampler, source: str) -> tuple[Plan, Corner]:
    """Return a hall and its start, near its lower left corner.

    All parameters fit, so `source`, which names the world in errors, is not used.
    """
    del source
    hall = Box(0, 0, round(100 * parameters.width), round(100 * parameters.depth))
    plan = Plan()
    plan.add_room("hall", hall)
    keep = _add_porches(plan, parameters, sampler, hall)
    pillars = _pillars(parameters, hall)
    for pillar in pillars:
        plan.add_block(pillar)
    start = Box(GAP, GAP, 2 * GAP, 2 * GAP)
    keep += [start, *(pillar.grown(GAP) for pillar in pillars)]
    # Furniture that is mirrored keeps half a passage away from the centre line.
    width = hall.width // 2 if parameters.symmetry else hall.width
    if parameters.symmetry:
        keep = [
            half
            for box in keep
            for half in (box, Box(hall.x2 - box.x2, box.y1, hall.x2 - box.x1, box.y2))
        ]
        keep.append(Box(width - GAP // 2 - 1, 0, width + 1, hall.y2))
    wanted = round(parameters.clutter * width * hall.depth / _FLOOR_PER_PIECE)
    furniture = furnish(sampler, (width, hall.depth), keep, wanted, HALL)
    furniture.put(plan, LocalFrame(box=hall))
    if parameters.symmetry:
        _mirrored(furniture, hall.width).put(plan, LocalFrame(box=hall))
    return plan, start.middle


def _add_porches(plan: Plan, parameters: HallParameters, sampler: Sampler, hall: Box) -> list[Box]:
    """Carve the porches and their doors; return the areas in front of doors to keep free."""
    door = round(100 * parameters.door_width)
    keep: list[Box] = []
    lower = parameters.porches // 2
    for number, above in ((lower, False), (parameters.porches - lower, True)):
        if not number:
            continue
        pitch = hall.width // number
        for index in range(number):
            left = index * pitch + sampler.length(0, pitch - _PORCH_WIDTH - WALL)
            y = hall.y2 + WALL if above else -WALL - _PORCH_DEPTH
            porch = Box(left, y, left + _PORCH_WIDTH, y + _PORCH_DEPTH)
            name = plan.add_room(f"porch {len(keep) + 1}", porch)
            x = left + (_PORCH_WIDTH - door) // 2
            wall = (hall.y2, hall.y2 + WALL) if above else (-WALL, 0)
            plan.add_door(Box(x, wall[0], x + door, wall[1]), (name, "hall"), along_x=True)
            before = (hall.y2 - GAP, hall.y2) if above else (0, GAP)
            keep.append(Box(x, before[0], x + door, before[1]))
    return keep


def _pillars(parameters: HallParameters, hall: Box) -> list[Box]:
    """Return square pillars in rows, at least half their spacing away from walls."""
    pitch, half = round(100 * parameters.pillars), 20
    if not pitch:
        return []
    columns, rows = hall.width // pitch, hall.depth // pitch
    left = (hall.width - (columns - 1) * pitch) // 2
    low = (hall.depth - (rows - 1) * pitch) // 2
    middles = [
        (left + column * pitch, low + row * pitch)
        for column in range(columns)
        for row in range(rows)
    ]
    return [Box(x - half, y - half, x + half, y + half) for x, y in middles]


def _mirrored(furniture: Furniture, width: int) -> Furniture:
    return Furniture(
        [Box(width - box.x2, box.y1, width - box.x1, box.y2) for box in furniture.blocks],
        [[(width - x, y) for x, y in outline] for outline in furniture.outlines],
    )
