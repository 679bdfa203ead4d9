"""Compiled walkers: the social force model of Helbing and Molnár.

D. Helbing and P. Molnár, "Social force model for pedestrian dynamics", Physical Review E 51,
4282 (1995). Equation numbers are that paper's, and so are the constants unless noted. We depart
from it in four ways. A walker follows the straight legs of a route and aims at a point one
metre ahead along them, so that a push aside cannot lead it into a dead end. It is a disc, not a
point: distances are reduced by the radii. Instead of the paper's random fluctuations, it steps to
the side of anyone in its way and turns round when it makes no progress. And it stops before the
robot and before boxes, into which the paper's forces may press it: it would push both about.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.geometry.segment_kernels import nearest_on_segment
from albot_core.kernels.compiled import kernel
from albot_env.sim.doors import distance_to_swept_area
from albot_env.sim.noise import draw, draw_uniform
from albot_env.sim.obstacle_tables import ObstacleTables

_RELAXATION = 0.5
"""Relaxation time, in which a walker reaches its speed (s), τ."""
_MAX_SPEED_RATIO = 1.3
"""Ratio of maximum speed to desired speed, equation (11)."""
_REPULSION, _RANGE = 2.1, 0.3
"""Potential (m²/s²) and range (m) of the repulsion between walkers, V⁰ and σ, equation (13)."""
_LOOK_AHEAD_TIME = 2.0
"""Time over which the others' steps are predicted (s), Δt, equation (4)."""
_WALL_REPULSION, _WALL_RANGE = 1.4, 0.1
"""The same for walls, U⁰ and R. The paper's 10 m²/s² and 0.2 m would block a door of 75 cm;
ours push less far and as hard on contact."""
_FIELD_OF_VIEW = math.cos(math.radians(100.0))
"""Cosine of half the field of view of 200° (2φ)."""
_OUT_OF_SIGHT = 0.5
"""Weight of a repulsion from outside the field of view, c, equation (8)."""
_SIDESTEP = 0.5
"""Share of the repulsion that acts sideways when the other is ahead."""
_MAX_ACCELERATION = 5.0
"""Maximum acceleration that a walker demands (m/s²)."""
_LOOK_AHEAD = 1.0
"""Distance from the walker to the point on its leg that it aims at (m)."""
_ARRIVED = 0.3
"""Distance from the end of a leg at which the next leg begins (m)."""
_STUCK_SPEED = 0.2
"""Share of its speed below which a walker makes no progress."""
_STUCK_TIME = 3.0
"""Time without progress after which a walker turns round (s)."""
_TRIES = 32
"""Number of places from which a walker's start is chosen."""
_START_CLEARANCE = 0.5
"""Desired distance (m) of a walker's start from the robot."""


@kernel()
def command_walkers(
    tables: ObstacleTables, i: int, robot: np.ndarray, radius: float, duration: float
) -> None:
    """Set the velocities that robot i's walkers try to reach in the next `duration` (s).

    `robot` (6,) is the robot's state: x, y, heading, velocity x, y, turn rate.
    """
    own = tables.robots[i]
    waypoints = tables.waypoints[own.waypoints : own.waypoints_end]
    # A robot's outlines are those of its doors, then of its boxes, then of its walkers.
    boxes = own.outlines + own.doors_end - own.doors
    boxes_end = boxes + 4 * (own.boxes_end - own.boxes)
    for w in range(own.walkers, own.walkers_end):
        walker = tables.walkers[w]
        x, y, size, speed = walker.x, walker.y, walker.radius, walker.speed
        _turn_round_if_stuck(walker, duration)
        ex, ey = _follow_route(walker, waypoints)
        # Eq. (2): acceleration towards the desired velocity.
        fx, fy = (speed * ex - walker.vx) / _RELAXATION, (speed * ey - walker.vy) / _RELAXATION
        for v in range(own.walkers - 1, own.walkers_end):
            if v == w:
                continue
            if v < own.walkers:
                from_x, from_y, vx, vy = x - robot[0], y - robot[1], robot[3], robot[4]
                sizes = size + radius
            else:
                other = tables.walkers[v]
                from_x, from_y, vx, vy = x - other.x, y - other.y, other.vx, other.vy
                sizes = size + other.radius
            gx, gy = _repulsion(from_x, from_y, vx, vy, sizes, ex, ey)
            fx, fy = fx + gx, fy + gy
        gx, gy = _wall_repulsion(tables, i, boxes_end, x, y, size)
        fx, fy = _clipped(fx + gx, fy + gy, _MAX_ACCELERATION)
        # Eq. (10) and (11): the velocity, limited relative to the desired speed.
        vx, vy = walker.vx + fx * duration, walker.vy + fy * duration
        vx, vy = _clipped(vx, vy, _MAX_SPEED_RATIO * speed)
        if own.boxes < own.boxes_end:
            _, near_x, near_y = _nearest(tables.outlines, boxes, boxes_end, x, y)
            vx, vy = _stop_short(x - near_x, y - near_y, vx, vy, size, duration)
        vx, vy = _stop_short(x - robot[0], y - robot[1], vx, vy, size + radius, duration)
        walker.wanted_x, walker.wanted_y = vx, vy


@kernel()
def _clipped(x: float, y: float, most: float) -> tuple[float, float]:
    length = length_of(x, y)
    return (x, y) if length <= most else (x * most / length, y * most / length)


@kernel()
def _repulsion(
    x: float, y: float, vx: float, vy: float, sizes: float, ex: float, ey: float
) -> tuple[float, float]:
    """Return the repulsion, eq. (3), (4), (8), of a walker who wants to go along ex, ey.

    x, y is the walker's position relative to the other, whose velocity is vx, vy.
    """
    from_x, from_y = x - vx * _LOOK_AHEAD_TIME, y - vy * _LOOK_AHEAD_TIME
    far, near = max(length_of(x, y), 1e-6), max(length_of(from_x, from_y), 1e-6)
    stride = length_of(vx, vy) * _LOOK_AHEAD_TIME
    b = max(math.sqrt(max((far + near) ** 2 - stride**2, 0.0)) / 2, 1e-6)
    # The gradient of b; the potential decays as exp(-b / σ).
    slope = (far + near) / (4 * b)
    gx, gy = slope * (x / far + from_x / near), slope * (y / far + from_y / near)
    strength = _REPULSION / _RANGE * math.exp(-max(b - sizes, 0.0) / _RANGE)
    # The other is in the direction opposite to the push.
    ahead = -(ex * x + ey * y) / far
    strength *= 1.0 if ahead >= _FIELD_OF_VIEW else _OUT_OF_SIGHT
    gx, gy = _clipped(strength * gx, strength * gy, _MAX_ACCELERATION)
    if ahead > 0.0:
        # Pass on the right of someone who stands to the left or straight ahead.
        side = 1.0 if ex * y - ey * x <= 1e-9 else -1.0
        push = _SIDESTEP * ahead * length_of(gx, gy)
        gx, gy = gx + side * push * ey, gy - side * push * ex
    return gx, gy


@kernel()
def _stop_short(
    x: float, y: float, vx: float, vy: float, sizes: float, duration: float
) -> tuple[float, float]:
    """Return a walker's velocity vx, vy without what would take it into something.

    x, y is the walker's position relative to that. The walker approaches it no faster than it can
    stop before it, at a speed v with v t + v² / (2 a) = gap.
    """
    far = max(length_of(x, y), 1e-6)
    gap = max(far - sizes, 0.0)
    lost = _MAX_ACCELERATION * duration
    most = math.sqrt(lost**2 + 2 * _MAX_ACCELERATION * gap) - lost
    excess = max(-(vx * x + vy * y) / far - most, 0.0)
    return vx + excess * x / far, vy + excess * y / far


@kernel()
def _wall_repulsion(
    tables: ObstacleTables, i: int, last: int, x: float, y: float, size: float
) -> tuple[float, float]:
    """Return the repulsion, eq. (5), from the nearest wall, door or box (outlines to `last`)."""
    own = tables.robots[i]
    gap, near_x, near_y = _nearest(tables.walls, own.walls, own.walls_end, x, y)
    other, other_x, other_y = _nearest(tables.outlines, own.outlines, last, x, y)
    if other < gap:
        gap, near_x, near_y = other, other_x, other_y
    push = _WALL_REPULSION / _WALL_RANGE * math.exp(-max(gap - size, 0.0) / _WALL_RANGE)
    gap = max(gap, 1e-6)
    return push * (x - near_x) / gap, push * (y - near_y) / gap


@kernel()
def _nearest(
    segments: np.ndarray, first: int, last: int, x: float, y: float
) -> tuple[float, float, float]:
    """Return the distance of the nearest point of some segments, and that point."""
    least, near_x, near_y = np.inf, 0.0, 0.0
    for k in range(first, last):
        x1, y1, x2, y2 = segments[k]
        at_x, at_y = nearest_on_segment(x, y, x1, y1, x2, y2)
        squared = (at_x - x) ** 2 + (at_y - y) ** 2
        if squared < least:
            least, near_x, near_y = squared, at_x, at_y
    return math.sqrt(least), near_x, near_y


@kernel()
def _follow_route(walker: Any, waypoints: np.ndarray) -> tuple[float, float]:
    """Return the direction to the point ahead on the leg; start the next leg at its end."""
    along, length, x1, y1, x2, y2 = _progress(walker, waypoints)
    if along > length - min(_ARRIVED, length / 2):
        _start_next_leg(walker)
        along, length, x1, y1, x2, y2 = _progress(walker, waypoints)
    share = min(max(along, 0.0) + _LOOK_AHEAD, length) / length
    to_x, to_y = x1 + share * (x2 - x1) - walker.x, y1 + share * (y2 - y1) - walker.y
    far = max(length_of(to_x, to_y), 1e-6)
    return to_x / far, to_y / far


@kernel()
def _progress(
    walker: Any, waypoints: np.ndarray
) -> tuple[float, float, float, float, float, float]:
    """Return a walker's progress along its leg, the leg's length, and its ends (m)."""
    last, onward = walker.first + walker.last, walker.first + walker.next
    x1, y1, x2, y2 = (
        waypoints[last, 0],
        waypoints[last, 1],
        waypoints[onward, 0],
        waypoints[onward, 1],
    )
    length = length_of(x2 - x1, y2 - y1)
    along = ((walker.x - x1) * (x2 - x1) + (walker.y - y1) * (y2 - y1)) / length
    return along, length, x1, y1, x2, y2


@kernel()
def _start_next_leg(walker: Any) -> None:
    """Head for the next waypoint; turn round at the end of an open route."""
    after = walker.next + walker.sense
    if walker.closed:
        after %= walker.count
    elif after < 0 or after >= walker.count:
        walker.sense = -walker.sense
        after = walker.next + walker.sense
    walker.last = walker.next
    walker.next = after


@kernel()
def _turn_round_if_stuck(walker: Any, duration: float) -> None:
    """Turn a walker round if it has made no progress for a while."""
    slow = length_of(walker.vx, walker.vy) < _STUCK_SPEED * walker.speed
    walker.idle = walker.idle + duration if slow else 0.0
    if walker.idle > _STUCK_TIME:
        walker.idle = 0.0
        last = walker.last
        walker.last = walker.next
        walker.next = last
        walker.sense = -walker.sense


@kernel()
def place_walkers(
    tables: ObstacleTables, i: int, key: np.uint64, counter: int, robot: np.ndarray, radius: float
) -> None:
    """Put the walkers of robot i on their routes at random.

    They start clear of the robot, of each other and of the doors where that is possible.
    `counter` is the counter of the first walker's key.
    """
    own = tables.robots[i]
    waypoints = tables.waypoints[own.waypoints : own.waypoints_end]
    for w in range(own.walkers, own.walkers_end):
        walker = tables.walkers[w]
        mine = draw(key, counter + w - own.walkers)
        walker.speed = walker.slowest + (walker.fastest - walker.slowest) * draw_uniform(mine, 0)
        walker.sense = 1 if draw_uniform(mine, 1) < 0.5 else -1
        walker.idle = walker.vx = walker.vy = walker.wanted_x = walker.wanted_y = 0.0
        legs = walker.count if walker.closed else walker.count - 1
        best, best_leg, best_share = -np.inf, 0, 0.0
        # The last candidates are the waypoints: the farthest one is always clear of the robot.
        for k in range(_TRIES + legs + 1):
            leg, share = int(legs * draw_uniform(mine, 2 + 2 * k)), draw_uniform(mine, 3 + 2 * k)
            if k >= _TRIES:
                leg, share = min(k - _TRIES, legs - 1), 1.0 if k - _TRIES == legs else 0.0
            _put_on_leg(walker, waypoints, leg, share)
            room = _free_space(tables, i, w, robot, radius)
            if room > best:
                best, best_leg, best_share = room, leg, share
            if best >= 0.0:
                break
        _put_on_leg(walker, waypoints, best_leg, best_share)


@kernel()
def _put_on_leg(walker: Any, waypoints: np.ndarray, leg: int, share: float) -> None:
    """Put a walker on a leg, facing the direction of its `sense`."""
    walker.last, walker.next = leg, (leg + 1) % walker.count
    _, _, x1, y1, x2, y2 = _progress(walker, waypoints)
    walker.x, walker.y = x1 + share * (x2 - x1), y1 + share * (y2 - y1)
    if walker.sense < 0:
        walker.last, walker.next = (leg + 1) % walker.count, leg


@kernel()
def _free_space(tables: ObstacleTables, i: int, w: int, robot: np.ndarray, radius: float) -> float:
    """Return a walker's clearance beyond what it needs (m); far below 0 on the robot."""
    walker = tables.walkers[w]
    size: float = walker.radius
    gap = length_of(walker.x - robot[0], walker.y - robot[1]) - radius - size
    if gap <= 0.0:
        return gap - 1e6
    room = min(gap - _START_CLEARANCE, distance_to_swept_area(tables, i, walker.x, walker.y) - size)
    for v in range(tables.robots[i].walkers, w):
        other = tables.walkers[v]
        gap = length_of(walker.x - other.x, walker.y - other.y)
        room = min(room, gap - size - float(other.radius))
    return room
