"""Compiled inner loops of the ray caster.

With wall ends a and b in the frame of the laser, a clockwise of b, a beam in direction u
meets the wall where a × u >= 0 and b × u <= 0, and there the inverse range is linear in
u: 1/r = (u × (b - a)) / (a × b). The nearest wall along each beam is a running maximum of
multiply-adds over all beams, which the compiler turns into vector instructions: nothing
is divided, and no angle computed, once a wall's coefficients are known. Both tests at
an end that two walls share are the same arithmetic, so that no beam slips between them.

Arrays: `walls` (n, 4) float64 of ends x1, y1, x2, y2; `directions` (2, padded) float64
cosine and sine of the beams' bearings from the middle of the fan; `frame` float64 of
reach, mount x, y, heading, and the grid's corner x, y, cell size, columns and rows;
`starts` and `members` the walls to look at from each cell,
members[starts[c]:starts[c + 1]], with all walls for a last cell, which stands for
everywhere else.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

PADDING = 64
"""The kernel wants a multiple of this many beams: whole vector instructions, no left-over."""

_GRAZING = 1000.0
"""Float32 costs less than 0.2 mm while range² / distance to the wall's line is below (m)."""


@njit(cache=True, error_model="numpy")
def scan_poses(
    walls: np.ndarray,
    starts: np.ndarray,
    members: np.ndarray,
    directions: np.ndarray,
    frame: np.ndarray,
    poses: np.ndarray,
    ranges: np.ndarray,
) -> None:
    """Fill `ranges` (n, beams) with the ranges seen from robots at `poses` (n, 3)."""
    reach, mount_x, mount_y, mount_heading, left, bottom, cell, columns, rows = frame
    horizon = np.float32(1.0 / reach)
    cosines, sines = directions[0].astype(np.float32), directions[1].astype(np.float32)
    # A fan of at most a half turn sees nothing behind the laser (a micrometre for rounding).
    behind = -1e-6 if directions[0].min() > -1e-9 else -np.inf
    nearest = np.empty(len(cosines), np.float32)
    for i in range(len(poses)):
        cos, sin = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        x = poses[i, 0] + cos * mount_x - sin * mount_y
        y = poses[i, 1] + sin * mount_x + cos * mount_y
        column, row = math.floor((x - left) / cell), math.floor((y - bottom) / cell)
        inside = 0 <= column < columns and 0 <= row < rows
        c = int(row * columns + column) if inside else len(starts) - 2
        cos, sin = math.cos(poses[i, 2] + mount_heading), math.sin(poses[i, 2] + mount_heading)
        nearest[:] = horizon
        for j in members[starts[c] : starts[c + 1]]:
            ax, ay = walls[j, 0] - x, walls[j, 1] - y
            bx, by = walls[j, 2] - x, walls[j, 3] - y
            ax, ay = cos * ax + sin * ay, cos * ay - sin * ax
            bx, by = cos * bx + sin * by, cos * by - sin * bx
            area = ax * by - ay * bx
            if area == 0.0 or (ax < behind and bx < behind):
                continue  # seen edge-on, or not at all
            if area < 0.0:
                ax, ay, bx, by, area = bx, by, ax, ay, -area
            p, q = (by - ay) / area, (ax - bx) / area
            far = min(max(ax * ax + ay * ay, bx * bx + by * by), reach * reach)
            if far * far * (p * p + q * q) > _GRAZING * _GRAZING:
                _take_grazing(nearest, directions, ax, ay, bx, by, p, q)
                continue
            ax32, ay32 = np.float32(ax), np.float32(ay)
            bx32, by32 = np.float32(bx), np.float32(by)
            p32, q32 = np.float32(p), np.float32(q)
            for k in range(len(cosines)):
                u, v = cosines[k], sines[k]
                inverse = p32 * u + q32 * v
                if ax32 * v - ay32 * u < 0 or bx32 * v - by32 * u > 0:
                    inverse = np.float32(0.0)
                nearest[k] = max(nearest[k], inverse)
        for k in range(ranges.shape[1]):
            inverse = nearest[k]
            ranges[i, k] = 1.0 / inverse if inverse > horizon else np.inf


@njit(cache=True)
def _take_grazing(
    nearest: np.ndarray,
    directions: np.ndarray,
    ax: float,
    ay: float,
    bx: float,
    by: float,
    p: float,
    q: float,
) -> None:
    """Take in, with float64, a wall seen so edge-on that float32 is too coarse."""
    for k in range(len(nearest)):
        u, v = directions[0, k], directions[1, k]
        if ax * v - ay * u >= 0.0 and bx * v - by * u <= 0.0:
            nearest[k] = max(nearest[k], np.float32(p * u + q * v))
