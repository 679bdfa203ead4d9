"""Compiled lists of the walls near a place."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def near_cell(walls: np.ndarray, x: float, y: float, reach: float, members: np.ndarray) -> int:
    """List the walls within `reach` (m) of the point (x, y).

    For all of a cell, give its middle and add half its diagonal to the reach.

    Args:
        walls: All walls (n, 4) (m).
        x: The point (m).
        y: The point (m).
        reach: Greatest distance (m).
        members: Filled with their numbers (int32), the nearest first.

    Returns:
        How many there are. Where `members` is too short, it holds the nearest.
    """
    count = 0
    distances = np.empty(members.shape[0])
    for j in range(walls.shape[0]):
        distance = _distance(walls, j, x, y)
        if distance > reach:
            continue
        k = min(count, members.shape[0])
        while k > 0 and distances[k - 1] > distance:
            if k < members.shape[0]:
                members[k], distances[k] = members[k - 1], distances[k - 1]
            k -= 1
        if k < members.shape[0]:
            members[k], distances[k] = j, distance
        count += 1
    return count


@njit(cache=True, error_model="numpy")
def _distance(walls: np.ndarray, j: int, x: float, y: float) -> float:
    """Distance (m) from the point (x, y) to a wall."""
    ex, ey = walls[j, 2] - walls[j, 0], walls[j, 3] - walls[j, 1]
    px, py = x - walls[j, 0], y - walls[j, 1]
    along = min(max((px * ex + py * ey) / (ex * ex + ey * ey), 0.0), 1.0)
    return math.hypot(px - along * ex, py - along * ey)
