"""The scales of observations: how lengths and times become numbers in [-1, 1]."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.kernels.bits import float32_bits, float32_from_bits
from albot_core.kernels.compiled import kernel


class LogScale(NamedTuple):
    """A logarithmic scale of lengths (m) or of times (s)."""

    knee: float
    """The scale is nearly linear up to here."""
    longest: float
    """Values from here on are all shown as the end of the scale."""
    whole: float
    """log(1 + longest / knee)."""


class Channels(NamedTuple):
    """The place of each channel of a map's patch among those shown; -1 for one that is not."""

    walls: int
    free: int
    trail: int
    exits: int
    home: int
    places: int
    obstacles: int

    @classmethod
    def of(cls, names: tuple[str, ...]) -> Channels:
        """Return the places of these channels, which are in their order."""
        return cls(**{name: names.index(name) if name in names else -1 for name in cls._fields})


class PatchScales(NamedTuple):
    """Scales, size and channels of the map's patches."""

    sides: np.ndarray
    """(scales,) float64: sides of the patches (m)."""
    cells: int
    """Number of cells along each side."""
    channels: Channels
    """The channels that are shown."""


class GraphScales(NamedTuple):
    """Size of the part `place_graph`."""

    places: int
    """Number of rows of places."""
    connections: int
    """Number of rows of connections."""


class Scales(NamedTuple):
    """Scales of observations and coverage (see their configurations)."""

    spacing: float
    turn: float
    patch_cell: float
    patch_cells: int
    laser: LogScale
    sonar: LogScale
    step_length: float
    step_turn: float
    home: LogScale
    home_drift: float
    home_near: float
    sectors: int
    time: LogScale
    patches: PatchScales
    graph: GraphScales
    matches: int


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
