"""Finding what the perceptual map holds in a place."""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import ZERO, kernel
from albot_core.mappers.albot1.memory import CELL, NEXT, USED, Memory, bucket_of, cell_of


@kernel()
def sort(values: np.ndarray, count: int) -> None:
    """Sort the first `count` values in place (Shell's method).

    numba takes more than a second to compile its own sort.
    """
    gap = count // 2
    while gap > 0:
        for i in range(gap, count):
            value, at = values[i], i
            while at >= gap and values[at - gap] > value:
                values[at] = values[at - gap]
                at -= gap
            values[at] = value
        gap //= 2


@kernel()
def _keep_distinct(values: np.ndarray, count: int) -> int:
    """Sort the first `count` values in place, each of them once; how many they are then."""
    sort(values, count)
    distinct = ZERO
    for i in range(count):
        if distinct == 0 or values[i] != values[distinct - 1]:
            values[distinct] = values[i]
            distinct += 1
    return int(distinct)


@kernel()
def _is_in(box: np.ndarray, x: float, y: float) -> bool:
    return bool((box[0] <= x) & (x <= box[2]) & (box[1] <= y) & (y <= box[3]))


@kernel()
def _search_all(memory: Memory, box: np.ndarray, found: np.ndarray) -> int:
    """`surfaces_ending_in`, by a look at every surface."""
    surfaces = memory.surfaces
    count = ZERO
    for slot in range(memory.counts[USED]):
        # Freed slots hold NaN, which is in no box. Without branches: half of what is looked at
        # is in the box, and which, no processor foresees.
        found[count] = slot
        count += _is_in(box, surfaces[slot, 0], surfaces[slot, 1]) | _is_in(
            box, surfaces[slot, 2], surfaces[slot, 3]
        )
    return int(count)


@kernel()
def _search_cells(memory: Memory, box: np.ndarray, found: np.ndarray) -> int:
    """`surfaces_ending_in`, by a look into the box's cells."""
    surfaces, heads, links = memory.surfaces, memory.heads, memory.links
    count = ZERO
    for column in range(cell_of(box[0]), cell_of(box[2]) + 1):
        for row in range(cell_of(box[1]), cell_of(box[3]) + 1):
            end = heads[bucket_of(column, row, heads.shape[0])]
            while end >= 0:
                slot, side = end >> 1, end & 1
                if _is_in(box, surfaces[slot, 2 * side], surfaces[slot, 2 * side + 1]):
                    if count == found.shape[0]:
                        # Cells that share a bucket have found the same ends again and again.
                        count = _keep_distinct(found, count)
                    found[count] = slot
                    count += 1
                end = links[end, NEXT]
    return _keep_distinct(found, count)


@kernel()
def surfaces_ending_in(memory: Memory, box: np.ndarray, found: np.ndarray) -> int:
    """Find the slots of the surfaces with an end in the box (x_min, y_min, x_max, y_max).

    They are in `found`, ascending, from its beginning on; how many they are. It must have room
    for one more than live; with room for twice as many it is seldom full on the way.
    """
    cells = (box[2] - box[0]) * (box[3] - box[1]) / CELL**2
    # A surface is looked at several times faster than a cell.
    if memory.counts[USED] < 4.0 * cells:
        return int(_search_all(memory, box, found))
    return int(_search_cells(memory, box, found))
