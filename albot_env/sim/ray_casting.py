"""Compiled ray casting: where a laser's beams meet walls, and with which errors it says so.

With wall ends a and b in the frame of the laser, a clockwise of b, a beam in direction u
meets the wall where u is between a and b, and there the inverse range is linear in u:
1/r = (u × (b - a)) / (a × b). The nearest wall along each beam is a running maximum of
multiply-adds over the beams that may meet it: nothing is divided, and no angle computed, once
a wall's coefficients are known. Directions are compared by their pseudo-angles. That of an end
which two walls share is the same for both, so that no beam slips between them. Beams are taken
in blocks, each with the walls that reach into it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import pseudo_angle, rotate_back
from albot_core.kernels.bits import lowest_bit
from albot_core.kernels.compiled import ZERO, kernel, load_element
from albot_core.kernels.simd import (
    LANES,
    LANES32,
    FloatTable,
    FloatVector,
    float32_predicate,
    mixed_predicate,
    padded_length,
)
from albot_env.sim.noise import draw
from albot_env.sim.plane_geometry import Transform, compose_transforms, transform_of
from albot_env.sim.visibility import WallTables

_GRAZING = 1000.0
"""Float32 costs less than 0.2 mm while range² / distance to the wall's line is below (m)."""
_EDGE_ON = 1e-12
"""A wall is seen edge-on where it subtends an angle (rad) below: it may be nothing but rounding."""
_STRIP: Any = np.int64(64)
"""Walls that are taken together: a word has a bit for each."""


class BeamGeometry(NamedTuple):
    """A laser's beams, in a frame whose x axis points along the middle one."""

    number: int
    """How many they are."""
    directions: np.ndarray
    """(2, beams) float64: cosine and sine of the beams' bearings from the middle."""
    padded: np.ndarray
    """(3, blocks × LANES32) float32: the same, and the beams' pseudo-angles, filled up
    to whole blocks: no range is read along what follows the last beam."""
    max_range: float
    """Distance at and beyond which a range is infinite (m)."""
    mount: Transform
    """Where on the robot the laser is, and where the middle of the beams points."""
    behind: float
    """Nothing with both ends at x below this (m) is in any beam's way."""


class ScanBuffers(NamedTuple):
    """Room to work in while scanning."""

    rays: np.ndarray
    """(4, blocks × LANES32) float32: the beams' directions, as vectors and as pseudo-angles,
    and the inverse ranges along them."""
    walls: np.ndarray
    """(4, room) float64: the ends x, y of the walls in question, a column each (m)."""
    lines: np.ndarray
    """(4, room) float32: their lines (see P and so on)."""
    bits: np.ndarray
    """(beams,) uint64: random bits for the errors of the beams."""


U, V, W, NEAREST = range(4)
"""Rows of `ScanBuffers.rays`."""
AX, AY, BX, BY = range(4)
"""Rows of `ScanBuffers.walls`, in the frame of the laser."""
P, Q, FROM, TO = range(4)
"""Rows of `ScanBuffers.lines`: 1/r along the laser's axes; and between which directions beams meet
a wall (pseudo-angles), which are none where float32 is too coarse for it, or it is seen edge-on."""


@kernel(arrays=True)
def make_scan_buffers(beams: BeamGeometry, room: int) -> ScanBuffers:
    """Buffers for so many walls."""
    rays = np.empty((4, beams.padded.shape[1]), np.float32)
    for row in range(NEAREST):  # An assignment of the whole takes seconds to compile.
        for k in range(rays.shape[1]):
            rays[row, k] = beams.padded[row, k]
    columns = 2 * padded_length(room) + _STRIP  # Some are taken twice, and a strip is asked whole.
    walls, lines = np.empty((4, columns)), np.empty((4, columns), np.float32)
    return ScanBuffers(rays, walls, lines, np.empty(beams.number, np.uint64))


@kernel(arrays=True, nogil=True)
def scan_poses(
    beams: BeamGeometry, index: WallTables, cells: np.ndarray, poses: np.ndarray, ranges: np.ndarray
) -> None:
    """Fill `ranges` (n, beams) with what robots at `poses` (n, 3) in `cells` (n,) see."""
    nothing = np.empty((0, 4))
    buffers = make_scan_buffers(beams, index.walls.shape[0])
    for i in range(poses.shape[0]):
        scan(beams, index, cells[i], nothing, 0, 0, transform_of(poses[i]), buffers, ranges[i])


@kernel()
def scan(
    beams: BeamGeometry,
    index: WallTables,
    cell: int,
    obstacles: np.ndarray,
    first: int,
    last: int,
    robot: Transform,
    buffers: ScanBuffers,
    ranges: np.ndarray,
) -> None:
    """Fill `ranges` (beams,) with the true ranges (m) of a robot in a cell of the index.

    It sees the cell's walls, and the segments first to last of `obstacles` (n, 4).
    """
    laser = compose_transforms(robot, beams.mount)
    # The walls and obstacles before the laser, in its frame.
    count = ZERO
    for m in index.members[index.spans[cell, 0] : index.spans[cell, 1]]:
        count += _transform_segment(index.walls, m, laser, beams.behind, buffers.walls, count)
    for j in range(first, last):
        count += _transform_segment(obstacles, j, laser, beams.behind, buffers.walls, count)
    # Inverse ranges begin at the horizon, and each wall raises those of the beams that meet it.
    horizon = np.float32(1.0 / beams.max_range)
    for k in range(buffers.rays.shape[1]):
        buffers.rays[NEAREST, k] = horizon
    count = _find_lines(beams, count, buffers)
    for start in range(0, count, _STRIP):
        _cast_strip(start, count - start, buffers)
    for k in range(beams.number):
        inverse = buffers.rays[NEAREST, k]
        ranges[k] = np.float32(1.0) / inverse if inverse > horizon else np.inf


@kernel()
def _transform_segment(
    segments: np.ndarray, k: int, laser: Transform, behind: float, walls: np.ndarray, count: int
) -> int:
    """Write a segment's ends, seen from x, y, cosine, sine, into column `count`; 0 if behind."""
    x, y, cos, sin = laser
    sx, sy = rotate_back(cos, sin, segments[k, 0] - x, segments[k, 1] - y)
    ex, ey = rotate_back(cos, sin, segments[k, 2] - x, segments[k, 3] - y)
    walls[AX, count], walls[AY, count], walls[BX, count], walls[BY, count] = sx, sy, ex, ey
    return 1 if max(sx, ex) >= behind else 0


@kernel()
def _find_lines(beams: BeamGeometry, count: int, buffers: ScanBuffers) -> int:
    """Find the lines of the first walls of the buffers; how many these are.

    A wall that passes behind the laser has two, one for each side. Beams are held at once against
    walls for which float32 is too coarse.
    """
    walls, lines = buffers.walls, buffers.lines
    lined_up = padded_length(count)
    for k in range(count, lined_up):  # Points are seen edge-on.
        walls[AX, k] = walls[AY, k] = walls[BX, k] = walls[BY, k] = 0.0
    squared = (beams.max_range * beams.max_range,)
    for first in range(0, count, LANES):
        odd = _lines_of_walls((walls, lines), (first, first), squared)
        while odd:
            lane = lowest_bit(odd)
            odd &= odd - 1
            j = first + lane % LANES
            if lane < LANES:  # too coarse
                _raise_grazing(buffers.rays, beams.directions, walls, j)
                continue
            lines[P, lined_up], lines[Q, lined_up] = lines[P, j], lines[Q, j]
            lines[FROM, lined_up], lines[TO, lined_up] = (
                -np.inf,
                pseudo_angle(walls[BX, j], walls[BY, j]),
            )
            lined_up += 1
    return lined_up


@mixed_predicate
def _lines_of_walls(
    walls: FloatTable, lines: FloatTable, max_range_squared: FloatVector
) -> tuple[FloatVector, FloatVector]:
    """Order the ends of walls, and find their lines.

    Given is the square of the laser's range (m²). Answered is for which of them float32 is too
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
    far = (ax * ax + ay * ay).maximum(bx * bx + by * by).minimum(max_range_squared)
    graze = far * far * (p * p + q * q)
    seen = area.abs() > (one.abs() + other.abs()) * _EDGE_ON
    coarse = graze > _GRAZING * _GRAZING
    plain = seen & (graze <= _GRAZING * _GRAZING)
    first, last = _pseudo_angles(ax, ay), _pseudo_angles(bx, by)
    behind = first > last
    lines[P], lines[Q] = p.to_float32(), q.to_float32()
    lines[FROM] = first.where(np.inf, plain).to_float32()
    lines[TO] = (last * 0.0 + np.inf).where(last, behind).to_float32()
    return seen & coarse, plain & behind


def _pseudo_angles(u: FloatVector, v: FloatVector) -> FloatVector:
    """The pseudo-angles of directions, as `pseudo_angle` has them."""
    part = v / (u.abs() + v.abs()).maximum(1e-300)
    behind = (2.0 - part).where(-2.0 - part, v >= 0.0)
    return part.where(behind, u >= 0.0)


@kernel()
def _cast_strip(start: int, count: int, buffers: ScanBuffers) -> None:
    """Raise the inverse ranges to those of the lines of a strip, or of so many if fewer."""
    rays, lines = buffers.rays, buffers.lines
    for first in range(0, rays.shape[1], LANES32):
        between = rays[W, first], rays[W, first + LANES32 - 1]
        walls = 0
        for group in range(0, min(count, _STRIP), LANES32):
            walls |= _walls_between(lines, start + group, between) << group
        if count < _STRIP:
            walls &= (1 << count) - 1
        while walls:
            # Four walls at a time.
            i, walls = _next_wall(walls, ZERO)
            j, walls = _next_wall(walls, i)
            k, walls = _next_wall(walls, j)
            m, walls = _next_wall(walls, k)
            pair = (*_line(lines, start + i), *_line(lines, start + j))
            other = (*_line(lines, start + k), *_line(lines, start + m))
            _raise_inverse_ranges(rays, first, (*pair, *other))


@float32_predicate
def _walls_between(lines: FloatTable, first: FloatVector, last: FloatVector) -> FloatVector:
    """Which walls do beams meet that lie between two directions."""
    return (lines[FROM] <= last) & (lines[TO] >= first)


@kernel()
def _next_wall(walls: int, before: int) -> tuple[int, int]:
    """The first of some walls, and the others; the one before where none is left.

    To take one twice changes nothing, and costs less than to ask whether one is left.
    """
    return lowest_bit(walls) if walls else before, walls & (walls - 1)


@kernel()
def _line(lines: np.ndarray, k: int) -> tuple[float, float, float, float]:
    return lines[P, k], lines[Q, k], lines[FROM, k], lines[TO, k]


@float32_predicate
def _raise_inverse_ranges(rays: FloatTable, *lines: FloatVector) -> FloatVector:
    """Raise the inverse ranges along a block of beams to those of walls, where they meet them."""
    u, v, w, nearest = rays[U], rays[V], rays[W], rays[NEAREST]
    for k in range(0, len(lines), 4):
        p, q, first, last = lines[k : k + 4]
        inverse = p * u + q * v
        nearest = inverse.where(nearest, (w >= first) & (w <= last) & (inverse > nearest))
    rays[NEAREST] = nearest
    return nearest > 0.0


@kernel()
def _raise_grazing(rays: np.ndarray, directions: np.ndarray, walls: np.ndarray, j: int) -> None:
    """Take in, with float64, a wall seen so edge-on that float32 is too coarse."""
    ax, ay, bx, by = walls[AX, j], walls[AY, j], walls[BX, j], walls[BY, j]
    area = ax * by - ay * bx
    p, q = (by - ay) / area, (ax - bx) / area
    for k in range(directions.shape[1]):
        u, v = directions[0, k], directions[1, k]
        if ax * v - ay * u >= 0.0 and bx * v - by * u <= 0.0:
            rays[NEAREST, k] = max(rays[NEAREST, k], np.float32(p * u + q * v))


@kernel()
def add_range_errors(
    ranges: np.ndarray,
    key: np.uint64,
    counter: int,
    normals: np.ndarray,
    dropout: int,
    max_range: float,
    bits: np.ndarray,
) -> None:
    """Make of a laser's true `ranges` (m) what it reports; `bits` (beams,) is room to work in."""
    for k in range(ranges.shape[0]):
        bits[k] = draw(key, counter + k)
    for k in range(ranges.shape[0]):
        ranges[k] += load_element(normals, bits[k] >> np.uint64(52))
    for k in range(ranges.shape[0]):
        reach = max(ranges[k], 0.0)
        lost = np.int64(bits[k] & np.uint64(0xFFFFFFFF)) < dropout
        ranges[k] = np.inf if lost or reach >= max_range else reach
