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
from albot_env.sim.lanes import LANES, LANES32, Lanes, Table, question, question32, whole_lanes
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
    walls: np.ndarray
    """(WALL_ROWS, room) float64: the walls in question, a column each (see AX and so on)."""
    spans: np.ndarray
    """(room, 2) int64: the first of the blocks that each may reach into, and the one behind
    the last, which is GRAZING where float32 is too coarse; none where it is seen edge-on."""


AX, AY, BX, BY, P, Q, AREA, FROM, TO, GRAZE = range(10)
"""Rows of `Desk.walls`, in the frame of the laser: ends a and b (m), and 1/r along its axes; twice
the area between a wall and the laser (m²); the directions of its ends, in parts of the full turn;
and the square of the length (m) that `_GRAZING` is compared with."""
WALL_ROWS = 10
"""How many they are."""


@kernel(arrays=True)
def make_desk(fan: Fan, room: int) -> Desk:
    """A desk for so many walls."""
    beams = np.empty((3, fan.padded.shape[1]), np.float32)
    for k in range(fan.padded.shape[1]):
        beams[U, k], beams[V, k] = fan.padded[0, k], fan.padded[1, k]
    columns = whole_lanes(room)
    return Desk(beams, np.empty((WALL_ROWS, columns)), np.empty((columns, 2), np.int64))


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
        count += _take(index.walls, m, eye, fan.behind, desk.walls, count)
    for j in range(first, last):
        count += _take(things, j, eye, fan.behind, desk.walls, count)
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
    walls: np.ndarray,
    count: int,
) -> int:
    """Write a segment's ends, seen from x, y, cosine, sine, into column `count`; 0 if behind."""
    x, y, cos, sin = eye
    sx, sy = segments[k, 0] - x, segments[k, 1] - y
    ex, ey = segments[k, 2] - x, segments[k, 3] - y
    sx, sy = cos * sx + sin * sy, cos * sy - sin * sx
    ex, ey = cos * ex + sin * ey, cos * ey - sin * ex
    walls[AX, count], walls[AY, count], walls[BX, count], walls[BY, count] = sx, sy, ex, ey
    return 1 if max(sx, ex) >= behind else 0


@kernel()
def _line_up(fan: Fan, count: int, desk: Desk) -> None:
    """Find, of the first walls of the desk, the lines and the blocks that they reach into."""
    walls, spans, blocks = desk.walls, desk.spans, fan.blocks
    parts, all_blocks = blocks.shape[1], desk.beams.shape[1] // LANES32
    for first in range(0, count, LANES):
        _draw_lines(walls, first, (fan.reach * fan.reach, 0.25 * parts))
    for j in range(count):
        first, last = walls[FROM, j], walls[TO, j]
        begin = blocks[0, min(int(first), parts - 1)]
        end = blocks[1, min(int(last), parts - 1)]
        if first > last:  # The wall passes behind the laser.
            begin, end = 0, all_blocks
        if walls[GRAZE, j] > _GRAZING * _GRAZING:
            begin, end = 0, GRAZING
        spans[j, 0], spans[j, 1] = begin, (end if walls[AREA, j] != 0.0 else _ZERO)


@question
def _draw_lines(walls: Table, reach2: Lanes, quarter: Lanes) -> Lanes:
    """Order the ends of walls, and find their lines; which are seen edge-on.

    Given are the square of the laser's reach (m²) and a quarter of the parts of a full turn.
    """
    sx, sy, ex, ey = (walls[row] for row in (AX, AY, BX, BY))
    area = sx * ey - sy * ex
    flip = area < 0.0
    ax, ay, bx, by = ex.where(sx, flip), ey.where(sy, flip), sx.where(ex, flip), sy.where(ey, flip)
    per_area = 1.0 / area.size()
    p, q = (by - ay) * per_area, (ax - bx) * per_area
    far = (ax * ax + ay * ay).most(bx * bx + by * by).least(reach2)
    walls[AX], walls[AY], walls[BX], walls[BY], walls[P], walls[Q] = ax, ay, bx, by, p, q
    walls[AREA], walls[GRAZE] = area.size(), far * far * (p * p + q * q)
    walls[FROM] = (_turned(ax, ay) + 2.0) * quarter
    walls[TO] = (_turned(bx, by) + 2.0) * quarter
    return area.size() <= 0.0


def _turned(u: Lanes, v: Lanes) -> Lanes:
    """What `turned` makes of directions."""
    part = v / (u.size() + v.size()).most(1e-300)
    behind = (2.0 - part).where(-2.0 - part, v >= 0.0)
    return part.where(behind, u >= 0.0)


@kernel()
def _raise_all(fan: Fan, count: int, desk: Desk) -> None:
    """Raise the inverse ranges to those of the first walls of the desk."""
    walls = desk.walls
    for j in range(count):
        begin, end = desk.spans[j]
        ax, ay = np.float32(walls[AX, j]), np.float32(walls[AY, j])
        bx, by = np.float32(walls[BX, j]), np.float32(walls[BY, j])
        p, q = np.float32(walls[P, j]), np.float32(walls[Q, j])
        for block in range(begin, end):
            _raise(desk.beams, block * LANES32, (ax, ay, bx, by, p, q))
        if end == GRAZING:
            _raise_grazing(desk.beams, fan.directions, walls, j)


@question32
def _raise(beams: Table, *line: Lanes) -> Lanes:
    """Raise the inverse ranges along a block of beams to those of a wall, where they meet it."""
    ax, ay, bx, by, p, q = line
    u, v, before = beams[U], beams[V], beams[NEAREST]
    met = (ax * v - ay * u >= 0.0) & (bx * v - by * u <= 0.0)
    beams[NEAREST] = (p * u + q * v).where(before, met).most(before)
    return met


@kernel()
def _raise_grazing(beams: np.ndarray, directions: np.ndarray, walls: np.ndarray, j: int) -> None:
    """Take in, with float64, a wall seen so edge-on that float32 is too coarse."""
    ax, ay, bx, by = walls[AX, j], walls[AY, j], walls[BX, j], walls[BY, j]
    area = ax * by - ay * bx
    p, q = (by - ay) / area, (ax - bx) / area
    for k in range(directions.shape[1]):
        u, v = directions[0, k], directions[1, k]
        if ax * v - ay * u >= 0.0 and bx * v - by * u <= 0.0:
            beams[NEAREST, k] = max(beams[NEAREST, k], np.float32(p * u + q * v))
