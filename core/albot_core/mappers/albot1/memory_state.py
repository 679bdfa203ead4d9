"""The perceptual map as arrays, to be saved, restored and enlarged."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from albot_core.errors import InputError
from albot_core.mappers.albot1.memory import (
    CAPACITY,
    FREE,
    NEXT_ID,
    USED,
    VISIT,
    Memory,
    empty_memory,
    file_all,
)

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
    file_all(memory)
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
    surfaces = stored["surfaces"]
    if not (np.isfinite(surfaces[alive]).all() and np.isnan(surfaces[~alive]).all()):
        raise InputError("memory.surfaces", "finite surfaces, NaN in freed slots", "others")
    if len(np.unique(ids[alive])) != alive.sum() or (ids >= counts[NEXT_ID]).any():
        raise InputError("memory.ids", "every id once and below the next", "others")
    return _filled(stored, max(CAPACITY, len(ids), visit + 2))
