"""The winding of a link that closes a loop: how many whole turns it holds.

An odometer with a constant bias measures too much turn all the time. At 6 °/s, a lap of a minute
has one whole turn too many. The odometer's measurements do not distinguish it from a lap without
error: a square whose sides are bent by 90° each closes as well as one with straight sides. But
robots drive straight more often than they turn, so the median turn rate while they drive is the
bias. The bias only decides how many whole turns the links of a loop hold; the correction of the map
does the rest. This is our addition; the paper does not cover it.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import length_of, rotate
from albot_core.kernels.compiled import kernel
from albot_core.mappers.schema import Field, Schema
from albot_core.mappers.stored import Stored

_FASTEST, _BIN = math.radians(30.0), math.radians(0.1)
_BINS = 2 * round(_FASTEST / _BIN) + 1
_ENOUGH = 3.0
"""Distance to be driven before a bias is believed (m)."""
_GAP = 0.25
"""Largest gap of a loop after the bias is removed, as a share of the loop's length."""


class HeadingBias(Stored):
    """The odometer's heading bias: the median turn rate, weighted by distance."""

    SCHEMA = Schema(Field("bias.ways", f"{_BINS}", least=0))

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._ways = np.zeros(_BINS)

    def add(self, way: float, turn: float, duration: float) -> None:
        """Add a motion: distance (m), turn (rad) and duration (s); a duration of 0 is unknown."""
        if duration > 0.0 and way > 0.0:
            rate = min(max(turn / duration, -_FASTEST), _FASTEST)
            self._ways[round(rate / _BIN) + _BINS // 2] += way

    @property
    def rate(self) -> float:
        """The bias (rad/s); 0 before the robot has driven far enough."""
        summed = np.cumsum(self._ways)
        if summed[-1] < _ENOUGH:
            return 0.0
        return float((np.searchsorted(summed, summed[-1] / 2) - _BINS // 2) * _BIN)


Tree = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""(experiences,) the link by which each was first reached, -1 for the first; and of all links the
(links,) sources, (links, 3) motions and (links,) times."""


@kernel()
def turns_of(
    source: int,
    target: int,
    motion: tuple[float, float, float],
    time: float,
    tree: Tree,
    bias: float,
) -> int:
    """Return the number of whole turns to add to a link between two known experiences.

    The turns follow from the path between both over the links by which each was first reached, with
    the bias removed. This result is rejected if that path does not lead to where the link does and
    the path as measured comes closer.
    """
    turns, gap, _ = _turns_without(source, target, motion, time, tree, 0.0)
    if bias != 0.0:
        others, other_gap, length = _turns_without(source, target, motion, time, tree, bias)
        if other_gap <= max(_GAP * length, gap):
            return others
    return turns


@kernel()
def _turns_without(
    source: int,
    target: int,
    motion: tuple[float, float, float],
    time: float,
    tree: Tree,
    bias: float,
) -> tuple[int, float, float]:
    """Return the whole turns, the remaining gap of the loop (m), and its length (m)."""
    reached_by, sources, motions, times = tree
    here, there = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)  # Source and target in their ancestors' frames.
    length = length_of(motion[0], motion[1])
    one, other = source, target
    while one != other:  # An experience is younger than that from which it was reached.
        link = reached_by[max(one, other)]
        step = _unbiased((motions[link, 0], motions[link, 1], motions[link, 2]), times[link], bias)
        length += length_of(step[0], step[1])
        if one > other:
            here = _unwrapped(step, here)
            one = sources[link]
        else:
            there = _unwrapped(step, there)
            other = sources[link]
    x, y = rotate(math.cos(-here[2]), math.sin(-here[2]), there[0] - here[0], there[1] - here[1])
    direct = _unbiased(motion, time, bias)
    turns = math.floor((there[2] - here[2] - direct[2]) / (2 * math.pi) + 0.5)
    return turns, length_of(x - direct[0], y - direct[1]), length


@kernel()
def _unbiased(
    motion: tuple[float, float, float], time: float, bias: float
) -> tuple[float, float, float]:
    """Return a motion without the excess turn of a bias.

    On average, half of the excess also rotates the direction of travel.
    """
    excess = bias * time
    x, y = rotate(math.cos(-excess / 2), math.sin(-excess / 2), motion[0], motion[1])
    return x, y, motion[2] - excess


@kernel()
def _unwrapped(
    first: tuple[float, float, float], second: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return one motion followed by another; headings are added without wrapping."""
    x, y = rotate(math.cos(first[2]), math.sin(first[2]), second[0], second[1])
    return first[0] + x, first[1] + y, first[2] + second[2]
