"""Compiled inner loops of the ray caster.

With wall ends a and b in the frame of the laser, a clockwise of b, a beam in direction u
meets the wall where a × u >= 0 and b × u <= 0, and there the inverse range is linear in
u: 1/r = (u × (b - a)) / (a × b). The nearest wall along each beam is a running maximum of
multiply-adds over the beams that may meet it, which the compiler turns into vector
instructions: nothing is divided, and no angle computed, once a wall's coefficients are
known. Which beams may meet it a table tells, by the wall's ends. Both tests at an end that
two walls share are the same arithmetic, so that no beam slips between them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from albot_core.geometry.directions import turned
from albot_env.sim.wall_index import Walls

BLOCK = 16
"""Beams are taken by so many at a time."""

_ZERO: Any = np.int64(0)
"""A plain 0 is a type of its own to numba: what it is passed to would be compiled twice."""

_GRAZING = 1000.0
"""Float32 costs less than 0.2 mm while range² / distance to the wall's line is below (m)."""


class Fan(NamedTuple):
    """A laser's beams. The fan's x axis runs through its middle."""

    beams: int
    directions: np.ndarray
    """(2, beams) float64: cosine and sine of the beams' bearings from the middle."""
    cosines: np.ndarray
    """(blocks, BLOCK) float32: the same, padded; a count that the compiler knows in the inner
    loops makes them whole vector instructions."""
    sines: np.ndarray
    """(blocks, BLOCK) float32: the same."""
    reach: float
    """Distance at and beyond which a range is infinite (m)."""
    x: float
    """Where on the robot the laser is (m)…"""
    y: float
    """…"""
    heading: float
    """…and the middle of the fan from the robot's heading (rad)."""
    behind: float
    """Nothing with both ends at x below this (m) is in any beam's way."""
    blocks: np.ndarray
    """(2, n) int64: for directions, finely divided, the block of the first beam not clockwise
    of it and the one behind the block of the last not counter-clockwise (see `turned`)."""


class Desk(NamedTuple):
    """Room to work in while scanning."""

    nearest: np.ndarray
    """(blocks, BLOCK) float32: inverse ranges along the beams."""
    ends: np.ndarray
    """(room, 4) float64: ends of the walls in question x1, y1, x2, y2."""
    lines: np.ndarray
    """(9, room) float64: of each, see RIGHT_X and so on."""


RIGHT_X, RIGHT_Y, LEFT_X, LEFT_Y, INVERSE_X, INVERSE_Y, FIRST, LAST, FINE = range(9)
"""Rows of `Desk.lines`: ends a and b in the frame of the laser, 1/r along its axes, the
first and last part of the full turn that the wall is in, and how fine float32 is there."""


@njit(cache=True, error_model="numpy")
def make_desk(fan: Fan, room: int) -> Desk:
    """A desk for so many walls."""
    return Desk(np.empty(fan.cosines.shape, np.float32), np.empty((room, 4)), np.empty((9, room)))


@njit(cache=True, error_model="numpy", nogil=True)
def scan_poses(
    fan: Fan,
    index: Walls,
    cells: np.ndarray,
    poses: np.ndarray,
    ranges: np.ndarray,
) -> None:
    """Fill `ranges` (n, beams) with what robots at `poses` (n, 3) in `cells` (n,) see."""
    nothing = np.empty((0, 4))
    desk = make_desk(fan, index.walls.shape[0])
    for i in range(poses.shape[0]):
        scan(fan, index, cells[i], nothing, 0, 0, poses[i], desk, ranges[i])


@njit(cache=True, error_model="numpy")
def scan(
    fan: Fan,
    index: Walls,
    cell: int,
    things: np.ndarray,
    first: int,
    last: int,
    pose: np.ndarray,
    desk: Desk,
    ranges: np.ndarray,
) -> None:
    """Fill `ranges` (beams,) with what a robot at `pose` (3,) in a cell sees.

    Beside the walls it sees the segments first to last of `things` (n, 4).
    """
    nearest = desk.nearest
    horizon = np.float32(1.0 / fan.reach)
    for block in range(nearest.shape[0]):
        for k in range(BLOCK):
            nearest[block, k] = horizon
    walls, members, ends = index.walls, index.members, desk.ends
    count = _ZERO
    for m in range(index.spans[cell, 0], index.spans[cell, 1]):
        for column in range(4):
            ends[count, column] = walls[members[m], column]
        count += 1
    for j in range(first, last):
        for column in range(4):
            ends[count, column] = things[j, column]
        count += 1
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x = pose[0] + cos * fan.x - sin * fan.y
    y = pose[1] + sin * fan.x + cos * fan.y
    _line_up(ends, count, x, y, pose[2] + fan.heading, fan, desk.lines)
    _take_nearest(fan, count, desk.lines, nearest)
    for k in range(fan.beams):
        inverse = nearest[k // BLOCK, k % BLOCK]
        ranges[k] = 1.0 / inverse if inverse > horizon else np.inf


@njit(cache=True, error_model="numpy")
def _line_up(
    ends: np.ndarray, count: int, x: float, y: float, heading: float, fan: Fan, lines: np.ndarray
) -> None:
    """Fill `lines` for the first walls of `ends`, seen from a laser at x, y, heading.

    Walls seen edge-on or not at all are in no part of the turn. Nothing branches here, for
    the compiler to take several walls at once.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    parts = fan.blocks.shape[1]
    reach2, behind = fan.reach * fan.reach, fan.behind
    for j in range(count):
        sx, sy = ends[j, 0] - x, ends[j, 1] - y
        ex, ey = ends[j, 2] - x, ends[j, 3] - y
        sx, sy = cos * sx + sin * sy, cos * sy - sin * sx
        ex, ey = cos * ex + sin * ey, cos * ey - sin * ex
        area = sx * ey - sy * ex
        flip = area < 0.0
        ax, ay = (ex if flip else sx), (ey if flip else sy)
        bx, by = (sx if flip else ex), (sy if flip else ey)
        area = abs(area)
        p, q = (by - ay) / area, (ax - bx) / area
        far = min(max(ax * ax + ay * ay, bx * bx + by * by), reach2)
        unseen = area == 0.0 or (ax < behind and bx < behind)
        lines[RIGHT_X, j], lines[RIGHT_Y, j] = ax, ay
        lines[LEFT_X, j], lines[LEFT_Y, j] = bx, by
        lines[INVERSE_X, j], lines[INVERSE_Y, j] = p, q
        lines[FIRST, j] = parts if unseen else (turned(ax, ay) + 2.0) / 4.0 * parts
        lines[LAST, j] = -1.0 if unseen else (turned(bx, by) + 2.0) / 4.0 * parts
        lines[FINE, j] = far * far * (p * p + q * q)


@njit(cache=True, error_model="numpy")
def _take_nearest(fan: Fan, count: int, lines: np.ndarray, nearest: np.ndarray) -> None:
    """Raise the inverse ranges `nearest` to those of the first walls of `lines`."""
    blocks, cosines, sines = fan.blocks, fan.cosines, fan.sines
    last_part = blocks.shape[1] - 1
    for j in range(count):
        if lines[LAST, j] < 0.0:
            continue
        ax, ay, bx, by = lines[RIGHT_X, j], lines[RIGHT_Y, j], lines[LEFT_X, j], lines[LEFT_Y, j]
        p, q = lines[INVERSE_X, j], lines[INVERSE_Y, j]
        if lines[FINE, j] > _GRAZING * _GRAZING:
            _take_grazing(nearest, fan.directions, ax, ay, bx, by, p, q)
            continue
        begin = blocks[0, min(int(lines[FIRST, j]), last_part)]
        end = blocks[1, min(int(lines[LAST, j]), last_part)]
        if lines[FIRST, j] > lines[LAST, j]:  # The wall passes behind the laser.
            begin, end = 0, nearest.shape[0]
        ax32, ay32 = np.float32(ax), np.float32(ay)
        bx32, by32 = np.float32(bx), np.float32(by)
        p32, q32 = np.float32(p), np.float32(q)
        for block in range(begin, end):
            for k in range(BLOCK):
                u, v = cosines[block, k], sines[block, k]
                inverse = p32 * u + q32 * v
                if ax32 * v - ay32 * u < 0 or bx32 * v - by32 * u > 0:
                    inverse = np.float32(0.0)
                nearest[block, k] = max(nearest[block, k], inverse)


@njit(cache=True, error_model="numpy")
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
    for k in range(directions.shape[1]):
        u, v = directions[0, k], directions[1, k]
        if ax * v - ay * u >= 0.0 and bx * v - by * u <= 0.0:
            block, place = k // BLOCK, k % BLOCK
            nearest[block, place] = max(nearest[block, place], np.float32(p * u + q * v))
