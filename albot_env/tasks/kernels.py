"""Compiled loops of the tasks: sweeping ground, cutting patches, finding rooms, observing.

A grid of ground is a square of cells, a bit each: row y in `grid[y]`, column x in bit x % 64
of its word x // 64. Robots by the thousand then find theirs in the processor's cache.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_ONE = 2.0**32
"""A cell in fixed-point numbers, in which loops over cells need no conversions: a negative
cell, taken as unsigned, is beyond every grid."""


@njit(cache=True, error_model="numpy")
def sweep(
    grid: np.ndarray,
    cell: float,
    centre: tuple[float, float],
    pose: np.ndarray,
    mount: tuple[float, float],
    ranges: np.ndarray,
    directions: np.ndarray,
    spacing: float,
    radius: float,
) -> int:
    """Mark the cells in view within `radius` of the laser; return how many were new.

    `grid` lies about `centre`; cells outside it are left out. The laser is mounted at
    `mount` on a robot at `pose`; `directions` (beams, 2) are its beams in the robot's
    frame. Beams are thinned to what the cells need at the radius, and every second of them
    begins half way to it: nearer, its neighbours are dense enough.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    half = grid.shape[0] // 2
    eye_x = (pose[0] + cos * mount[0] - sin * mount[1] - centre[0]) / cell + half
    eye_y = (pose[1] + sin * mount[0] + cos * mount[1] - centre[1]) / cell + half
    stride = max(1, int(0.5 * cell / (spacing * radius)))
    size = np.uint64(grid.shape[0])
    new = 0
    far_only = False
    for k in range(0, ranges.shape[0], stride):
        reach = min(ranges[k], radius)
        steps = int(1.5 * reach / cell) + 1
        along = reach / (steps * cell)
        dx = (cos * directions[k, 0] - sin * directions[k, 1]) * along
        dy = (sin * directions[k, 0] + cos * directions[k, 1]) * along
        first = int(0.75 * radius / cell) if far_only else 0
        far_only = not far_only
        x, step_x = int((eye_x + (first + 0.5) * dx) * _ONE), int(dx * _ONE)
        y, step_y = int((eye_y + (first + 0.5) * dy) * _ONE), int(dy * _ONE)
        for _ in range(first, steps):
            column, row = np.uint64(x >> 32), np.uint64(y >> 32)
            if column < size and row < size:
                bit = np.uint64(1) << (column & np.uint64(63))
                word = grid[row, column >> np.uint64(6)]
                if word & bit == 0:
                    grid[row, column >> np.uint64(6)] = word | bit
                    new += 1
            x += step_x
            y += step_y
    return new


@njit(cache=True, error_model="numpy")
def cut_patch(
    grid: np.ndarray,
    cell: float,
    centre: tuple[float, float],
    pose: np.ndarray,
    patch_cell: float,
    width: int,
    patch: np.ndarray,
) -> None:
    """Fill `patch`, row by row of `width` cells, with the cells around a pose: 1 covered, -1 not.

    Row 0 lies farthest ahead of the robot, column 0 farthest to its left.
    """
    size = np.uint64(grid.shape[0])
    half = grid.shape[0] // 2
    cos, sin = math.cos(pose[2]) * patch_cell / cell, math.sin(pose[2]) * patch_cell / cell
    middle_x = (pose[0] - centre[0]) / cell + half
    middle_y = (pose[1] - centre[1]) / cell + half
    left = (width - 1) / 2
    step_x, step_y = int(sin * _ONE), int(-cos * _ONE)
    for row in range(width):
        forward = (width - 1) / 2 - row
        x = int((middle_x + cos * forward - sin * left) * _ONE)
        y = int((middle_y + sin * forward + cos * left) * _ONE)
        for column in range(width):
            cell_x, cell_y = np.uint64(x >> 32), np.uint64(y >> 32)
            covered = np.uint64(0)
            if cell_x < size and cell_y < size:
                word = grid[cell_y, cell_x >> np.uint64(6)]
                covered = (word >> (cell_x & np.uint64(63))) & np.uint64(1)
            patch[row * width + column] = 2.0 * np.int64(covered) - 1.0
            x += step_x
            y += step_y


@njit(cache=True, error_model="numpy")
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
            x1, y1 = corners[last, 0], corners[last, 1]
            x2, y2 = corners[k, 0], corners[k, 1]
            if (y1 > y) != (y2 > y) and x < x1 + (y - y1) / (y2 - y1) * (x2 - x1):
                inside = not inside
            last = k
        if inside:
            return room
        start = ends[room]
    return -1


@njit(cache=True, error_model="numpy")
def log_scale(length: float, knee: float, longest: float) -> float:
    """A length as a number from -1 at 0 to 1 at `longest` and beyond, finest where short."""
    share = math.log1p(min(length, longest) / knee) / math.log1p(longest / knee)
    return min(2.0 * share - 1.0, 1.0)


@njit(cache=True, error_model="numpy")
def scale_ranges(ranges: np.ndarray, knee: float, longest: float, scaled: np.ndarray) -> None:
    """Fill the first of `scaled` with ranges (m): 1 at 0, -1 at `longest` and beyond.

    What `log_scale` does, negated, for many lengths at once: a number is 2^e m with m in
    [1, 2), and log m = log √2 + 2 artanh t with t = (m - √2) / (m + √2), whose series
    is cut where it is below 1e-9. The loops hold nothing but arithmetic, for the compiler
    to make vector instructions of.
    """
    beams = ranges.shape[0]
    numbers = np.empty(beams)
    exponents = np.empty(beams)
    bits = numbers.view(np.int64)
    for k in range(beams):
        numbers[k] = 1.0 + min(ranges[k], longest) / knee
    for k in range(beams):
        exponents[k] = (bits[k] >> 52) - 1023
        bits[k] = (bits[k] & 0xFFFFFFFFFFFFF) | (1023 << 52)
    root = math.sqrt(2.0)
    share = 2.0 / math.log1p(longest / knee)
    for k in range(beams):
        t = (numbers[k] - root) / (numbers[k] + root)
        s = t * t
        series = 1 + s * (1 / 3 + s * (1 / 5 + s * (1 / 7 + s * (1 / 9 + s / 11))))
        log = (exponents[k] + 0.5) * math.log(2.0) + 2.0 * t * series
        scaled[k] = min(max(1.0 - share * log, -1.0), 1.0)


@njit(cache=True, error_model="numpy")
def observe_motions(
    motion: np.ndarray,
    heading: float,
    home: np.ndarray,
    scales: tuple[float, float, float, float],
    row: np.ndarray,
) -> None:
    """Fill `row` (8,) with the parts motion, heading and home of an observation.

    `scales` are the step's length and turn and the knee and range of home's distance.
    """
    step_length, step_turn, knee, longest = scales
    for i in range(3):
        share = motion[i] / (step_length if i < 2 else step_turn)
        row[i] = min(max(share, -1.0), 1.0)
    row[3], row[4] = math.cos(heading), math.sin(heading)
    distance = math.hypot(home[0], home[1])
    row[5], row[6] = 1.0, 0.0
    if distance > 0.0:
        row[5] = min(max(home[0] / distance, -1.0), 1.0)
        row[6] = min(max(home[1] / distance, -1.0), 1.0)
    row[7] = log_scale(distance, knee, longest)


@njit(cache=True, error_model="numpy")
def reckon(rows: np.ndarray, motions: np.ndarray, beliefs: np.ndarray, homes: np.ndarray) -> None:
    """Add the motions measured to beliefs x, y, heading (n, 3), and find home from there."""
    for i in rows:
        belief, motion, home = beliefs[i], motions[i], homes[i]
        cos, sin = math.cos(belief[2]), math.sin(belief[2])
        belief[0] += cos * motion[0] - sin * motion[1]
        belief[1] += sin * motion[0] + cos * motion[1]
        belief[2] = (belief[2] + motion[2] + math.pi) % (2 * math.pi) - math.pi
        cos, sin = math.cos(belief[2]), math.sin(belief[2])
        home[0] = -cos * belief[0] - sin * belief[1]
        home[1] = sin * belief[0] - cos * belief[1]
        home[2] = (math.pi - belief[2]) % (2 * math.pi) - math.pi


@njit(cache=True, error_model="numpy")
def find_errors(
    starts: np.ndarray, poses: np.ndarray, beliefs: np.ndarray, errors: np.ndarray
) -> None:
    """Fill `errors` with the distances from true positions to believed ones.

    A belief is in the frame of the pose in `starts`.
    """
    for i in range(errors.shape[0]):
        cos, sin = math.cos(starts[i, 2]), math.sin(starts[i, 2])
        x = starts[i, 0] + cos * beliefs[i, 0] - sin * beliefs[i, 1]
        y = starts[i, 1] + sin * beliefs[i, 0] + cos * beliefs[i, 1]
        errors[i] = math.hypot(x - poses[i, 0], y - poses[i, 1])
