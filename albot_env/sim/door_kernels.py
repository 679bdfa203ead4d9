"""Compiled doors: when they swing, and when they wait because something is in the way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from albot_core.geometry.directions import length_of
from albot_core.kernels.compiled import kernel
from albot_env.sim.noise_kernels import draw, draw_share
from albot_env.sim.plane_kernels import gap_to_ray, gap_to_sector
from albot_env.sim.thing_arrays import Stage

_GAP = 0.05
"""How far (m) from what is in its way a leaf stops, at least."""
_THERE = 1e-9
"""A leaf that lacks no more than this (rad) is where it is to be."""


@kernel()
def swing(stage: Stage, i: int, robot: np.ndarray, radius: float, duration: float) -> None:
    """Decide how fast the doors of robot i turn in the next while (s).

    `robot` (6,) is its state: x, y, heading, velocity x, y, turn rate.
    """
    for d in range(stage.robots[i].doors, stage.robots[i].doors_end):
        door = stage.doors[d]
        rest = door.heading + door.opening * door.wanted - door.angle
        door.rate = 0.0
        if abs(rest) <= _THERE:
            door.wait -= duration
            if door.wait <= 0.0:
                door.wanted = 1 - door.wanted
                _draw_stay(door)
            continue
        most = door.turn_rate * duration
        turn = min(max(rest, -most), most)
        if not _is_barred(stage, i, door, turn, robot, radius, duration):
            door.rate = turn / duration


@kernel()
def begin_doors(
    stage: Stage, i: int, key: np.uint64, place: int, robot: np.ndarray, radius: float
) -> None:
    """Shut or open the doors of robot i by chance.

    One in whose way somebody stands is where it is not drawn to be. `place` is that of the
    first door's key in the stream.
    """
    for d in range(stage.robots[i].doors, stage.robots[i].doors_end):
        door = stage.doors[d]
        door.key = draw(key, place + d - stage.robots[i].doors)
        door.rate = 0.0
        door.wanted = 1 if draw_share(door.key, 0) < 0.5 else 0
        door.angle = door.heading + door.opening * door.wanted
        if _is_barred(stage, i, door, 0.0, robot, radius, 0.0):
            door.wanted = 1 - door.wanted
            door.angle = door.heading + door.opening * door.wanted
        door.draws = 2
        _draw_stay(door)
        # It has been so for some of that time.
        door.wait *= draw_share(door.key, 1)


@kernel()
def _draw_stay(door: Any) -> None:
    """Draw how long a door stays as it is wanted now."""
    least = door.least_open if door.wanted else door.least_shut
    most = door.most_open if door.wanted else door.most_shut
    door.wait = least + (most - least) * draw_share(door.key, door.draws)
    door.draws += 1


@kernel()
def _is_barred(
    stage: Stage,
    i: int,
    door: Any,
    turn: float,
    robot: np.ndarray,
    radius: float,
    duration: float,
) -> bool:
    """Whether a door would come too near to something if it turned so far (rad)."""
    own = stage.robots[i]
    reach = radius + length_of(robot[3], robot[4]) * duration
    barred = _comes_near(door, turn, robot[0], robot[1], reach)
    for w in range(own.walkers, own.walkers_end):
        walker = stage.walkers[w]
        reach = walker.radius + length_of(walker.vx, walker.vy) * duration
        barred = barred or _comes_near(door, turn, walker.x, walker.y, reach)
    for b in range(own.boxes, own.boxes_end):
        # Discs in a row cover a box.
        box = stage.boxes[b]
        long, short = box.half_length, box.half_width
        heading = box.heading
        if short > long:
            long, short, heading = short, long, heading + math.pi / 2
        discs = math.ceil(long / short)
        cos, sin, each = math.cos(heading), math.sin(heading), long / discs
        along = each - long
        while along < long:
            x, y = box.x + along * cos, box.y + along * sin
            barred = barred or _comes_near(door, turn, x, y, length_of(each, short))
            along += 2 * each
    return barred


@kernel()
def _comes_near(door: Any, turn: float, x: float, y: float, reach: float) -> bool:
    """Whether a leaf that turns comes too near to a disc, and nearer than it is."""
    x, y = x - door.hinge_x, y - door.hinge_y
    gap = gap_to_sector(x, y, door.angle, turn, door.width)
    if gap >= reach + _GAP:
        return False
    return turn == 0.0 or gap < gap_to_ray(x, y, door.angle, door.width)


@kernel()
def gap_to_sweeps(stage: Stage, i: int, x: float, y: float) -> float:
    """Distance (m) of a point from all that the doors of robot i ever pass."""
    gap = np.inf
    for d in range(stage.robots[i].doors, stage.robots[i].doors_end):
        door = stage.doors[d]
        from_x, from_y = x - door.hinge_x, y - door.hinge_y
        gap = min(gap, gap_to_sector(from_x, from_y, door.heading, door.opening, door.width))
    return gap
