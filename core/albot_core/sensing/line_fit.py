"""Lines through the points of a scan, by weighted total least squares. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.sensing.beam_model import RANGE_NOISE, BeamModel, precision_across

LEAST_POINTS = 4
"""Each part of a bent span has so many points at least."""
LEAST_NOISE = 0.5 * RANGE_NOISE
"""What points deviate from a line by chance, at least (m, standard deviation): the nearest points
of a wall may happen to lie in line."""


class Moments(NamedTuple):
    """Sums over points (x, y), by their weights w."""

    w: float
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
    line: np.ndarray,
) -> None:
    """Fit a line to points first..last by total least squares: line = x, y, dx, dy.

    (x, y) is the points' mean; the unit direction (dx, dy) runs from first to last. The laser is at
    `eye`.
    """
    aside = _aside(points, first, last, eye)
    n = mx = my = 0.0
    for i in range(first, last + 1):
        w = _weight(points, i, eye, model, aside)
        n += w
        mx += w * points[i, 0]
        my += w * points[i, 1]
    mx /= n
    my /= n
    sxx = sxy = syy = 0.0
    for i in range(first, last + 1):
        w = _weight(points, i, eye, model, aside)
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
def find_bend(
    points: np.ndarray,
    first: int,
    last: int,
    eye: tuple[float, float],
    model: BeamModel,
    significance: float,
) -> int:
    """Return the point at which two lines fit points first..last best, or -1 where one will do.

    Two are better where the F statistic, of what they explain beyond one by what they leave, is
    above `significance`. How much points scatter is taken from the points themselves.
    """
    count = last - first + 1
    if count < 2 * LEAST_POINTS:
        return -1
    aside = _aside(points, first, last, eye)
    total, part = NOTHING, NOTHING
    for i in range(first, last + 1):
        total = _sum(total, _moments_of(points, first, i, eye, model, aside), 1.0)
    one = best = _residual(total)
    where = -1
    for i in range(first, last - LEAST_POINTS + 2):
        rest = _sum(total, part, -1.0)
        part = _sum(part, _moments_of(points, first, i, eye, model, aside), 1.0)
        if i - first + 1 >= LEAST_POINTS:
            two = _residual(part) + _residual(rest)
            if two < best:
                best, where = two, i
    noise = max(best / (count - 4), LEAST_NOISE**2)
    return where if one - best > 2.0 * significance * noise else -1


@kernel()
def _aside(points: np.ndarray, first: int, last: int, eye: tuple[float, float]) -> float:
    """How far the chord of points first..last passes the laser (m)."""
    dx, dy = points[last, 0] - points[first, 0], points[last, 1] - points[first, 1]
    x, y = points[first, 0] - eye[0], points[first, 1] - eye[1]
    return float((x * dy - y * dx) / max(np.sqrt(dx * dx + dy * dy), 1e-9))


@kernel()
def _weight(
    points: np.ndarray, i: int, eye: tuple[float, float], model: BeamModel, aside: float
) -> float:
    """How much a point of a wall counts, whose line passes the laser `aside` (m)."""
    if not model.is_used:
        return 1.0
    square = (points[i, 0] - eye[0]) ** 2 + (points[i, 1] - eye[1]) ** 2
    return precision_across(square, aside, model)


@kernel()
def _moments_of(
    points: np.ndarray,
    first: int,
    i: int,
    eye: tuple[float, float],
    model: BeamModel,
    aside: float,
) -> Moments:
    """The moments of a point, from the point `first`."""
    w = _weight(points, i, eye, model, aside)
    x, y = points[i, 0] - points[first, 0], points[i, 1] - points[first, 1]
    return Moments(w, w * x, w * y, w * x * x, w * x * y, w * y * y)


@kernel()
def _sum(a: Moments, b: Moments, sign: float) -> Moments:
    """The moments of the points of both; with a `sign` of -1 without those of the second."""
    return Moments(
        a.w + sign * b.w,
        a.x + sign * b.x,
        a.y + sign * b.y,
        a.xx + sign * b.xx,
        a.xy + sign * b.xy,
        a.yy + sign * b.yy,
    )


@kernel()
def _scatter(m: Moments) -> tuple[float, float, float]:
    """The second moments about the mean: of x with x, x with y, and y with y."""
    return m.xx - m.x * m.x / m.w, m.xy - m.x * m.y / m.w, m.yy - m.y * m.y / m.w


@kernel()
def _residual(m: Moments) -> float:
    """The weighted sum of squared distances of the points from their line (m²)."""
    xx, xy, yy = _scatter(m)
    spread = np.sqrt((xx - yy) ** 2 + 4.0 * xy * xy)
    return float(max(0.5 * (xx + yy - spread), 0.0))
