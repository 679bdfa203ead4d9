"""Segments in compiled code: directions, frames, sides, crossings and distances.

A segment is x1, y1, x2, y2 (m), as a row of an array or a tuple; it runs from its first end to its
second. All arithmetic is in the order in which it stands, so that the bits do not depend on who
calls.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import PoseLike, length_of, transform_point
from albot_core.kernels.compiled import kernel

SegmentLike = np.ndarray | tuple[float, float, float, float]
"""x1, y1, x2, y2 (m), as an array or a tuple."""


@kernel()
def heading_of(segment: SegmentLike) -> float:
    """Return the direction of a segment from its first end to its second (rad)."""
    return math.atan2(segment[3] - segment[1], segment[2] - segment[0])


@kernel()
def transform_segment(frame: PoseLike, segment: SegmentLike, out: np.ndarray) -> None:
    """Write into `out` (4,) a segment given in `frame`, in the frame in which `frame` is given."""
    cos, sin = math.cos(frame[2]), math.sin(frame[2])
    out[0], out[1] = transform_point(frame, cos, sin, segment[0], segment[1])
    out[2], out[3] = transform_point(frame, cos, sin, segment[2], segment[3])


@kernel()
def left_of(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> float:
    """Return a positive number if (x, y) is left of the line from a to b; 0 on the line.

    It is the distance from the line times that of a from b.
    """
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@kernel()
def distance_left_of(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> float:
    """Return how far (x, y) is left of the line from a to b (m)."""
    return left_of(ax, ay, bx, by, x, y) / length_of(bx - ax, by - ay)


@kernel()
def crosses(one: SegmentLike, other: SegmentLike) -> bool:
    """Return whether two segments cross at a point inside both."""
    return _parts(one, other) and _parts(other, one)


@kernel()
def _parts(one: SegmentLike, other: SegmentLike) -> bool:
    """Return whether the line through a segment has the other's ends strictly on either side."""
    first = left_of(one[0], one[1], one[2], one[3], other[0], other[1])
    last = left_of(one[0], one[1], one[2], one[3], other[2], other[3])
    return first * last < 0.0


@kernel()
def crosses_line(line: SegmentLike, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether the way from a to b passes a segment between its ends.

    A point on a line counts as right of it, so that a way in pieces passes only once.
    """
    x1, y1, x2, y2 = line[0], line[1], line[2], line[3]
    if (left_of(x1, y1, x2, y2, ax, ay) > 0.0) == (left_of(x1, y1, x2, y2, bx, by) > 0.0):
        return False
    return (left_of(ax, ay, bx, by, x1, y1) > 0.0) != (left_of(ax, ay, bx, by, x2, y2) > 0.0)


@kernel()
def nearest_share(x: float, y: float, x1: float, y1: float, x2: float, y2: float) -> float:
    """Return which share of a segment's length its point nearest to (x, y) is from its first end.

    It is 0 for a segment without length.
    """
    along_x, along_y = x2 - x1, y2 - y1
    squared = along_x * along_x + along_y * along_y
    share = ((x - x1) * along_x + (y - y1) * along_y) / squared if squared > 0.0 else 0.0
    return min(max(share, 0.0), 1.0)


@kernel()
def nearest_on_segment(
    x: float, y: float, x1: float, y1: float, x2: float, y2: float
) -> tuple[float, float]:
    """Return the point of a segment that is nearest to a point."""
    share = nearest_share(x, y, x1, y1, x2, y2)
    return x1 + share * (x2 - x1), y1 + share * (y2 - y1)


@kernel()
def distance_to_segment(x: float, y: float, x1: float, y1: float, x2: float, y2: float) -> float:
    """Return the distance of a point from a segment (m)."""
    share = nearest_share(x, y, x1, y1, x2, y2)
    return length_of(x - x1 - share * (x2 - x1), y - y1 - share * (y2 - y1))
