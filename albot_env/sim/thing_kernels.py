"""Compiled steps of all movable things: what they do next, and where they are."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_env.sim.chipmunk_calls import take_step, visit
from albot_env.sim.chipmunk_kernels import (
    EACH_BODY,
    GET_BODY,
    PUSHES,
    SET_BODY,
    SET_SPIN,
    STATES,
    Engine,
)
from albot_env.sim.door_kernels import begin_doors, swing
from albot_env.sim.plane_kernels import put_side
from albot_env.sim.thing_arrays import Stage
from albot_env.sim.walker_kernels import begin_walkers, walk

SIDES = 8
"""Sides of the regular polygon that a walker is, to contacts and to rays."""
_KEYS = 2**62
"""Where in a robot's stream the keys of its things stand, beyond all that its sensors draw."""


@kernel(nogil=True)
def command(
    rows: np.ndarray,
    engine: Engine,
    stage: Stage,
    states: np.ndarray,
    radius: float,
    duration: float,
) -> None:
    """Let the doors and walkers of some robots decide what they do in the next while (s).

    `states` (robots, 6) are the robots', `radius` theirs (m).
    """
    for i in rows:
        own = stage.robots[i]
        swing(stage, i, states[i], radius, duration)
        for d in range(own.doors, own.doors_end):
            # A function of a pointer and a number, as a step is.
            take_step(engine.calls[SET_SPIN], stage.doors[d].body, stage.doors[d].rate)
        if own.walkers == own.walkers_end:
            continue
        walk(stage, i, states[i], radius, duration)
        place = 0
        for w in range(own.walkers, own.walkers_end):
            engine.buffer[place] = stage.walkers[w].wanted_x
            engine.buffer[place + 1] = stage.walkers[w].wanted_y
            engine.buffer[place + 2] = 0.0
            place += 3
        engine.filled[0] = 0
        visit(engine.calls[EACH_BODY], own.shelf, engine.calls[SET_BODY], engine.requests[PUSHES])


@kernel(nogil=True)
def observe(rows: np.ndarray, engine: Engine, stage: Stage) -> None:
    """Read out where the things of some robots are."""
    for i in rows:
        engine.filled[0] = 0
        space = stage.robots[i].space
        visit(engine.calls[EACH_BODY], space, engine.calls[GET_BODY], engine.requests[STATES])
        _take(engine.buffer, stage, i)
        outline(stage, i)


@kernel()
def begin(stage: Stage, i: int, key: np.uint64, robot: np.ndarray, radius: float) -> None:
    """Choose where the doors and walkers of robot i begin; its boxes are there already.

    `robot` (6,) is its state: x, y, heading, velocity x, y, turn rate.
    """
    own = stage.robots[i]
    begin_walkers(stage, i, key, _KEYS + own.doors_end - own.doors, robot, radius)
    begin_doors(stage, i, key, _KEYS, robot, radius)
    outline(stage, i)


@kernel()
def _take(buffer: np.ndarray, stage: Stage, i: int) -> None:
    """Take places and speeds from what pymunk has read out."""
    own = stage.robots[i]
    for d in range(own.doors, own.doors_end):
        door = stage.doors[d]
        door.angle = buffer[6 * door.row + 2]
    for b in range(own.boxes, own.boxes_end):
        box = stage.boxes[b]
        place = 6 * box.row
        box.x, box.y, box.heading = buffer[place], buffer[place + 1], buffer[place + 2]
    for w in range(own.walkers, own.walkers_end):
        walker = stage.walkers[w]
        place = 6 * walker.row
        walker.x, walker.y = buffer[place], buffer[place + 1]
        walker.vx, walker.vy = buffer[place + 3], buffer[place + 4]


@kernel()
def outline(stage: Stage, i: int) -> None:
    """Draw the segments of robot i's things: doors, then boxes, then walkers."""
    own = stage.robots[i]
    row = own.segments
    for d in range(own.doors, own.doors_end):
        door = stage.doors[d]
        x, y = door.hinge_x, door.hinge_y
        cos, sin = math.cos(door.angle), math.sin(door.angle)
        put_side(stage.segments, row, x, y, x + door.width * cos, y + door.width * sin)
        row += 1
    for b in range(own.boxes, own.boxes_end):
        for k in range(4):
            x1, y1 = _box_corner(stage.boxes[b], k)
            x2, y2 = _box_corner(stage.boxes[b], (k + 1) % 4)
            put_side(stage.segments, row, x1, y1, x2, y2)
            row += 1
    for w in range(own.walkers, own.walkers_end):
        for k in range(SIDES):
            x1, y1 = _walker_corner(stage.walkers[w], k)
            x2, y2 = _walker_corner(stage.walkers[w], (k + 1) % SIDES)
            put_side(stage.segments, row, x1, y1, x2, y2)
            row += 1


# Two sides that meet compute their corner alike, so that no ray slips between them.


@kernel()
def _box_corner(box: Any, k: int) -> tuple[float, float]:
    """One of a box's four corners, counter-clockwise."""
    along = box.half_length if k == 1 or k == 2 else -box.half_length
    aside = box.half_width if k >= 2 else -box.half_width
    cos, sin = math.cos(box.heading), math.sin(box.heading)
    return box.x + along * cos - aside * sin, box.y + along * sin + aside * cos


@kernel()
def _walker_corner(walker: Any, k: int) -> tuple[float, float]:
    angle = 2 * math.pi * k / SIDES
    return walker.x + walker.radius * math.cos(angle), walker.y + walker.radius * math.sin(angle)
