"""Compiled inner loops of the ray caster.

With wall ends a and b in the frame of the laser, a clockwise of b, a beam in direction u
meets the wall where u is between a and b, and there the inverse range is linear in u:
1/r = (u × (b - a)) / (a × b). The nearest wall along each beam is a running maximum of
multiply-adds over the beams that may meet it: nothing is divided, and no angle computed, once
a wall's coefficients are known. Directions are compared by numbers that grow with them (see
`turned`). The number of an end that two walls share is the same for both, so that no beam slips
between them. Beams are taken in blocks, each with the walls that reach into it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from albot_core.geometry.directions import turned
from albot_core.kernels.bits import lowest_bit
from albot_core.kernels.compiled import ZERO, kernel
from albot_core.kernels.simd import (
    LANES,
    LANES32,
    FloatTable,
    FloatVector,
    float32_predicate,
    mixed_predicate,
    padded_length,
)
from albot_env.sim.plane_kernels import Stance, mounted, stance_at
from albot_env.sim.wall_index import Walls

_GRAZING = 1000.0
"""Float32 costs less than 0.2 mm while range² / distance to the wall's line is below (m)."""
_EDGE_ON = 1e-12
"""A wall is seen edge-on where it subtends an angle (rad) below: it may be nothing but rounding."""
_STRIP: Any = np.int64(64)
"""Walls that are taken together: a word has a bit for each."""


class Fan(NamedTuple):
    """A laser's beams. The fan's x axis runs through its middle."""

    beams: int
    directions: np.ndarray
    """(2, beams) float64: cosine and sine of the beams' bearings from the middle."""
    padded: np.ndarray
    """(3, blocks × LANES32) float32: the same, and the beams' directions as `turned` tells them,
    to whole blocks: no range is found along what the last beam is followed by."""
    reach: float
    """Distance at and beyond which a range is infinite (m)."""
    mount: Stance
    """Where on the robot the laser is, and where the middle of the fan points."""
    behind: float
    """Nothing with both ends at x below this (m) is in any beam's way."""


U, V, W, NEAREST = range(4)
"""Rows of `Desk.beams`."""


class Desk(NamedTuple):
    """Room to work in while scanning."""

    beams: np.ndarray
    """(4, blocks × LANES32) float32: the beams' directions, as vectors and as `turned` tells them,
    and the inverse ranges along them."""
    walls: np.ndarray
    """(4, room) float64: the ends x, y of the walls in question, a column each (m)."""
    lines: np.ndarray
    """(4, room) float32: their lines (see P and so on)."""
    bits: np.ndarray
    """(beams,) uint64: random bits for the errors of the beams."""


AX, AY, BX, BY = range(4)
"""Rows of `Desk.walls`, in the frame of the laser."""
P, Q, FROM, TO = range(4)
"""Rows of `Desk.lines`: 1/r along the laser's axes; and between which directions beams meet a wall
(see `turned`), which are none where float32 is too coarse for it, or it is seen edge-on."""


@kernel(arrays=True)
def make_desk(fan: Fan, room: int) -> Desk:
    """A desk for so many walls."""
    beams = np.empty((4, fan.padded.shape[1]), np.float32)
    beams[:NEAREST] = fan.padded
    columns = 2 * padded_length(room) + _STRIP  # Some are taken twice, and a strip is asked whole.
    walls, lines = np.empty((4, columns)), np.empty((4, columns), np.float32)
    return Desk(beams, walls, lines, np.empty(fan.beams, np.uint64))


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
        scan(fan, index, cells[i], nothing, 0, 0, stance_at(poses[i]), desk, ranges[i])


@kernel()
def scan(
    fan: Fan,
    index: Walls,
    cell: int,
    things: np.ndarray,
    first: int,
    last: int,
    robot: Stance,
    desk: Desk,
    ranges: np.ndarray,
) -> None:
    """Fill `ranges` (beams,) with what a robot in a cell sees.

    Beside the walls it sees the segments first to last of `things` (n, 4).
    """
    eye = mounted(robot, fan.mount)
    count = ZERO
    for m in index.members[index.spans[cell, 0] : index.spans[cell, 1]]:
        count += _take(index.walls, m, eye, fan.behind, desk.walls, count)
    for j in range(first, last):
        count += _take(things, j, eye, fan.behind, desk.walls, count)
    horizon = np.float32(1.0 / fan.reach)
    for k in range(desk.beams.shape[1]):
        desk.beams[NEAREST, k] = horizon
    count = _line_up(fan, count, desk)
    for start in range(0, count, _STRIP):
        _raise_all(start, count - start, desk)
    for k in range(fan.beams):
        inverse = desk.beams[NEAREST, k]
        ranges[k] = np.float32(1.0) / inverse if inverse > horizon else np.inf


@kernel()
def _take(
    segments: np.ndarray,
    k: int,
    eye: Stance,
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
def _line_up(fan: Fan, count: int, desk: Desk) -> int:
    """Find the lines of the first walls of the desk; how many these are.

    A wall that passes behind the laser has two, one for each side. Beams are held at once against
    walls for which float32 is too coarse.
    """
    walls, lines = desk.walls, desk.lines
    lined_up = padded_length(count)
    for k in range(count, lined_up):  # Points are seen edge-on.
        walls[AX, k] = walls[AY, k] = walls[BX, k] = walls[BY, k] = 0.0
    for first in range(0, count, LANES):
        odd = _draw_lines((walls, lines), (first, first), (fan.reach * fan.reach,))
        while odd:
            lane = lowest_bit(odd)
            odd &= odd - 1
            j = first + lane % LANES
            if lane < LANES:
                _raise_grazing(desk.beams, fan.directions, walls, j)
                continue
            lines[P, lined_up], lines[Q, lined_up] = lines[P, j], lines[Q, j]
            lines[FROM, lined_up], lines[TO, lined_up] = -np.inf, turned(walls[BX, j], walls[BY, j])
            lined_up += 1
    return lined_up


@mixed_predicate
def _draw_lines(
    walls: FloatTable, lines: FloatTable, reach2: FloatVector
) -> tuple[FloatVector, FloatVector]:
    """Order the ends of walls, and find their lines.

    Given is the square of the laser's reach (m²). Answered is for which of them float32 is too
    coarse, and of the others which pass behind the laser: their lines are those to its left.
    """
    sx, sy, ex, ey = (walls[row] for row in (AX, AY, BX, BY))
    one, other = sx * ey, sy * ex
    area = one - other
    flip = area < 0.0
    ax, ay, bx, by = ex.where(sx, flip), ey.where(sy, flip), sx.where(ex, flip), sy.where(ey, flip)
    per_area = 1.0 / area.abs()
    p, q = (by - ay) * per_area, (ax - bx) * per_area
    walls[AX], walls[AY], walls[BX], walls[BY] = ax, ay, bx, by
    far = (ax * ax + ay * ay).maximum(bx * bx + by * by).minimum(reach2)
    graze = far * far * (p * p + q * q)
    seen = area.abs() > (one.abs() + other.abs()) * _EDGE_ON
    coarse = graze > _GRAZING * _GRAZING
    plain = seen & (graze <= _GRAZING * _GRAZING)
    first, last = _turned(ax, ay), _turned(bx, by)
    behind = first > last
    lines[P], lines[Q] = p.to_float32(), q.to_float32()
    lines[FROM] = first.where(np.inf, plain).to_float32()
    lines[TO] = (last * 0.0 + np.inf).where(last, behind).to_float32()
    return seen & coarse, plain & behind


def _turned(u: FloatVector, v: FloatVector) -> FloatVector:
    """What `turned` makes of directions."""
    part = v / (u.abs() + v.abs()).maximum(1e-300)
    behind = (2.0 - part).where(-2.0 - part, v >= 0.0)
    return part.where(behind, u >= 0.0)


@kernel()
def _raise_all(start: int, count: int, desk: Desk) -> None:
    """Raise the inverse ranges to those of the lines of a strip, or of so many if fewer."""
    beams, lines = desk.beams, desk.lines
    for first in range(0, beams.shape[1], LANES32):
        between = beams[W, first], beams[W, first + LANES32 - 1]
        walls = 0
        for group in range(0, min(count, _STRIP), LANES32):
            walls |= _reaching(lines, start + group, between) << group
        if count < _STRIP:
            walls &= (1 << count) - 1
        while walls:
            i, walls = _take_next(walls, ZERO)
            j, walls = _take_next(walls, i)
            k, walls = _take_next(walls, j)
            m, walls = _take_next(walls, k)
            pair = (*_line(lines, start + i), *_line(lines, start + j))
            other = (*_line(lines, start + k), *_line(lines, start + m))
            _raise(beams, first, (*pair, *other))


@float32_predicate
def _reaching(lines: FloatTable, first: FloatVector, last: FloatVector) -> FloatVector:
    """Which walls do beams meet that lie between two directions."""
    return (lines[FROM] <= last) & (lines[TO] >= first)


@kernel()
def _take_next(walls: int, before: int) -> tuple[int, int]:
    """The first of some walls, and the others; the one before where none is left.

    To take one twice changes nothing, and costs less than to ask whether one is left.
    """
    return lowest_bit(walls) if walls else before, walls & (walls - 1)


@kernel()
def _line(lines: np.ndarray, k: int) -> tuple[float, float, float, float]:
    return lines[P, k], lines[Q, k], lines[FROM, k], lines[TO, k]


@float32_predicate
def _raise(beams: FloatTable, *lines: FloatVector) -> FloatVector:
    """Raise the inverse ranges along a block of beams to those of walls, where they meet them."""
    u, v, w, nearest = beams[U], beams[V], beams[W], beams[NEAREST]
    for k in range(0, len(lines), 4):
        p, q, first, last = lines[k : k + 4]
        inverse = p * u + q * v
        nearest = inverse.where(nearest, (w >= first) & (w <= last) & (inverse > nearest))
    beams[NEAREST] = nearest
    return nearest > 0.0


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
