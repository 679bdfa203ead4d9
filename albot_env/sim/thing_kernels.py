"""Compiled steps of all movable things: what they do next, and where they are."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from albot_env.sim.chipmunk_calls import visit
from albot_env.sim.chipmunk_kernels import EACH_BODY, GET_BODY, PUSHES, SET_BODY, STATES, Engine
from albot_env.sim.door_kernels import begin_doors, swing
from albot_env.sim.plane_kernels import put_side
from albot_env.sim.thing_arrays import Boxes, Stage, Walkers
from albot_env.sim.walker_kernels import begin_walkers, walk

SIDES = 8
"""Sides of the regular polygon that a walker is, to contacts and to rays."""
_KEYS = 2**62
"""Where in a robot's stream the keys of its things stand, beyond all that its sensors draw."""


@njit(cache=True, error_model="numpy", nogil=True)
def command(
    engine: Engine, stage: Stage, states: np.ndarray, radius: float, duration: float
) -> None:
    """Let all doors and walkers decide what they do in the next while (s).

    `states` (robots, 6) are the robots', `radius` theirs (m).
    """
    walkers = stage.walkers
    for i in range(states.shape[0]):
        swing(stage, i, states[i], radius, duration)
        first, last = walkers.at[i], walkers.at[i + 1]
        if first == last:
            continue
        walk(stage, i, states[i], radius, duration)
        for w in range(first, last):
            engine.buffer[3 * (w - first)] = walkers.wanted[w, 0]
            engine.buffer[3 * (w - first) + 1] = walkers.wanted[w, 1]
            engine.buffer[3 * (w - first) + 2] = 0.0
        engine.filled[0] = 0
        shelf = stage.spaces[i, 1]
        visit(engine.calls[EACH_BODY], shelf, engine.calls[SET_BODY], engine.requests[PUSHES])


@njit(cache=True, error_model="numpy", nogil=True)
def observe(engine: Engine, stage: Stage, first: int, last: int) -> None:
    """Read out where the things of the robots from `first` up to `last` are."""
    for i in range(first, last):
        if stage.segments_at[i] == stage.segments_at[i + 1]:
            continue
        engine.filled[0] = 0
        space = stage.spaces[i, 0]
        visit(engine.calls[EACH_BODY], space, engine.calls[GET_BODY], engine.requests[STATES])
        _take(engine.buffer, stage, i)
        outline(stage, i)


@njit(cache=True, error_model="numpy", nogil=True)
def begin(stage: Stage, i: int, key: np.uint64, x: float, y: float, radius: float) -> None:
    """Put the things of robot i, which begins at x, y, where they begin."""
    doors, boxes = stage.doors, stage.boxes
    for b in range(boxes.at[i], boxes.at[i + 1]):
        for column in range(3):
            boxes.poses[b, column] = boxes.beginnings[b, column]
    count = doors.at[i + 1] - doors.at[i]
    begin_walkers(stage, i, key, _KEYS + count, x, y, radius)
    begin_doors(stage, i, key, _KEYS, x, y, radius)
    outline(stage, i)


@njit(cache=True, error_model="numpy")
def _take(buffer: np.ndarray, stage: Stage, i: int) -> None:
    """Take places and speeds from what pymunk has read out."""
    doors, boxes, walkers = stage.doors, stage.boxes, stage.walkers
    for d in range(doors.at[i], doors.at[i + 1]):
        doors.angles[d] = buffer[6 * doors.rows[d] + 2]
    for b in range(boxes.at[i], boxes.at[i + 1]):
        for column in range(3):
            boxes.poses[b, column] = buffer[6 * boxes.rows[b] + column]
    for w in range(walkers.at[i], walkers.at[i + 1]):
        row = 6 * walkers.rows[w]
        walkers.states[w, 0], walkers.states[w, 1] = buffer[row], buffer[row + 1]
        walkers.states[w, 2], walkers.states[w, 3] = buffer[row + 3], buffer[row + 4]


@njit(cache=True, error_model="numpy")
def outline(stage: Stage, i: int) -> None:
    """Draw the segments of robot i's things: doors, then boxes, then walkers."""
    doors, boxes, walkers = stage.doors, stage.boxes, stage.walkers
    segments, row = stage.segments, stage.segments_at[i]
    for d in range(doors.at[i], doors.at[i + 1]):
        x, y = doors.hinges[d]
        width, angle = doors.leaves[d, 1], doors.angles[d]
        put_side(segments, row, x, y, x + width * math.cos(angle), y + width * math.sin(angle))
        row += 1
    for b in range(boxes.at[i], boxes.at[i + 1]):
        for k in range(4):
            x1, y1 = _box_corner(boxes, b, k)
            x2, y2 = _box_corner(boxes, b, (k + 1) % 4)
            put_side(segments, row, x1, y1, x2, y2)
            row += 1
    for w in range(walkers.at[i], walkers.at[i + 1]):
        for k in range(SIDES):
            x1, y1 = _walker_corner(walkers, w, k)
            x2, y2 = _walker_corner(walkers, w, (k + 1) % SIDES)
            put_side(segments, row, x1, y1, x2, y2)
            row += 1


# Two sides that meet compute their corner alike, so that no ray slips between them.


@njit(cache=True, error_model="numpy")
def _box_corner(boxes: Boxes, b: int, k: int) -> tuple[float, float]:
    """One of a box's four corners, counter-clockwise."""
    x, y, heading = boxes.poses[b]
    along = boxes.halves[b, 0] * (1.0 if k in (1, 2) else -1.0)
    aside = boxes.halves[b, 1] * (1.0 if k >= 2 else -1.0)
    cos, sin = math.cos(heading), math.sin(heading)
    return x + along * cos - aside * sin, y + along * sin + aside * cos


@njit(cache=True, error_model="numpy")
def _walker_corner(walkers: Walkers, w: int, k: int) -> tuple[float, float]:
    angle = 2 * math.pi * k / SIDES
    radius = walkers.radii[w]
    x, y = walkers.states[w, 0], walkers.states[w, 1]
    return x + radius * math.cos(angle), y + radius * math.sin(angle)
