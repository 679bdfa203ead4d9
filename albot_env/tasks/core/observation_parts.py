"""The parts of an observation, one compiled function for each, and their scales.

`ObservationConfig` describes what the parts mean.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of, rotate_back, wrap_angle
from albot_core.kernels.bits import float32_bits, float32_from_bits
from albot_core.kernels.compiled import kernel


@kernel()
def observe_motion(motion: np.ndarray, length: float, turn: float, row: np.ndarray) -> None:
    """Fill `row` (3,) with the part motion, in shares of a step's length (m) and turn (rad)."""
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


@kernel()
def observe_exit(belief: np.ndarray, line: np.ndarray, scale: LogScale, row: np.ndarray) -> None:
    """Fill `row` (6,) with the part exit.

    `line` (4,) is the next exit home (map frame), with the present place to its left; NaN for
    none. `scale` is that of home's distance.
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
    """Fill `row` (4,) with the part way.

    `point` (2,) is a point ahead on a way (map frame); NaN for none. `scale` is that of home's
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
    """Return the part confidence: from 1 if home is certain to -1.

    It is the probability that a point drawn from a normal distribution in the plane, of standard
    deviation σ = drift × `travel` (m) along each axis, is within r = `near` (m) of the mean:
    1 - exp(-r² / 2σ²), scaled to [-1, 1].
    """
    deviation = drift * travel
    return 1.0 - 2.0 * math.exp(-0.5 * (near / max(deviation, 1e-9)) ** 2)


@kernel()
def find_nearest(ranges: np.ndarray, nearest: np.ndarray) -> None:
    """Fill `nearest` with the minimum range of each of `len(nearest)` equal sectors."""
    beams, sectors = ranges.shape[0], nearest.shape[0]
    for k in range(sectors):
        first, last = k * beams // sectors, (k + 1) * beams // sectors
        shortest = ranges[first]
        for beam in range(first + 1, last):
            shortest = min(shortest, ranges[beam])
        nearest[k] = shortest


@kernel()
def _direct(east: float, north: float, cos: float, sin: float, row: np.ndarray) -> None:
    """Write the direction of a map-frame vector relative to a heading."""
    length = max(length_of(east, north), 1e-9)
    ahead, left = rotate_back(cos, sin, east, north)
    row[0] = min(max(ahead / length, -1.0), 1.0)
    row[1] = min(max(left / length, -1.0), 1.0)


@kernel()
def locate_home(
    belief: np.ndarray, turn: tuple[float, float], where: np.ndarray, home: np.ndarray
) -> None:
    """Write home's pose x, y, heading (3,) relative to a belief; `where` is its map-frame pose.

    `turn` is the cosine and sine of the believed heading.
    """
    cos, sin = turn
    east, north = where[0] - belief[0], where[1] - belief[1]
    home[0], home[1] = rotate_back(cos, sin, east, north)
    home[2] = wrap_angle(where[2] - belief[2])


@kernel()
def observe_time(left: float, scale: LogScale) -> float:
    """Return the time left (s) as a number from -1 (none) to 1 (the scale's longest, or more)."""
    return scaled(max(left, 0.0), scale)


class LogScale(NamedTuple):
    """A logarithmic scale of lengths (m) or of times (s)."""

    knee: float
    """The scale is nearly linear up to here."""
    longest: float
    """Values from here on are all shown as the end of the scale."""
    whole: float
    """log(1 + longest / knee)."""


def make_log_scale(knee: float, longest: float) -> LogScale:
    """Return a scale with this knee and this longest value."""
    return LogScale(float(knee), float(longest), math.log1p(longest / knee))


@kernel()
def scaled(length: float, scale: LogScale) -> float:
    """Return a length as a number from -1 at 0 to 1 at the scale's longest and beyond."""
    share = math.log1p(min(length, scale.longest) / scale.knee) / scale.whole
    return min(2.0 * share - 1.0, 1.0)


@kernel()
def unscaled(number: float, scale: LogScale) -> float:
    """Return the length of which `scaled` made this number."""
    return scale.knee * math.expm1(0.5 * (number + 1) * scale.whole)


@kernel()
def scale_ranges(ranges: np.ndarray, scale: LogScale, shown: np.ndarray) -> None:
    """Fill the first of `shown` with scaled ranges: 1 at 0 m, -1 at the scale's longest and beyond.

    It computes -`scaled` for many lengths at once. A number is 2^e m with m in [1, 2), and
    log m = log √2 + 2 artanh t with t = (m - √2) / (m + √2), whose series is cut where it is
    below 1e-7. The loop contains only float32 arithmetic, so that the compiler can vectorise it.
    """
    one, half, root = np.float32(1.0), np.float32(0.5), np.float32(math.sqrt(2.0))
    two, log_2 = np.float32(2.0), np.float32(math.log(2.0))
    third, fifth, seventh = np.float32(1 / 3), np.float32(1 / 5), np.float32(1 / 7)
    share, per_knee = np.float32(2.0 / scale.whole), 1.0 / scale.knee
    for k in range(ranges.shape[0]):
        bits = float32_bits(np.float32(1.0 + min(ranges[k], scale.longest) * per_knee))
        exponent = np.float32((bits >> np.int32(23)) - np.int32(127))
        number = float32_from_bits((bits & np.int32(0x7FFFFF)) | np.int32(127 << 23))
        t = (number - root) / (number + root)
        s = t * t
        log = (exponent + half) * log_2 + two * t * (one + s * (third + s * (fifth + s * seventh)))
        shown[k] = min(max(one - share * log, -one), one)


@kernel(arrays=True)
def unscale_ranges(shown: np.ndarray, scale: LogScale) -> np.ndarray:
    """Return the ranges (m) of which `scale_ranges` made these numbers.

    It works one at a time: numpy's expm1 over arrays rounds differently with AVX-512.
    """
    ranges = np.empty(shown.shape[0])
    for k in range(shown.shape[0]):
        ranges[k] = unscaled(-np.float64(shown[k]), scale)
    return ranges
