"""Finding what the perceptual map holds in a place."""

from __future__ import annotations

import numpy as np

from albot_core.albot1.memory import ALIVE, CELL, NEXT, USED, Memory, bucket_of, cell_of
from albot_core.compiled import ZERO, kernel


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
def _is_in(box: np.ndarray, x: float, y: float) -> bool:
    return bool(box[0] <= x and x <= box[2] and box[1] <= y and y <= box[3])


@kernel(arrays=True)
def _search_all(memory: Memory, box: np.ndarray) -> np.ndarray:
    """Slots of the surfaces with an end in the box, by a look at every surface."""
    surfaces = memory.surfaces
    found = np.empty(memory.counts[ALIVE], np.int64)
    count = 0
    for slot in range(memory.counts[USED]):
        # Freed slots hold NaN, which is in no box.
        if _is_in(box, surfaces[slot, 0], surfaces[slot, 1]) or _is_in(
            box, surfaces[slot, 2], surfaces[slot, 3]
        ):
            found[count] = slot
            count += 1
    return found[:count]


@kernel(arrays=True)
def _search_cells(memory: Memory, box: np.ndarray) -> np.ndarray:
    """Slots of the surfaces with an end in the box, by a look into its cells."""
    surfaces, heads, links = memory.surfaces, memory.heads, memory.links
    found = np.empty(256, np.int64)
    count = ZERO
    for column in range(cell_of(box[0]), cell_of(box[2]) + 1):
        for row in range(cell_of(box[1]), cell_of(box[3]) + 1):
            end = heads[bucket_of(column, row, heads.shape[0])]
            while end >= 0:
                slot, side = end >> 1, end & 1
                if _is_in(box, surfaces[slot, 2 * side], surfaces[slot, 2 * side + 1]):
                    if count == found.shape[0]:
                        larger = np.empty(2 * count, np.int64)
                        for i in range(count):
                            larger[i] = found[i]
                        found = larger
                    found[count] = slot
                    count += 1
                end = links[end, NEXT]
    sort(found, count)
    distinct = 0
    for i in range(count):
        if distinct == 0 or found[i] != found[distinct - 1]:
            found[distinct] = found[i]
            distinct += 1
    return found[:distinct]


@kernel(arrays=True)
def surfaces_ending_in(memory: Memory, box: np.ndarray) -> np.ndarray:
    """Slots of the surfaces with an end in the box (x_min, y_min, x_max, y_max), ascending."""
    cells = (box[2] - box[0]) * (box[3] - box[1]) / CELL**2
    # A surface is looked at several times faster than a cell.
    if memory.counts[USED] < 4.0 * cells:
        return _search_all(memory, box)
    return _search_cells(memory, box)
