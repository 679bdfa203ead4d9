"""Compiled loops of the sketch. Meaning of the arrays: see `sketch`."""

from __future__ import annotations

import numpy as np
from numba import njit

UNKNOWN, FREE, BLOCKED = 0, 1, 2


@njit(cache=True)
def draw_scan(
    grid: np.ndarray,
    covered: np.ndarray,
    cell: float,
    eye: np.ndarray,
    ranges: np.ndarray,
    bearings: np.ndarray,
    reaches: tuple[float, float],
) -> None:
    """Mark the ground along the beams free, and blocked where they end.

    `eye` is the laser's pose in the map's frame. Ground is covered up to the first of
    the reaches (m), and drawn up to the second.
    """
    near, reach = reaches
    half = grid.shape[0] // 2
    for blocked in (False, True):  # Ends last: a beam that grazes a wall must not erase it.
        for k in range(ranges.shape[0]):
            angle = eye[2] + bearings[k]
            dx, dy = np.cos(angle), np.sin(angle)
            if blocked:
                if ranges[k] < reach:
                    row = int(np.floor((eye[1] + ranges[k] * dy) / cell)) + half
                    column = int(np.floor((eye[0] + ranges[k] * dx) / cell)) + half
                    grid[row, column] = BLOCKED
                continue
            free = min(ranges[k] - cell, reach)
            steps = int(free / cell)
            for j in range(steps + 1):
                row = int(np.floor((eye[1] + j * cell * dy) / cell)) + half
                column = int(np.floor((eye[0] + j * cell * dx) / cell)) + half
                grid[row, column] = FREE
                covered[row, column] |= j * cell <= near


@njit(cache=True)
def _passable(grid: np.ndarray, row: int, column: int, radius: float, hopeful: bool) -> bool:
    """Whether a disc about a free cell holds the middle of no blocked one.

    Who is hopeful takes unknown cells for free.
    """
    if grid[row, column] != FREE and not (hopeful and grid[row, column] == UNKNOWN):
        return False
    around = int(radius)
    for i in range(-around, around + 1):
        for j in range(-around, around + 1):
            if i * i + j * j <= radius * radius and grid[row + i, column + j] == BLOCKED:
                return False
    return True


@njit(cache=True)
def flood(
    grid: np.ndarray,
    start: tuple[int, int],
    radius: float,
    before: np.ndarray,
    hopeful: bool,
    goal: tuple[int, int],
) -> np.ndarray:
    """Flood the passable cells from `start`, nearest first; return steps to each, -1 beyond.

    It ends at the cell `goal`, if it gets there. `before` receives the flat index of the cell
    before each. Near the start only blocked cells stop the flood, so that a robot close to a
    wall can leave it.
    """
    size, border = grid.shape[0], int(radius)
    steps = np.full((size, size), -1, np.int32)
    queue = np.empty(size * size, np.int64)
    queue[0] = start[0] * size + start[1]
    steps[start[0], start[1]] = 0
    before[start[0], start[1]] = queue[0]
    first, last = 0, 1
    while first < last:
        here = queue[first]
        first += 1
        row, column = here // size, here % size
        if row == goal[0] and column == goal[1]:
            break
        for i in range(9):
            r, c = row + (i // 3) - 1, column + (i % 3) - 1
            inside = border <= r < size - border and border <= c < size - border
            if not inside or steps[r, c] >= 0:
                continue
            near = (r - start[0]) ** 2 + (c - start[1]) ** 2 <= (radius + 1) ** 2
            if (near and grid[r, c] != BLOCKED) or _passable(grid, r, c, radius, hopeful):
                steps[r, c] = steps[row, column] + 1
                before[r, c] = here
                queue[last] = r * size + c
                last += 1
    return steps


@njit(cache=True)
def straight_is_free(
    grid: np.ndarray, start: tuple[int, int], end: tuple[int, int], radius: float, hopeful: bool
) -> bool:
    """Whether a disc can go straight from cell to cell; near the start as in `flood`."""
    rows, columns = end[0] - start[0], end[1] - start[1]
    count = max(abs(rows), abs(columns))
    for k in range(1, count + 1):
        row = start[0] + int(np.round(rows * k / count))
        column = start[1] + int(np.round(columns * k / count))
        near = (row - start[0]) ** 2 + (column - start[1]) ** 2 <= (radius + 1) ** 2
        if near:
            if grid[row, column] == BLOCKED:
                return False
        elif not _passable(grid, row, column, radius, hopeful):
            return False
    return True
