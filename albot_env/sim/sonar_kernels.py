"""Compiled sonars: the nearest echo inside a cone, exactly.

In a sonar's frame, x along its axis, the direction u = (1, t) stands for the bearing whose
tangent is t. Of a wall with ends a and b, a clockwise of b, what a sonar may hear is an
interval of t, each bound of it linear in t: the ends (a × u >= 0, u × b >= 0), the cone
(|t| <= tan half), and the two bearings at the specular limit from the wall's
perpendicular. Where another wall hides it is the same: its ends, and that it is nearer,
for 1/range = n · u / area with n = (b.y - a.y, a.x - b.x) and area = a × b. So no angle
is computed, and nothing is divided but for walls inside the cone.

The nearest point of a wall in an interval is the one nearest to the foot of the
perpendicular. Walls are tried in the order of that point's distance, and where it is
hidden, the search goes on from it to either side, behind what hides it; the first wall
whose point is nearer than all others' is the echo. It goes fastest with the near walls
first in the list. `seen` are the walls in the cone (see `surface_kernels`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from albot_env.sim.corner_kernels import corner_echo
from albot_env.sim.noise_kernels import draw
from albot_env.sim.surface_kernels import (
    AREA,
    AX,
    AY,
    BX,
    BY,
    HAIR,
    NEARER,
    Ear,
    bounded,
    gather,
    look,
)

SONAR_DRAWS = 1
"""Places in the robot's stream that each sonar takes at a reading."""


class Sonars(NamedTuple):
    """What the compiled sonars compute with; see `SonarConfig.constants`."""

    mounts: np.ndarray
    """(sonars, 4) float64: x, y (m), cosine and sine of the bearing, robot's frame."""
    horizon: float
    """Distance (m) from the robot's middle beyond which no sonar hears."""
    slope: float
    """Tangent of half the cone."""
    min_range: float
    """Nearer echoes are reported as this (m)."""
    max_range: float
    """Farther echoes are not heard (m)."""
    cos_limit: float
    """Cosine and sine of the specular limit."""
    sin_limit: float
    limit: float
    """The specular limit (rad)."""
    corner_reach: float
    """Distance (m) up to which concave corners echo."""
    edge_reach: float
    """Distance (m) up to which edges and wall ends echo."""
    noise: float
    """Standard deviation of a range (m)."""
    proportional_noise: float
    """Standard deviation of a range as a share of it."""
    crosstalk: int
    """Probability of hearing a neighbour's pulse, times 2^25."""
    dropout: int
    """Probability of missing an echo, times 2^26."""
    normals: np.ndarray
    """(4096,) float64: normal numbers of deviation 1, each as likely as the others."""


@njit(cache=True, error_model="numpy", nogil=True)
def listen(
    walls: np.ndarray,
    nearby: np.ndarray,
    things: np.ndarray,
    pose: np.ndarray,
    sonars: Sonars,
    key: np.uint64,
    place: int,
    echoes: np.ndarray,
) -> None:
    """Fill `echoes` (sonars,) with the ranges (m) that a robot's sonars report.

    Args:
        walls: All walls of the world (n, 4) float64, world frame (m).
        nearby: Which of them may be in reach (int32).
        things: Surfaces that move (k, 4) float64, world frame (m).
        pose: The robot's, world frame (3,).
        sonars: The sonars.
        key: Key of the robot's stream.
        place: First of the places in it that the reading takes: SONAR_DRAWS for each sonar.
        echoes: Filled; infinite where nothing came back.
    """
    most = nearby.shape[0] + things.shape[0]
    scratch = np.empty((10, most))
    ends, inside, seen = scratch[:4], scratch[4], scratch[5:]
    count = gather(walls, nearby, things, pose, sonars.horizon, ends)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for s in range(sonars.mounts.shape[0]):
        ear = _ear(sonars.mounts, s, cos, sin)
        found = look(ends, count, ear, sonars.slope, sonars.max_range, inside, seen)
        reach, _ = find_echo(seen, found, sonars)
        bits = draw(key, place + s)
        if np.int64((bits >> np.uint64(26)) & np.uint64(0x1FFFFFF)) < sonars.crosstalk:
            other = s + 1 if (bits >> np.uint64(51)) & np.uint64(1) else s - 1
            if 0 <= other < sonars.mounts.shape[0]:
                mouth = _ear(sonars.mounts, other, cos, sin)
                found = look(ends, count, mouth, sonars.slope, sonars.max_range, inside, seen)
                out, tangent = find_echo(seen, found, sonars)
                reach = min(reach, _overheard(ear, mouth, out, tangent))
        echoes[s] = _reported(reach, bits, sonars)


@njit(cache=True, error_model="numpy")
def find_echo(seen: np.ndarray, count: int, sonars: Sonars) -> tuple[float, float]:
    """Range (m) of the nearest echo, infinite where there is none, and tangent of its bearing."""
    best, best_tangent = sonars.max_range, 0.0
    tried, last = -1.0, -1
    while True:
        # The nearest of the walls that were not tried yet, if it is nearer than the best.
        reach, tangent, nearest = best, 0.0, -1
        for j in range(count):
            if min(seen[AX, j], seen[BX, j]) >= reach:
                continue
            found, slant = _nearest_point(seen, j, sonars)
            if found < reach and (found > tried or (found == tried and j > last)):
                reach, tangent, nearest = found, slant, j
        if nearest < 0:
            break
        shown, slant = _shown_point(seen, count, nearest, sonars, tangent)
        if shown < best:
            best, best_tangent = shown, slant
        if shown <= reach:
            break
        tried, last = reach, nearest
    if max(sonars.corner_reach, sonars.edge_reach) > 0.0:
        reaches = sonars.corner_reach, sonars.edge_reach
        best, best_tangent = corner_echo(
            seen, count, sonars.slope, sonars.limit, reaches, best, best_tangent
        )
    return (best, best_tangent) if best < sonars.max_range else (np.inf, 0.0)


@njit(cache=True, error_model="numpy")
def near_cell(walls: np.ndarray, x: float, y: float, reach: float, members: np.ndarray) -> int:
    """List the walls within `reach` (m) of the point (x, y).

    For all of a cell, give its middle and add half its diagonal to the reach.

    Args:
        walls: All walls (n, 4) (m).
        x: The point (m).
        y: The point (m).
        reach: Greatest distance (m).
        members: Filled with their numbers (int32), the nearest first.

    Returns:
        How many there are. Where `members` is too short, it holds the nearest.
    """
    count = 0
    distances = np.empty(members.shape[0])
    for j in range(walls.shape[0]):
        distance = _distance(walls, j, x, y)
        if distance > reach:
            continue
        k = min(count, members.shape[0])
        while k > 0 and distances[k - 1] > distance:
            if k < members.shape[0]:
                members[k], distances[k] = members[k - 1], distances[k - 1]
            k -= 1
        if k < members.shape[0]:
            members[k], distances[k] = j, distance
        count += 1
    return count


@njit(cache=True, error_model="numpy")
def _distance(walls: np.ndarray, j: int, x: float, y: float) -> float:
    """Distance (m) from the point (x, y) to a wall."""
    ex, ey = walls[j, 2] - walls[j, 0], walls[j, 3] - walls[j, 1]
    px, py = x - walls[j, 0], y - walls[j, 1]
    along = min(max((px * ex + py * ey) / (ex * ex + ey * ey), 0.0), 1.0)
    return math.hypot(px - along * ex, py - along * ey)


@njit(cache=True, error_model="numpy")
def _ear(mounts: np.ndarray, s: int, cos: float, sin: float) -> Ear:
    """Where a sonar is and points to, for a robot with this cosine and sine of its heading."""
    mx, my, mc, ms = mounts[s, 0], mounts[s, 1], mounts[s, 2], mounts[s, 3]
    return (
        cos * mx - sin * my,
        sin * mx + cos * my,
        cos * mc - sin * ms,
        sin * mc + cos * ms,
    )


@njit(cache=True, error_model="numpy")
def _span(ax: float, ay: float, bx: float, by: float, sonars: Sonars) -> tuple[float, float]:
    """Between which tangents a wall could be heard if nothing hid it; empty where low >= high."""
    low, high = -sonars.slope, sonars.slope
    low, high = bounded(low, high, ax, -ay)
    low, high = bounded(low, high, -bx, by)
    # u from the perpendicular turned clockwise by the limit to it turned the other way.
    nx, ny = by - ay, ax - bx
    cos, sin = sonars.cos_limit, sonars.sin_limit
    low, high = bounded(low, high, nx * cos + ny * sin, nx * sin - ny * cos)
    return bounded(low, high, ny * sin - nx * cos, ny * cos + nx * sin)


@njit(cache=True, error_model="numpy")
def _nearest_point(seen: np.ndarray, j: int, sonars: Sonars) -> tuple[float, float]:
    """Range and tangent of the nearest point of a wall that echoes, if nothing hides it.

    Infinite where there is none.
    """
    ax, ay, bx, by, area = seen[AX, j], seen[AY, j], seen[BX, j], seen[BY, j], seen[AREA, j]
    low, high = _span(ax, ay, bx, by, sonars)
    if area == 0.0 or not high - low > HAIR:
        return np.inf, 0.0
    nx, ny = by - ay, ax - bx
    # With the perpendicular's foot behind the sonar, the nearer end of the span.
    foot = ny / nx if nx > 0.0 else math.copysign(np.inf, ny)
    tangent = min(max(foot, low), high)
    return area * math.sqrt(1.0 + tangent * tangent) / (nx + ny * tangent), tangent


@njit(cache=True, error_model="numpy")
def _shown_point(
    seen: np.ndarray, count: int, j: int, sonars: Sonars, tangent: float
) -> tuple[float, float]:
    """Range and tangent of a wall's nearest point that echoes and is not hidden.

    `tangent` is that of the nearest point if nothing hid it; infinite where all is hidden.
    """
    ax, ay, bx, by, area = seen[AX, j], seen[AY, j], seen[BX, j], seen[BY, j], seen[AREA, j]
    low, high = _span(ax, ay, bx, by, sonars)
    nx, ny = by - ay, ax - bx
    best, best_tangent = np.inf, 0.0
    for side in (1.0, -1.0):
        end = high if side > 0.0 else low
        shown = _emerge(seen, count, j, tangent, side, end)
        if side * (end - shown) > HAIR:
            reach = area * math.sqrt(1.0 + shown * shown) / (nx + ny * shown)
            if reach < best:
                best, best_tangent = reach, shown
    return best, best_tangent


@njit(cache=True, error_model="numpy")
def _emerge(
    seen: np.ndarray, count: int, wall: int, tangent: float, side: float, end: float
) -> float:
    """From a tangent on to one side (1 or -1), the first where nothing hides the wall.

    At or beyond `end` where there is none. A gap narrower than HAIR, as between walls
    that touch, is none.
    """
    nx, ny = seen[BY, wall] - seen[AY, wall], seen[AX, wall] - seen[BX, wall]
    area = seen[AREA, wall]
    moved = True
    while moved and side * (end - tangent) > HAIR:
        moved = False
        probe = tangent + side * HAIR
        for j in range(count):
            ax, ay, bx, by = seen[AX, j], seen[AY, j], seen[BX, j], seen[BY, j]
            if j == wall or ax * probe < ay or by < bx * probe or seen[AREA, j] == 0.0:
                continue
            share = seen[AREA, j] * NEARER
            cx, cy = (by - ay) * area - nx * share, (ax - bx) * area - ny * share
            if cx + cy * probe > 0.0:
                ahead = min(_leave(ax, -ay, side), _leave(-bx, by, side))
                tangent = side * min(ahead, _leave(cy, cx, side))
                moved = True
                break
    return tangent


@njit(cache=True, error_model="numpy")
def _leave(slope: float, offset: float, side: float) -> float:
    """Where, going to one side, slope t + offset >= 0 ends to hold: side times that t."""
    return -side * offset / slope if slope * side < 0.0 else np.inf


@njit(cache=True, error_model="numpy")
def _overheard(ear: Ear, mouth: Ear, out: float, tangent: float) -> float:
    """Range (m) at which one sonar hears another's echo, which that hears at `out`.

    Half the way from the other to the point that echoes and on to this sonar.
    """
    if out == np.inf:
        return np.inf
    along = out / math.sqrt(1.0 + tangent * tangent)
    across = along * tangent
    x = mouth[0] + mouth[2] * along - mouth[3] * across
    y = mouth[1] + mouth[3] * along + mouth[2] * across
    return (out + math.hypot(x - ear[0], y - ear[1])) / 2


@njit(cache=True, error_model="numpy")
def _reported(reach: float, bits: np.uint64, sonars: Sonars) -> float:
    """What a sonar reports of an echo at this range: noise, misses, and both limits."""
    if np.int64(bits & np.uint64(0x3FFFFFF)) < sonars.dropout:
        return np.inf
    share = sonars.proportional_noise * reach
    deviation = math.sqrt(sonars.noise * sonars.noise + share * share)
    reach += deviation * sonars.normals[bits >> np.uint64(52)]
    return max(reach, sonars.min_range) if reach < sonars.max_range else np.inf
