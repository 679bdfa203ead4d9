"""Compiled loops of the tasks: covering ground, cutting patches, finding rooms, observing.

A grid of ground is a square of cells, a bit each. Eight by eight cells share a word, so that
what lies around a robot lies together in memory: column x, row y is bit 8 (y % 8) + x % 8 of
word (x // 8) + words a row × (y // 8).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from albot_core.geometry.directions import turned

TIME_KNEE = 0.05
"""Share of the longest time up to which the scale of times is nearly linear."""

_ONE = 2.0**32
"""A cell in fixed-point numbers, in which loops over cells need no conversions: a negative
cell, taken as unsigned, is beyond every grid."""


class Sight(NamedTuple):
    """What of the ground a laser shows."""

    radius: float
    """Ground farther from the laser is not covered (m)."""
    x: float
    """Where on the robot the laser is (m)…"""
    y: float
    """…"""
    first: float
    """Where its first beam points from the robot's heading (rad)…"""
    spacing: float
    """…and how far it is from each beam to the next (rad)."""
    beams: np.ndarray
    """(parts,) int64: the beam that points into each part of the full turn (see `turned`);
    -1 where none does."""


@njit(cache=True, error_model="numpy")
def is_time_to_look(motion: np.ndarray, spacing: float, turn: float, moved: np.ndarray) -> bool:
    """Add a motion to what was `moved` (m, rad) since the last look; whether one is due."""
    moved[0] += math.hypot(motion[0], motion[1])
    moved[1] += abs(motion[2])
    if moved[0] < spacing and moved[1] < turn:
        return False
    moved[0] = moved[1] = 0.0
    return True


@njit(cache=True, error_model="numpy")
def cover(
    grid: np.ndarray,
    side: int,
    cell: float,
    centre: np.ndarray,
    pose: np.ndarray,
    sight: Sight,
    ranges: np.ndarray,
) -> int:
    """Mark the cells whose middles a scan taken at `pose` shows; return how many were new.

    A middle is seen where it is no farther than the radius, and than the range of the beam
    that points its way. `grid` (words,) is a square of `side` cells of that size about
    `centre` (2,); cells outside it are left out.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    # The laser's place, in cells from the middle of cell (0, 0).
    eye_x = (pose[0] + cos * sight.x - sin * sight.y - centre[0]) / cell + side / 2 - 0.5
    eye_y = (pose[1] + sin * sight.x + cos * sight.y - centre[1]) / cell + side / 2 - 0.5
    radius, beams = sight.radius / cell, sight.beams
    parts, words = beams.shape[0], side // 8
    new = 0
    for row in range(max(0, math.ceil(eye_y - radius)), min(side, math.floor(eye_y + radius) + 1)):
        dy = row - eye_y
        half = math.sqrt(max(0.0, radius * radius - dy * dy))
        first, last = math.ceil(eye_x - half), math.floor(eye_x + half)
        for column in range(max(0, first), min(side, last + 1)):
            word = (row >> 3) * words + (column >> 3)
            bit = np.uint64(1) << np.uint64(((row & 7) << 3) | (column & 7))
            if grid[word] & bit:
                continue
            dx = column - eye_x
            u, v = cos * dx + sin * dy, cos * dy - sin * dx
            beam = beams[min(int((turned(u, v) + 2.0) * 0.25 * parts), parts - 1)]
            if beam < 0:
                continue
            reach = ranges[beam] / cell
            if dx * dx + dy * dy <= reach * reach:
                grid[word] |= bit
                new += 1
    return new


@njit(cache=True, error_model="numpy")
def cut_patch(
    grid: np.ndarray,
    side: int,
    cell: float,
    centre: np.ndarray,
    pose: np.ndarray,
    patch_cell: float,
    width: int,
    patch: np.ndarray,
) -> None:
    """Fill `patch`, row by row of `width` cells, with the cells around a pose: 1 covered, -1 not.

    Row 0 lies farthest ahead of the robot, column 0 farthest to its left.
    """
    size, words = np.uint64(side), np.uint64(side // 8)
    three, seven, whole = np.uint64(3), np.uint64(7), np.uint64(32)
    cos, sin = math.cos(pose[2]) * patch_cell / cell, math.sin(pose[2]) * patch_cell / cell
    middle_x = (pose[0] - centre[0]) / cell + side / 2
    middle_y = (pose[1] - centre[1]) / cell + side / 2
    left = (width - 1) / 2
    step_x, step_y = np.uint64(np.int64(sin * _ONE)), np.uint64(np.int64(-cos * _ONE))
    for row in range(width):
        forward = (width - 1) / 2 - row
        x = np.uint64(np.int64((middle_x + cos * forward - sin * left) * _ONE))
        y = np.uint64(np.int64((middle_y + sin * forward + cos * left) * _ONE))
        for column in range(width):
            cell_x, cell_y = x >> whole, y >> whole
            covered = np.uint64(0)
            if cell_x < size and cell_y < size:
                word = grid[(cell_y >> three) * words + (cell_x >> three)]
                covered = word >> (((cell_y & seven) << three) | (cell_x & seven))
            patch[row * width + column] = 1.0 if covered & np.uint64(1) else -1.0
            x += step_x
            y += step_y


@njit(cache=True, error_model="numpy")
def find_frontier(
    grid: np.ndarray,
    side: int,
    cell: float,
    centre: np.ndarray,
    pose: np.ndarray,
    sight: Sight,
    ranges: np.ndarray,
    frontier: np.ndarray,
) -> None:
    """Fill `frontier` with how far (m) uncovered ground is in each of as many equal sectors.

    Along the middle beam; infinitely far where the beam ends before. It begins where the cells
    on the beam and to both its sides are uncovered: beside a wall there are some whose middles
    lie within it.
    """
    heading = pose[2] + sight.first
    eye_x = pose[0] + math.cos(pose[2]) * sight.x - math.sin(pose[2]) * sight.y - centre[0]
    eye_y = pose[1] + math.sin(pose[2]) * sight.x + math.cos(pose[2]) * sight.y - centre[1]
    half, sectors = side / 2, frontier.shape[0]
    for k in range(sectors):
        beam = (2 * k + 1) * ranges.shape[0] // (2 * sectors)
        bearing = heading + beam * sight.spacing
        cos, sin = math.cos(bearing), math.sin(bearing)
        frontier[k] = math.inf
        reach = min(ranges[beam], side * cell) - cell
        for step in range(1, int(reach / cell) + 1):
            x, y = eye_x / cell + half + step * cos, eye_y / cell + half + step * sin
            if not (
                _is_covered(grid, side, x, y)
                or _is_covered(grid, side, x - sin, y + cos)
                or _is_covered(grid, side, x + sin, y - cos)
            ):
                frontier[k] = step * cell
                break


@njit(cache=True, error_model="numpy")
def _is_covered(grid: np.ndarray, side: int, x: float, y: float) -> bool:
    """Whether a point (cells from the corner of the square) is on covered ground."""
    if not (0.0 <= x < side and 0.0 <= y < side):
        return False
    column, row = int(x), int(y)
    word = grid[(row >> 3) * (side // 8) + (column >> 3)]
    return bool((word >> np.uint64(((row & 7) << 3) | (column & 7))) & np.uint64(1))


@njit(cache=True, error_model="numpy")
def find_room(
    x: float, y: float, corners: np.ndarray, spans: np.ndarray, first: int, last: int
) -> int:
    """The first of the rooms first to last whose outline holds the point, -1 where none does.

    Room k's outline is corners[spans[k, 0]:spans[k, 1]]. A point is inside where a ray to
    +x crosses the outline an odd number of times.
    """
    for room in range(first, last):
        inside = False
        before = spans[room, 1] - 1
        for k in range(spans[room, 0], spans[room, 1]):
            x1, y1 = corners[before, 0], corners[before, 1]
            x2, y2 = corners[k, 0], corners[k, 1]
            if (y1 > y) != (y2 > y) and x < x1 + (y - y1) / (y2 - y1) * (x2 - x1):
                inside = not inside
            before = k
        if inside:
            return room
    return -1


@njit(cache=True, error_model="numpy")
def log_scale(length: float, knee: float, longest: float) -> float:
    """A length as a number from -1 at 0 to 1 at `longest` and more, finest where short."""
    share = math.log1p(min(length, longest) / knee) / math.log1p(longest / knee)
    return min(2.0 * share - 1.0, 1.0)


@njit(cache=True, error_model="numpy")
def scale_ranges(ranges: np.ndarray, knee: float, longest: float, scaled: np.ndarray) -> None:
    """Fill the first of `scaled` with ranges (m): 1 at 0, -1 at `longest` and beyond.

    What `log_scale` does, negated, for many lengths at once: a number is 2^e m with m in
    [1, 2), and log m = log √2 + 2 artanh t with t = (m - √2) / (m + √2), whose series
    is cut where it is below 1e-7. The loops hold nothing but arithmetic in float32, for the
    compiler to make vector instructions of.
    """
    beams = ranges.shape[0]
    numbers = np.empty(beams, np.float32)
    bits = numbers.view(np.int32)
    one, half, root = np.float32(1.0), np.float32(0.5), np.float32(math.sqrt(2.0))
    two, log_2 = np.float32(2.0), np.float32(math.log(2.0))
    third, fifth, seventh = np.float32(1 / 3), np.float32(1 / 5), np.float32(1 / 7)
    share = np.float32(2.0 / math.log1p(longest / knee))
    for k in range(beams):
        numbers[k] = np.float32(1.0 + min(ranges[k], longest) / knee)
    for k in range(beams):
        number = bits[k]
        exponent = np.float32((number >> np.int32(23)) - np.int32(127))
        bits[k] = (number & np.int32(0x7FFFFF)) | np.int32(127 << 23)
        t = (numbers[k] - root) / (numbers[k] + root)
        s = t * t
        log = (exponent + half) * log_2 + two * t * (one + s * (third + s * (fifth + s * seventh)))
        scaled[k] = min(max(one - share * log, -one), one)


@njit(cache=True, error_model="numpy")
def observe_motion(motion: np.ndarray, length: float, turn: float, row: np.ndarray) -> None:
    """Fill `row` (3,) with the part motion: in shares of a step's length (m) and turn (rad)."""
    for i in range(3):
        share = motion[i] / (length if i < 2 else turn)
        row[i] = min(max(share, -1.0), 1.0)


@njit(cache=True, error_model="numpy")
def observe_home(home: np.ndarray, knee: float, longest: float, row: np.ndarray) -> None:
    """Fill `row` (3,) with the part home: direction and distance of home (robot frame)."""
    distance = math.hypot(home[0], home[1])
    row[0], row[1] = 1.0, 0.0
    if distance > 0.0:
        row[0] = min(max(home[0] / distance, -1.0), 1.0)
        row[1] = min(max(home[1] / distance, -1.0), 1.0)
    row[2] = log_scale(distance, knee, longest)


@njit(cache=True, error_model="numpy", nogil=True)
def reckon(rows: np.ndarray, motions: np.ndarray, beliefs: np.ndarray, travels: np.ndarray) -> None:
    """Add the motions measured to beliefs x, y, heading (n, 3), their lengths to travels (n,)."""
    for i in rows:
        travels[i] += math.hypot(motions[i, 0], motions[i, 1])
        cos, sin = math.cos(beliefs[i, 2]), math.sin(beliefs[i, 2])
        beliefs[i, 0] += cos * motions[i, 0] - sin * motions[i, 1]
        beliefs[i, 1] += sin * motions[i, 0] + cos * motions[i, 1]
        beliefs[i, 2] = (beliefs[i, 2] + motions[i, 2] + math.pi) % (2 * math.pi) - math.pi


@njit(cache=True, error_model="numpy")
def observe_exit(
    belief: np.ndarray, line: np.ndarray, knee: float, longest: float, row: np.ndarray
) -> None:
    """Fill `row` (6,) with the part exit of an observation.

    `line` (4,) is the next exit home in the map, with the present place to its left; NaN for
    none. The lengths are the knee and range of home's distance.
    """
    for k in range(6):
        row[k] = 0.0
    row[2] = row[5] = -1.0
    if math.isnan(line[0]):
        return
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    east = 0.5 * (line[0] + line[2]) - belief[0]
    north = 0.5 * (line[1] + line[3]) - belief[1]
    row[2] = log_scale(math.hypot(east, north), knee, longest)
    _direct(east, north, cos, sin, row)
    _direct(line[3] - line[1], line[0] - line[2], cos, sin, row[3:])
    row[5] = 1.0


@njit(cache=True, error_model="numpy")
def observe_way(
    belief: np.ndarray, point: np.ndarray, knee: float, longest: float, row: np.ndarray
) -> None:
    """Fill `row` (4,) with the part way of an observation.

    `point` (2,) is a point ahead on the way home, in the map; NaN for none. The lengths are
    the knee and range of home's distance.
    """
    row[0] = row[1] = 0.0
    row[2] = row[3] = -1.0
    if math.isnan(point[0]):
        return
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    east, north = point[0] - belief[0], point[1] - belief[1]
    row[2] = log_scale(math.hypot(east, north), knee, longest)
    _direct(east, north, cos, sin, row)
    row[3] = 1.0


@njit(cache=True, error_model="numpy")
def observe_confidence(travel: float, drift: float, near: float) -> float:
    """The part confidence of an observation: from 1 where home is certain to -1.

    It is the share of a normal distribution in the plane, of standard deviation drift ×
    `travel` (m) along each axis, that is no farther than `near` (m) from its middle: 1 - exp(-r²
    / 2σ²), stretched to [-1, 1].
    """
    deviation = drift * travel
    return 1.0 - 2.0 * math.exp(-0.5 * (near / max(deviation, 1e-9)) ** 2)


@njit(cache=True, error_model="numpy")
def find_nearest(ranges: np.ndarray, nearest: np.ndarray) -> None:
    """Fill `nearest` with the shortest of the ranges in each of as many equal sectors."""
    beams, sectors = ranges.shape[0], nearest.shape[0]
    for k in range(sectors):
        first, last = k * beams // sectors, (k + 1) * beams // sectors
        shortest = ranges[first]
        for beam in range(first + 1, last):
            shortest = min(shortest, ranges[beam])
        nearest[k] = shortest


@njit(cache=True, error_model="numpy")
def _direct(east: float, north: float, cos: float, sin: float, row: np.ndarray) -> None:
    """Write the direction of a vector of the map as seen with a heading."""
    length = max(math.hypot(east, north), 1e-9)
    row[0] = min(max((cos * east + sin * north) / length, -1.0), 1.0)
    row[1] = min(max((cos * north - sin * east) / length, -1.0), 1.0)


@njit(cache=True, error_model="numpy")
def find_home(belief: np.ndarray, where: np.ndarray, home: np.ndarray) -> None:
    """Write where home is, seen from a belief, as x, y, heading (3,); `where` it is in the map."""
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    east, north = where[0] - belief[0], where[1] - belief[1]
    home[0] = cos * east + sin * north
    home[1] = cos * north - sin * east
    home[2] = (where[2] - belief[2] + math.pi) % (2 * math.pi) - math.pi


@njit(cache=True, error_model="numpy")
def observe_time(left: float, longest: float) -> float:
    """Time left (s) as a number from -1 at none to 1 at `longest` and more, finest where short."""
    return log_scale(max(left, 0.0), TIME_KNEE * longest, longest)
