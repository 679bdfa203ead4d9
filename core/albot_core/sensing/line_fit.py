"""Lines through the points of a scan, by weighted total least squares. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.sensing.beam_model import RANGE_NOISE, BeamModel, variance_across

LEAST_POINTS = 4
"""Minimum number of points in each part of a bent span."""
TINY = 1e-12
"""Lower bound of variances, for a range of 0, whose point gets no weight."""
LEAST_NOISE = RANGE_NOISE
"""Minimum standard deviation of points from a line (m)."""


class Moments(NamedTuple):
    """Sums over points (x, y)."""

    size: float
    x: float
    y: float
    xx: float
    xy: float
    yy: float


NOTHING = Moments(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel()
def fit_line(
    points: np.ndarray,
    first: int,
    last: int,
    eye: tuple[float, float],
    model: BeamModel,
    weights: np.ndarray,
    line: np.ndarray,
) -> None:
    """Fit a line to points first..last by total least squares: line = x, y, dx, dy.

    (x, y) is the points' mean; the unit direction (dx, dy) runs from first to last. The laser is at
    `eye`. `weights` (points,) is a scratch buffer.
    """
    aside = _aside(points, first, last, eye)
    n = mx = my = 0.0
    for i in range(first, last + 1):
        w = weights[i] = _weight(points, i, eye, model, aside)
        n += w
        mx += w * points[i, 0]
        my += w * points[i, 1]
    mx /= n
    my /= n
    sxx = sxy = syy = 0.0
    for i in range(first, last + 1):
        w = weights[i]
        x, y = points[i, 0] - mx, points[i, 1] - my
        sxx += w * x * x
        sxy += w * x * y
        syy += w * y * y
    angle = 0.5 * np.arctan2(2 * sxy, sxx - syy)
    dx, dy = np.cos(angle), np.sin(angle)
    run_x = points[last, 0] - points[first, 0]
    run_y = points[last, 1] - points[first, 1]
    if dx * run_x + dy * run_y < 0:
        dx, dy = -dx, -dy
    line[0], line[1], line[2], line[3] = mx, my, dx, dy


@kernel()
def find_bend(points: np.ndarray, first: int, last: int, significance: float) -> int:
    """Return the point at which two lines fit points first..last best, or -1 if one line is enough.

    Two lines are better if the F statistic, of the residual that the second line explains by the
    one that remains, is above `significance`. The noise is estimated from the points themselves, as
    at least LEAST_NOISE.
    """
    count = last - first + 1
    if count < 2 * LEAST_POINTS:
        return -1
    total, part = NOTHING, NOTHING
    for i in range(first, last + 1):
        total = _sum(total, _moments_of(points, first, i), 1.0)
    one = best = _residual(total)
    where = -1
    if one <= 2.0 * significance * LEAST_NOISE**2:
        return -1
    for i in range(first, last - LEAST_POINTS + 2):
        rest = _sum(total, part, -1.0)
        part = _sum(part, _moments_of(points, first, i), 1.0)
        if i - first + 1 >= LEAST_POINTS:
            two = _residual(part) + _residual(rest)
            if two < best:
                best, where = two, i
    noise = max(best / (count - 4), LEAST_NOISE**2)
    return where if one - best > 2.0 * significance * noise else -1


@kernel()
def _aside(points: np.ndarray, first: int, last: int, eye: tuple[float, float]) -> float:
    """Return the distance of the laser from the line through points `first` and `last` (m)."""
    dx, dy = points[last, 0] - points[first, 0], points[last, 1] - points[first, 1]
    x, y = points[first, 0] - eye[0], points[first, 1] - eye[1]
    return float((x * dy - y * dx) / max(np.sqrt(dx * dx + dy * dy), 1e-9))


@kernel()
def _weight(
    points: np.ndarray, i: int, eye: tuple[float, float], model: BeamModel, aside: float
) -> float:
    """Return the weight of a point of a wall whose line passes the laser at `aside` (m)."""
    if not model.is_used:
        return 1.0
    square = (points[i, 0] - eye[0]) ** 2 + (points[i, 1] - eye[1]) ** 2
    return float(square / max(variance_across(square, aside, model), TINY))


@kernel()
def _moments_of(points: np.ndarray, first: int, i: int) -> Moments:
    """Return the moments of a point, relative to the point `first`."""
    x, y = points[i, 0] - points[first, 0], points[i, 1] - points[first, 1]
    return Moments(1.0, x, y, x * x, x * y, y * y)


@kernel()
def _sum(a: Moments, b: Moments, sign: float) -> Moments:
    """Return the sum of two moments, or their difference for a `sign` of -1."""
    return Moments(
        a.size + sign * b.size,
        a.x + sign * b.x,
        a.y + sign * b.y,
        a.xx + sign * b.xx,
        a.xy + sign * b.xy,
        a.yy + sign * b.yy,
    )


@kernel()
def _residual(m: Moments) -> float:
    """Return the sum of squared distances of the points from their line (m²).

    It is the smaller eigenvalue of the scatter; for points in a row, its determinant by its trace.
    """
    n = m.size
    xx, xy, yy = n * m.xx - m.x * m.x, n * m.xy - m.x * m.y, n * m.yy - m.y * m.y
    return float((xx * yy - xy * xy) / (n * (xx + yy)))
