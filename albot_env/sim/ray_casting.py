"""Compiled ray casting: the ranges of a laser's beams to walls, and their measurement errors.

Let a and b be the ends of a wall in the laser's frame, a clockwise of b. A beam of direction u
meets the wall if u is between a and b, and its inverse range is then linear in u:
1/r = (u × (b - a)) / (a × b). The nearest wall along each beam is a running maximum of
multiply-adds over the walls that the beam may meet: once a wall's coefficients are known, no
division and no angle is computed. Directions are compared by their pseudo-angles. An end that
two walls share has the same pseudo-angle in both, so no beam slips between them. Beams are
processed in blocks, each with the walls that reach into it.
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
"""Float32 is used while range² / distance to the wall's line is below this (m): error < 0.2 mm."""
_EDGE_ON = 1e-12
"""A wall that subtends a smaller angle (rad) is edge-on: the angle may be a rounding error."""
_STRIP: Any = np.int64(64)
"""Number of walls processed together: one bit of a word for each."""


class BeamGeometry(NamedTuple):
    """A laser's beams, in a frame whose x axis points along the middle beam."""

    number: int
    """Number of beams."""
    directions: np.ndarray
    """(2, beams) float64: cosine and sine of the beams' bearings from the middle beam."""
    padded: np.ndarray
    """(3, blocks × LANES32) float32: `directions` and the beams' pseudo-angles, padded to whole
    blocks. Ranges of the padding are never read."""
    max_range: float
    """Ranges at or beyond this distance are reported as infinite (m)."""
    mount: Transform
    """Position of the laser on the robot, and direction of the middle beam."""
    behind: float
    """A wall whose ends both have an x below this (m) meets no beam."""


class ScanBuffers(NamedTuple):
    """Scratch buffers for scanning."""

    rays: np.ndarray
    """(4, blocks × LANES32) float32: the beams' directions as vectors and as pseudo-angles, and
    their inverse ranges."""
    walls: np.ndarray
    """(4, room) float64: ends x, y of the walls to test, one wall per column (m)."""
    lines: np.ndarray
    """(4, room) float32: line coefficients of the walls (see P, Q, FROM, TO)."""
    bits: np.ndarray
    """(beams,) uint64: random bits for the range errors."""


U, V, W, NEAREST = range(4)
"""Rows of `ScanBuffers.rays`."""
AX, AY, BX, BY = range(4)
"""Rows of `ScanBuffers.walls`, in the frame of the laser."""
P, Q, FROM, TO = range(4)
"""Rows of `ScanBuffers.lines`: 1/r along the laser's axes, and the pseudo-angles between which
beams meet the wall. That interval is empty if float32 is too coarse or the wall is edge-on."""


@kernel(arrays=True)
def make_scan_buffers(beams: BeamGeometry, room: int) -> ScanBuffers:
    """Allocate buffers for `room` walls."""
    rays = np.empty((4, beams.padded.shape[1]), np.float32)
    for row in range(NEAREST):  # Assigning the whole array takes seconds to compile.
        for k in range(rays.shape[1]):
            rays[row, k] = beams.padded[row, k]
    columns = 2 * padded_length(room) + _STRIP  # Some walls appear twice; strips are read whole.
    walls, lines = np.empty((4, columns)), np.empty((4, columns), np.float32)
    return ScanBuffers(rays, walls, lines, np.empty(beams.number, np.uint64))


@kernel(arrays=True, nogil=True)
def scan_poses(
    beams: BeamGeometry, index: WallTables, cells: np.ndarray, poses: np.ndarray, ranges: np.ndarray
) -> None:
    """Fill `ranges` (n, beams) with the true ranges (m) at `poses` (n, 3) in cells `cells` (n,)."""
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

    The laser sees the cell's walls and the segments `first` to `last` of `obstacles` (n, 4).
    """
    laser = compose_transforms(robot, beams.mount)
    # The walls and obstacles in front of the laser, in its frame.
    count = ZERO
    for m in index.members[index.spans[cell, 0] : index.spans[cell, 1]]:
        count += _transform_segment(index.walls, m, laser, beams.behind, buffers.walls, count)
    for j in range(first, last):
        count += _transform_segment(obstacles, j, laser, beams.behind, buffers.walls, count)
    # Inverse ranges start at 1 / max_range; each wall raises those of the beams that meet it.
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
    """Write a segment's ends, in the laser's frame, into column `count`; return 0 if behind it."""
    x, y, cos, sin = laser
    sx, sy = rotate_back(cos, sin, segments[k, 0] - x, segments[k, 1] - y)
    ex, ey = rotate_back(cos, sin, segments[k, 2] - x, segments[k, 3] - y)
    walls[AX, count], walls[AY, count], walls[BX, count], walls[BY, count] = sx, sy, ex, ey
    return 1 if max(sx, ex) >= behind else 0


@kernel()
def _find_lines(beams: BeamGeometry, count: int, buffers: ScanBuffers) -> int:
    """Find the lines of the first `count` walls in the buffers; return the number of lines.

    A wall that passes behind the laser gets two lines, one for each side. Walls for which float32
    is too coarse are tested against the beams at once.
    """
    walls, lines = buffers.walls, buffers.lines
    lined_up = padded_length(count)
    for k in range(count, lined_up):  # A single point counts as edge-on.
        walls[AX, k] = walls[AY, k] = walls[BX, k] = walls[BY, k] = 0.0
    squared = (beams.max_range * beams.max_range,)
    for first in range(0, count, LANES):
        odd = _lines_of_walls((walls, lines), (first, first), squared)
        while odd:
            lane = lowest_bit(odd)
            odd &= odd - 1
            j = first + lane % LANES
            if lane < LANES:  # float32 is too coarse
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
    """Sort the ends of walls and compute their lines.

    `max_range_squared` is the square of the laser's range (m²). The first mask marks walls for
    which float32 is too coarse. The second marks, among the others, walls that pass behind the
    laser; their lines are those of the left side.
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
    """Return the pseudo-angles of directions, as `pseudo_angle` defines them."""
    part = v / (u.abs() + v.abs()).maximum(1e-300)
    behind = (2.0 - part).where(-2.0 - part, v >= 0.0)
    return part.where(behind, u >= 0.0)


@kernel()
def _cast_strip(start: int, count: int, buffers: ScanBuffers) -> None:
    """Raise the inverse ranges to those of the lines in a strip of at most `count` lines."""
    rays, lines = buffers.rays, buffers.lines
    for first in range(0, rays.shape[1], LANES32):
        between = rays[W, first], rays[W, first + LANES32 - 1]
        walls = 0
        for group in range(0, min(count, _STRIP), LANES32):
            walls |= _walls_between(lines, start + group, between) << group
        if count < _STRIP:
            walls &= (1 << count) - 1
        while walls:
            # Process four walls at a time.
            i, walls = _next_wall(walls, ZERO)
            j, walls = _next_wall(walls, i)
            k, walls = _next_wall(walls, j)
            m, walls = _next_wall(walls, k)
            pair = (*_line(lines, start + i), *_line(lines, start + j))
            other = (*_line(lines, start + k), *_line(lines, start + m))
            _raise_inverse_ranges(rays, first, (*pair, *other))


@float32_predicate
def _walls_between(lines: FloatTable, first: FloatVector, last: FloatVector) -> FloatVector:
    """Return which walls are met by beams between two pseudo-angles."""
    return (lines[FROM] <= last) & (lines[TO] >= first)


@kernel()
def _next_wall(walls: int, before: int) -> tuple[int, int]:
    """Return the lowest wall of a bit set and the remaining set; `before` if the set is empty.

    Processing a wall twice changes nothing and is cheaper than a test for an empty set.
    """
    return lowest_bit(walls) if walls else before, walls & (walls - 1)


@kernel()
def _line(lines: np.ndarray, k: int) -> tuple[float, float, float, float]:
    return lines[P, k], lines[Q, k], lines[FROM, k], lines[TO, k]


@float32_predicate
def _raise_inverse_ranges(rays: FloatTable, *lines: FloatVector) -> FloatVector:
    """Raise the inverse ranges of a block of beams to those of the walls that the beams meet."""
    u, v, w, nearest = rays[U], rays[V], rays[W], rays[NEAREST]
    for k in range(0, len(lines), 4):
        p, q, first, last = lines[k : k + 4]
        inverse = p * u + q * v
        nearest = inverse.where(nearest, (w >= first) & (w <= last) & (inverse > nearest))
    rays[NEAREST] = nearest
    return nearest > 0.0


@kernel()
def _raise_grazing(rays: np.ndarray, directions: np.ndarray, walls: np.ndarray, j: int) -> None:
    """Raise the inverse ranges, in float64, for a nearly edge-on wall (float32 is too coarse)."""
    ax, ay, bx, by = walls[AX, j], walls[AY, j], walls[BX, j], walls[BY, j]
    area = ax * by - ay * bx
    p, q = (by - ay) / area, (ax - bx) / area
    for k in range(directions.shape[1]):
        u, v = directions[0, k], directions[1, k]
        if ax * v - ay * u >= 0.0 and bx * v - by * u <= 0.0:
            rays[NEAREST, k] = max(rays[NEAREST, k], np.float32(p * u + q * v))


@kernel()
def measure_ranges(
    met: np.ndarray,
    key: np.uint64,
    counter: int,
    normals: np.ndarray,
    dropout: int,
    max_range: float,
    bits: np.ndarray,
    ranges: np.ndarray,
) -> None:
    """Write the ranges that beams measure of what they have `met` at true ranges (m).

    `bits` (beams,) is a scratch buffer.
    """
    for k in range(ranges.shape[0]):
        bits[k] = draw(key, counter + k)
    for k in range(ranges.shape[0]):
        ranges[k] = met[k] + load_element(normals, bits[k] >> np.uint64(52))
    for k in range(ranges.shape[0]):
        reach = max(ranges[k], 0.0)
        lost = np.int64(bits[k] & np.uint64(0xFFFFFFFF)) < dropout
        ranges[k] = np.inf if lost or reach >= max_range else reach
