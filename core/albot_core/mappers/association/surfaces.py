"""The geometry of surfaces: similarity and distance of two surfaces, crossings, lengthening.

A surface is a row x1, y1, x2, y2 (m). Its ends are in the order in which the laser's beams, which
run counter-clockwise, hit them, so the two faces of a wall have opposite directions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of, wrap_angle
from albot_core.geometry.segment_kernels import crosses, distance_to_segment, heading_of
from albot_core.kernels.compiled import kernel

_LIKE = 0.2
"""A distance of this (m) between two surfaces counts as much as a turn of 1 rad."""


class Surfaces(NamedTuple):
    """Surfaces, and the seen length of each."""

    lines: np.ndarray
    """(n, 4) float64: the surfaces (m)."""
    lengths: np.ndarray
    """(n,) float64: the length of each surface that was seen when its direction was measured
    (m)."""


@kernel()
def most_similar(
    surface: np.ndarray, others: np.ndarray, count: int, angle: float, closeness: float
) -> int:
    """Return which of the first `count` others is close and the most similar; -1 for none.

    Those turned by more than `angle` (rad) or farther away than `closeness` (m) do not count. The
    paper takes the most similar orientation. But the walls of a corridor are parallel, and by
    orientation alone noise would decide; so the distance counts as well, which is ours.
    """
    best, least = -1, np.inf
    for k in range(count):
        if not may_be_close(surface, others[k], closeness):
            continue
        turned = abs(wrap_angle(heading_of(others[k]) - heading_of(surface)))
        if turned > angle:
            continue
        apart = distance_between(surface, others[k])
        if apart <= closeness and apart + _LIKE * turned < least:
            best, least = k, apart + _LIKE * turned
    return best


@kernel()
def overhang(surface: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    """Return how far `other` reaches beyond the first and the last end of `surface` (m)."""
    first, length = along(surface, other[0], other[1])
    last, _ = along(surface, other[2], other[3])
    return max(0.0, -min(first, last)), max(0.0, max(first, last) - length)


@kernel()
def missing(surface: np.ndarray, known: np.ndarray) -> tuple[float, float]:
    """Return the lengths to add at either end of a surface to give it a known one's extent (m).

    The known surface reaches at least as far at both ends.
    """
    middle, length = along(surface, 0.5 * (known[0] + known[2]), 0.5 * (known[1] + known[3]))
    half = 0.5 * length_of(known[2] - known[0], known[3] - known[1])
    return half - middle, middle + half - length


@kernel()
def along(surface: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """Return the distance of a point along a surface from its first end, and its length (m)."""
    dx, dy = surface[2] - surface[0], surface[3] - surface[1]
    length = length_of(dx, dy)
    return (dx * (x - surface[0]) + dy * (y - surface[1])) / length, length


@kernel()
def lengthen(surface: np.ndarray, before: float, after: float) -> None:
    """Move a surface's first end back by `before` and its last end forward by `after` (m)."""
    dx, dy = surface[2] - surface[0], surface[3] - surface[1]
    length = length_of(dx, dy)
    dx, dy = dx / length, dy / length
    surface[0] -= before * dx
    surface[1] -= before * dy
    surface[2] += after * dx
    surface[3] += after * dy


@kernel()
def distance_between(one: np.ndarray, other: np.ndarray) -> float:
    """Return the least distance between two surfaces (m); 0 if they cross."""
    if crosses(one, other):
        return 0.0
    first = min(distance_to(one, other[0], other[1]), distance_to(one, other[2], other[3]))
    last = min(distance_to(other, one[0], one[1]), distance_to(other, one[2], one[3]))
    return min(first, last)


@kernel()
def distance_to(surface: np.ndarray, x: float, y: float) -> float:
    """Return the least distance of a point from a surface (m)."""
    return distance_to_segment(x, y, surface[0], surface[1], surface[2], surface[3])


@kernel()
def may_be_close(one: np.ndarray, other: np.ndarray, closeness: float) -> bool:
    """Return whether the bounding boxes of two surfaces are at most this far apart on each axis."""
    return bool(
        min(one[0], one[2]) - closeness <= max(other[0], other[2])
        and min(other[0], other[2]) - closeness <= max(one[0], one[2])
        and min(one[1], one[3]) - closeness <= max(other[1], other[3])
        and min(other[1], other[3]) - closeness <= max(one[1], one[3])
    )
