"""Lines as rows, and functions to compare them. Compiled.

A row is x1, y1, x2, y2 (m), length (m), heading (rad), and the unit vector along the line.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.pose_kernels import transform_point
from albot_core.geometry.segment_kernels import heading_of
from albot_core.kernels.compiled import kernel

MIN_OVERLAP = 0.3
"""Two lines overlap if they share at least this part of the shorter one's length."""

Ends = tuple[float, float, float, float]
"""A line's ends x1, y1, x2, y2 (m)."""


@kernel()
def describe_all(lines: np.ndarray, min_length: float, rows: np.ndarray) -> int:
    """Fill the rows of the lines of at least this length; return their number."""
    kept = 0
    for k in range(lines.shape[0]):
        if line_length(lines[k]) >= min_length:
            describe(lines[k], rows[kept])
            kept += 1
    return kept


@kernel()
def describe(line: np.ndarray, row: np.ndarray) -> None:
    """Fill a row: x1, y1, x2, y2, length, heading, and the unit vector along the line."""
    measure(line, row)
    row[5] = heading_of(line)


@kernel()
def measure(line: np.ndarray, row: np.ndarray) -> None:
    """Fill a row except its heading, whose computation takes longer than all the rest."""
    for i in range(4):
        row[i] = line[i]
    length = line_length(line)
    row[4] = length
    row[6] = (line[2] - line[0]) / length
    row[7] = (line[3] - line[1]) / length


@kernel()
def line_length(line: np.ndarray) -> float:
    """Return the length of a line (m)."""
    x, y = line[2] - line[0], line[3] - line[1]
    return float(np.sqrt(x * x + y * y))


@kernel()
def wrap(angle: float) -> float:
    """Return the angle in [-pi, pi), for angles in [-3 pi, 3 pi): all sums of two headings."""
    if angle >= np.pi:
        return angle - 2 * np.pi
    if angle < -np.pi:
        return angle + 2 * np.pi
    return angle


@kernel()
def moved_ends(row: np.ndarray, motion: np.ndarray, cos: float, sin: float) -> Ends:
    """Return a line's ends after a motion (3,), given the cosine and sine of its turn."""
    x1, y1 = transform_point(motion, cos, sin, row[0], row[1])
    x2, y2 = transform_point(motion, cos, sin, row[2], row[3])
    return x1, y1, x2, y2


@kernel()
def beside(wall: np.ndarray, ends: Ends, length: float) -> float:
    """Return a line's mean distance from a wall (m), infinity if they do not overlap.

    `length` is the line's length (m).
    """
    ux, uy = wall[6], wall[7]
    dx, dy = ends[0] - wall[0], ends[1] - wall[1]
    first, aside = ux * dx + uy * dy, ux * dy - uy * dx
    dx, dy = ends[2] - wall[0], ends[3] - wall[1]
    last = ux * dx + uy * dy
    aside = 0.5 * abs(aside + ux * dy - uy * dx)
    overlap = min(last, wall[4]) - max(first, 0.0)
    return aside if overlap >= MIN_OVERLAP * min(length, wall[4]) else np.inf
