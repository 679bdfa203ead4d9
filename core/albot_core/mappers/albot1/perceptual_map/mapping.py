"""Perceptual mapping: algorithms 1 to 4 of the thesis, from top to bottom. Compiled.

The robot remembers a view as the local environment that it is about to explore, follows the
landmarks in it from view to view (algorithm 1), and localises itself in its map by them (algorithm
2). When too few are left in view the robot has reached the limiting point: there it lays its latest
view over the map, and forgets what the map held within the view's boundary (algorithm 3).
`map_step` is the whole step (algorithm 4).

The thesis's symbols: `pm` is the perceptual map PM; `current` and `previous` are the views V_n and
V_n-1; a view's `landmark` flags its landmarks L, and those with a slot in the map are its
recognised landmarks RL; a view's `pose` is the robot's position RP; `motion` is its displacement
RDTR.

`albot1-tracked` searches the turn before algorithm 1, and localises by `tracking` in place of
algorithm 2. `albot1` uses `submap_matching.match_submap` in place of both, and notices by
`consistency` that the robot was carried away. All other lines are the thesis's.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from albot_core.geometry.pose_kernels import rotate
from albot_core.geometry.segment_kernels import heading_of, transform_segment
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.consistency import inconsistent_views
from albot_core.mappers.albot1.perceptual_map.frames import compose_pose, seen_from
from albot_core.mappers.albot1.perceptual_map.memory import (
    ALIVE,
    NOT_RECOGNIZED,
    VISIT,
    LocatedView,
    PerceptualMap,
    add_surface,
    count_reobserved,
    find_surfaces,
    move_surface,
    remove_surface,
)
from albot_core.mappers.albot1.perceptual_map.odometer_error import (
    HAS_MOVED,
    learn_error,
    note_motion,
)
from albot_core.mappers.albot1.perceptual_map.overlay import (
    bend_height,
    box_around,
    cut_at_boundary,
    extend_surface,
    is_covered,
    same_wall,
    view_boundary,
)
from albot_core.mappers.albot1.perceptual_map.submap import MatchBuffers, pair_views
from albot_core.mappers.albot1.perceptual_map.submap_matching import match_submap
from albot_core.mappers.albot1.perceptual_map.tracking import localize_jointly, search_turn
from albot_core.matching.lines import line_length, wrap
from albot_core.sensing.beam_model import BeamModel
from albot_core.sensing.view import NO_EDGE

MAPPING_PROGRESS = np.dtype(
    [
        ("step", np.int64),  # views taken in
        ("updated_at", np.int64),  # the view last laid over the map (the thesis's ustep)
        ("updates", np.int64),  # how often a view was laid over it
        ("unrecognized", np.int64),  # views without any recognised landmark
        ("inconsistent", np.int64),  # latest views in a row that contradict the robot's pose
    ]
)
"""Elements of `progress`: number of views processed; the view last laid over the map (the thesis's
ustep); number of views laid over the map; number of views without any recognised landmark; number
of latest views in a row that contradict the robot's estimated pose."""
LANDMARK_PAIR = np.dtype(
    [
        ("end", np.int64),  # which end was recognised
        ("gap", np.float64),  # how far it is from where it was expected (m)
        ("angle", np.float64),  # how far the surface is turned from what was expected (rad)
        ("distance", np.float64),  # the end's distance from the robot in the previous view (m)
    ]
)
"""Columns of `pairs`, one row for each recognised landmark: the end by which it was recognised, the
distance of that end from where it was expected (m), the angle between the surface and the expected
one (rad), and the end's distance from the robot in the previous view (m)."""

TINY = 1e-6
"""Gaps and angles below this (m, rad) do not increase a landmark's goodness."""
MIN_REMAINDER = 0.10
"""The remainder of a cut surface is forgotten if it is shorter than this (m)."""


# Algorithm 1: recognise landmarks


@kernel(arrays=True)
def recognize_landmarks(
    previous: LocatedView,
    current: LocatedView,
    motion: np.ndarray,
    limits: Albot1Limits,
    pairs: np.ndarray,
) -> int:
    """Find the landmarks recognised in `previous` among those of `current` (algorithm 1).

    Fills `current.slots` and, for every recognised surface, its row of `pairs`. Returns the number
    of landmarks of the current view that were recognised. The last match of a surface counts.
    """
    for j in range(current.size[0]):
        current.slots[j] = NOT_RECOGNIZED
    expected = np.empty(4)
    cos, sin = np.cos(motion[2]), np.sin(motion[2])
    for i in range(previous.size[0]):
        if previous.slots[i] == NOT_RECOGNIZED:
            continue
        seen_from(motion, cos, sin, previous.surfaces[i], expected)  # Alg. 1, line 2
        heading = heading_of(expected)
        for j in range(current.size[0]):
            angle = abs(wrap(heading_of(current.surfaces[j]) - heading))
            if not current.landmark[j] or angle >= limits.landmark_angle:  # Alg. 1, line 6
                continue
            end, gap = _nearest_end(
                expected, previous.edges[i], current.surfaces[j], current.edges[j]
            )
            if gap >= limits.landmark_gap:  # Alg. 1, line 7
                continue
            current.slots[j] = previous.slots[i]  # Alg. 1, lines 8 and 9
            x, y = previous.surfaces[i, 2 * end], previous.surfaces[i, 2 * end + 1]
            pair = pairs[j]
            pair.end, pair.gap, pair.angle = end, gap, angle
            pair.distance = np.sqrt(x * x + y * y)
    recognized = 0
    for j in range(current.size[0]):
        recognized += current.slots[j] != NOT_RECOGNIZED
    return recognized


@kernel()
def _nearest_end(
    expected: np.ndarray, edges: np.ndarray, seen: np.ndarray, seen_edges: np.ndarray
) -> tuple[int, float]:
    """Return the end at which two surfaces share an occluding or corner point, and the gap (m)."""
    nearest, which = np.inf, -1
    for end in range(2):
        if edges[end] != NO_EDGE and seen_edges[end] != NO_EDGE:
            dx, dy = seen[2 * end] - expected[2 * end], seen[2 * end + 1] - expected[2 * end + 1]
            gap = np.sqrt(dx * dx + dy * dy)
            if gap < nearest:
                nearest, which = gap, end
    return which, nearest


# Algorithm 2: localise the robot


@kernel(arrays=True)
def localize(
    pm: PerceptualMap, current: LocatedView, pairs: np.ndarray, longest: bool = False
) -> None:
    """Set `current.pose` by the best of the recognised landmarks (algorithm 2).

    Every landmark gives a localisation point. Those farther from their average than their standard
    deviation are discarded. Of the rest the landmark of highest goodness is used or, as the text at
    figure 3.11 says, the `longest`.
    """
    room = current.size[0]
    poses = np.empty((room, 3))
    which = np.empty(room, np.int64)
    found = 0
    for j in range(room):
        if current.slots[j] != NOT_RECOGNIZED:
            remembered = pm.surfaces[current.slots[j]]
            _pose_by_landmark(remembered, current.surfaces[j], pairs[j].end, poses[found])
            which[found] = j
            found += 1
    mean_x = mean_y = variance = 0.0
    for k in range(found):
        mean_x += poses[k, 0] / found
        mean_y += poses[k, 1] / found
    for k in range(found):
        variance += ((poses[k, 0] - mean_x) ** 2 + (poses[k, 1] - mean_y) ** 2) / found
    best = -1.0
    for k in range(found):
        if np.hypot(poses[k, 0] - mean_x, poses[k, 1] - mean_y) > np.sqrt(variance) + TINY:
            continue
        j = which[k]
        goodness = line_length(current.surfaces[j])
        if not longest:  # Eq. (3.5); perfect agreement would divide by zero.
            pair = pairs[j]
            goodness /= max(pair.distance, TINY)
            goodness /= max(pair.gap, TINY) * max(pair.angle, TINY)
        if goodness > best:  # Alg. 2, line 1
            best = goodness
            for i in range(3):
                current.pose[i] = poses[k, i]


@kernel()
def _pose_by_landmark(remembered: np.ndarray, seen: np.ndarray, end: int, pose: np.ndarray) -> None:
    """Write the pose from which the remembered surface appears as the seen one.

    Eq. (3.6) and (3.7) place the robot by its distance and angle from the landmark; here the same
    rigid motion is computed from the two surfaces' directions and the common point.
    """
    pose[2] = wrap(heading_of(remembered) - heading_of(seen))
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x, y = rotate(cos, sin, seen[2 * end], seen[2 * end + 1])
    pose[0] = remembered[2 * end] - x
    pose[1] = remembered[2 * end + 1] - y


# Algorithm 3: update the map


@kernel(arrays=True)
def update_map(pm: PerceptualMap, view: LocatedView, limits: Albot1Limits) -> None:
    """Lay a view, taken at its pose, over the map (algorithm 3).

    Surfaces with both ends inside the view's boundary are removed. Of a surface with one end
    inside, the part outside remains. It is joined with the view's surface of the same wall or, if
    there is none, cut at the boundary. Not in the thesis: a wall that would be bent by more than
    `join_height` is cut as well. Then the rest of the view is added, and all its landmarks count as
    recognised (algorithm 4, lines 17 and 22).
    """
    count = view.size[0]
    in_map = np.empty((count, 4))
    for k in range(count):  # Alg. 3, lines 2 to 6
        transform_segment(view.pose, view.surfaces[k], in_map[k])
    polygon = view_boundary(in_map, view.pose, limits.robot_in_boundary)  # Alg. 3, line 7
    box, found = _box(), np.empty(2 * pm.counts[ALIVE] + 1, np.int64)
    box_around(polygon, limits.margin, box)
    nearby = found[: find_surfaces(pm, box, found)]
    slots = np.empty(count, np.int64)
    is_used, none_used = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    _lay_over(pm, view, limits, in_map, polygon, box, nearby, slots, is_used, none_used)


_box, _changed, _edges = scratch(4), scratch(4), scratch(2, kind=types.int8)


@kernel()
def _lay_over(
    pm: PerceptualMap,
    view: LocatedView,
    limits: Albot1Limits,
    in_map: np.ndarray,
    polygon: np.ndarray,
    box: np.ndarray,
    nearby: np.ndarray,
    slots: np.ndarray,
    is_used: np.ndarray,
    none_used: np.ndarray,
) -> None:
    """Lay a view, whose surfaces in the map's frame are `in_map`, over the surfaces `nearby`.

    `slots` and `is_used` have one element for each surface; `is_used` and `none_used` are all
    false.
    """
    count = view.size[0]
    changed, edges = _changed(), _edges()
    for slot in nearby:  # Alg. 3, line 8
        old = pm.surfaces[slot]
        first = is_covered(polygon, box, limits.margin, old[0], old[1])
        second = is_covered(polygon, box, limits.margin, old[2], old[3])
        if first or second:
            _note_visit(pm, slot, in_map, none_used, limits)
        if first and second:  # Alg. 3, line 9
            remove_surface(pm, slot)
        elif first or second:  # Alg. 3, line 11
            outer = 1 if first else 0
            k = same_wall(old, in_map, is_used, limits)
            is_longer = k >= 0 and extend_surface(
                in_map[k], old, outer, limits.keeps_outer_end, changed
            )
            if k < 0 or bend_height(in_map[k], changed, outer) > limits.join_height:
                cut_at_boundary(old, outer, polygon, box, limits.margin, changed)
                edges[outer], edges[1 - outer] = pm.edges[slot, outer], NO_EDGE
                if line_length(changed) < MIN_REMAINDER:
                    remove_surface(pm, slot)
                else:
                    move_surface(pm, slot, changed, edges)
                continue
            edges[0], edges[1] = view.edges[k, 0], view.edges[k, 1]
            if is_longer:
                edges[outer] = pm.edges[slot, outer]
                # The end in view is not the end of the wall in the map.
                view.edges[k, outer] = NO_EDGE
            move_surface(pm, slot, changed, edges)  # Alg. 3, line 12
            pm.marks[slot] = pm.counts[VISIT]
            slots[k] = slot
            is_used[k] = True
    for k in range(count):  # Alg. 3, line 15
        if not is_used[k]:
            slots[k] = add_surface(pm, in_map[k], view.edges[k])
        view.slots[k] = slots[k] if view.landmark[k] else NOT_RECOGNIZED


@kernel()
def _note_visit(
    pm: PerceptualMap, slot: int, in_map: np.ndarray, none_used: np.ndarray, limits: Albot1Limits
) -> None:
    """Count a covered surface for its visit, a possible loop-closure candidate (section 4.1.2).

    If `covered_is_reobserved` is off, it counts only if the view holds the same wall.
    """
    old = pm.surfaces[slot]
    if pm.marks[slot] == pm.counts[VISIT] or line_length(old) < limits.landmark_length:
        return
    if limits.covered_is_reobserved or same_wall(old, in_map, none_used, limits) >= 0:
        count_reobserved(pm, slot)


# Algorithm 4: the whole step


@kernel()
def map_step(
    pm: PerceptualMap,
    previous: LocatedView,
    current: LocatedView,
    motion: np.ndarray,
    limits: Albot1Limits,
    progress: Any,
    odometer: np.ndarray,
    beam_model: BeamModel,
    buffers: MatchBuffers,
) -> None:
    """Process the view `current`, a motion away from `previous` (algorithm 4 from line 5 on).

    Not in the thesis: an inconsistent view waits until the next one confirms it. A misread view
    must not be laid over the map, because what it covers is forgotten.
    """
    step = progress.step
    progress.step += 1
    recognized, agreement = 0, 0.0
    note_motion(odometer, motion)
    if step == 0:  # Alg. 4, lines 5 to 8
        for i in range(3):
            current.pose[i] = 0.0
    else:
        while True:
            compose_pose(previous.pose, motion, current.pose)  # Alg. 4, line 10
            if limits.submap_matching:
                pair = pair_views(previous, current, motion, odometer, limits, beam_model, buffers)
                recognized, agreement = match_submap(pm, pair)
            else:  # Alg. 4, lines 11, 14 and 19
                recognized = _recognize_and_localize(pm, previous, current, motion, limits, buffers)
            is_laid = progress.updated_at >= step - 1 or progress.inconsistent > 0
            if recognized >= limits.min_landmarks or is_laid:  # Alg. 4, lines 12 and 13
                break
            update_map(pm, previous, limits)  # Alg. 4, lines 18 to 23: back to line 11
            progress.updated_at = step - 1
            progress.updates += 1
        if recognized == 0:
            progress.unrecognized += 1
        if limits.submap_matching:
            is_sure, was_misread = agreement >= limits.unsure, progress.inconsistent > 0
            learn_error(odometer, previous.pose, motion, current.pose, is_sure, was_misread)
            _check_consistency(previous, current, motion, agreement, odometer, progress, limits)
    if progress.inconsistent == 1:
        return
    if recognized < limits.min_landmarks:  # Alg. 4, lines 13 to 17
        update_map(pm, current, limits)
        progress.updated_at = step
        progress.updates += 1


@kernel()
def _check_consistency(
    previous: LocatedView,
    current: LocatedView,
    motion: np.ndarray,
    agreement: float,
    odometer: np.ndarray,
    progress: Any,
    limits: Albot1Limits,
) -> None:
    """Count the inconsistent views, and reset the pose of the first to the one by the odometer."""
    before = progress.inconsistent
    count = inconsistent_views(before, agreement, motion, odometer, previous, current, limits)
    progress.inconsistent = count
    if count == 1 and odometer[HAS_MOVED] > 0.0:
        compose_pose(previous.pose, motion, current.pose)


@kernel(arrays=True)
def _recognize_and_localize(
    pm: PerceptualMap,
    previous: LocatedView,
    current: LocatedView,
    motion: np.ndarray,
    limits: Albot1Limits,
    buffers: MatchBuffers,
) -> int:
    """Run algorithms 1 and 2; without a landmark path integration stands in (section 3.2.1)."""
    pairs, turned = np.empty(current.size[0], LANDMARK_PAIR), motion.copy()
    if limits.joint_landmarks:
        turned[2] += search_turn(previous, current, motion, limits, buffers)
        compose_pose(previous.pose, turned, current.pose)
    recognized = recognize_landmarks(previous, current, turned, limits, pairs)
    if recognized > 0 and limits.joint_landmarks:
        localize_jointly(pm, current, pairs, limits)
    elif recognized > 0:
        localize(pm, current, pairs, limits.longest_landmark)
    return int(recognized)
