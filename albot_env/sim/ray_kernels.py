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

from albot_core.compiled import kernel
from albot_core.geometry.directions import turned
from albot_env.sim.lanes import LANES32, Lanes, Table, question32
from albot_env.sim.wall_index import Walls

GRAZING: Any = np.int64(-1)
"""In place of a wall's last block: float32 is too coarse for it."""

_ZERO: Any = np.int64(0)
"""A plain 0 is a type of its own to numba: what it is passed to would be compiled twice."""

_GRAZING = 1000.0
"""Float32 costs less than 0.2 mm while range² / distance to the wall's line is below (m)."""


class Fan(NamedTuple):
    """A laser's beams. The fan's x axis runs through its middle."""

    beams: int
    directions: np.ndarray
    """(2, beams) float64: cosine and sine of the beams' bearings from the middle."""
    padded: np.ndarray
    """(2, blocks × LANES32) float32: the same, and zeros, to whole blocks."""
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


NEAREST, U, V = range(3)
"""Rows of `Desk.beams`."""


class Desk(NamedTuple):
    """Room to work in while scanning."""

    beams: np.ndarray
    """(3, blocks × LANES32) float32: inverse ranges along the beams, and their directions."""
    ends: np.ndarray
    """(room, 4) float64: ends x1, y1, x2, y2 of the walls in question, frame of the laser."""
    lines: np.ndarray
    """(room, 6) float32: of each, ends a and b, and 1/r along the laser's axes."""
    spans: np.ndarray
    """(room, 2) int64: the first of the blocks that each may reach into, and the one behind
    the last, which is GRAZING where float32 is too coarse; none where it is seen edge-on."""


@kernel(arrays=True)
def make_desk(fan: Fan, room: int) -> Desk:
    """A desk for so many walls."""
    beams = np.empty((3, fan.padded.shape[1]), np.float32)
    for k in range(fan.padded.shape[1]):
        beams[U, k], beams[V, k] = fan.padded[0, k], fan.padded[1, k]
    return Desk(
        beams,
        np.empty((room, 4)),
        np.empty((room, 6), np.float32),
        np.empty((room, 2), np.int64),
    )


@kernel(arrays=True, nogil=True)
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


@kernel()
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
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x = pose[0] + cos * fan.x - sin * fan.y
    y = pose[1] + sin * fan.x + cos * fan.y
    heading = pose[2] + fan.heading
    eye = x, y, math.cos(heading), math.sin(heading)
    count = _ZERO
    for m in index.members[index.spans[cell, 0] : index.spans[cell, 1]]:
        count += _take(index.walls, m, eye, fan.behind, desk.ends, count)
    for j in range(first, last):
        count += _take(things, j, eye, fan.behind, desk.ends, count)
    _line_up(fan, count, desk)
    horizon = np.float32(1.0 / fan.reach)
    for k in range(desk.beams.shape[1]):
        desk.beams[NEAREST, k] = horizon
    _raise_all(fan, count, desk)
    for k in range(fan.beams):
        inverse = desk.beams[NEAREST, k]
        ranges[k] = np.float32(1.0) / inverse if inverse > horizon else np.inf


@kernel()
def _take(
    segments: np.ndarray,
    k: int,
    eye: tuple[float, float, float, float],
    behind: float,
    ends: np.ndarray,
    count: int,
) -> int:
    """Write a segment's ends, seen from x, y, cosine and sine, into row `count`; 0 if behind."""
    x, y, cos, sin = eye
    sx, sy = segments[k, 0] - x, segments[k, 1] - y
    ex, ey = segments[k, 2] - x, segments[k, 3] - y
    sx, sy = cos * sx + sin * sy, cos * sy - sin * sx
    ex, ey = cos * ex + sin * ey, cos * ey - sin * ex
    ends[count, 0], ends[count, 1], ends[count, 2], ends[count, 3] = sx, sy, ex, ey
    return 1 if max(sx, ex) >= behind else 0


@kernel()
def _line_up(fan: Fan, count: int, desk: Desk) -> None:
    """Find, of the first walls of the desk, the lines and the blocks that they reach into."""
    ends, lines, spans, blocks = desk.ends, desk.lines, desk.spans, fan.blocks
    parts, all_blocks = blocks.shape[1], desk.beams.shape[1] // LANES32
    reach2 = fan.reach * fan.reach
    for j in range(count):
        sx, sy, ex, ey = ends[j, 0], ends[j, 1], ends[j, 2], ends[j, 3]
        area = sx * ey - sy * ex
        flip = area < 0.0
        ax, ay = (ex if flip else sx), (ey if flip else sy)
        bx, by = (sx if flip else ex), (sy if flip else ey)
        per_area = 1.0 / abs(area)
        p, q = (by - ay) * per_area, (ax - bx) * per_area
        lines[j, 0], lines[j, 1], lines[j, 2], lines[j, 3] = ax, ay, bx, by
        lines[j, 4], lines[j, 5] = p, q
        first, last = turned(ax, ay), turned(bx, by)
        begin = blocks[0, min(int((first + 2.0) * 0.25 * parts), parts - 1)]
        end = blocks[1, min(int((last + 2.0) * 0.25 * parts), parts - 1)]
        if first > last:  # The wall passes behind the laser.
            begin, end = 0, all_blocks
        far = min(max(ax * ax + ay * ay, bx * bx + by * by), reach2)
        if far * far * (p * p + q * q) > _GRAZING * _GRAZING:
            begin, end = 0, GRAZING
        spans[j, 0], spans[j, 1] = begin, (end if area != 0.0 else _ZERO)


@kernel()
def _raise_all(fan: Fan, count: int, desk: Desk) -> None:
    """Raise the inverse ranges to those of the first walls of the desk."""
    for j in range(count):
        begin, end = desk.spans[j]
        ax, ay, bx, by, p, q = desk.lines[j]
        for block in range(begin, end):
            _raise(desk.beams, block * LANES32, (ax, ay, bx, by, p, q))
        if end == GRAZING:
            _raise_grazing(desk.beams, fan.directions, desk.ends[j])


@question32
def _raise(beams: Table, *line: Lanes) -> Lanes:
    """Raise the inverse ranges along a block of beams to those of a wall, where they meet it."""
    ax, ay, bx, by, p, q = line
    u, v, before = beams[U], beams[V], beams[NEAREST]
    met = (ax * v - ay * u >= 0.0) & (bx * v - by * u <= 0.0)
    beams[NEAREST] = (p * u + q * v).where(before, met).most(before)
    return met


@kernel()
def _raise_grazing(beams: np.ndarray, directions: np.ndarray, ends: np.ndarray) -> None:
    """Take in, with float64, a wall seen so edge-on that float32 is too coarse."""
    sx, sy, ex, ey = ends
    area = sx * ey - sy * ex
    side = math.copysign(1.0, area)
    p, q = (ey - sy) / area, (sx - ex) / area
    for k in range(directions.shape[1]):
        u, v = directions[0, k], directions[1, k]
        if side * (sx * v - sy * u) >= 0.0 and side * (ex * v - ey * u) <= 0.0:
            beams[NEAREST, k] = max(beams[NEAREST, k], np.float32(p * u + q * v))
