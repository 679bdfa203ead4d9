"""A robot's memory: its perceptual map and its latest view, in plain arrays. Compiled.

The time to remove what lies within a view must not grow with the map. So the two ends of every
surface are filed in a hashed grid of square cells: the ends near a point are found in the cells
around it. A surface keeps its slot as long as it exists; freed slots are used again. Every surface
has a mark: the visit to a place in which it was last seen (chapter 4).

Map and view are named tuples, so that kernels take each as one argument. Both are small and quickly
cleared, because thousands of robots may have one of each.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import ZERO, kernel
from albot_core.kernels.sorting import sort

CELL = 2.0
"""Side of a grid cell (m)."""
MAP_ROOM_AT_FIRST = 128
"""Capacity of a new map (surfaces); a map's capacity is always a power of two."""
VIEW_ROOM_AT_FIRST = 64
"""Capacity of a new robot's view (surfaces)."""
ALIVE, FREE, NEXT_ID, USED, VISIT, CANDIDATE = 0, 1, 2, 3, 4, 5
"""Elements of `PerceptualMap.counts`: number of surfaces, number of slots on the free list, the
next surface id, number of slots that have ever held a surface (these are the first ones), number of
the present visit, and the loop-closure candidate: an earlier visit that the present one may repeat
(0 for none)."""
OBSERVED, GATE, COUNTED_FOR = 0, 1, 2
"""Columns of `PerceptualMap.reobserved`."""
NEVER = np.iinfo(np.int32).max
"""The gate of a visit that cannot become a candidate."""
NEXT, BEFORE = 0, 1
"""Columns of `PerceptualMap.links`: the next end in the bucket, and the previous one."""
NOT_RECOGNIZED = -1
"""In `LocatedView.slots`: this surface is no recognised landmark."""


class PerceptualMap(NamedTuple):
    """The arrays of a perceptual map with a capacity of `len(surfaces)` surfaces.

    Their values for slots never used have no meaning.
    """

    surfaces: np.ndarray
    """(capacity, 4) float64: x1, y1, x2, y2 in the map's frame (m); NaN in freed slots."""
    edges: np.ndarray
    """(capacity, 2) int8: the kinds of the two ends (see `sensing.view`)."""
    ids: np.ndarray
    """(capacity,) int64: the surface's id, never used twice; -1 in freed slots."""
    marks: np.ndarray
    """(capacity,) int32: the visit, counted from 1, in which the surface was last seen."""
    reobserved_in: np.ndarray
    """(capacity,) int32: the latest visit, except its mark, in which it was observed again."""
    reobserved: np.ndarray
    """(capacity, 3) int32: number of surfaces of each earlier visit that were observed again in the
    present one; the visit's gate: with more than this it becomes a loop-closure candidate; and the
    visit for which its surfaces count, itself or the first visit to its place."""
    free: np.ndarray
    """(capacity,) int32: stack of freed slots."""
    heads: np.ndarray
    """(2 * capacity,) int32: first end filed in each bucket, -1 if there is none."""
    links: np.ndarray
    """(2 * capacity, 2) int32: an end's neighbours in its bucket (see NEXT, BEFORE)."""
    counts: np.ndarray
    """(6,) int64: see ALIVE, FREE, NEXT_ID, USED, VISIT, CANDIDATE."""


class LocatedView(NamedTuple):
    """The arrays of one view with a capacity of `len(surfaces)` surfaces, in the robot's frame."""

    surfaces: np.ndarray
    """(room, 4) float64: x1, y1, x2, y2 in the robot's frame (m)."""
    edges: np.ndarray
    """(room, 2) int8: the kinds of the two ends (see `sensing.view`)."""
    landmark: np.ndarray
    """(room,) bool: the surface is a landmark."""
    slots: np.ndarray
    """(room,) int64: the slot of the map's surface that it was recognised as, or NOT_RECOGNIZED."""
    size: np.ndarray
    """(1,) int64: number of surfaces in the view."""
    pose: np.ndarray
    """(3,) float64: the estimated pose from which the view was taken (m, rad; the map's frame)."""


def empty_map(capacity: int = MAP_ROOM_AT_FIRST) -> PerceptualMap:
    """Return an empty map with room for at least `capacity` surfaces."""
    capacity = 1 << max(capacity - 1, 1).bit_length()
    pm = PerceptualMap(
        surfaces=np.empty((capacity, 4)),
        edges=np.empty((capacity, 2), np.int8),
        ids=np.empty(capacity, np.int64),
        marks=np.empty(capacity, np.int32),
        reobserved_in=np.empty(capacity, np.int32),
        reobserved=np.empty((capacity, 3), np.int32),
        free=np.empty(capacity, np.int32),
        heads=np.empty(2 * capacity, np.int32),
        links=np.empty((2 * capacity, 2), np.int32),
        counts=np.empty(6, np.int64),
    )
    clear_map(pm)
    return pm


def clear_map(pm: PerceptualMap) -> None:
    """Remove everything from the map."""
    pm.heads[:] = -1
    pm.reobserved[:] = (0, NEVER, 0)
    pm.reobserved[:, COUNTED_FOR] = np.arange(len(pm.reobserved))
    pm.counts[:] = 0
    pm.counts[VISIT] = 1


def living(pm: PerceptualMap) -> np.ndarray:
    """Return which of the used slots hold a surface, (slots used,) bool."""
    return np.asarray(pm.ids[: pm.counts[USED]] >= 0)


def empty_view(room: int = VIEW_ROOM_AT_FIRST) -> LocatedView:
    """Return an empty view with room for `room` surfaces, taken at the map's origin."""
    return LocatedView(
        surfaces=np.zeros((room, 4)),
        edges=np.zeros((room, 2), np.int8),
        landmark=np.zeros(room, np.bool_),
        slots=np.full(room, NOT_RECOGNIZED, np.int64),
        size=np.zeros(1, np.int64),
        pose=np.zeros(3),
    )


@kernel()
def copy_view(source: LocatedView, target: LocatedView) -> None:
    """Copy a view into `target`, which must have room for it."""
    target.size[0] = source.size[0]
    for i in range(3):
        target.pose[i] = source.pose[i]
    for k in range(source.size[0]):
        for i in range(4):
            target.surfaces[k, i] = source.surfaces[k, i]
        target.edges[k, 0], target.edges[k, 1] = source.edges[k, 0], source.edges[k, 1]
        target.landmark[k] = source.landmark[k]
        target.slots[k] = source.slots[k]


@kernel()
def add_surface(pm: PerceptualMap, surface: np.ndarray, edges: np.ndarray) -> int:
    """Add a surface under a new id, and return its slot. There must be room."""
    if pm.counts[FREE] > 0:
        pm.counts[FREE] -= 1
        slot = int(pm.free[pm.counts[FREE]])
    else:
        slot = int(pm.counts[USED])
        pm.counts[USED] += 1
    _write(pm, slot, surface, edges)
    pm.marks[slot] = pm.counts[VISIT]
    pm.reobserved_in[slot] = 0
    pm.ids[slot] = pm.counts[NEXT_ID]
    pm.counts[NEXT_ID] += 1
    pm.counts[ALIVE] += 1
    return slot


@kernel()
def remove_surface(pm: PerceptualMap, slot: int) -> None:
    """Forget the surface in a slot."""
    _unfile_end(pm, 2 * slot)
    _unfile_end(pm, 2 * slot + 1)
    for i in range(4):
        pm.surfaces[slot, i] = np.nan
    pm.ids[slot] = -1
    pm.free[pm.counts[FREE]] = slot
    pm.counts[FREE] += 1
    pm.counts[ALIVE] -= 1


@kernel()
def move_surface(pm: PerceptualMap, slot: int, surface: np.ndarray, edges: np.ndarray) -> None:
    """Give the surface in a slot new ends; it keeps its id."""
    _unfile_end(pm, 2 * slot)
    _unfile_end(pm, 2 * slot + 1)
    _write(pm, slot, surface, edges)


@kernel()
def room_left(pm: PerceptualMap) -> int:
    """Return the number of surfaces that may still be added."""
    counts = pm.counts
    return int(pm.ids.shape[0] - counts[USED] + counts[FREE])


@kernel()
def count_reobserved(pm: PerceptualMap, slot: int) -> None:
    """Count a surface that is in view for its visit, which may become a loop-closure candidate.

    Only surfaces of earlier visits count, each once in the present visit.
    """
    visit, now = pm.marks[slot], pm.counts[VISIT]
    if visit == now:
        return
    visit = pm.reobserved[visit, COUNTED_FOR]  # Section 4.1.2: in the thesis, for its place.
    if pm.reobserved_in[slot] != now:
        pm.reobserved_in[slot] = now
        pm.reobserved[visit, OBSERVED] += 1
    if pm.reobserved[visit, OBSERVED] > pm.reobserved[visit, GATE]:
        pm.counts[CANDIDATE] = visit


@kernel()
def find_surfaces(pm: PerceptualMap, box: np.ndarray, found: np.ndarray) -> int:
    """Write to `found` the slots of surfaces with an end in a box (x_min, y_min, x_max, y_max).

    The slots are in ascending order. Returns their number. `found` must have room for one more than
    the surfaces of the map; with room for twice as many it is seldom full during the search.
    """
    cells = (box[2] - box[0]) * (box[3] - box[1]) / CELL**2
    # Testing a surface is several times faster than testing a cell.
    if pm.counts[USED] < 4.0 * cells:
        return int(_search_all(pm, box, found))
    return int(_search_cells(pm, box, found))


@kernel()
def _search_all(pm: PerceptualMap, box: np.ndarray, found: np.ndarray) -> int:
    """Search as `find_surfaces` does, by testing every surface."""
    surfaces = pm.surfaces
    count = ZERO
    for slot in range(pm.counts[USED]):
        # Freed slots hold NaN, which is in no box. The test has no branches, because about half of
        # the surfaces are in the box, in an unpredictable order.
        found[count] = slot
        count += _is_in(box, surfaces[slot, 0], surfaces[slot, 1]) | _is_in(
            box, surfaces[slot, 2], surfaces[slot, 3]
        )
    return int(count)


@kernel()
def _search_cells(pm: PerceptualMap, box: np.ndarray, found: np.ndarray) -> int:
    """Search as `find_surfaces` does, by testing the ends in the box's cells."""
    surfaces, heads, links = pm.surfaces, pm.heads, pm.links
    count = ZERO
    for column in range(cell_of(box[0]), cell_of(box[2]) + 1):
        for row in range(cell_of(box[1]), cell_of(box[3]) + 1):
            end = heads[bucket_of(column, row, heads.shape[0])]
            while end >= 0:
                slot, side = end >> 1, end & 1
                if _is_in(box, surfaces[slot, 2 * side], surfaces[slot, 2 * side + 1]):
                    if count == found.shape[0]:
                        # Cells that share a bucket yield the same ends several times.
                        count = _keep_distinct(found, count)
                    found[count] = slot
                    count += 1
                end = links[end, NEXT]
    return _keep_distinct(found, count)


@kernel()
def _is_in(box: np.ndarray, x: float, y: float) -> bool:
    return bool((box[0] <= x) & (x <= box[2]) & (box[1] <= y) & (y <= box[3]))


@kernel()
def _keep_distinct(values: np.ndarray, count: int) -> int:
    """Sort the first `count` values in place without duplicates, and return their new number."""
    sort(values, count)
    distinct = ZERO
    for i in range(count):
        if distinct == 0 or values[i] != values[distinct - 1]:
            values[distinct] = values[i]
            distinct += 1
    return int(distinct)


@kernel()
def _write(pm: PerceptualMap, slot: int, surface: np.ndarray, edges: np.ndarray) -> None:
    # Element by element: assigning rows takes numba seconds to compile.
    for i in range(4):
        pm.surfaces[slot, i] = surface[i]
    for end in range(2):
        pm.edges[slot, end] = edges[end]
        _file_end(pm, 2 * slot + end)


@kernel()
def _file_end(pm: PerceptualMap, end: int) -> None:
    bucket = _bucket_of_end(pm, end)
    head = pm.heads[bucket]
    pm.links[end, NEXT], pm.links[end, BEFORE] = head, -1
    if head >= 0:
        pm.links[head, BEFORE] = end
    pm.heads[bucket] = end


@kernel()
def _unfile_end(pm: PerceptualMap, end: int) -> None:
    after, before = pm.links[end, NEXT], pm.links[end, BEFORE]
    if before >= 0:
        pm.links[before, NEXT] = after
    else:
        pm.heads[_bucket_of_end(pm, end)] = after
    if after >= 0:
        pm.links[after, BEFORE] = before


@kernel()
def file_all(pm: PerceptualMap) -> None:
    """File the ends of all surfaces, none of which may be filed yet."""
    for slot in range(pm.counts[USED]):
        if pm.ids[slot] >= 0:
            _file_end(pm, 2 * slot)
            _file_end(pm, 2 * slot + 1)


@kernel()
def _bucket_of_end(pm: PerceptualMap, end: int) -> int:
    slot, side = end >> 1, end & 1
    column = cell_of(pm.surfaces[slot, 2 * side])
    row = cell_of(pm.surfaces[slot, 2 * side + 1])
    return bucket_of(column, row, pm.heads.shape[0])


@kernel()
def bucket_of(column: int, row: int, buckets: int) -> int:
    """Return the bucket in which the ends of a cell are filed; other cells may share it."""
    return int(((column * 73856093) ^ (row * 19349663)) & (buckets - 1))


@kernel()
def cell_of(coordinate: float) -> int:
    """Return the index of the grid cell that holds a coordinate."""
    return int(np.floor(coordinate / CELL))
