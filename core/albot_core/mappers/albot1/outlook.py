"""What is in view, was in view, and is remembered, as rows that can be compared.

A row describes a surface as seen from where the robot is expected to be: its ends x1, y1,
x2, y2 (m), its length (m), its heading (rad), and the unit vector along it; in the view also
how far away the two ends are (m).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Limits
from albot_core.mappers.albot1.memory import Memory
from albot_core.mappers.albot1.recognition import seen_along
from albot_core.mappers.albot1.search import surfaces_ending_in
from albot_core.mappers.albot1.sight import Sight
from albot_core.matching.lines import describe, length_of, measure


class Outlook(NamedTuple):
    """Room in which views are compared with what is expected, any number of them in turn."""

    which: np.ndarray
    """(views' room,) int64: of each surface seen, its place in the view."""
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
    """(views' room, 3) int64: see `triangulation`."""
    votes: np.ndarray
    """(2, turns) float64: see `turning`."""


@kernel(arrays=True)
def make_outlook(views: int, capacity: int, turns: int) -> Outlook:
    """Room for views of so many surfaces, maps of such a capacity, and so many turns."""
    room = max(views, 2 * capacity)
    return Outlook(
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
def describe_seen(current: Sight, limits: Limits, outlook: Outlook) -> int:
    """Describe the surfaces of the view long enough to be recognised; how many they are."""
    which, edges, rows = outlook.which, outlook.seen_edges, outlook.seen
    kept = 0
    for k in range(current.size[0]):
        if length_of(current.surfaces[k]) >= limits.landmark_length:
            row = rows[kept]
            describe(current.surfaces[k], row)
            row[8], row[9] = np.hypot(row[0], row[1]), np.hypot(row[2], row[3])
            edges[kept, 0], edges[kept, 1] = current.edges[k, 0], current.edges[k, 1]
            which[kept] = k
            kept += 1
    return kept


_from_here, _bounds = scratch(4), scratch(4)


@kernel()
def describe_expected(previous: Sight, motion: np.ndarray, limits: Limits, outlook: Outlook) -> int:
    """Describe the last view's surfaces as the odometer expects them in this one; how many."""
    edges, rows, expected = outlook.edges, outlook.expected, _from_here()
    cos, sin = np.cos(motion[2]), np.sin(motion[2])
    kept = 0
    for i in range(previous.size[0]):
        if length_of(previous.surfaces[i]) >= limits.landmark_length:
            seen_along(motion, cos, sin, previous.surfaces[i], expected)
            describe(expected, rows[kept])
            edges[kept, 0], edges[kept, 1] = previous.edges[i, 0], previous.edges[i, 1]
            kept += 1
    return kept


@kernel()
def describe_remembered(
    memory: Memory, pose: np.ndarray, seen: np.ndarray, limits: Limits, outlook: Outlook
) -> int:
    """Describe what the map holds where the view is expected to lie; how many surfaces.

    Those long enough to be recognised; without their headings.
    """
    slots, edges, rows = outlook.slots, outlook.edges, outlook.expected
    box, expected = _bounds(), _from_here()
    _bound(pose, seen, limits, box)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    kept = 0
    for k in range(surfaces_ending_in(memory, box, slots)):
        slot = slots[k]
        seen_along(pose, cos, sin, memory.surfaces[slot], expected)
        if length_of(expected) >= limits.landmark_length:
            measure(expected, rows[kept])
            edges[kept, 0], edges[kept, 1] = memory.edges[slot, 0], memory.edges[slot, 1]
            slots[kept] = slot
            kept += 1
    return kept


@kernel()
def _bound(pose: np.ndarray, seen: np.ndarray, limits: Limits, box: np.ndarray) -> None:
    """Write the box in which what is seen from a pose may be remembered."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    box[0], box[1], box[2], box[3] = pose[0], pose[1], pose[0], pose[1]
    for k in range(seen.shape[0]):
        for end in range(2):
            x, y = seen[k, 2 * end], seen[k, 2 * end + 1]
            shrink = min(1.0, limits.reach / max(seen[k, 8 + end], 1e-9))
            east = pose[0] + shrink * (cos * x - sin * y)
            north = pose[1] + shrink * (sin * x + cos * y)
            box[0], box[2] = min(box[0], east), max(box[2], east)
            box[1], box[3] = min(box[1], north), max(box[3], north)
    for axis in range(2):
        box[axis] -= limits.landmark_gap
        box[2 + axis] += limits.landmark_gap
