"""Visits to places: the visit in which each surface was seen, and the loop-closure candidates.

Every surface of the map has a mark: the visit in which it was last seen (algorithm 5). An earlier
visit becomes a loop-closure candidate when more of its surfaces than its gate are observed again
(section 4.1.2). Compiled, except what happens once in a visit.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.segment_kernels import transform_segment
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.mapping import update_map
from albot_core.mappers.albot1.perceptual_map.memory import (
    ALIVE,
    CANDIDATE,
    COUNTED_FOR,
    GATE,
    NOT_RECOGNIZED,
    OBSERVED,
    USED,
    VISIT,
    LocatedView,
    PerceptualMap,
    add_surface,
    count_reobserved,
    find_surfaces,
    living,
    move_surface,
)
from albot_core.mappers.albot1.perceptual_map.overlay import box_around, same_wall
from albot_core.mappers.albot1.places.exits import NOT_CROSSING, ExitMemory
from albot_core.matching.lines import line_length, wrap


def seen_since(pm: PerceptualMap, visit: int) -> np.ndarray:
    """Return the surfaces seen since a visit, (n, 4) float64, in the map's frame (a copy)."""
    return np.asarray(
        pm.surfaces[: pm.counts[USED]][living(pm) & (pm.marks[: pm.counts[USED]] >= visit)]
    )


def begin_visit(pm: PerceptualMap, gates: np.ndarray, counted_for: np.ndarray) -> None:
    """Begin a new visit, for which there must be room.

    Args:
        pm: The map.
        gates: (visits + 1,): a visit becomes a candidate if more surfaces than this are observed
            again that count for it.
        counted_for: (visits + 1,): the visit for which the surfaces of each visit count.
    """
    pm.counts[VISIT] += 1
    reset_candidates(pm, gates, counted_for)


_box = scratch(4)


@kernel(arrays=True)
def enter_place(pm: PerceptualMap, view: LocatedView, limits: Albot1Limits) -> None:
    """Mark the surfaces in view as the new visit's, by a forced update (algorithm 5, line 16).

    The thesis lays the view over the map, and so do `albot1-thesis` and `albot1-tracked`. But this
    update is needed for the marks alone, not because landmarks go out of sight; its only other
    effect is that the errors of a view from a doorway enter the map. Where the local submap
    localises the robot, the map is not changed: its surfaces in the view are marked, and missing
    ones are added.
    """
    if not limits.submap_matching:
        update_map(pm, view, limits)
        return
    count = view.size[0]
    in_map, none_used = np.empty((count, 4)), np.zeros(count, np.bool_)
    for k in range(count):
        transform_segment(view.pose, view.surfaces[k], in_map[k])
    box, found = _box(), np.empty(2 * pm.counts[ALIVE] + 1, np.int64)
    box_around(in_map.reshape((2 * count, 2)), limits.margin, box)
    slots = found[: find_surfaces(pm, box, found)]
    held, none_held = np.empty((slots.shape[0], 4)), np.zeros(slots.shape[0], np.bool_)
    for q in range(slots.shape[0]):
        for i in range(4):
            held[q, i] = pm.surfaces[slots[q], i]
        if same_wall(held[q], in_map, none_used, limits) >= 0:
            if line_length(held[q]) >= limits.landmark_length:
                count_reobserved(pm, slots[q])
            pm.marks[slots[q]] = pm.counts[VISIT]
    for k in range(count):
        q = same_wall(in_map[k], held, none_held, limits)
        slot = slots[q] if q >= 0 else add_surface(pm, in_map[k], view.edges[k])
        view.slots[k] = slot if view.landmark[k] else NOT_RECOGNIZED


def reset_candidates(pm: PerceptualMap, gates: np.ndarray, counted_for: np.ndarray) -> None:
    """Reset the counts of re-observed surfaces to 0; the arguments are those of `begin_visit`."""
    pm.reobserved[: len(gates), OBSERVED] = 0
    pm.reobserved[: len(gates), GATE] = gates
    pm.reobserved[: len(gates), COUNTED_FOR] = counted_for
    drop_candidates(pm)


@kernel()
def drop_candidates(pm: PerceptualMap) -> None:
    """Drop all candidates except those that need no re-observed surface."""
    candidate, least = 0, 0
    for visit in range(pm.counts[VISIT] + 1):
        if pm.reobserved[visit, GATE] < least:
            candidate, least = visit, pm.reobserved[visit, GATE]
    pm.counts[CANDIDATE] = candidate


@kernel()
def keep_or_drop_candidate(
    pm: PerceptualMap,
    exits: ExitMemory,
    compared_from: np.ndarray,
    is_lost: bool,
    pose: np.ndarray,
    is_updated: bool,
    limits: Albot1Limits,
) -> bool:
    """Drop a candidate that comes too soon; return whether a candidate is to be compared now.

    In the thesis every update of the map with a candidate is a time to compare (section 4.1.2):
    `is_updated` says whether the present view led to one. The rest is ours. Too soon is too near to
    where places were last compared. If the robot is lost the candidate is kept. While an exit is
    being crossed nothing is compared, because it is not known in which of the two places the robot
    is.
    """
    if pm.counts[CANDIDATE] == 0:
        return False
    if limits.compares_at_updates:
        return is_updated
    if exits.counts[1] != NOT_CROSSING:
        return False
    if may_compare(compared_from, pose, limits.compare_spacing, limits.compare_turn):
        return True
    if not is_lost:
        drop_candidates(pm)
    return False


@kernel()
def may_compare(compared_from: np.ndarray, pose: np.ndarray, spacing: float, turn: float) -> bool:
    """Return whether the robot has moved (m) or turned (rad) enough since it last compared places.

    `compared_from` is its pose then, NaN before the first comparison of its present visit.
    """
    x, y = pose[0] - compared_from[0], pose[1] - compared_from[1]
    is_near = x * x + y * y < spacing**2
    return not (is_near and abs(wrap(pose[2] - compared_from[2])) < turn)


@kernel(arrays=True)
def move_visits(pm: PerceptualMap, first: int, pose: np.ndarray) -> None:
    """Move all surfaces seen since visit `first` so that a point at the origin lies at `pose`."""
    moved = np.empty(4)
    for slot in range(pm.counts[USED]):
        if pm.ids[slot] >= 0 and pm.marks[slot] >= first:
            transform_segment(pose, pm.surfaces[slot], moved)
            move_surface(pm, slot, moved, pm.edges[slot])


def marked_visits(pm: PerceptualMap) -> np.ndarray:
    """Return the visits in which surfaces of the map were last seen, (visits + 1,) bool."""
    marked = np.zeros(pm.counts[VISIT] + 1, np.bool_)
    marked[pm.marks[: pm.counts[USED]][living(pm)]] = True
    return marked


def renumber_visits(pm: PerceptualMap, numbers: np.ndarray) -> None:
    """Renumber the visits, whose order stays the same.

    `numbers` (visits + 1,) are the new numbers, -1 for forgotten visits, which no surface may have.
    """
    kept, used = numbers >= 0, pm.counts[USED]
    pm.reobserved[: kept.sum()] = pm.reobserved[: len(kept)][kept]
    counted_for = pm.reobserved[: kept.sum(), COUNTED_FOR]
    counted_for[:] = numbers[counted_for]
    pm.marks[:used] = numbers[pm.marks[:used].clip(0, len(kept) - 1)]
    pm.reobserved_in[:used] = np.maximum(numbers[pm.reobserved_in[:used]], 0)
    pm.counts[VISIT] = kept.sum() - 1
    pm.counts[CANDIDATE] = max(numbers[pm.counts[CANDIDATE]], 0)
