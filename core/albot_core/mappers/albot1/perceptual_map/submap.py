"""The local submap: what is in view, was in view, and is remembered nearby, as rows to compare.

A row describes a surface as seen from where the robot is expected to be: its ends x1, y1, x2, y2
(m), its length (m), its heading (rad), and the unit vector along it; in the view also how far away
the two ends are (m). Compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import rotate
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.frames import seen_from
from albot_core.mappers.albot1.perceptual_map.memory import (
    LocatedView,
    PerceptualMap,
    find_surfaces,
)
from albot_core.matching.lines import describe, line_length, measure


class MatchBuffers(NamedTuple):
    """Scratch buffers in which views are matched with what is expected, one view after another."""

    which: np.ndarray
    """(views' room,) int64: of each surface seen, its index in the view."""
    seen_edges: np.ndarray
    """(views' room, 2) int8: what its ends are."""
    seen: np.ndarray
    """(views' room, 10) float64: its row."""
    slots: np.ndarray
    """(room,) int64: of each surface remembered, its slot."""
    edges: np.ndarray
    """(room, 2) int8: of each surface expected, what its ends are."""
    expected: np.ndarray
    """(room, 8) float64: its row."""
    matches: np.ndarray
    """(views' room, 3) int64: see `submap_matching`."""
    votes: np.ndarray
    """(2, turns) float64: see `submap_matching.likeliest_turn`."""


@kernel(arrays=True)
def make_match_buffers(views: int, capacity: int, turns: int) -> MatchBuffers:
    """Buffers for views of so many surfaces, maps of such a capacity, and so many turns."""
    room = max(views, 2 * capacity)
    return MatchBuffers(
        np.empty(views, np.int64),
        np.empty((views, 2), np.int8),
        np.empty((views, 10)),
        np.empty(room, np.int64),
        np.empty((room, 2), np.int8),
        np.empty((room, 8)),
        np.empty((views, 3), np.int64),
        np.empty((2, turns)),
    )


@kernel()
def describe_seen(current: LocatedView, limits: Albot1Limits, buffers: MatchBuffers) -> int:
    """Describe the surfaces of the view that are long enough to be recognised; how many."""
    which, edges, rows = buffers.which, buffers.seen_edges, buffers.seen
    kept = 0
    for k in range(current.size[0]):
        if line_length(current.surfaces[k]) >= limits.landmark_length:
            row = rows[kept]
            describe(current.surfaces[k], row)
            row[8], row[9] = np.hypot(row[0], row[1]), np.hypot(row[2], row[3])
            edges[kept, 0], edges[kept, 1] = current.edges[k, 0], current.edges[k, 1]
            which[kept] = k
            kept += 1
    return kept


_from_here, _box = scratch(4), scratch(4)


@kernel()
def describe_expected(
    previous: LocatedView, motion: np.ndarray, limits: Albot1Limits, buffers: MatchBuffers
) -> int:
    """Describe the previous view's surfaces as the odometer expects them now; how many."""
    edges, rows, expected = buffers.edges, buffers.expected, _from_here()
    cos, sin = np.cos(motion[2]), np.sin(motion[2])
    kept = 0
    for i in range(previous.size[0]):
        if line_length(previous.surfaces[i]) >= limits.landmark_length:
            seen_from(motion, cos, sin, previous.surfaces[i], expected)
            describe(expected, rows[kept])
            edges[kept, 0], edges[kept, 1] = previous.edges[i, 0], previous.edges[i, 1]
            kept += 1
    return kept


@kernel()
def describe_remembered(
    pm: PerceptualMap,
    pose: np.ndarray,
    seen: np.ndarray,
    limits: Albot1Limits,
    buffers: MatchBuffers,
) -> int:
    """Describe what the map holds where the view is expected to lie; how many surfaces.

    Those long enough to be recognised; without their headings.
    """
    slots, edges, rows = buffers.slots, buffers.edges, buffers.expected
    box, expected = _box(), _from_here()
    _box_around_view(pose, seen, limits, box)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    kept = 0
    for k in range(find_surfaces(pm, box, slots)):
        slot = slots[k]
        seen_from(pose, cos, sin, pm.surfaces[slot], expected)
        if line_length(expected) >= limits.landmark_length:
            measure(expected, rows[kept])
            edges[kept, 0], edges[kept, 1] = pm.edges[slot, 0], pm.edges[slot, 1]
            slots[kept] = slot
            kept += 1
    return kept


@kernel()
def _box_around_view(
    pose: np.ndarray, seen: np.ndarray, limits: Albot1Limits, box: np.ndarray
) -> None:
    """Write the box in which what is seen from a pose may be remembered (map frame)."""
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
