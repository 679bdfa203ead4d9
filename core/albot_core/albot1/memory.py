"""The perceptual map: surfaces in plain arrays, with a grid over their ends.

Removing what lies in a view must not cost more as the map grows, so every surface's two
ends are filed in a hashed grid of square cells: the ends near a place are found by looking
into the cells there. A surface keeps its slot as long as it lives; freed slots are used
again. Every surface bears a mark: the visit to a place in which it was last seen (chapter 4).
Compiled; a `Memory` is a named tuple so that kernels take it whole. Thousands of
robots may each have one: it is small, and emptied in no time.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from albot_core.errors import InputError

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

_ZERO: Any = np.int64(0)
"""A plain 0 is a type of its own to numba: what it is passed to would be compiled twice."""


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


@njit(cache=True, error_model="numpy")
def cell_of(coordinate: float) -> int:
    """Index of the grid cell that holds a coordinate."""
    return int(np.floor(coordinate / CELL))


@njit(cache=True, error_model="numpy")
def bucket_of(column: int, row: int, buckets: int) -> int:
    """The bucket in which the ends of a cell are filed; other cells may share it."""
    return int(((column * 73856093) ^ (row * 19349663)) & (buckets - 1))


@njit(cache=True, error_model="numpy")
def _bucket_of_end(memory: Memory, end: int) -> int:
    slot, side = end >> 1, end & 1
    column = cell_of(memory.surfaces[slot, 2 * side])
    row = cell_of(memory.surfaces[slot, 2 * side + 1])
    return bucket_of(column, row, memory.heads.shape[0])


@njit(cache=True, error_model="numpy")
def _file_end(memory: Memory, end: int) -> None:
    bucket = _bucket_of_end(memory, end)
    head = memory.heads[bucket]
    memory.links[end, NEXT], memory.links[end, BEFORE] = head, -1
    if head >= 0:
        memory.links[head, BEFORE] = end
    memory.heads[bucket] = end


@njit(cache=True, error_model="numpy")
def _unfile_end(memory: Memory, end: int) -> None:
    after, before = memory.links[end, NEXT], memory.links[end, BEFORE]
    if before >= 0:
        memory.links[before, NEXT] = after
    else:
        memory.heads[_bucket_of_end(memory, end)] = after
    if after >= 0:
        memory.links[after, BEFORE] = before


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


@njit(cache=True, error_model="numpy", inline="always")
def room_left(memory: Memory) -> int:
    """How many more surfaces there is room for."""
    counts = memory.counts
    return int(memory.ids.shape[0] - counts[USED] + counts[FREE])


@njit(cache=True, error_model="numpy")
def _is_in(box: np.ndarray, x: float, y: float) -> bool:
    return bool(box[0] <= x and x <= box[2] and box[1] <= y and y <= box[3])


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def _search_cells(memory: Memory, box: np.ndarray) -> np.ndarray:
    """Slots of the surfaces with an end in the box, by a look into its cells."""
    surfaces, heads, links = memory.surfaces, memory.heads, memory.links
    found = np.empty(256, np.int64)
    count = _ZERO
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
    _sort(found, count)
    distinct = 0
    for i in range(count):
        if distinct == 0 or found[i] != found[distinct - 1]:
            found[distinct] = found[i]
            distinct += 1
    return found[:distinct]


@njit(cache=True, error_model="numpy")
def surfaces_ending_in(memory: Memory, box: np.ndarray) -> np.ndarray:
    """Slots of the surfaces with an end in the box (x_min, y_min, x_max, y_max), ascending."""
    cells = (box[2] - box[0]) * (box[3] - box[1]) / CELL**2
    # A surface is looked at several times faster than a cell.
    if memory.counts[USED] < 4.0 * cells:
        return _search_all(memory, box)
    return _search_cells(memory, box)


@njit(cache=True, error_model="numpy")
def meet_again(memory: Memory, slot: int) -> None:
    """Note that a surface is in view; one of an earlier visit may arouse a suspicion."""
    visit, now = memory.marks[slot], memory.counts[VISIT]
    if visit == now:
        return
    if memory.met_in[slot] != now:
        memory.met_in[slot] = now
        memory.met[visit, 0] += 1
    if memory.met[visit, 0] > memory.met[visit, 1]:
        memory.counts[SUSPECT] = visit


@njit(cache=True, error_model="numpy")
def move_visits(memory: Memory, first: int, pose: np.ndarray) -> None:
    """Move all that was seen in the visits from `first` on: what was at the origin is at `pose`."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    moved = np.empty(4)
    for slot in range(memory.counts[USED]):
        if memory.ids[slot] >= 0 and memory.marks[slot] >= first:
            for end in range(2):
                x, y = memory.surfaces[slot, 2 * end], memory.surfaces[slot, 2 * end + 1]
                moved[2 * end] = pose[0] + cos * x - sin * y
                moved[2 * end + 1] = pose[1] + sin * x + cos * y
            move_surface(memory, slot, moved, memory.edges[slot])


def seen_in_visit(memory: Memory) -> np.ndarray:
    """(n, 4) float64: the surfaces seen in the present visit, in the map's frame (a copy)."""
    used = memory.counts[USED]
    present = (memory.ids[:used] >= 0) & (memory.marks[:used] == memory.counts[VISIT])
    return np.asarray(memory.surfaces[:used][present])


def begin_visit(memory: Memory, needed: np.ndarray) -> None:
    """Begin a new visit, for which there must be room.

    `needed` (visits + 1,): with more surfaces of a visit met again than this, suspicion arises.
    """
    memory.counts[VISIT] += 1
    arouse_from(memory, needed)


def arouse_from(memory: Memory, needed: np.ndarray) -> None:
    """Count the surfaces met again anew; `needed` is as for `begin_visit`."""
    memory.met[: len(needed), 0] = 0
    memory.met[: len(needed), 1] = needed
    suspect_still(memory, needed)


def suspect_still(memory: Memory, needed: np.ndarray) -> None:
    """Allay all suspicions but those for which nothing at all needs to be met again."""
    memory.counts[SUSPECT] = int(np.argmin(needed)) if (needed < 0).any() else 0


STORED = ("surfaces", "edges", "ids", "marks", "met_in", "met", "free", "counts")
"""The fields from which a memory can be rebuilt; the grid follows from them."""


def stored_memory(memory: Memory) -> dict[str, np.ndarray]:
    """Copies of the STORED fields, as far as they are in use."""
    used, freed = memory.counts[USED], memory.counts[FREE]
    return {
        "surfaces": memory.surfaces[:used].copy(),
        "edges": memory.edges[:used].copy(),
        "ids": memory.ids[:used].copy(),
        "marks": memory.marks[:used].copy(),
        "met_in": memory.met_in[:used].copy(),
        "met": memory.met[: memory.counts[VISIT] + 1].copy(),
        "free": memory.free[:freed].copy(),
        "counts": memory.counts.copy(),
    }


def _filled(stored: Mapping[str, np.ndarray], capacity: int) -> Memory:
    memory = empty_memory(capacity)
    for field in STORED:
        getattr(memory, field)[: len(stored[field])] = stored[field]
    _file_all(memory)
    return memory


def enlarged(memory: Memory) -> Memory:
    """The same map with twice the room.

    Slots are used in the same order and the search sorts its answer: a map that has grown
    behaves exactly as one that was large from the start.
    """
    return _filled(stored_memory(memory), 2 * len(memory.ids))


def rebuilt_memory(stored: Mapping[str, np.ndarray]) -> Memory:
    """The memory with the given STORED fields.

    Raises:
        InputError: The fields contradict each other.
    """
    ids, counts = stored["ids"], stored["counts"]
    shapes = {
        "surfaces": (len(ids), 4),
        "edges": (len(ids), 2),
        "marks": (len(ids),),
        "met_in": (len(ids),),
        "counts": (6,),
    }
    for field, shape in shapes.items():
        if stored[field].shape != shape:
            raise InputError(f"memory.{field}", f"shape {shape}", str(stored[field].shape))
    alive = ids >= 0
    expected = [alive.sum(), len(ids) - alive.sum(), counts[NEXT_ID], len(ids)]
    if counts[:VISIT].tolist() != expected:
        raise InputError("memory.counts", str(expected), str(counts.tolist()))
    visit, suspect = counts[VISIT:].tolist()
    if visit < 1 or not 0 <= suspect <= visit or stored["met"].shape != (visit + 1, 2):
        found = f"{visit}, {suspect} and {stored['met'].shape}"
        raise InputError("memory.met", "a row for each visit up to the present one", found)
    if ((stored["marks"][alive] < 1) | (stored["marks"][alive] > visit)).any():
        raise InputError("memory.marks", f"visits from 1 to {visit}", "others")
    if not np.array_equal(np.sort(stored["free"]), np.flatnonzero(~alive)):
        raise InputError("memory.free", "exactly the slots without a surface", "others")
    if not (np.isfinite(stored["surfaces"]).all(axis=1) == alive).all():
        raise InputError("memory.surfaces", "finite surfaces, NaN in freed slots", "others")
    if len(np.unique(ids[alive])) != alive.sum() or (ids >= counts[NEXT_ID]).any():
        raise InputError("memory.ids", "every id once and below the next", "others")
    return _filled(stored, max(CAPACITY, len(ids), visit + 2))


@njit(cache=True, error_model="numpy")
def _file_all(memory: Memory) -> None:
    for slot in range(memory.counts[USED]):
        if memory.ids[slot] >= 0:
            _file_end(memory, 2 * slot)
            _file_end(memory, 2 * slot + 1)
