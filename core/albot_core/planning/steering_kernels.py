"""Compiled steering: free ways all round, and how fast to take one of them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of, wrap_angle
from albot_core.kernels.compiled import kernel
from albot_core.planning.braking_kernels import least_distance

COUNT = 180
"""How many directions are weighed."""
_SPACING = 2 * math.pi / COUNT
_SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Shares of the speed wanted that are tried where braking would come too late."""
_SAME = 0.005
"""Things that come nearer by no more than this (m) count as no nearer: ranges are noisy."""
_LEAST = 0.015
"""…but not where less than this (m) is left: many such steps would end in touching them."""
_FARTHEST = 1.5
"""Within this the robot comes to a stand from any speed (m)."""


class Limits(NamedTuple):
    """The numbers of `SteeringConfig`, in its order."""

    radius: float
    tight: float
    lookahead: float
    braking: float
    body: float
    speed: float
    turn_rate: float
    creep: float
    ease: float
    gain: float
    pivot: float
    margin: float
    acceleration: float
    wheel_base: float
    step: float


@kernel()
def find_free_way(points: np.ndarray, radius: float, farthest: float, way: np.ndarray) -> None:
    """How far (m) a disc can go in each of `COUNT` directions from -pi on, into `way`.

    Points farther away than `farthest` are not minded.
    """
    for k in range(COUNT):
        way[k] = math.inf
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        away = math.sqrt(x * x + y * y)
        if away >= farthest:
            continue
        # A point that is already nearer than the radius must not bar the way along it.
        reach = min(radius, 0.97 * away)
        bearing = math.atan2(y, x)
        spread = math.asin(reach / away) if away > 0 else math.pi
        first = math.ceil((bearing - spread + math.pi) / _SPACING)
        last = math.floor((bearing + spread + math.pi) / _SPACING)
        for k in range(first, last + 1):
            off = bearing + math.pi - k * _SPACING
            aside = away * math.sin(off)
            free = away * math.cos(off) - math.sqrt(max(reach * reach - aside * aside, 0.0))
            way[k % COUNT] = max(0.0, min(way[k % COUNT], free))


@kernel(arrays=True)
def steer_towards(points: np.ndarray, x: float, y: float, s: Limits) -> tuple[float, float]:
    """The command of `steer` towards the target x, y (m, robot's frame)."""
    distance, bearing = length_of(x, y), math.atan2(y, x)
    way = np.empty(COUNT)
    direction, least = bearing, math.inf
    for radius in (s.radius, s.tight):
        find_free_way(points, radius, _FARTHEST, way)
        for k in range(COUNT):
            if way[k] >= min(s.lookahead, distance):
                candidate = k * _SPACING - math.pi
                off = abs(wrap_angle(candidate - bearing))
                if off < least:
                    direction, least = candidate, off
        if least <= s.pivot:
            break
    if least == math.inf:
        return 0.0, math.copysign(s.turn_rate, bearing)
    turn_rate = min(max(s.gain * direction, -s.turn_rate), s.turn_rate)
    if abs(direction) > s.pivot:
        return 0.0, turn_rate
    nearest = math.inf
    for i in range(points.shape[0]):
        nearest = min(nearest, length_of(points[i, 0], points[i, 1]))
    room = min(way[COUNT // 2], distance + 0.2)
    speed = min(
        s.speed,
        math.sqrt(2 * s.braking * room),
        s.creep + s.ease * max(0.0, nearest - s.body),
    )
    return speed * math.cos(direction) ** 2, turn_rate


@kernel(arrays=True)
def brake_in_time(
    points: np.ndarray, motion: tuple[float, float], command: tuple[float, float], s: Limits
) -> tuple[float, float]:
    """The command of `hold_back`; `motion` is speed and turn rate now."""
    near = np.empty_like(points)
    count, held = 0, math.inf
    for i in range(points.shape[0]):
        away = length_of(points[i, 0], points[i, 1])
        if away < _FARTHEST:
            near[count, 0], near[count, 1] = points[i, 0], points[i, 1]
            count += 1
            held = min(held, away)
    near = near[:count]
    if count == 0:
        return command
    enough = min(s.body + s.margin, max(held - _SAME, s.body + _LEAST))
    best, most = command, -math.inf
    for turning in (1.0, 0.0):
        for share in _SHARES:
            tried = command[0] * share, command[1] * turning
            distance = least_distance(near, motion, tried, s.wheel_base, s.acceleration, s.step)
            if distance >= enough:
                return tried
            if distance > most:
                best, most = tried, distance
    return best
