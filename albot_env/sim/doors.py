"""Compiled doors: when they swing, and when they wait because something blocks them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.geometry.segment_kernels import distance_to_segment
from albot_core.kernels.compiled import kernel
from albot_env.sim.noise import draw, draw_uniform
from albot_env.sim.obstacle_tables import ObstacleTables

_CLEARANCE = 0.05
"""Minimum distance (m) at which a leaf stops before an obstruction."""
_ARRIVED = 1e-9
"""A leaf within this angle (rad) of its target has arrived."""


@kernel()
def command_doors(
    tables: ObstacleTables, i: int, robot: np.ndarray, radius: float, duration: float
) -> None:
    """Set the turn rates of robot i's doors for the next `duration` (s).

    `robot` (6,) is the robot's state: x, y, heading, velocity x, y, turn rate.
    """
    for d in range(tables.robots[i].doors, tables.robots[i].doors_end):
        door = tables.doors[d]
        rest = door.heading + door.opening * door.wanted - door.angle
        door.rate = 0.0
        if abs(rest) <= _ARRIVED:
            door.wait -= duration
            if door.wait <= 0.0:
                door.wanted = 1 - door.wanted
                _draw_wait(door)
            continue
        most = door.turn_rate * duration
        turn = min(max(rest, -most), most)
        if not _is_blocked(tables, i, door, turn, robot, radius, duration):
            door.rate = turn / duration


@kernel()
def place_doors(
    tables: ObstacleTables, i: int, key: np.uint64, counter: int, robot: np.ndarray, radius: float
) -> None:
    """Open or close the doors of robot i at random, at the start of an episode.

    If something blocks a door's drawn state, the door gets the other state. `counter` is the
    counter of the first door's key.
    """
    for d in range(tables.robots[i].doors, tables.robots[i].doors_end):
        door = tables.doors[d]
        door.key = draw(key, counter + d - tables.robots[i].doors)
        door.rate = 0.0
        door.wanted = 1 if draw_uniform(door.key, 0) < 0.5 else 0
        door.angle = door.heading + door.opening * door.wanted
        if _is_blocked(tables, i, door, 0.0, robot, radius, 0.0):
            door.wanted = 1 - door.wanted
            door.angle = door.heading + door.opening * door.wanted
        door.draws = 2
        _draw_wait(door)
        # Part of the waiting time has already passed.
        door.wait *= draw_uniform(door.key, 1)


@kernel()
def _draw_wait(door: Any) -> None:
    """Draw how long a door stays in its wanted state."""
    least = door.least_open if door.wanted else door.least_shut
    most = door.most_open if door.wanted else door.most_shut
    door.wait = least + (most - least) * draw_uniform(door.key, door.draws)
    door.draws += 1


@kernel()
def _is_blocked(
    tables: ObstacleTables,
    i: int,
    door: Any,
    turn: float,
    robot: np.ndarray,
    radius: float,
    duration: float,
) -> bool:
    """Whether a door that turns by `turn` (rad) would come too near to something."""
    own = tables.robots[i]
    reach = radius + length_of(robot[3], robot[4]) * duration
    blocked = _comes_near(door, turn, robot[0], robot[1], reach)
    for w in range(own.walkers, own.walkers_end):
        walker = tables.walkers[w]
        reach = walker.radius + length_of(walker.vx, walker.vy) * duration
        blocked = blocked or _comes_near(door, turn, walker.x, walker.y, reach)
    for b in range(own.boxes, own.boxes_end):
        # A row of discs covers a box.
        box = tables.boxes[b]
        long, short = box.half_length, box.half_width
        heading = box.heading
        if short > long:
            long, short, heading = short, long, heading + math.pi / 2
        discs = math.ceil(long / short)
        cos, sin, each = math.cos(heading), math.sin(heading), long / discs
        along = each - long
        while along < long:
            x, y = box.x + along * cos, box.y + along * sin
            blocked = blocked or _comes_near(door, turn, x, y, length_of(each, short))
            along += 2 * each
    return blocked


@kernel()
def _comes_near(door: Any, turn: float, x: float, y: float, reach: float) -> bool:
    """Whether a turning leaf comes too near to a disc and nearer than it is now."""
    x, y = x - door.hinge_x, y - door.hinge_y
    gap = distance_to_sector(x, y, door.angle, turn, door.width)
    if gap >= reach + _CLEARANCE:
        return False
    return turn == 0.0 or gap < distance_to_ray(x, y, door.angle, door.width)


@kernel()
def distance_to_swept_area(tables: ObstacleTables, i: int, x: float, y: float) -> float:
    """Return the distance (m) of a point from the area that the doors of robot i sweep."""
    gap = np.inf
    for d in range(tables.robots[i].doors, tables.robots[i].doors_end):
        door = tables.doors[d]
        from_x, from_y = x - door.hinge_x, y - door.hinge_y
        gap = min(gap, distance_to_sector(from_x, from_y, door.heading, door.opening, door.width))
    return gap


@kernel()
def distance_to_ray(x: float, y: float, angle: float, length: float) -> float:
    """Return the distance of a point from a segment that starts at the origin, at an angle."""
    end_x, end_y = length * math.cos(angle), length * math.sin(angle)
    return distance_to_segment(x, y, 0.0, 0.0, end_x, end_y)


@kernel()
def distance_to_sector(x: float, y: float, first: float, turn: float, radius: float) -> float:
    """Return the distance of a point from the sector about the origin that a segment sweeps."""
    ahead = (math.atan2(y, x) - first) * (1.0 if turn >= 0.0 else -1.0)
    if ahead % (2.0 * math.pi) <= abs(turn):
        return max(0.0, length_of(x, y) - radius)
    gap = distance_to_ray(x, y, first, radius)
    return min(gap, distance_to_ray(x, y, first + turn, radius))
