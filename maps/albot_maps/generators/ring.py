"""Rings: corridors that form loops of a chosen length, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

from albot_core.errors import InputError
from albot_maps.generators.furniture import GAP, PASSAGE, furnish
from albot_maps.generators.parameters import Parameters, count, fraction, metres, number
from albot_maps.generators.plan import Box, Corner, LocalFrame, Plan, Sampler, Side

_LEAST_BLOCK = 100
"""Shortest side of the block that a loop surrounds (cm)."""
_LARGEST = 500_000
"""Largest total width of all loops (cm)."""
_LENGTH_PER_PIECE = 200
"""Length of corridor per piece of furniture at full clutter (cm)."""


@dataclass(frozen=True, kw_only=True)
class RingParameters(Parameters):
    """Loops of corridors."""

    kind: ClassVar[str] = "ring"

    loops: int = count(1, 1, 10)
    """Number of loops; neighbouring loops share a corridor."""
    length: float = metres(40.0, 8, 1000)
    """Length of the first loop along the middle of its corridors (m)."""
    growth: float = number(1.0, 1, 3)
    """Factor by which each loop is longer than the one before."""
    corridor_width: float = metres(2.0, 1, 5)
    """Width of the corridors (m)."""
    clutter: float = fraction(0.2)
    """Cupboards along the walls: 0 none, 1 one per 2 m of corridor, where they fit."""


def draw_ring(parameters: RingParameters, sampler: Sampler, source: str) -> tuple[Plan, Corner]:
    """Return the loops, and a start in the first.

    Raises:
        InputError: A loop is too short for its corridors, or all loops together are too wide.
    """
    corridor = round(100 * parameters.corridor_width)
    halves = _half_lengths(parameters)
    least = corridor + _LEAST_BLOCK
    if halves[0] < 2 * least:
        expected = f"at least {4 * least / 100:g} with corridors of {corridor / 100:g} m"
        raise InputError(source, expected, str(parameters.length), place="length")
    # All loops have the same depth: a third to a half of half the first loop's length.
    depth = max(least, min(halves[0] * sampler.integer(33, 55) // 100, halves[0] - least))
    rungs = [0]
    for half in halves:
        rungs.append(rungs[-1] + half - depth)
    if rungs[-1] > _LARGEST:
        found = f"{rungs[-1] / 100:.0f} m"
        raise InputError(source, f"loops at most {_LARGEST // 100} m wide", found, place="growth")
    plan = Plan()
    names = []
    for index, x in enumerate(rungs):
        box = Box(x, 0, x + corridor, depth + corridor)
        names.append(plan.add_room(f"cross {index + 1}", box))
        between = LocalFrame(box=Box(x, corridor, x + corridor, depth), side=Side.EAST)
        _furnish(plan, between, parameters.clutter, sampler)
    for index, (left, right) in enumerate(pairwise(rungs)):
        for low, side in ((0, "south"), (depth, "north")):
            box = Box(left + corridor, low, right, low + corridor)
            name = plan.add_room(f"{side} {index + 1}", box)
            for x, rung in ((box.x1, names[index]), (box.x2, names[index + 1])):
                plan.add_opening(Box(x, box.y1, x, box.y2), (name, rung))
            _furnish(plan, LocalFrame(box=box), parameters.clutter, sampler)
    return plan, (corridor // 2, corridor // 2)


def _half_lengths(parameters: RingParameters) -> list[int]:
    """Return half the length of each loop (cm)."""
    half, halves = parameters.length * 50, []
    for _ in range(parameters.loops):
        halves.append(round(half))
        half *= parameters.growth
    return halves


def _furnish(plan: Plan, passage: LocalFrame, clutter: float, sampler: Sampler) -> None:
    """Put cupboards along a stretch of corridor, but not near its open ends."""
    size = (passage.width, passage.depth)
    ends = [Box(0, 0, GAP, size[1]), Box(size[0] - GAP, 0, size[0], size[1])]
    wanted = round(clutter * size[0] / _LENGTH_PER_PIECE)
    furnish(sampler, size, ends, wanted, PASSAGE).put(plan, passage)
