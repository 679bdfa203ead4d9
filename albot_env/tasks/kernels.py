"""Compiled loops of the tasks: reckoning beliefs, observing."""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.directions import length_of, wrapped
from albot_core.kernels.compiled import kernel
from albot_env.tasks.log_scale import LogScale, scaled


@kernel()
def observe_motion(motion: np.ndarray, length: float, turn: float, row: np.ndarray) -> None:
    """Fill `row` (3,) with the part motion: in shares of a step's length (m) and turn (rad)."""
    for i in range(3):
        share = motion[i] / (length if i < 2 else turn)
        row[i] = min(max(share, -1.0), 1.0)


@kernel()
def observe_home(home: np.ndarray, scale: LogScale, row: np.ndarray) -> None:
    """Fill `row` (3,) with the part home: direction and distance of home (robot frame)."""
    distance = length_of(home[0], home[1])
    row[0], row[1] = 1.0, 0.0
    if distance > 0.0:
        row[0] = min(max(home[0] / distance, -1.0), 1.0)
        row[1] = min(max(home[1] / distance, -1.0), 1.0)
    row[2] = scaled(distance, scale)


@kernel(nogil=True)
def reckon(rows: np.ndarray, motions: np.ndarray, beliefs: np.ndarray, travels: np.ndarray) -> None:
    """Add the motions measured to beliefs x, y, heading (n, 3), their lengths to travels (n,)."""
    for i in rows:
        travels[i] += length_of(motions[i, 0], motions[i, 1])
        cos, sin = math.cos(beliefs[i, 2]), math.sin(beliefs[i, 2])
        beliefs[i, 0] += cos * motions[i, 0] - sin * motions[i, 1]
        beliefs[i, 1] += sin * motions[i, 0] + cos * motions[i, 1]
        beliefs[i, 2] = wrapped(beliefs[i, 2] + motions[i, 2])


@kernel()
def observe_exit(belief: np.ndarray, line: np.ndarray, scale: LogScale, row: np.ndarray) -> None:
    """Fill `row` (6,) with the part exit of an observation.

    `line` (4,) is the next exit home in the map, with the present place to its left; NaN for
    none. The scale is that of home's distance.
    """
    for k in range(6):
        row[k] = 0.0
    row[2] = row[5] = -1.0
    if math.isnan(line[0]):
        return
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    east = 0.5 * (line[0] + line[2]) - belief[0]
    north = 0.5 * (line[1] + line[3]) - belief[1]
    row[2] = scaled(length_of(east, north), scale)
    _direct(east, north, cos, sin, row)
    _direct(line[3] - line[1], line[0] - line[2], cos, sin, row[3:])
    row[5] = 1.0


@kernel()
def observe_way(belief: np.ndarray, point: np.ndarray, scale: LogScale, row: np.ndarray) -> None:
    """Fill `row` (4,) with the part way of an observation.

    `point` (2,) is a point ahead on a way, in the map; NaN for none. The scale is that of home's
    distance.
    """
    row[0] = row[1] = 0.0
    row[2] = row[3] = -1.0
    if math.isnan(point[0]):
        return
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    east, north = point[0] - belief[0], point[1] - belief[1]
    row[2] = scaled(length_of(east, north), scale)
    _direct(east, north, cos, sin, row)
    row[3] = 1.0


@kernel()
def observe_confidence(travel: float, drift: float, near: float) -> float:
    """The part confidence of an observation: from 1 where home is certain to -1.

    It is the share of a normal distribution in the plane, of standard deviation drift ×
    `travel` (m) along each axis, that is no farther than `near` (m) from its middle: 1 - exp(-r²
    / 2σ²), stretched to [-1, 1].
    """
    deviation = drift * travel
    return 1.0 - 2.0 * math.exp(-0.5 * (near / max(deviation, 1e-9)) ** 2)


@kernel()
def find_nearest(ranges: np.ndarray, nearest: np.ndarray) -> None:
    """Fill `nearest` with the shortest of the ranges in each of as many equal sectors."""
    beams, sectors = ranges.shape[0], nearest.shape[0]
    for k in range(sectors):
        first, last = k * beams // sectors, (k + 1) * beams // sectors
        shortest = ranges[first]
        for beam in range(first + 1, last):
            shortest = min(shortest, ranges[beam])
        nearest[k] = shortest


@kernel()
def _direct(east: float, north: float, cos: float, sin: float, row: np.ndarray) -> None:
    """Write the direction of a vector of the map as seen with a heading."""
    length = max(length_of(east, north), 1e-9)
    row[0] = min(max((cos * east + sin * north) / length, -1.0), 1.0)
    row[1] = min(max((cos * north - sin * east) / length, -1.0), 1.0)


@kernel()
def find_home(
    belief: np.ndarray, turn: tuple[float, float], where: np.ndarray, home: np.ndarray
) -> None:
    """Write where home is, seen from a belief, as x, y, heading (3,); `where` it is in the map.

    `turn` is the cosine and sine of the belief's heading.
    """
    cos, sin = turn
    east, north = where[0] - belief[0], where[1] - belief[1]
    home[0] = cos * east + sin * north
    home[1] = cos * north - sin * east
    home[2] = wrapped(where[2] - belief[2])


@kernel()
def observe_time(left: float, scale: LogScale) -> float:
    """Time left (s) as a number from -1 at none to 1 at the scale's longest and more."""
    return scaled(max(left, 0.0), scale)
