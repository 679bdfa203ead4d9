"""Entering a place: what is in view becomes part of it (algorithm 5, line 16)."""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Limits
from albot_core.mappers.albot1.memory import (
    ALIVE,
    VISIT,
    Memory,
    add_surface,
)
from albot_core.mappers.albot1.search import surfaces_ending_in
from albot_core.mappers.albot1.sight import NOT_RECOGNIZED, Sight
from albot_core.mappers.albot1.updating import box_around, counterpart, placed, update_map
from albot_core.mappers.albot1.visits import meet_again
from albot_core.matching.lines import length_of

_bounds = scratch(4)


@kernel(arrays=True)
def enter(memory: Memory, sight: Sight, limits: Limits) -> None:
    """The forced update: mark the surfaces in view as those of the visit that begins.

    The thesis lays the view over the map, and so does `albot1-thesis`. But this update is made
    for the marks alone, not because landmarks go out of sight: all else that it does is to
    make the error of a view from a doorway the map's. Where all that is remembered nearby
    localises the robot, the map stays as it is: what it holds of the view is marked, and what
    it lacks is added.
    """
    if not limits.remembered:
        update_map(memory, sight, limits)
        return
    count = sight.size[0]
    laid, free = np.empty((count, 4)), np.zeros(count, np.bool_)
    for k in range(count):
        placed(sight.pose, sight.surfaces[k], laid[k])
    box, found = _bounds(), np.empty(2 * memory.counts[ALIVE] + 1, np.int64)
    box_around(laid.reshape((2 * count, 2)), limits.margin, box)
    slots = found[: surfaces_ending_in(memory, box, found)]
    held, loose = np.empty((slots.shape[0], 4)), np.zeros(slots.shape[0], np.bool_)
    for q in range(slots.shape[0]):
        for i in range(4):
            held[q, i] = memory.surfaces[slots[q], i]
        if counterpart(held[q], laid, free, limits) >= 0:
            if length_of(held[q]) >= limits.landmark_length:
                meet_again(memory, slots[q])
            memory.marks[slots[q]] = memory.counts[VISIT]
    for k in range(count):
        q = counterpart(laid[k], held, loose, limits)
        slot = slots[q] if q >= 0 else add_surface(memory, laid[k], sight.edges[k])
        sight.slots[k] = slot if sight.landmark[k] else NOT_RECOGNIZED
