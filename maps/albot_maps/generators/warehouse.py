"""Warehouses: rows of racks, and aisles between them that look alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from albot_maps.generators.furniture import GAP, PALLETS, furnish
from albot_maps.generators.parameters import Parameters, count, fraction, metres
from albot_maps.generators.plan import Box, Corner, LocalFrame, Plan, Sampler, Side

_BAY, _POST = 270, 10
"""Width of a rack's bay, and of the post on each of its sides (cm)."""
_AISLE_PER_PALLET = 300
"""Length of aisle per pallet at full clutter (cm)."""


@dataclass(frozen=True, kw_only=True)
class WarehouseParameters(Parameters):
    """A warehouse."""

    kind: ClassVar[str] = "warehouse"

    aisles: int = count(5, 1, 40)
    """Number of aisles, side by side."""
    bays: int = count(4, 1, 40)
    """Number of bays of 2.7 m per rack, between two cross aisles."""
    cross_aisles: int = count(1, 0, 10)
    """Number of cross aisles between the front and the back."""
    aisle_width: float = metres(2.4, 1.2, 6)
    """Width of the aisles (m)."""
    cross_width: float = metres(3.0, 1.2, 10)
    """Width of the cross aisles, of the front and of the back (m)."""
    rack_depth: float = metres(1.1, 0.5, 2)
    """Depth of the racks (m), which stand back to back between two aisles."""
    empty: float = fraction(0.1)
    """Share of empty bays; without empty bays and pallets all aisles are alike."""
    clutter: float = fraction(0.1)
    """Pallets in the aisles: 0 none, 1 one per 3 m of aisle, where they fit."""


def draw_warehouse(
    parameters: WarehouseParameters, sampler: Sampler, source: str
) -> tuple[Plan, Corner]:
    """Return a warehouse and its start, at the front.

    All parameters fit, so `source`, which names the world in errors, is not used.
    """
    del source
    rack, aisle = round(100 * parameters.rack_depth), round(100 * parameters.aisle_width)
    cross, run = round(100 * parameters.cross_width), parameters.bays * _BAY
    pitch = 2 * rack + aisle
    width = parameters.aisles * pitch
    plan = Plan()
    below = plan.add_room("front", Box(0, 0, width, cross))
    for row in range(parameters.cross_aisles + 1):
        low = cross + row * (run + cross)
        high = low + run
        last = row == parameters.cross_aisles
        above = "back" if last else f"cross {row + 1}"
        plan.add_room(above, Box(0, high, width, high + cross))
        for index in range(parameters.aisles):
            left = index * pitch + rack
            number = f"{index + 1}" if not parameters.cross_aisles else f"{index + 1}.{row + 1}"
            passage = Box(left, low, left + aisle, high)
            name = plan.add_room(f"aisle {number}", passage)
            for y, other in ((low, below), (high, above)):
                plan.add_opening(Box(passage.x1, y, passage.x2, y), (name, other))
            for side, x in ((Side.WEST, left - rack), (Side.EAST, passage.x2)):
                _carve_empty(
                    plan,
                    LocalFrame(box=Box(x, low, x + rack, high), side=side),
                    parameters,
                    sampler,
                )
            _leave_pallets(
                plan, LocalFrame(box=passage, side=Side.EAST), parameters.clutter, sampler
            )
        below = above
    return plan, (width // 2, cross // 2)


def _carve_empty(
    plan: Plan, rack: LocalFrame, parameters: WarehouseParameters, sampler: Sampler
) -> None:
    """Open a rack's empty bays toward its aisle."""
    for bay in range(parameters.bays):
        if sampler.bernoulli(parameters.empty):
            left, right = bay * _BAY + _POST, (bay + 1) * _BAY - _POST
            plan.carve(rack.placed(Box(left, 0, right, rack.depth - _POST)))


def _leave_pallets(plan: Plan, aisle: LocalFrame, clutter: float, sampler: Sampler) -> None:
    """Put pallets along the racks, but not near the ends of the aisle."""
    size = (aisle.width, aisle.depth)
    ends = [Box(0, 0, GAP, size[1]), Box(size[0] - GAP, 0, size[0], size[1])]
    wanted = round(clutter * size[0] / _AISLE_PER_PALLET)
    furnish(sampler, size, ends, wanted, PALLETS).put(plan, aisle)
