"""Whose surfaces are whose: the visits to places in which the map's were seen (chapter 4)."""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.memory import SUSPECT, USED, VISIT, Memory, living, move_surface
from albot_core.matching.lines import wrap


@kernel()
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


@kernel(arrays=True)
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


def marked_visits(memory: Memory) -> np.ndarray:
    """(visits + 1,) bool: the visits in which surfaces of the map were last seen."""
    marked = np.zeros(memory.counts[VISIT] + 1, np.bool_)
    marked[memory.marks[: memory.counts[USED]][living(memory)]] = True
    return marked


def renumber_visits(memory: Memory, numbers: np.ndarray) -> None:
    """Give visits other numbers, in the same order.

    `numbers` (visits + 1,): the new ones, -1 for those forgotten, which no surface's are.
    """
    kept, used = numbers >= 0, memory.counts[USED]
    memory.met[: kept.sum()] = memory.met[: len(kept)][kept]
    memory.marks[:used] = numbers[memory.marks[:used].clip(0, len(kept) - 1)]
    memory.met_in[:used] = np.maximum(numbers[memory.met_in[:used]], 0)
    memory.counts[VISIT] = kept.sum() - 1
    memory.counts[SUSPECT] = max(numbers[memory.counts[SUSPECT]], 0)


def arouse_from(memory: Memory, needed: np.ndarray) -> None:
    """Count the surfaces met again anew; `needed` is as for `begin_visit`."""
    memory.met[: len(needed), 0] = 0
    memory.met[: len(needed), 1] = needed
    allay(memory.met, memory.counts)


@kernel()
def allay(met: np.ndarray, counts: np.ndarray) -> None:
    """Allay all suspicions but those for which nothing at all needs to be met again.

    `met` and `counts` are the memory's.
    """
    suspect, least = 0, 0
    for visit in range(counts[VISIT] + 1):
        if met[visit, 1] < least:
            suspect, least = visit, met[visit, 1]
    counts[SUSPECT] = suspect


@kernel()
def is_time_to_look(looked_from: np.ndarray, pose: np.ndarray, spacing: float, turn: float) -> bool:
    """Whether the robot has gone (m) or turned (rad) so far since it last compared places.

    That was at the pose `looked_from`, NaN where it has not yet in its present visit.
    """
    x, y = pose[0] - looked_from[0], pose[1] - looked_from[1]
    is_near = x * x + y * y < spacing**2
    return not (is_near and abs(wrap(pose[2] - looked_from[2])) < turn)
