"""Tiny hand-drawn scenes, scanned by the slow obvious method."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.poses import inverse, transform_segments
from albot_core.sensing.reading import LaserGeometry, LaserScan

ROOM = np.array(
    [
        [-4.0, -3.0, 5.0, -3.0],
        [5.0, -3.0, 5.0, 4.0],
        [5.0, 4.0, -4.0, 4.0],
        [-4.0, 4.0, -4.0, -3.0],
        # A cupboard, and a pillar standing free.
        [2.0, 4.0, 2.0, 3.2],
        [2.0, 3.2, 3.5, 3.2],
        [3.5, 3.2, 3.5, 4.0],
        [2.6, -1.0, 3.4, -1.0],
        [3.4, -1.0, 3.4, -1.8],
        [3.4, -1.8, 2.6, -1.8],
        [2.6, -1.8, 2.6, -1.0],
    ]
)
"""A room of 9 x 7 m with a cupboard in its far wall and a pillar (m)."""


def scan_from(
    pose: np.ndarray, walls: np.ndarray, geometry: LaserGeometry | None = None
) -> LaserScan:
    """The exact scan of the walls from a pose, beam by beam and wall by wall."""
    geometry = geometry or LaserGeometry()
    seen = transform_segments(inverse(pose), walls)
    ranges = np.full(geometry.beams, np.inf)
    for i, (dx, dy) in enumerate(geometry.directions):
        for x1, y1, x2, y2 in seen:
            wx, wy = x2 - x1, y2 - y1
            cross = dx * wy - dy * wx
            if abs(cross) < 1e-12:
                continue
            reach = (x1 * wy - y1 * wx) / cross
            along = (x1 * dy - y1 * dx) / cross
            if reach > 0 and -1e-9 <= along <= 1 + 1e-9:
                ranges[i] = min(ranges[i], reach)
    ranges[ranges >= geometry.max_range] = np.inf
    return LaserScan(ranges=ranges, geometry=geometry)


def doorway(x: float, width: float, shut: bool = False) -> list[tuple[float, ...]]:
    """A wall across at x from y = -4 to 4 (m), 15 cm thick, with a gap about y = 0."""
    half, back = width / 2, x + 0.15
    walls = [(x, -4, x, -half), (x, half, x, 4), (back, -4, back, -half), (back, half, back, 4)]
    walls += [(x, -half, back, -half), (x, half, back, half)]
    return [*walls, (x, -half, x, half)] if shut else walls


OUTSIDE = [(-3.0, -4, 9, -4), (-3, 4, 9, 4), (9, -4, 9, 4), (-3, -4, -3, 4)]
"""The outer walls of a house of 12 x 8 m."""


def two_rooms(width: float = 0.9, shut: bool = False) -> np.ndarray:
    """Two rooms of 8 m with a doorway between them, in the middle of the wall at x = 2.5."""
    return np.array([*doorway(2.5, width, shut), *OUTSIDE], float)


FURNITURE = np.array(
    [
        [-2.0, 4.0, -2.0, 3.0],
        [-2.0, 3.0, -0.5, 3.0],
        [-0.5, 3.0, -0.5, 4.0],
        [-3.0, -1.5, -2.2, -1.5],
        [-2.2, -1.5, -2.2, -2.8],
        [-2.2, -2.8, -3.0, -2.8],
        [6.0, -4.0, 6.0, -3.2],
        [6.0, -3.2, 7.8, -3.2],
        [7.8, -3.2, 7.8, -4.0],
        [8.0, 4.0, 8.0, 2.4],
        [8.0, 2.4, 9.0, 2.4],
    ]
)
"""Cupboards in both of the two rooms (m)."""


def house_walk() -> np.ndarray:
    """From the one of two rooms into the other and back, twice: poses (n, 3)."""
    there = [(x, 0.0, 0.0) for x in np.arange(0.0, 5.5, 0.5)]
    back = [(x, 0.0, np.pi) for x in np.arange(5.0, -0.5, -0.5)]
    turn = [(5.0, 0.0, turn) for turn in np.linspace(0.4, 2.8, 7)]
    round_again = [(0.0, 0.0, turn) for turn in np.linspace(3.5, 6.0, 7)]
    once = [*there, *turn, *back, *round_again]
    return np.array([*once, *once])
