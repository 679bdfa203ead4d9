"""What is in view, was in view, and is remembered, as rows that can be compared.

A row describes a surface as seen from where the robot is expected to be: its ends x1, y1,
x2, y2 (m), its length (m), its heading (rad), and the unit vector along it; in the view also
how far away the two ends are (m).
"""

from __future__ import annotations

import numpy as np

from albot_core.albot1.config import Limits
from albot_core.albot1.memory import Memory
from albot_core.albot1.recognition import heading_of, length_of, seen_along
from albot_core.albot1.search import surfaces_ending_in
from albot_core.albot1.sight import Sight
from albot_core.compiled import kernel


@kernel()
def describe(surface: np.ndarray, row: np.ndarray) -> None:
    """Fill a row: x1, y1, x2, y2, length, heading, and the unit vector along the surface."""
    for i in range(4):
        row[i] = surface[i]
    length = length_of(surface)
    row[4] = length
    row[5] = heading_of(surface)
    row[6] = (surface[2] - surface[0]) / length
    row[7] = (surface[3] - surface[1]) / length


@kernel(inline=True)
def seen_now(current: Sight, limits: Limits) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The surfaces of the view long enough to be recognised: places in it, ends and rows."""
    which = np.empty(current.size[0], np.int64)
    edges = np.empty((current.size[0], 2), np.int8)
    rows = np.empty((current.size[0], 10))
    kept = 0
    for k in range(current.size[0]):
        if length_of(current.surfaces[k]) >= limits.landmark_length:
            row = rows[kept]
            describe(current.surfaces[k], row)
            row[8], row[9] = np.hypot(row[0], row[1]), np.hypot(row[2], row[3])
            edges[kept, 0], edges[kept, 1] = current.edges[k, 0], current.edges[k, 1]
            which[kept] = k
            kept += 1
    return which[:kept], edges[:kept], rows[:kept]


@kernel(inline=True)
def seen_before(
    previous: Sight, motion: np.ndarray, limits: Limits
) -> tuple[np.ndarray, np.ndarray]:
    """The last view's surfaces as the odometer expects them in this one: ends and rows."""
    edges = np.empty((previous.size[0], 2), np.int8)
    rows = np.empty((previous.size[0], 8))
    expected = np.empty(4)
    cos, sin = np.cos(motion[2]), np.sin(motion[2])
    kept = 0
    for i in range(previous.size[0]):
        if length_of(previous.surfaces[i]) >= limits.landmark_length:
            seen_along(motion, cos, sin, previous.surfaces[i], expected)
            describe(expected, rows[kept])
            edges[kept, 0], edges[kept, 1] = previous.edges[i, 0], previous.edges[i, 1]
            kept += 1
    return edges[:kept], rows[:kept]


@kernel(arrays=True)
def remembered_nearby(
    memory: Memory, pose: np.ndarray, seen: np.ndarray, limits: Limits
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the map holds where the view is expected to lie: slots, ends and rows."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    box = np.array((pose[0], pose[1], pose[0], pose[1]))
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
    slots = surfaces_ending_in(memory, box)
    edges = np.empty((slots.shape[0], 2), np.int8)
    rows = np.empty((slots.shape[0], 8))
    expected = np.empty(4)
    kept = 0
    for slot in slots:
        seen_along(pose, cos, sin, memory.surfaces[slot], expected)
        if length_of(expected) >= limits.landmark_length:
            describe(expected, rows[kept])
            edges[kept, 0], edges[kept, 1] = memory.edges[slot, 0], memory.edges[slot, 1]
            slots[kept] = slot
            kept += 1
    return slots[:kept], edges[:kept], rows[:kept]


@kernel()
def beside(
    wall: np.ndarray, seen: np.ndarray, correction: np.ndarray, cos: float, sin: float
) -> float:
    """How far the corrected surface runs beside the wall (m); infinity without overlap."""
    ux, uy = wall[6], wall[7]
    dx = correction[0] + cos * seen[0] - sin * seen[1] - wall[0]
    dy = correction[1] + sin * seen[0] + cos * seen[1] - wall[1]
    first, aside = ux * dx + uy * dy, ux * dy - uy * dx
    dx = correction[0] + cos * seen[2] - sin * seen[3] - wall[0]
    dy = correction[1] + sin * seen[2] + cos * seen[3] - wall[1]
    last = ux * dx + uy * dy
    aside = 0.5 * abs(aside + ux * dy - uy * dx)
    overlap = min(last, wall[4]) - max(first, 0.0)
    return aside if overlap >= 0.3 * min(seen[4], wall[4]) else np.inf
