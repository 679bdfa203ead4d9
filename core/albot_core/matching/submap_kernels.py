"""Compiled matching of local submaps: lines propose poses, scans decide.

Algorithm 6 of Hossain (2014) assumes in turn that each pair of one line of either place matches
(see `lines`). Here each resulting pose is scored by the scans: points of one submap that fall on
walls of the other count for the pose, and points that fall where the other saw free space count
against it.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.pose_kernels import rotate_back, transform_point
from albot_core.kernels.compiled import kernel
from albot_core.matching.line_matching import is_near, lay_on
from albot_core.matching.line_pairs import MatchLimits

CELL = 0.15
"""Side of a cell of the grid (m)."""
CELLS = 220
"""Number of cells along each side of the grid, with the robot in the middle."""
MIDDLE = CELLS // 2 + 0.37
"""The robot's position along each side, in cells. It is not at a corner: in generated worlds walls
stand at round distances from it, and rounding would decide the cell."""
UNKNOWN, FREE, WALL = 0, 1, 2
"""States of a cell; a wall is three cells wide."""

FREE_PENALTY = 2.0
"""Weight of a point in free space, relative to a point on a wall."""
COARSE = 4
"""Proposed poses are compared by every n-th point only."""
STEP, TURN, HALVINGS, ROUNDS = 0.2, np.radians(4.0), 4, 10
"""Refinement: first steps (m, rad), number of step sizes, each half the one before, and largest
number of rounds with each."""
ASIDE = 1.2
"""Distance of the shifted poses at which the submaps should no longer match (m)."""
AMBIGUITY_WEIGHT = 0.5
"""Weight of the best score among these poses, which is subtracted: along a bare corridor a match
has little meaning."""


@kernel(arrays=True)
def match_grids(
    mine: np.ndarray,
    my_points: np.ndarray,
    my_grid: np.ndarray,
    theirs: np.ndarray,
    their_points: np.ndarray,
    their_grid: np.ndarray,
    limits: MatchLimits,
    pose: np.ndarray,
) -> float:
    """Return the match score of two submaps at the best pose, at most 1.

    Args:
        mine: Rows of one submap's lines (see `lines.describe`).
        my_points: Its points (n, 2), in its frame (m).
        my_grid: Its cells (CELLS, CELLS).
        theirs: As `mine`, of the other submap.
        their_points: As `my_points`.
        their_grid: As `my_grid`.
        limits: Largest distance and turn between their frames.
        pose: Set to the pose of the other's frame in the first one's; to infinity if no pose is
            proposed.
    """
    if not _propose(mine, theirs, their_points, my_grid, limits, pose):
        for i in range(3):
            pose[i] = np.inf
        return 0.0
    _refine(their_points, my_grid, pose)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    back, beside = np.empty(3), np.empty(3)
    x, y = rotate_back(cos, sin, pose[0], pose[1])
    back[0], back[1] = -x, -y
    back[2] = -pose[2]
    beside[2] = pose[2]
    elsewhere = -np.inf
    for way in range(8):
        beside[0] = pose[0] + ASIDE * np.cos(0.25 * np.pi * way)
        beside[1] = pose[1] + ASIDE * np.sin(0.25 * np.pi * way)
        elsewhere = max(elsewhere, _score(their_points, my_grid, beside, 1))
    there = _score(their_points, my_grid, pose, 1)
    here = _score(my_points, their_grid, back, 1)
    both = (there + here) / (their_points.shape[0] + my_points.shape[0])
    return float(both - AMBIGUITY_WEIGHT * elsewhere / their_points.shape[0])


@kernel(arrays=True)
def _propose(
    mine: np.ndarray,
    theirs: np.ndarray,
    points: np.ndarray,
    grid: np.ndarray,
    limits: MatchLimits,
    best: np.ndarray,
) -> bool:
    """Set `best` to the best pose that two lines propose; return False if no pose is proposed."""
    pose, nowhere = np.empty(3), np.zeros(3)
    most = -np.inf
    for j in range(mine.shape[0]):
        for k in range(theirs.shape[0]):
            for anchor in range(3):
                lay_on(mine[j], theirs[k], anchor, pose)
                if not is_near(pose, nowhere, nowhere, limits):
                    continue
                score = _score(points, grid, pose, COARSE)
                if score > most:
                    most = score
                    for i in range(3):
                        best[i] = pose[i]
    return bool(most > -np.inf)


@kernel()
def _score(points: np.ndarray, grid: np.ndarray, pose: np.ndarray, every: int) -> float:
    """Return the number of points on walls at `pose`, less the weighted number in free space."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    total = 0.0
    for k in range(0, points.shape[0], every):
        x, y = transform_point(pose, cos, sin, points[k, 0], points[k, 1])
        i, j = int(np.floor(x / CELL + MIDDLE)), int(np.floor(y / CELL + MIDDLE))
        if 0 <= i < CELLS and 0 <= j < CELLS:
            cell = grid[i, j]
            if cell == WALL:
                total += 1.0
            elif cell == FREE:
                total -= FREE_PENALTY
    return total


@kernel(arrays=True)
def _refine(points: np.ndarray, grid: np.ndarray, best: np.ndarray) -> None:
    """Move `best` by ever smaller steps as long as the score grows."""
    pose = np.empty(3)
    most = _score(points, grid, best, 1)
    for halving in range(HALVINGS):
        for _ in range(ROUNDS):
            before = most
            for way in range(6):
                for i in range(3):
                    pose[i] = best[i]
                step = (STEP if way < 4 else TURN) / (1 << halving)
                pose[way // 2] += step if way % 2 else -step
                score = _score(points, grid, pose, 1)
                if score > most:
                    most = score
                    for i in range(3):
                        best[i] = pose[i]
            if most == before:
                break


@kernel()
def mark_free(grid: np.ndarray, eye: np.ndarray, points: np.ndarray) -> None:
    """Mark as free the cells from `eye` (2,) to seen points (n, 2), in the robot's frame (m)."""
    for k in range(points.shape[0]):
        dx, dy = points[k, 0] - eye[0], points[k, 1] - eye[1]
        away = np.sqrt(dx * dx + dy * dy)
        for step in range(int(max(away - 2 * CELL, 0.0) / (0.5 * CELL))):
            part = step * 0.5 * CELL / away
            i = int(np.floor((eye[0] + part * dx) / CELL + MIDDLE))
            j = int(np.floor((eye[1] + part * dy) / CELL + MIDDLE))
            if 0 <= i < CELLS and 0 <= j < CELLS:
                grid[i, j] = FREE


@kernel()
def mark_walls(grid: np.ndarray, points: np.ndarray) -> None:
    """Mark as walls the cells of points (n, 2) in the robot's frame (m), and those beside them."""
    for k in range(points.shape[0]):
        i = int(np.floor(points[k, 0] / CELL + MIDDLE))
        j = int(np.floor(points[k, 1] / CELL + MIDDLE))
        for a in range(max(i - 1, 0), min(i + 2, CELLS)):
            for b in range(max(j - 1, 0), min(j + 2, CELLS)):
                grid[a, b] = WALL
