"""The perceptual map: surfaces in plain arrays, with a grid over their ends.

Removing what lies in a view must not cost more as the map grows, so every surface's two
ends are filed in a hashed grid of square cells: the ends near a place are found by looking
into the cells there. A surface keeps its slot as long as it lives; freed slots are used
again. Compiled; a `Memory` is a named tuple so that kernels take it whole.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numba import njit

from albot_core.errors import InputError

CELL = 2.0
"""Side of a grid cell (m)."""

ALIVE, FREE, NEXT_ID = 0, 1, 2
"""Places in `Memory.counts`: surfaces alive, slots on the free list, the next surface id."""

NEXT, BEFORE, BUCKET, KEY = 0, 1, 2, 3
"""Columns of `Memory.links`: the next end in the bucket, the one before, the bucket, the cell."""


class Memory(NamedTuple):
    """The arrays of a perceptual map with room for `len(surfaces)` surfaces."""

    surfaces: np.ndarray
    """(capacity, 4) float64: x1, y1, x2, y2 in the map's frame (m); NaN in free slots."""
    edges: np.ndarray
    """(capacity, 2) int8: what the two ends are (see `perception.surfaces`)."""
    ids: np.ndarray
    """(capacity,) int64: the surface's id, never used twice; -1 in free slots."""
    free: np.ndarray
    """(capacity,) int64: stack of free slots."""
    heads: np.ndarray
    """(buckets,) int64: first end filed in each bucket, -1 where none."""
    links: np.ndarray
    """(2 * capacity, 4) int64: where every end is filed (see NEXT, BEFORE, BUCKET, KEY)."""
    counts: np.ndarray
    """(3,) int64: see ALIVE, FREE, NEXT_ID."""


def empty_memory(capacity: int = 1024) -> Memory:
    """A map that remembers nothing, with room for `capacity` surfaces."""
    buckets = 1 << max(6, int(np.ceil(np.log2(2 * capacity))))
    return Memory(
        surfaces=np.full((capacity, 4), np.nan),
        edges=np.zeros((capacity, 2), np.int8),
        ids=np.full(capacity, -1, np.int64),
        free=np.arange(capacity - 1, -1, -1, dtype=np.int64),
        heads=np.full(buckets, -1, np.int64),
        links=np.full((2 * capacity, 4), -1, np.int64),
        counts=np.array([0, capacity, 0], np.int64),
    )


@njit(cache=True, error_model="numpy")
def cell_of(coordinate: float) -> int:
    """Index of the grid cell that holds a coordinate."""
    return int(np.floor(coordinate / CELL))


@njit(cache=True, error_model="numpy")
def cell_key(column: int, row: int) -> int:
    """One number for a cell; cells less than 2^31 cells apart never share it."""
    return int((column << 32) ^ (row & 0xFFFFFFFF))


@njit(cache=True, error_model="numpy")
def bucket_of(column: int, row: int, buckets: int) -> int:
    """The bucket in which the ends of a cell are filed; other cells may share it."""
    return int(((column * 73856093) ^ (row * 19349663)) & (buckets - 1))


@njit(cache=True, error_model="numpy")
def _file_end(memory: Memory, end: int) -> None:
    slot, side = end >> 1, end & 1
    column = cell_of(memory.surfaces[slot, 2 * side])
    row = cell_of(memory.surfaces[slot, 2 * side + 1])
    bucket = bucket_of(column, row, memory.heads.shape[0])
    head = memory.heads[bucket]
    link = memory.links[end]
    link[NEXT], link[BEFORE], link[BUCKET], link[KEY] = head, -1, bucket, cell_key(column, row)
    if head >= 0:
        memory.links[head, BEFORE] = end
    memory.heads[bucket] = end


@njit(cache=True, error_model="numpy")
def _unfile_end(memory: Memory, end: int) -> None:
    link = memory.links[end]
    if link[BEFORE] >= 0:
        memory.links[link[BEFORE], NEXT] = link[NEXT]
    else:
        memory.heads[link[BUCKET]] = link[NEXT]
    if link[NEXT] >= 0:
        memory.links[link[NEXT], BEFORE] = link[BEFORE]


@njit(cache=True, error_model="numpy")
def _write(memory: Memory, slot: int, surface: np.ndarray, edges: np.ndarray) -> None:
    # Element by element: assigning rows takes numba seconds to compile.
    for i in range(4):
        memory.surfaces[slot, i] = surface[i]
    for end in range(2):
        memory.edges[slot, end] = edges[end]
        _file_end(memory, 2 * slot + end)


@njit(cache=True, error_model="numpy")
def add_surface(memory: Memory, surface: np.ndarray, edges: np.ndarray) -> int:
    """Remember a surface under a new id; return its slot. There must be a free one."""
    memory.counts[FREE] -= 1
    slot = int(memory.free[memory.counts[FREE]])
    _write(memory, slot, surface, edges)
    memory.ids[slot] = memory.counts[NEXT_ID]
    memory.counts[NEXT_ID] += 1
    memory.counts[ALIVE] += 1
    return slot


@njit(cache=True, error_model="numpy")
def remove_surface(memory: Memory, slot: int) -> None:
    """Forget the surface in a slot."""
    _unfile_end(memory, 2 * slot)
    _unfile_end(memory, 2 * slot + 1)
    for i in range(4):
        memory.surfaces[slot, i] = np.nan
    memory.ids[slot] = -1
    memory.free[memory.counts[FREE]] = slot
    memory.counts[FREE] += 1
    memory.counts[ALIVE] -= 1


@njit(cache=True, error_model="numpy")
def move_surface(memory: Memory, slot: int, surface: np.ndarray, edges: np.ndarray) -> None:
    """Give the surface in a slot new ends; it keeps its id."""
    _unfile_end(memory, 2 * slot)
    _unfile_end(memory, 2 * slot + 1)
    _write(memory, slot, surface, edges)


@njit(cache=True, error_model="numpy")
def _sort(values: np.ndarray, count: int) -> None:
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


@njit(cache=True, error_model="numpy")
def surfaces_ending_in(memory: Memory, box: np.ndarray) -> np.ndarray:
    """Slots of the surfaces with an end in the box (x_min, y_min, x_max, y_max), ascending."""
    surfaces, heads, links = memory.surfaces, memory.heads, memory.links
    x_min, y_min, x_max, y_max = box[0], box[1], box[2], box[3]
    found = np.empty(min(256, 2 * memory.counts[ALIVE] + 1), np.int64)
    count = 0
    for column in range(cell_of(x_min), cell_of(x_max) + 1):
        for row in range(cell_of(y_min), cell_of(y_max) + 1):
            key = cell_key(column, row)
            end = heads[bucket_of(column, row, heads.shape[0])]
            while end >= 0:
                if links[end, KEY] == key:
                    slot, side = end >> 1, end & 1
                    x, y = surfaces[slot, 2 * side], surfaces[slot, 2 * side + 1]
                    if x_min <= x <= x_max and y_min <= y <= y_max:
                        if count == found.shape[0]:
                            larger = np.empty(2 * count, np.int64)
                            for i in range(count):
                                larger[i] = found[i]
                            found = larger
                        found[count] = slot
                        count += 1
                end = links[end, NEXT]
    _sort(found, count)
    distinct = 0
    for i in range(count):
        if distinct == 0 or found[i] != found[distinct - 1]:
            found[distinct] = found[i]
            distinct += 1
    return found[:distinct]


def with_room(memory: Memory, room: int) -> Memory:
    """The same map with at least `room` free slots; larger arrays only where needed.

    Old free slots are used before the new ones, and the search sorts its answer: a map that
    has grown behaves exactly as one that was large from the start.
    """
    if memory.counts[FREE] >= room:
        return memory
    old, unused = len(memory.surfaces), int(memory.counts[FREE])
    larger = empty_memory(max(2 * old, old + room))
    larger.surfaces[:old] = memory.surfaces
    larger.edges[:old] = memory.edges
    larger.ids[:old] = memory.ids
    added = len(larger.surfaces) - old
    larger.free[:added] = np.arange(old + added - 1, old - 1, -1)
    larger.free[added : added + unused] = memory.free[:unused]
    larger.counts[:] = memory.counts[ALIVE], added + unused, memory.counts[NEXT_ID]
    _file_all(larger)
    return larger


STORED = ("surfaces", "edges", "ids", "free", "counts")
"""The fields from which a memory can be rebuilt; the grid follows from them."""


def rebuilt_memory(stored: Mapping[str, np.ndarray]) -> Memory:
    """The memory with the given STORED fields.

    Raises:
        InputError: The fields contradict each other.
    """
    capacity = len(stored["ids"])
    memory = empty_memory(capacity)
    for field in STORED:
        expected = getattr(memory, field)
        if stored[field].shape != expected.shape:
            raise InputError(f"memory.{field}", f"shape {expected.shape}", str(stored[field].shape))
        expected[...] = stored[field]
    living = memory.ids >= 0
    unused = int(memory.counts[FREE])
    if (
        memory.counts[ALIVE] != living.sum()
        or unused != capacity - living.sum()
        or not np.array_equal(np.sort(memory.free[:unused]), np.flatnonzero(~living))
    ):
        raise InputError("memory.free", "exactly the slots without a surface", "others")
    if not np.isfinite(memory.surfaces[living]).all():
        raise InputError("memory.surfaces", "finite surfaces", "NaN or infinity")
    if (
        len(np.unique(memory.ids[living])) != living.sum()
        or (memory.ids >= memory.counts[NEXT_ID]).any()
    ):
        raise InputError("memory.ids", "every id once and below the next", "others")
    _file_all(memory)
    return memory


@njit(cache=True, error_model="numpy")
def _file_all(memory: Memory) -> None:
    for slot in range(memory.ids.shape[0]):
        if memory.ids[slot] >= 0:
            _file_end(memory, 2 * slot)
            _file_end(memory, 2 * slot + 1)
