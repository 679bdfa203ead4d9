"""Evidence against a hypothesis of a lost robot's position: the consistency check against places.

If the hypothesis is right, a known wall cannot be missing where the view sees past it, and no wall
can be seen across a way that the robot has driven or has seen to be free. Compiled.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.segment_kernels import crosses_line
from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.perceptual_map.consistency import SPACING, TOLERANCE, range_along
from albot_core.matching.lines import line_length

BESIDE, PARALLEL = 0.25, np.cos(np.radians(15.0))
"""A point lies on a wall within this distance (m) whose direction differs by at most this angle
(15°, by its cosine)."""
REACH = 6.0
"""Walls farther away than this cannot be missing (m), because doorways look narrow there."""


@kernel(arrays=True)
def share_missing(known: np.ndarray, view: np.ndarray, eye: np.ndarray, min_length: float) -> float:
    """Return the share of missing walls among the known walls (n, 4) that a view can decide on.

    Walls of at least `min_length` (m) are compared, piece by piece. A piece is present if it lies
    on a wall of the view (m, 4). It is missing if the view, from the point `eye` (2,), sees past
    it.
    """
    around = np.empty_like(view)
    for k in range(view.shape[0]):
        for i in range(4):
            around[k, i] = view[k, i] - eye[i % 2]
    there = missing = 0
    for wall in known:
        length = line_length(wall)
        ux, uy = (wall[2] - wall[0]) / length, (wall[3] - wall[1]) / length
        for part in range(_pieces(length, min_length)):
            along = _middle(part, length)
            x, y = wall[0] + along * ux, wall[1] + along * uy
            dx, dy = x - eye[0], y - eye[1]
            away = np.sqrt(dx * dx + dy * dy)
            if _lies_on(x, y, ux, uy, view):
                there += 1
            elif away < REACH and (range_along(around, dx, dy) - 1.0) * away > TOLERANCE:
                missing += 1
    return missing / max(there + missing, 1)


@kernel()
def count_across(seen: np.ndarray, known: np.ndarray, ways: np.ndarray, min_length: float) -> int:
    """Return how many pieces of the walls seen (n, 4) lie across one of the free ways (k, 4).

    Walls of at least `min_length` (m) are compared. A piece that lies on a known wall (m, 4) does
    not count.
    """
    across, half = 0, 0.5 * SPACING
    for wall in seen:
        length = line_length(wall)
        ux, uy = (wall[2] - wall[0]) / length, (wall[3] - wall[1]) / length
        for part in range(_pieces(length, min_length)):
            along = _middle(part, length)
            x, y = wall[0] + along * ux, wall[1] + along * uy
            if _lies_on(x, y, ux, uy, known):
                continue
            for way in ways:
                if crosses_line(way, x - half * ux, y - half * uy, x + half * ux, y + half * uy):
                    across += 1
                    break
    return across


@kernel()
def _pieces(length: float, min_length: float) -> int:
    """Return the number of pieces of a wall; 0 if it is too short."""
    return max(int(length / SPACING), 1) if length >= min_length else 0


@kernel()
def _middle(part: int, length: float) -> float:
    """Return the distance of a piece's middle from the wall's first end (m)."""
    return (part + 0.5) / max(int(length / SPACING), 1) * length


@kernel()
def _lies_on(x: float, y: float, ux: float, uy: float, walls: np.ndarray) -> bool:
    """Return whether a point of a wall along (ux, uy) lies on one of `walls`, on the same side."""
    for wall in walls:
        length = line_length(wall)
        vx, vy = (wall[2] - wall[0]) / length, (wall[3] - wall[1]) / length
        dx, dy = x - wall[0], y - wall[1]
        along, aside = vx * dx + vy * dy, abs(vx * dy - vy * dx)
        is_beside = aside <= BESIDE and -BESIDE <= along <= length + BESIDE
        if is_beside and ux * vx + uy * vy >= PARALLEL:
            return True
    return False
