"""The local submap: the walls in view, and those remembered nearby or seen in the previous view.

All walls are rows (`lines.measure`) relative to the robot's expected pose: a wall's ends x1, y1,
x2, y2 (m), its length (m), an element for its heading, and the unit vector along it; for walls in
view also the distances of the two ends from the robot (m). Compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import rotate
from albot_core.kernels.compiled import kernel, scratch
from albot_core.kernels.simd import padded_length
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.frames import relative_pose, seen_from
from albot_core.mappers.albot1.perceptual_map.memory import (
    GATE,
    NEVER,
    VISIT,
    LocatedView,
    PerceptualMap,
    count_reobserved,
    find_surfaces,
)
from albot_core.mappers.albot1.perceptual_map.near_walls import tabulate
from albot_core.mappers.albot1.perceptual_map.odometer_error import turn_scale
from albot_core.mappers.albot1.perceptual_map.range_profile import (
    BINS,
    UNSEEN_HERE,
    fill_profile,
)
from albot_core.matching.lines import beside, measure, moved_ends
from albot_core.sensing.beam_model import BeamModel

REVISIT_GAP, REVISIT_COSINE = 1.5, np.cos(np.radians(15.0))
"""A wall may be one of an earlier visit if it is within this distance of it (m) and turned by at
most this angle (15°, by its cosine), because a map drifts on a loop. Such a wall counts for a
loop-closure candidate, and for nothing else."""


class MatchBuffers(NamedTuple):
    """Scratch buffers for matching views with the expected walls, one view after another."""

    seen: np.ndarray
    """(views' room, 10) float64: the rows of the walls in view."""
    slots: np.ndarray
    """(room,) int64: the slots of the walls remembered."""
    expected: np.ndarray
    """(room + views' room, 8) float64: rows of the remembered walls, then of the last view's
    walls."""
    table: np.ndarray
    """(8, room + views' room or a few more) float64: the same walls as columns, for
    `near_walls`."""
    near: np.ndarray
    """(room + views' room,) int64: the walls among them that one wall in view is compared with."""
    landmarks: np.ndarray
    """(views' room, 2) int64: the landmarks recognised (see ROW and SIDE in `submap_matching`)."""
    profiles: np.ndarray
    """(2, 3 BINS) int32: range profiles of the view and of the expected walls."""


class ViewPair(NamedTuple):
    """A view to be matched, the previous view, and the motion between them."""

    previous: LocatedView
    current: LocatedView
    seen: np.ndarray
    """(n, 10) float64: the rows of the walls in view."""
    directions: int
    """Number of directions in which the view sees a wall; its profile is the first in the
    buffers."""
    motion: np.ndarray
    """(3,) float64: the motion between the two, by the odometer (m, rad; the previous frame)."""
    odometer: np.ndarray
    """(ROW,) float64: the learnt errors of the odometer (see `odometer_error`)."""
    turn_scale: float
    """The scale of the odometer's turn errors (rad)."""
    limits: Albot1Limits
    beam_model: BeamModel
    buffers: MatchBuffers


@kernel(arrays=True)
def make_match_buffers(views: int, capacity: int) -> MatchBuffers:
    """Return buffers for views of up to `views` surfaces and maps of the given capacity."""
    room = 2 * capacity + 1
    return MatchBuffers(
        np.empty((views, 10)),
        np.empty(room, np.int64),
        np.empty((room + views, 8)),
        np.empty((8, padded_length(room + views))),
        np.empty(room + views, np.int64),
        np.empty((views, 2), np.int64),
        np.empty((2, 3 * BINS), np.int32),
    )


@kernel()
def pair_views(
    previous: LocatedView,
    current: LocatedView,
    motion: np.ndarray,
    odometer: np.ndarray,
    limits: Albot1Limits,
    beam_model: BeamModel,
    buffers: MatchBuffers,
) -> ViewPair:
    """Write the rows of the view's walls and its profile; return it with the previous view."""
    seen = buffers.seen[: describe_seen(current, buffers)]
    directions = fill_profile(seen, UNSEEN_HERE, buffers.profiles[0])
    scale = turn_scale(odometer, limits)
    return ViewPair(
        previous, current, seen, directions, motion, odometer, scale, limits, beam_model, buffers
    )


@kernel()
def describe_seen(current: LocatedView, buffers: MatchBuffers) -> int:
    """Write the rows of the view's walls, in the view's order; return their number."""
    for k in range(current.size[0]):
        row = buffers.seen[k]
        measure(current.surfaces[k], row)
        row[8], row[9] = np.hypot(row[0], row[1]), np.hypot(row[2], row[3])
    return int(current.size[0])


_from_here, _box, _motion = scratch(4), scratch(4), scratch(3)


@kernel()
def describe_previous(
    previous: LocatedView, motion: np.ndarray, first: int, buffers: MatchBuffers
) -> int:
    """Write the previous view's walls after a motion, from row `first`; return the next row."""
    ends = _from_here()
    cos, sin = np.cos(motion[2]), np.sin(motion[2])
    for i in range(previous.size[0]):
        seen_from(motion, cos, sin, previous.surfaces[i], ends)
        measure(ends, buffers.expected[first + i])
    return int(first + previous.size[0])


@kernel()
def describe_nearby(pm: PerceptualMap, pair: ViewPair) -> tuple[int, int]:
    """Write the rows of all walls that may be in view: those in the map, and the previous view's.

    Returns the number of remembered walls, and the number of all walls.
    """
    box, ends, pose, buffers = _box(), _from_here(), pair.current.pose, pair.buffers
    _box_around_view(pose, pair.seen, pair.limits, box)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    remembered = find_surfaces(pm, box, buffers.slots)
    for q in range(remembered):
        seen_from(pose, cos, sin, pm.surfaces[buffers.slots[q]], ends)
        measure(ends, buffers.expected[q])
    motion = _motion()
    relative_pose(pair.previous.pose, pose, motion)
    total = describe_previous(pair.previous, motion, remembered, buffers)
    tabulate(buffers.expected[:total], buffers.table)
    return int(remembered), int(total)


@kernel()
def _box_around_view(
    pose: np.ndarray, seen: np.ndarray, limits: Albot1Limits, box: np.ndarray
) -> None:
    """Write the box of the map in which walls seen from a pose may be remembered (map frame)."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    box[0], box[1], box[2], box[3] = pose[0], pose[1], pose[0], pose[1]
    for k in range(seen.shape[0]):
        for end in range(2):
            x, y = seen[k, 2 * end], seen[k, 2 * end + 1]
            shrink = min(1.0, limits.match_range / max(seen[k, 8 + end], 1e-9))
            x, y = rotate(cos, sin, x, y)
            east, north = pose[0] + shrink * x, pose[1] + shrink * y
            box[0], box[2] = min(box[0], east), max(box[2], east)
            box[1], box[3] = min(box[1], north), max(box[3], north)
    for axis in range(2):
        box[axis] -= limits.landmark_gap
        box[2 + axis] += limits.landmark_gap


@kernel()
def note_reobserved(
    pm: PerceptualMap, pair: ViewPair, remembered: int, correction: np.ndarray
) -> None:
    """Count the remembered surfaces of earlier visits that may be in view, for their visits."""
    seen, limits = pair.seen, pair.limits
    slots, expected = pair.buffers.slots, pair.buffers.expected
    cos, sin = np.cos(correction[2]), np.sin(correction[2])
    for q in range(remembered):
        visit = pm.marks[slots[q]]
        if visit == pm.counts[VISIT] or pm.reobserved[visit, GATE] == NEVER:
            continue
        if expected[q, 4] < limits.landmark_length:
            continue
        for k in range(seen.shape[0]):
            ux, uy = rotate(cos, sin, seen[k, 6], seen[k, 7])
            aligned = ux * expected[q, 6] + uy * expected[q, 7]
            if aligned <= REVISIT_COSINE or seen[k, 4] < limits.landmark_length:
                continue
            ends = moved_ends(seen[k], correction, cos, sin)
            if beside(expected[q], ends, seen[k, 4]) < REVISIT_GAP:
                count_reobserved(pm, slots[q])
                break
