"""How well two pieces of ground agree: structure proposes where they meet, the scans decide.

Algorithm 6 supposes that each surface of the one place is each of the other. Here what was
seen judges each such alignment: points of the one that fall on walls of the other speak for
it, and points that fall where the other saw through speak against it. Compiled.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.config import Alike
from albot_core.mappers.albot1.structure import is_near, suppose

CELL = 0.15
"""Side of a cell of the ground (m)."""
CELLS = 220
"""Cells along the ground's sides, with the robot in the middle."""
MIDDLE = CELLS // 2 + 0.37
"""The robot's place along the sides, in cells: not at a corner, for in worlds made up walls
stand at round numbers from it, where they would be in one cell or the next by chance."""
UNKNOWN, SEEN_THROUGH, WALL = 0, 1, 2
"""What a cell may be; a wall is as wide as three."""

AGAINST = 2.0
"""A point seen through weighs so many points on walls."""
COARSE = 4
"""To look through the alignments every fourth point will do."""
STEP, TURN, HALVINGS, ROUNDS = 0.2, np.radians(4.0), 4, 10
"""The best alignment is drawn nearer by steps (m, rad), which are halved so often, after so
many rounds at the most."""
ASIDE = 1.2
"""So far aside the ground should no longer agree (m)…"""
UNSURE = 0.5
"""…and so much of what it agrees there is not counted: along a bare corridor it tells nothing."""


@kernel()
def look_through(ground: np.ndarray, eye: np.ndarray, points: np.ndarray) -> None:
    """Mark the cells between the eye (2,) and what it sees (n, 2), in the robot's frame (m)."""
    for k in range(points.shape[0]):
        dx, dy = points[k, 0] - eye[0], points[k, 1] - eye[1]
        away = np.sqrt(dx * dx + dy * dy)
        for step in range(int(max(away - 2 * CELL, 0.0) / (0.5 * CELL))):
            part = step * 0.5 * CELL / away
            i = int(np.floor((eye[0] + part * dx) / CELL + MIDDLE))
            j = int(np.floor((eye[1] + part * dy) / CELL + MIDDLE))
            if 0 <= i < CELLS and 0 <= j < CELLS:
                ground[i, j] = SEEN_THROUGH


@kernel()
def put_walls(ground: np.ndarray, points: np.ndarray) -> None:
    """Mark the cells of points (n, 2) in the robot's frame (m), and those beside them."""
    for k in range(points.shape[0]):
        i = int(np.floor(points[k, 0] / CELL + MIDDLE))
        j = int(np.floor(points[k, 1] / CELL + MIDDLE))
        for a in range(max(i - 1, 0), min(i + 2, CELLS)):
            for b in range(max(j - 1, 0), min(j + 2, CELLS)):
                ground[a, b] = WALL


@kernel()
def _agreed(points: np.ndarray, ground: np.ndarray, pose: np.ndarray, every: int) -> float:
    """Points on walls of the ground in which they lie at `pose`, less those seen through."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    sum_of = 0.0
    for k in range(0, points.shape[0], every):
        x = pose[0] + cos * points[k, 0] - sin * points[k, 1]
        y = pose[1] + sin * points[k, 0] + cos * points[k, 1]
        i, j = int(np.floor(x / CELL + MIDDLE)), int(np.floor(y / CELL + MIDDLE))
        if 0 <= i < CELLS and 0 <= j < CELLS:
            cell = ground[i, j]
            if cell == WALL:
                sum_of += 1.0
            elif cell == SEEN_THROUGH:
                sum_of -= AGAINST
    return sum_of


@kernel(arrays=True)
def _propose(
    mine: np.ndarray,
    theirs: np.ndarray,
    points: np.ndarray,
    ground: np.ndarray,
    alike: Alike,
    best: np.ndarray,
) -> bool:
    """Set `best` to the supposed alignment that agrees best; false where there is none."""
    pose, nowhere = np.empty(3), np.zeros(3)
    most = -np.inf
    for j in range(mine.shape[0]):
        for k in range(theirs.shape[0]):
            for anchor in range(3):
                suppose(mine[j], theirs[k], anchor, pose)
                if not is_near(pose, nowhere, nowhere, alike):
                    continue
                agreed = _agreed(points, ground, pose, COARSE)
                if agreed > most:
                    most = agreed
                    for i in range(3):
                        best[i] = pose[i]
    return bool(most > -np.inf)


@kernel(arrays=True)
def _draw_nearer(points: np.ndarray, ground: np.ndarray, best: np.ndarray) -> None:
    """Move `best` by ever smaller steps as long as more agrees."""
    pose = np.empty(3)
    most = _agreed(points, ground, best, 1)
    for halving in range(HALVINGS):
        for _ in range(ROUNDS):
            before = most
            for way in range(6):
                for i in range(3):
                    pose[i] = best[i]
                step = (STEP if way < 4 else TURN) / (1 << halving)
                pose[way // 2] += step if way % 2 else -step
                agreed = _agreed(points, ground, pose, 1)
                if agreed > most:
                    most = agreed
                    for i in range(3):
                        best[i] = pose[i]
            if most == before:
                break


@kernel(arrays=True)
def agreement(
    mine: np.ndarray,
    my_points: np.ndarray,
    my_ground: np.ndarray,
    theirs: np.ndarray,
    their_points: np.ndarray,
    their_ground: np.ndarray,
    alike: Alike,
    pose: np.ndarray,
) -> float:
    """How well two pieces of ground agree at best, at most 1.

    Args:
        mine: Rows of the one's surfaces (see `outlook.describe`).
        my_points: What was seen there (n, 2), in its frame (m).
        my_ground: Its cells (CELLS, CELLS).
        theirs: As `mine`, of the other.
        their_points: As `my_points`.
        their_ground: As `my_ground`.
        alike: How far apart, and how much turned, their frames may be.
        pose: Set to where the other's frame lies in the one's; to infinity where nothing can
            be aligned.
    """
    if not _propose(mine, theirs, their_points, my_ground, alike, pose):
        for i in range(3):
            pose[i] = np.inf
        return 0.0
    _draw_nearer(their_points, my_ground, pose)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    back, beside = np.empty(3), np.empty(3)
    back[0], back[1] = -cos * pose[0] - sin * pose[1], sin * pose[0] - cos * pose[1]
    back[2] = -pose[2]
    beside[2] = pose[2]
    elsewhere = -np.inf
    for way in range(8):
        beside[0] = pose[0] + ASIDE * np.cos(0.25 * np.pi * way)
        beside[1] = pose[1] + ASIDE * np.sin(0.25 * np.pi * way)
        elsewhere = max(elsewhere, _agreed(their_points, my_ground, beside, 1))
    there = _agreed(their_points, my_ground, pose, 1)
    here = _agreed(my_points, their_ground, back, 1)
    both = (there + here) / (their_points.shape[0] + my_points.shape[0])
    return float(both - UNSURE * elsewhere / their_points.shape[0])
