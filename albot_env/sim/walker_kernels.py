"""Compiled walkers: the social force model of Helbing and Molnár.

D. Helbing and P. Molnár, "Social force model for pedestrian dynamics", Physical Review E 51,
4282 (1995); equation numbers are that paper's, and so are the constants but where it says
so. Three things differ. A walker follows the straight legs of a route and looks a metre
ahead along them, so that what pushes it aside cannot lead it into a dead end. It is a disc
and not a point: distances are reduced by the radii. And it steps to the side of whoever
stands in its way, for which the paper has random fluctuations, and turns round where it
gets nowhere.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from albot_env.sim.door_kernels import gap_to_sweeps
from albot_env.sim.noise_kernels import draw, draw_share
from albot_env.sim.plane_kernels import nearest_on
from albot_env.sim.thing_arrays import Stage, Walkers

_RELAXATION = 0.5
"""Time in which a walker reaches its speed (s), τ."""
_EXCESS = 1.3
"""Greatest speed over the one wanted, equation (11)."""
_REPULSION, _REACH = 2.1, 0.3
"""Potential (m²/s²) and range (m) of the repulsion from others, V⁰ and σ, equation (13)."""
_STRIDE = 2.0
"""For how long the others' steps are foreseen (s), Δt, equation (4)."""
_WALL_REPULSION, _WALL_REACH = 1.4, 0.1
"""The same of walls, U⁰ and R. The paper's 10 m²/s² and 0.2 m bar a door of 75 cm; these
push as hard at a touch."""
_SIGHT = math.cos(math.radians(100.0))
"""Who is outside the field of view of 200°, 2φ, …"""
_BEHIND = 0.5
"""… counts for so much, c, equation (8)."""
_SIDESTEP = 0.5
"""Share of the repulsion that acts sideways when somebody stands ahead."""
_STRONGEST = 5.0
"""The greatest acceleration that a walker asks of its legs (m/s²)."""
_AHEAD = 1.0
"""How far ahead on its leg a walker looks (m)."""
_ARRIVED = 0.3
"""How near to its end a leg counts as walked (m)."""
_SLOW = 0.2
"""Slower than this share of its speed a walker gets nowhere …"""
_PATIENCE = 3.0
"""… and turns round after so long (s)."""
_TRIES = 32
"""How many places a walker's beginning is chosen from."""
_BERTH = 0.5
"""How far (m) from the robot it begins, where there is a choice."""


@njit(cache=True, error_model="numpy")
def walk(stage: Stage, i: int, robot: np.ndarray, radius: float, duration: float) -> None:
    """Decide the velocities that the walkers of robot i try to reach in the next while (s).

    `robot` (6,) is its state: x, y, heading, velocity x, y, turn rate.
    """
    walkers = stage.walkers
    for w in range(walkers.at[i], walkers.at[i + 1]):
        x, y, vx, vy = walkers.states[w]
        _lose_patience(walkers, w, duration)
        ex, ey = _direction(walkers, w)
        speed = walkers.speeds[w]
        # Eq. (2): acceleration towards the velocity wanted.
        fx, fy = (speed * ex - vx) / _RELAXATION, (speed * ey - vy) / _RELAXATION
        size = walkers.radii[w]
        gx, gy = _away_from(x - robot[0], y - robot[1], robot[3], robot[4], size + radius, ex, ey)
        fx, fy = fx + gx, fy + gy
        for v in range(walkers.at[i], walkers.at[i + 1]):
            if v == w:
                continue
            other_x, other_y, other_vx, other_vy = walkers.states[v]
            sizes = size + walkers.radii[v]
            gx, gy = _away_from(x - other_x, y - other_y, other_vx, other_vy, sizes, ex, ey)
            fx, fy = fx + gx, fy + gy
        gx, gy = _away_from_walls(stage, i, x, y, size)
        fx, fy = _clipped(fx + gx, fy + gy, _STRONGEST)
        # Eq. (10) and (11): the velocity, at most so much over the one wanted.
        vx, vy = _clipped(vx + fx * duration, vy + fy * duration, _EXCESS * speed)
        walkers.wanted[w, 0], walkers.wanted[w, 1] = vx, vy


@njit(cache=True, error_model="numpy")
def _clipped(x: float, y: float, most: float) -> tuple[float, float]:
    length = math.hypot(x, y)
    return (x, y) if length <= most else (x * most / length, y * most / length)


@njit(cache=True, error_model="numpy")
def _away_from(
    x: float, y: float, vx: float, vy: float, sizes: float, ex: float, ey: float
) -> tuple[float, float]:
    """The repulsion from another, eq. (3), (4), (8), of a walker who wants to go along ex, ey.

    x, y is the walker's place as seen from the other, who moves with vx, vy.
    """
    from_x, from_y = x - vx * _STRIDE, y - vy * _STRIDE
    far, near = max(math.hypot(x, y), 1e-6), max(math.hypot(from_x, from_y), 1e-6)
    stride = math.hypot(vx, vy) * _STRIDE
    b = max(math.sqrt(max((far + near) ** 2 - stride**2, 0.0)) / 2, 1e-6)
    # The gradient of b; the potential falls by exp(-b / σ).
    slope = (far + near) / (4 * b)
    gx, gy = slope * (x / far + from_x / near), slope * (y / far + from_y / near)
    strength = _REPULSION / _REACH * math.exp(-max(b - sizes, 0.0) / _REACH)
    # The other is seen in the direction opposite to the push.
    ahead = -(ex * x + ey * y) / far
    strength *= 1.0 if ahead >= _SIGHT else _BEHIND
    gx, gy = _clipped(strength * gx, strength * gy, _STRONGEST)
    if ahead > 0.0:
        # One who stands to the left, or straight ahead, is passed on the right.
        side = 1.0 if ex * y - ey * x <= 1e-9 else -1.0
        push = _SIDESTEP * ahead * math.hypot(gx, gy)
        gx, gy = gx + side * push * ey, gy - side * push * ex
    return gx, gy


@njit(cache=True, error_model="numpy")
def _away_from_walls(stage: Stage, i: int, x: float, y: float, size: float) -> tuple[float, float]:
    """The repulsion, eq. (5), from the nearest of walls, doors and boxes."""
    gap, near_x, near_y = _nearest(stage.walls, stage.walls_at[i, 0], stage.walls_at[i, 1], x, y)
    first = stage.segments_at[i]
    doors = stage.doors.at[i + 1] - stage.doors.at[i]
    boxes = stage.boxes.at[i + 1] - stage.boxes.at[i]
    last = first + doors + 4 * boxes
    other, other_x, other_y = _nearest(stage.segments, first, last, x, y)
    if other < gap:
        gap, near_x, near_y = other, other_x, other_y
    push = _WALL_REPULSION / _WALL_REACH * math.exp(-max(gap - size, 0.0) / _WALL_REACH)
    gap = max(gap, 1e-6)
    return push * (x - near_x) / gap, push * (y - near_y) / gap


@njit(cache=True, error_model="numpy")
def _nearest(
    segments: np.ndarray, first: int, last: int, x: float, y: float
) -> tuple[float, float, float]:
    """Distance of the nearest point of some segments, and that point."""
    least, near_x, near_y = np.inf, 0.0, 0.0
    for k in range(first, last):
        x1, y1, x2, y2 = segments[k]
        at_x, at_y = nearest_on(x, y, x1, y1, x2, y2)
        squared = (at_x - x) ** 2 + (at_y - y) ** 2
        if squared < least:
            least, near_x, near_y = squared, at_x, at_y
    return math.sqrt(least), near_x, near_y


@njit(cache=True, error_model="numpy")
def _direction(walkers: Walkers, w: int) -> tuple[float, float]:
    """Where a walker wants to go: to the point of its leg a little ahead of it."""
    course, x, y = walkers.courses[w], walkers.states[w, 0], walkers.states[w, 1]
    along, length = _progress(walkers, w)
    if along > length - min(_ARRIVED, length / 2):
        course[0], course[1] = course[1], _after(walkers, w)
        along, length = _progress(walkers, w)
    base = walkers.route_at[w]
    x1, y1 = walkers.waypoints[base + course[0]]
    x2, y2 = walkers.waypoints[base + course[1]]
    share = min(max(along, 0.0) + _AHEAD, length) / length
    to_x, to_y = x1 + share * (x2 - x1) - x, y1 + share * (y2 - y1) - y
    far = max(math.hypot(to_x, to_y), 1e-6)
    return to_x / far, to_y / far


@njit(cache=True, error_model="numpy")
def _progress(walkers: Walkers, w: int) -> tuple[float, float]:
    """How far along its leg a walker is, and the leg's length (m)."""
    base = walkers.route_at[w]
    x1, y1 = walkers.waypoints[base + walkers.courses[w, 0]]
    x2, y2 = walkers.waypoints[base + walkers.courses[w, 1]]
    length = math.hypot(x2 - x1, y2 - y1)
    x, y = walkers.states[w, 0] - x1, walkers.states[w, 1] - y1
    return (x * (x2 - x1) + y * (y2 - y1)) / length, length


@njit(cache=True, error_model="numpy")
def _after(walkers: Walkers, w: int) -> int:
    """The waypoint after the next; at the end of an open route the walker turns round."""
    count = walkers.route_at[w + 1] - walkers.route_at[w]
    course = walkers.courses[w]
    if walkers.closed[w]:
        return int((course[1] + course[2]) % count)
    if not 0 <= course[1] + course[2] < count:
        course[2] = -course[2]
    return int(course[1] + course[2])


@njit(cache=True, error_model="numpy")
def _lose_patience(walkers: Walkers, w: int, duration: float) -> None:
    """Turn round one who has got nowhere for a while."""
    course = walkers.courses[w]
    slow = math.hypot(walkers.states[w, 2], walkers.states[w, 3]) < _SLOW * walkers.speeds[w]
    walkers.idle[w] = walkers.idle[w] + duration if slow else 0.0
    if walkers.idle[w] > _PATIENCE:
        walkers.idle[w] = 0.0
        course[0], course[1], course[2] = course[1], course[0], -course[2]


@njit(cache=True, error_model="numpy")
def begin_walkers(
    stage: Stage, i: int, key: np.uint64, first: int, x: float, y: float, radius: float
) -> None:
    """Put the walkers of robot i, which stands at x, y, on their routes by chance.

    They begin clear of it, of each other and of the doors where that can be had. `first` is
    the place of the first walker's key in the stream.
    """
    walkers = stage.walkers
    for w in range(walkers.at[i], walkers.at[i + 1]):
        own = draw(key, first + w - walkers.at[i])
        least, most = walkers.paces[w, 0], walkers.paces[w, 1]
        walkers.speeds[w] = least + (most - least) * draw_share(own, 0)
        walkers.courses[w, 2] = 1 if draw_share(own, 1) < 0.5 else -1
        best, share, leg = -np.inf, 0.0, 0
        for k in range(_TRIES):
            here, this = _any_place(walkers, w, own, 2 + k)
            _stand(walkers, w, here, this)
            room = _room(stage, i, w, x, y, radius)
            if room > best:
                best, share, leg = room, this, here
            if room >= 0.0:
                break
        _stand(walkers, w, leg, share)
        if best == -np.inf:
            _stand_farthest(walkers, w, x, y)
        walkers.states[w, 2] = walkers.states[w, 3] = 0.0
        walkers.wanted[w, 0] = walkers.wanted[w, 1] = 0.0
        walkers.idle[w] = 0.0


@njit(cache=True, error_model="numpy")
def _legs(walkers: Walkers, w: int) -> int:
    """How many legs a route has."""
    count = walkers.route_at[w + 1] - walkers.route_at[w]
    return int(count if walkers.closed[w] else count - 1)


@njit(cache=True, error_model="numpy")
def _any_place(walkers: Walkers, w: int, key: np.uint64, place: int) -> tuple[int, float]:
    """A leg of the route and a share of it, every metre as likely."""
    base, count = walkers.route_at[w], walkers.route_at[w + 1] - walkers.route_at[w]
    whole = 0.0
    for leg in range(_legs(walkers, w)):
        x1, y1 = walkers.waypoints[base + leg]
        x2, y2 = walkers.waypoints[base + (leg + 1) % count]
        whole += math.hypot(x2 - x1, y2 - y1)
    rest = whole * draw_share(key, place)
    for leg in range(_legs(walkers, w)):
        x1, y1 = walkers.waypoints[base + leg]
        x2, y2 = walkers.waypoints[base + (leg + 1) % count]
        length = math.hypot(x2 - x1, y2 - y1)
        if rest < length:
            return leg, rest / length
        rest -= length
    return 0, 0.0


@njit(cache=True, error_model="numpy")
def _stand(walkers: Walkers, w: int, leg: int, share: float) -> None:
    """Put a walker on a leg, to walk on the way round that it has."""
    base, count = walkers.route_at[w], walkers.route_at[w + 1] - walkers.route_at[w]
    onward = (leg + 1) % count
    x1, y1 = walkers.waypoints[base + leg]
    x2, y2 = walkers.waypoints[base + onward]
    walkers.states[w, 0], walkers.states[w, 1] = x1 + share * (x2 - x1), y1 + share * (y2 - y1)
    forth = walkers.courses[w, 2] == 1
    walkers.courses[w, 0], walkers.courses[w, 1] = (leg, onward) if forth else (onward, leg)


@njit(cache=True, error_model="numpy")
def _stand_farthest(walkers: Walkers, w: int, x: float, y: float) -> None:
    """Put a walker on the waypoint farthest from a point."""
    most, leg, share = -1.0, 0, 0.0
    for k in range(_legs(walkers, w)):
        for end in (0.0, 1.0):
            _stand(walkers, w, k, end)
            far = math.hypot(walkers.states[w, 0] - x, walkers.states[w, 1] - y)
            if far > most:
                most, leg, share = far, k, end
    _stand(walkers, w, leg, share)


@njit(cache=True, error_model="numpy")
def _room(stage: Stage, i: int, w: int, x: float, y: float, radius: float) -> float:
    """How much more than needed a walker has to all sides (m); -inf where it is on the robot."""
    walkers = stage.walkers
    here_x, here_y, size = walkers.states[w, 0], walkers.states[w, 1], walkers.radii[w]
    gap = math.hypot(here_x - x, here_y - y) - radius - size
    if gap <= 0.0:
        return -np.inf
    room: float = min(gap - _BERTH, gap_to_sweeps(stage.doors, i, here_x, here_y) - size)
    for v in range(walkers.at[i], w):
        other_x, other_y = walkers.states[v, 0], walkers.states[v, 1]
        gap = math.hypot(here_x - other_x, here_y - other_y)
        room = min(room, gap - size - walkers.radii[v])
    return room
