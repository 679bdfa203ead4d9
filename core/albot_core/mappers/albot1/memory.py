"""The perceptual map: surfaces in plain arrays, with a grid over their ends.

Removing what lies in a view must not cost more as the map grows, so every surface's two
ends are filed in a hashed grid of square cells: the ends near a place are found by looking
into the cells there. A surface keeps its slot as long as it lives; freed slots are used
again. Every surface bears a mark: the visit to a place in which it was last seen (chapter 4).
Compiled; a `Memory` is a named tuple so that kernels take it whole. Thousands of
robots may each have one: it is small, and emptied in no time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel

CELL = 2.0
"""Side of a grid cell (m)."""

CAPACITY = 128
"""Surfaces that a new map has room for; its room is always a power of two."""

ALIVE, FREE, NEXT_ID, USED, VISIT, SUSPECT = 0, 1, 2, 3, 4, 5
"""Places in `Memory.counts`: surfaces alive, slots on the free list, the next surface id, how
many slots, from the first on, have ever held a surface, the number of the present visit, and
an earlier visit that the robot may have come back to (0 where none is suspected)."""

NEVER = np.iinfo(np.int32).max
"""In `Memory.met`: surfaces of this visit arouse no suspicion, however many are met again."""

NEXT, BEFORE = 0, 1
"""Columns of `Memory.links`: the next end in the bucket, and the one before."""


class Memory(NamedTuple):
    """The arrays of a perceptual map with room for `len(surfaces)` surfaces.

    What they hold for slots never used is of no account.
    """

    surfaces: np.ndarray
    """(capacity, 4) float64: x1, y1, x2, y2 in the map's frame (m); NaN in freed slots."""
    edges: np.ndarray
    """(capacity, 2) int8: what the two ends are (see `perception.surfaces`)."""
    ids: np.ndarray
    """(capacity,) int64: the surface's id, never used twice; -1 in freed slots."""
    marks: np.ndarray
    """(capacity,) int32: the visit in which the surface was last seen; they count from 1."""
    met_in: np.ndarray
    """(capacity,) int32: the last visit, not that of its mark, in which it was met again."""
    met: np.ndarray
    """(capacity, 2) int32: how many surfaces of each earlier visit were met again in the
    present one, and more than how many arouse the suspicion of being there."""
    free: np.ndarray
    """(capacity,) int32: stack of freed slots."""
    heads: np.ndarray
    """(2 * capacity,) int32: first end filed in each bucket, -1 where none."""
    links: np.ndarray
    """(2 * capacity, 2) int32: the other ends in an end's bucket (see NEXT, BEFORE)."""
    counts: np.ndarray
    """(6,) int64: see ALIVE, FREE, NEXT_ID, USED, VISIT, SUSPECT."""


def empty_memory(capacity: int = CAPACITY) -> Memory:
    """A map that remembers nothing, with room for `capacity` surfaces or a few more."""
    capacity = 1 << max(capacity - 1, 1).bit_length()
    memory = Memory(
        surfaces=np.empty((capacity, 4)),
        edges=np.empty((capacity, 2), np.int8),
        ids=np.empty(capacity, np.int64),
        marks=np.empty(capacity, np.int32),
        met_in=np.empty(capacity, np.int32),
        met=np.empty((capacity, 2), np.int32),
        free=np.empty(capacity, np.int32),
        heads=np.empty(2 * capacity, np.int32),
        links=np.empty((2 * capacity, 2), np.int32),
        counts=np.empty(6, np.int64),
    )
    forget(memory)
    return memory


def forget(memory: Memory) -> None:
    """Make the map remember nothing."""
    memory.heads[:] = -1
    memory.met[:] = (0, NEVER)
    memory.counts[:] = 0
    memory.counts[VISIT] = 1


def living(memory: Memory) -> np.ndarray:
    """(slots used,) bool: the slots that hold a surface."""
    return np.asarray(memory.ids[: memory.counts[USED]] >= 0)


@kernel()
def cell_of(coordinate: float) -> int:
    """Index of the grid cell that holds a coordinate."""
    return int(np.floor(coordinate / CELL))


@kernel()
def bucket_of(column: int, row: int, buckets: int) -> int:
    """The bucket in which the ends of a cell are filed; other cells may share it."""
    return int(((column * 73856093) ^ (row * 19349663)) & (buckets - 1))


@kernel()
def _bucket_of_end(memory: Memory, end: int) -> int:
    slot, side = end >> 1, end & 1
    column = cell_of(memory.surfaces[slot, 2 * side])
    row = cell_of(memory.surfaces[slot, 2 * side + 1])
    return bucket_of(column, row, memory.heads.shape[0])


@kernel()
def _file_end(memory: Memory, end: int) -> None:
    bucket = _bucket_of_end(memory, end)
    head = memory.heads[bucket]
    memory.links[end, NEXT], memory.links[end, BEFORE] = head, -1
    if head >= 0:
        memory.links[head, BEFORE] = end
    memory.heads[bucket] = end


@kernel()
def _unfile_end(memory: Memory, end: int) -> None:
    after, before = memory.links[end, NEXT], memory.links[end, BEFORE]
    if before >= 0:
        memory.links[before, NEXT] = after
    else:
        memory.heads[_bucket_of_end(memory, end)] = after
    if after >= 0:
        memory.links[after, BEFORE] = before


@kernel()
def _write(memory: Memory, slot: int, surface: np.ndarray, edges: np.ndarray) -> None:
    # Element by element: assigning rows takes numba seconds to compile.
    for i in range(4):
        memory.surfaces[slot, i] = surface[i]
    for end in range(2):
        memory.edges[slot, end] = edges[end]
        _file_end(memory, 2 * slot + end)


@kernel()
def add_surface(memory: Memory, surface: np.ndarray, edges: np.ndarray) -> int:
    """Remember a surface under a new id; return its slot. There must be room."""
    if memory.counts[FREE] > 0:
        memory.counts[FREE] -= 1
        slot = int(memory.free[memory.counts[FREE]])
    else:
        slot = int(memory.counts[USED])
        memory.counts[USED] += 1
    _write(memory, slot, surface, edges)
    memory.marks[slot] = memory.counts[VISIT]
    memory.met_in[slot] = 0
    memory.ids[slot] = memory.counts[NEXT_ID]
    memory.counts[NEXT_ID] += 1
    memory.counts[ALIVE] += 1
    return slot


@kernel()
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


@kernel()
def move_surface(memory: Memory, slot: int, surface: np.ndarray, edges: np.ndarray) -> None:
    """Give the surface in a slot new ends; it keeps its id."""
    _unfile_end(memory, 2 * slot)
    _unfile_end(memory, 2 * slot + 1)
    _write(memory, slot, surface, edges)


@kernel()
def room_left(memory: Memory) -> int:
    """How many more surfaces there is room for."""
    counts = memory.counts
    return int(memory.ids.shape[0] - counts[USED] + counts[FREE])


@kernel()
def file_all(memory: Memory) -> None:
    """File the ends of all surfaces; none must be filed yet."""
    for slot in range(memory.counts[USED]):
        if memory.ids[slot] >= 0:
            _file_end(memory, 2 * slot)
            _file_end(memory, 2 * slot + 1)
