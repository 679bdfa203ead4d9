"""Recognising what is remembered nearby and localising by all of it at once.

This is ours, in place of algorithms 1 and 2. The thesis follows landmarks from view to view
under the odometer's turn, and one of them localises the robot. Here the turn is first looked
for (`turning`). Then all that the map holds nearby and that is seen again says together
where the robot is, landmarks by their occluding and corner points and plain walls by their
lines. Only what is remembered around the robot takes part, and nothing remembered is
corrected by it.
"""

from __future__ import annotations

import numpy as np

from albot_core.albot1.config import Limits
from albot_core.albot1.memory import NEVER, VISIT, Memory
from albot_core.albot1.outlook import (
    Outlook,
    beside,
    describe_expected,
    describe_remembered,
    describe_seen,
)
from albot_core.albot1.recognition import wrap
from albot_core.albot1.sight import NOT_RECOGNIZED, Sight
from albot_core.albot1.turning import LINE_GAP, likeliest_turn
from albot_core.albot1.visits import meet_again
from albot_core.compiled import kernel, scratch
from albot_core.perception.surfaces import NO_EDGE

POINT_NOISE, POINT_NOISE_GROWTH = 0.05, 0.02
"""Standard deviation of an occluding or corner point (m), and its growth with range (m/m)."""
LINE_NOISE = 0.03
"""Standard deviation of a wall's place (m)."""
POINT_DOUBT, LINE_DOUBT = 0.15, 0.10
"""Residuals (m) at which a point and a wall count half (Cauchy weights)."""
ROUNDS, ITERATIONS = 3, 2
"""How often surfaces are matched anew, and the Gauss-Newton steps after each."""

MEETING_GAP, MEETING_ANGLE = 1.5, np.radians(15.0)
"""A wall this near to one of an earlier visit (m), and turned no more (rad), may be it: so far
a map drifts on its way round. It arouses a suspicion and no more."""

POINT, SIDE, LINE = 0, 1, 2
"""Columns of `matches`: the row of `expected` recognised by an end, which end, and the row
recognised by its line; -1 where none."""


@kernel()
def _match(
    seen: np.ndarray,
    seen_edges: np.ndarray,
    expected: np.ndarray,
    edges: np.ndarray,
    correction: np.ndarray,
    limits: Limits,
    matches: np.ndarray,
) -> int:
    """Match every surface seen to the nearest remembered point and line; count the points."""
    cos, sin = np.cos(correction[2]), np.sin(correction[2])
    points = 0
    for k in range(seen.shape[0]):
        matches[k, POINT] = matches[k, LINE] = -1
        nearest_gap, nearest_line = limits.landmark_gap**2, LINE_GAP
        for q in range(expected.shape[0]):
            if abs(wrap(expected[q, 5] - seen[k, 5] - correction[2])) >= limits.landmark_angle:
                continue
            for end in range(2):
                if seen_edges[k, end] == NO_EDGE or edges[q, end] == NO_EDGE:
                    continue
                x, y = seen[k, 2 * end], seen[k, 2 * end + 1]
                dx = correction[0] + cos * x - sin * y - expected[q, 2 * end]
                dy = correction[1] + sin * x + cos * y - expected[q, 2 * end + 1]
                gap = dx * dx + dy * dy
                if gap < nearest_gap:
                    nearest_gap = gap
                    matches[k, POINT], matches[k, SIDE] = q, end
            aside = beside(expected[q], seen[k], correction, cos, sin)
            if aside < nearest_line:
                nearest_line = aside
                matches[k, LINE] = q
        if matches[k, POINT] >= 0:
            points += 1
    return points


@kernel()
def _pull(
    normal: np.ndarray,
    slope: np.ndarray,
    x: float,
    y: float,
    nx: float,
    ny: float,
    residual: float,
    weight: float,
) -> None:
    """Add to the normal equations that the arm (x, y) should move by `residual` along (nx, ny)."""
    turn = x * ny - y * nx
    normal[0, 0] += weight * nx * nx
    normal[0, 1] += weight * nx * ny
    normal[1, 1] += weight * ny * ny
    normal[0, 2] += weight * nx * turn
    normal[1, 2] += weight * ny * turn
    normal[2, 2] += weight * turn * turn
    slope[0] += weight * residual * nx
    slope[1] += weight * residual * ny
    slope[2] += weight * residual * turn


@kernel()
def _pull_point(
    side: int,
    seen: np.ndarray,
    expected: np.ndarray,
    correction: np.ndarray,
    cos: float,
    sin: float,
    normal: np.ndarray,
    slope: np.ndarray,
) -> None:
    """Add a recognised landmark's point to the normal equations."""
    px, py = seen[2 * side], seen[2 * side + 1]
    x, y = cos * px - sin * py, sin * px + cos * py
    ex = expected[2 * side] - correction[0] - x
    ey = expected[2 * side + 1] - correction[1] - y
    noise = POINT_NOISE + POINT_NOISE_GROWTH * seen[8 + side]
    weight = 1.0 / (1.0 + (ex * ex + ey * ey) / POINT_DOUBT**2) / noise**2
    _pull(normal, slope, x, y, 1.0, 0.0, ex, weight)
    _pull(normal, slope, x, y, 0.0, 1.0, ey, weight)


@kernel()
def pull_line(
    seen: np.ndarray,
    wall: np.ndarray,
    correction: np.ndarray,
    cos: float,
    sin: float,
    normal: np.ndarray,
    slope: np.ndarray,
) -> None:
    """Add a recognised wall to the normal equations: both ends of the common part lie on it."""
    ux, uy = wall[6], wall[7]
    x0, y0 = cos * seen[0] - sin * seen[1], sin * seen[0] + cos * seen[1]
    x1, y1 = cos * seen[2] - sin * seen[3], sin * seen[2] + cos * seen[3]
    first = ux * (correction[0] + x0 - wall[0]) + uy * (correction[1] + y0 - wall[1])
    last = ux * (correction[0] + x1 - wall[0]) + uy * (correction[1] + y1 - wall[1])
    run = last - first
    if run <= 0.0:
        return
    for end in range(2):
        along = last if end else first
        part = (min(max(along, 0.0), wall[4]) - first) / run
        x, y = x0 + part * (x1 - x0), y0 + part * (y1 - y0)
        off = (correction[0] + x - wall[0]) * -uy + (correction[1] + y - wall[1]) * ux
        weight = min(seen[4], 3.0) / (1.0 + (off / LINE_DOUBT) ** 2) / LINE_NOISE**2
        _pull(normal, slope, x, y, -uy, ux, -off, weight)


@kernel()
def solve(normal: np.ndarray, slope: np.ndarray, step: np.ndarray) -> None:
    """Solve the symmetric 3 x 3 system (upper triangle given) by Cholesky's method."""
    a = np.sqrt(normal[0, 0])
    b, c = normal[0, 1] / a, normal[0, 2] / a
    d = np.sqrt(normal[1, 1] - b * b)
    e = (normal[1, 2] - b * c) / d
    f = np.sqrt(normal[2, 2] - c * c - e * e)
    u = slope[0] / a
    v = (slope[1] - b * u) / d
    w = (slope[2] - c * u - e * v) / f
    step[2] = w / f
    step[1] = (v - e * step[2]) / d
    step[0] = (u - b * step[1] - c * step[2]) / a


_matrix, _vector, _step, _correction = scratch(3, 3), scratch(3), scratch(3), scratch(3)


@kernel()
def _adjust(
    seen: np.ndarray,
    expected: np.ndarray,
    matches: np.ndarray,
    limits: Limits,
    correction: np.ndarray,
) -> None:
    """Gauss-Newton on the correction, held by the odometer's motion and the likeliest turn."""
    normal, slope, step = _matrix(), _vector(), _step()
    for _ in range(ITERATIONS):
        cos, sin = np.cos(correction[2]), np.sin(correction[2])
        for i in range(3):
            for j in range(3):
                normal[i, j] = 0.0
        normal[0, 0] = normal[1, 1] = 1.0 / limits.motion_error**2
        normal[2, 2] = 1.0 / limits.turn_error**2
        for i in range(3):
            slope[i] = -normal[i, i] * correction[i]
        for k in range(seen.shape[0]):
            if matches[k, POINT] >= 0:
                wall, side = expected[matches[k, POINT]], matches[k, SIDE]
                _pull_point(side, seen[k], wall, correction, cos, sin, normal, slope)
            if matches[k, LINE] >= 0:
                wall = expected[matches[k, LINE]]
                pull_line(seen[k], wall, correction, cos, sin, normal, slope)
        solve(normal, slope, step)
        for i in range(3):
            correction[i] += step[i]


@kernel()
def _meet_earlier(
    memory: Memory,
    slots: np.ndarray,
    expected: np.ndarray,
    seen: np.ndarray,
    correction: np.ndarray,
) -> None:
    """Note which of the remembered surfaces are of earlier visits and may be in view."""
    cos, sin = np.cos(correction[2]), np.sin(correction[2])
    for q in range(expected.shape[0]):
        visit = memory.marks[slots[q]]
        if visit == memory.counts[VISIT] or memory.met[visit, 1] == NEVER:
            continue
        for k in range(seen.shape[0]):
            if abs(wrap(expected[q, 5] - seen[k, 5] - correction[2])) >= MEETING_ANGLE:
                continue
            if beside(expected[q], seen[k], correction, cos, sin) < MEETING_GAP:
                meet_again(memory, slots[q])
                break


@kernel()
def triangulate(
    memory: Memory,
    previous: Sight,
    current: Sight,
    motion: np.ndarray,
    limits: Limits,
    outlook: Outlook,
) -> int:
    """Move `current.pose` from where the odometer says to where the remembered surfaces say.

    Sets `current.slots` for the landmarks recognised there; returns their number.
    """
    kept = describe_seen(current, limits, outlook)
    which, seen_edges, seen = outlook.which[:kept], outlook.seen_edges[:kept], outlook.seen[:kept]
    kept = describe_expected(previous, motion, limits, outlook)
    edges, expected = outlook.edges[:kept], outlook.expected[:kept]
    turn = likeliest_turn(seen, seen_edges, expected, edges, limits, outlook.votes)
    current.pose[2] = wrap(current.pose[2] + turn)

    kept = describe_remembered(memory, current.pose, seen, limits, outlook)
    slots, edges, expected = outlook.slots[:kept], outlook.edges[:kept], outlook.expected[:kept]
    correction, matches = _correction(), outlook.matches
    correction[0] = correction[1] = correction[2] = 0.0
    for _ in range(ROUNDS):
        _match(seen, seen_edges, expected, edges, correction, limits, matches)
        _adjust(seen, expected, matches, limits, correction)
    recognized = _match(seen, seen_edges, expected, edges, correction, limits, matches)

    for k in range(current.size[0]):
        current.slots[k] = NOT_RECOGNIZED
    for k in range(seen.shape[0]):
        if matches[k, POINT] >= 0:
            current.slots[which[k]] = slots[matches[k, POINT]]
    _meet_earlier(memory, slots, expected, seen, correction)
    cos, sin = np.cos(current.pose[2]), np.sin(current.pose[2])
    current.pose[0] += cos * correction[0] - sin * correction[1]
    current.pose[1] += sin * correction[0] + cos * correction[1]
    current.pose[2] = wrap(current.pose[2] + correction[2])
    return int(recognized)
