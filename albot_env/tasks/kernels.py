"""Compiled loops of the tasks: sweeping ground, cutting egocentric patches, finding rooms."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def sweep(
    grid: np.ndarray,
    cell: float,
    centre: tuple[float, float],
    pose: np.ndarray,
    mount: tuple[float, float, float],
    ranges: np.ndarray,
    first_bearing: float,
    spacing: float,
    radius: float,
) -> int:
    """Mark the cells in view within `radius` of the laser; return how many were new.

    `grid` is a square about `centre`, rows along y; cells outside it are left out. The
    laser is mounted at `mount` on a robot at `pose`. Beams are thinned to what the cells
    need at the radius.
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    eye_x = pose[0] + cos * mount[0] - sin * mount[1] - centre[0]
    eye_y = pose[1] + sin * mount[0] + cos * mount[1] - centre[1]
    heading = pose[2] + mount[2] + first_bearing
    size = grid.shape[0]
    half = size // 2
    stride = max(1, int(0.5 * cell / (spacing * radius)))
    new = 0
    for k in range(0, ranges.shape[0], stride):
        angle = heading + k * spacing
        dx, dy = np.cos(angle), np.sin(angle)
        reach = min(ranges[k], radius)
        steps = int(2.0 * reach / cell) + 1
        for j in range(steps):
            along = reach * (j + 0.5) / steps
            column = int(np.floor((eye_x + along * dx) / cell)) + half
            row = int(np.floor((eye_y + along * dy) / cell)) + half
            if 0 <= row < size and 0 <= column < size and grid[row, column] == 0:
                grid[row, column] = 1
                new += 1
    return new


@njit(cache=True)
def cut_patch(
    grid: np.ndarray,
    cell: float,
    centre: tuple[float, float],
    pose: np.ndarray,
    patch_cell: float,
    patch: np.ndarray,
) -> None:
    """Fill `patch` with the cells around a pose: 1 covered, -1 not.

    Row 0 lies farthest ahead of the robot, column 0 farthest to its left.
    """
    size = grid.shape[0]
    half = size // 2
    width = patch.shape[0]
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    for row in range(width):
        forward = ((width - 1) / 2 - row) * patch_cell
        for column in range(width):
            left = ((width - 1) / 2 - column) * patch_cell
            x = int(np.floor((pose[0] - centre[0] + cos * forward - sin * left) / cell)) + half
            y = int(np.floor((pose[1] - centre[1] + sin * forward + cos * left) / cell)) + half
            inside = 0 <= x < size and 0 <= y < size
            patch[row, column] = 1.0 if inside and grid[y, x] else -1.0


@njit(cache=True)
def find_room(x: float, y: float, corners: np.ndarray, ends: np.ndarray) -> int:
    """The index of the first room whose outline holds the point, -1 where none does.

    `corners` are the corners of all outlines one after another; `ends[k]` is where those
    of room k end. A point is inside where a ray to +x crosses the outline an odd number
    of times.
    """
    start = 0
    for room in range(ends.shape[0]):
        inside = False
        last = ends[room] - 1
        for k in range(start, ends[room]):
            x1, y1 = corners[last]
            x2, y2 = corners[k]
            if (y1 > y) != (y2 > y) and x < x1 + (y - y1) / (y2 - y1) * (x2 - x1):
                inside = not inside
            last = k
        if inside:
            return room
        start = ends[room]
    return -1
