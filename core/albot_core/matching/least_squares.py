"""Gauss-Newton steps of a pose: normal equations summed over matched lines and points.

The equations are a tuple, so that compiled code keeps them in registers while it sums. Lines are
rows (see `lines.describe`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import rotate
from albot_core.kernels.compiled import kernel

POINT_NOISE, POINT_NOISE_GROWTH = 0.05, 0.02
"""Standard deviation of an occluding or corner point (m), and its growth with range (m/m)."""
LINE_NOISE = 0.03
"""Standard deviation of a wall's position (m)."""
POINT_SCALE, LINE_SCALE = 0.15, 0.10
"""Residuals (m) at which a point and a wall have half their weight (Cauchy weights)."""


class Equations(NamedTuple):
    """A symmetric 3 x 3 system for a step in x, y (m) and turn (rad)."""

    xx: float
    xy: float
    yy: float
    xt: float
    yt: float
    tt: float
    """The upper triangle of the matrix."""
    x: float
    y: float
    t: float
    """The right-hand side."""


@kernel()
def stiff(motion: float, turn: float) -> Equations:
    """Return equations that hold the step at 0, with weights for x and y, and for the turn."""
    return Equations(motion, 0.0, motion, 0.0, 0.0, turn, 0.0, 0.0, 0.0)


@kernel()
def held(
    correction: np.ndarray, goal: tuple[float, float], motion: float, turn: float
) -> Equations:
    """Return equations that pull the step to bring a correction (3,) to a goal and no turn.

    The goal is (x, y) (m); weights as for `stiff`.
    """
    x, y = motion * (goal[0] - correction[0]), motion * (goal[1] - correction[1])
    return Equations(motion, 0.0, motion, 0.0, 0.0, turn, x, y, -turn * correction[2])


@kernel()
def pulled_along(
    e: Equations, x: float, y: float, nx: float, ny: float, residual: float, weight: float
) -> Equations:
    """Add the equation that moves the arm (x, y) by `residual` along (nx, ny)."""
    turn = x * ny - y * nx
    return Equations(
        e.xx + weight * nx * nx,
        e.xy + weight * nx * ny,
        e.yy + weight * ny * ny,
        e.xt + weight * nx * turn,
        e.yt + weight * ny * turn,
        e.tt + weight * turn * turn,
        e.x + weight * residual * nx,
        e.y + weight * residual * ny,
        e.t + weight * residual * turn,
    )


@kernel()
def pulled_by_point(
    equations: Equations,
    side: int,
    seen: np.ndarray,
    expected: np.ndarray,
    correction: np.ndarray,
    cos: float,
    sin: float,
) -> Equations:
    """Add the equations that move a landmark's end `side` to that of its remembered surface."""
    px, py = seen[2 * side], seen[2 * side + 1]
    x, y = rotate(cos, sin, px, py)
    ex = expected[2 * side] - correction[0] - x
    ey = expected[2 * side + 1] - correction[1] - y
    noise = POINT_NOISE + POINT_NOISE_GROWTH * seen[8 + side]
    weight = 1.0 / (1.0 + (ex * ex + ey * ey) / POINT_SCALE**2) / noise**2
    equations = pulled_along(equations, x, y, 1.0, 0.0, ex, weight)
    return pulled_along(equations, x, y, 0.0, 1.0, ey, weight)


@kernel()
def pulled_by_line(
    equations: Equations,
    seen: np.ndarray,
    wall: np.ndarray,
    correction: np.ndarray,
    cos: float,
    sin: float,
) -> Equations:
    """Add the equations that move both ends of the common part onto a recognised wall."""
    ux, uy = wall[6], wall[7]
    x0, y0 = rotate(cos, sin, seen[0], seen[1])
    x1, y1 = rotate(cos, sin, seen[2], seen[3])
    first = ux * (correction[0] + x0 - wall[0]) + uy * (correction[1] + y0 - wall[1])
    last = ux * (correction[0] + x1 - wall[0]) + uy * (correction[1] + y1 - wall[1])
    run = last - first
    if run <= 0.0:
        return equations
    for end in range(2):
        along = last if end else first
        part = (min(max(along, 0.0), wall[4]) - first) / run
        x, y = x0 + part * (x1 - x0), y0 + part * (y1 - y0)
        off = (correction[0] + x - wall[0]) * -uy + (correction[1] + y - wall[1]) * ux
        weight = min(seen[4], 3.0) / (1.0 + (off / LINE_SCALE) ** 2) / LINE_NOISE**2
        equations = pulled_along(equations, x, y, -uy, ux, -off, weight)
    return equations


@kernel()
def solved(e: Equations) -> tuple[float, float, float]:
    """Return the step in x, y (m) and turn (rad), by Cholesky decomposition."""
    a = np.sqrt(e.xx)
    b, c = e.xy / a, e.xt / a
    d = np.sqrt(e.yy - b * b)
    f = (e.yt - b * c) / d
    g = np.sqrt(e.tt - c * c - f * f)
    u = e.x / a
    v = (e.y - b * u) / d
    w = (e.t - c * u - f * v) / g
    turn = w / g
    y = (v - f * turn) / d
    return (u - b * y - c * turn) / a, y, turn
