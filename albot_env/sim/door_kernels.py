"""Compiled doors: when they swing, and when they wait because something is in the way."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from albot_env.sim.noise_kernels import draw, draw_share
from albot_env.sim.plane_kernels import gap_to_ray, gap_to_sector
from albot_env.sim.thing_arrays import Boxes, Doors, Stage

_GAP = 0.05
"""How far (m) from what is in its way a leaf stops, at least."""
_THERE = 1e-9
"""A leaf that lacks no more than this (rad) is where it is to be."""


@njit(cache=True, error_model="numpy")
def swing(stage: Stage, i: int, robot: np.ndarray, radius: float, duration: float) -> None:
    """Decide how fast the doors of robot i turn in the next while (s).

    `robot` (6,) is its state: x, y, heading, velocity x, y, turn rate.
    """
    doors = stage.doors
    for d in range(doors.at[i], doors.at[i + 1]):
        heading, opening = doors.leaves[d, 0], doors.leaves[d, 2]
        rest = heading + opening * doors.wanted[d] - doors.angles[d]
        doors.rates[d] = 0.0
        if abs(rest) <= _THERE:
            doors.waits[d] -= duration
            if doors.waits[d] <= 0.0:
                doors.wanted[d] = 1 - doors.wanted[d]
                doors.waits[d] = _stay(doors, d)
            continue
        most = doors.leaves[d, 3] * duration
        turn = min(max(rest, -most), most)
        if not _is_barred(stage, i, d, turn, robot, radius, duration):
            doors.rates[d] = turn / duration


@njit(cache=True, error_model="numpy")
def begin_doors(
    stage: Stage, i: int, key: np.uint64, first: int, x: float, y: float, radius: float
) -> None:
    """Shut or open the doors of robot i, which stands at x, y, by chance.

    One on which somebody stands is where it is not drawn to be. `first` is the place of the
    first door's key in the stream.
    """
    doors = stage.doors
    for d in range(doors.at[i], doors.at[i + 1]):
        doors.keys[d] = draw(key, first + d - doors.at[i])
        doors.draws[d] = 0
        doors.wanted[d] = 1 if draw_share(doors.keys[d], 0) < 0.5 else 0
        doors.draws[d] = 1
        for _ in range(2):
            heading, opening = doors.leaves[d, 0], doors.leaves[d, 2]
            doors.angles[d] = heading + opening * doors.wanted[d]
            if not _is_occupied(stage, i, d, x, y, radius):
                break
            doors.wanted[d] = 1 - doors.wanted[d]
        # It has been so for some of its time.
        doors.waits[d] = _stay(doors, d) * draw_share(doors.keys[d], 1)
        doors.rates[d] = 0.0


@njit(cache=True, error_model="numpy")
def _stay(doors: Doors, d: int) -> float:
    """Draw how long a door stays as it is wanted now (s)."""
    least, most = doors.stays[d, doors.wanted[d], 0], doors.stays[d, doors.wanted[d], 1]
    doors.draws[d] += 1
    stay: float = least + (most - least) * draw_share(doors.keys[d], doors.draws[d])
    return stay


@njit(cache=True, error_model="numpy")
def _is_barred(
    stage: Stage,
    i: int,
    d: int,
    turn: float,
    robot: np.ndarray,
    radius: float,
    duration: float,
) -> bool:
    """Whether a door would come too near to something if it turned so far (rad)."""
    doors, boxes, walkers = stage.doors, stage.boxes, stage.walkers
    reach = radius + _GAP + math.hypot(robot[3], robot[4]) * duration
    if _comes_near(doors, d, turn, robot[0], robot[1], reach):
        return True
    for w in range(walkers.at[i], walkers.at[i + 1]):
        x, y, vx, vy = walkers.states[w]
        reach = walkers.radii[w] + _GAP + math.hypot(vx, vy) * duration
        if _comes_near(doors, d, turn, x, y, reach):
            return True
    for b in range(boxes.at[i], boxes.at[i + 1]):
        for k in range(discs_of(boxes, b)):
            x, y, reach = disc_of(boxes, b, k)
            if _comes_near(doors, d, turn, x, y, reach + _GAP):
                return True
    return False


@njit(cache=True, error_model="numpy")
def _comes_near(doors: Doors, d: int, turn: float, x: float, y: float, reach: float) -> bool:
    """Whether a leaf that turns comes within reach (m) of a point, and nearer than it is."""
    x, y = x - doors.hinges[d, 0], y - doors.hinges[d, 1]
    angle, width = doors.angles[d], doors.leaves[d, 1]
    gap = gap_to_sector(x, y, angle, turn, width)
    if gap >= reach:
        return False
    return min(gap, gap_to_ray(x, y, angle + turn, width)) < gap_to_ray(x, y, angle, width)


@njit(cache=True, error_model="numpy")
def _is_occupied(stage: Stage, i: int, d: int, x: float, y: float, radius: float) -> bool:
    """Whether a leaf touches the robot, somebody or a box where it is."""
    doors, boxes, walkers = stage.doors, stage.boxes, stage.walkers
    if _touches(doors, d, x, y, radius):
        return True
    for w in range(walkers.at[i], walkers.at[i + 1]):
        if _touches(doors, d, walkers.states[w, 0], walkers.states[w, 1], walkers.radii[w]):
            return True
    for b in range(boxes.at[i], boxes.at[i + 1]):
        for k in range(discs_of(boxes, b)):
            x, y, reach = disc_of(boxes, b, k)
            if _touches(doors, d, x, y, reach):
                return True
    return False


@njit(cache=True, error_model="numpy")
def _touches(doors: Doors, d: int, x: float, y: float, reach: float) -> bool:
    x, y = x - doors.hinges[d, 0], y - doors.hinges[d, 1]
    return gap_to_ray(x, y, doors.angles[d], doors.leaves[d, 1]) < reach


@njit(cache=True, error_model="numpy")
def gap_to_sweeps(doors: Doors, i: int, x: float, y: float) -> float:
    """Distance (m) of a point from all that the doors of robot i ever pass."""
    gap = np.inf
    for d in range(doors.at[i], doors.at[i + 1]):
        heading, width, opening = doors.leaves[d, 0], doors.leaves[d, 1], doors.leaves[d, 2]
        from_x, from_y = x - doors.hinges[d, 0], y - doors.hinges[d, 1]
        gap = min(gap, gap_to_sector(from_x, from_y, heading, opening, width))
    return gap


@njit(cache=True, error_model="numpy")
def discs_of(boxes: Boxes, b: int) -> int:
    """How many discs in a row cover a box well."""
    long, short = max(boxes.halves[b]), min(boxes.halves[b])
    return int(math.ceil(long / short))  # noqa: RUF046 (in numba it is a float)


@njit(cache=True, error_model="numpy")
def disc_of(boxes: Boxes, b: int, k: int) -> tuple[float, float, float]:
    """Middle x, y and radius (m) of one of the discs that cover a box."""
    x, y, heading = boxes.poses[b]
    long, short = max(boxes.halves[b]), min(boxes.halves[b])
    if boxes.halves[b, 1] > boxes.halves[b, 0]:
        heading += math.pi / 2
    each = long / discs_of(boxes, b)
    along = (2 * k + 1) * each - long
    radius = math.hypot(each, short)
    return x + along * math.cos(heading), y + along * math.sin(heading), radius
