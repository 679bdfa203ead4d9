"""Compiled steps of all dynamic obstacles: their next motion and their current outlines."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from albot_core.geometry.pose_kernels import transform_point
from albot_core.kernels.compiled import kernel
from albot_env.sim.chipmunk import (
    SET_TURN_RATE,
    ChipmunkInterface,
    call_with_number,
    read_states,
    write_velocities,
)
from albot_env.sim.doors import command_doors, place_doors
from albot_env.sim.obstacle_tables import SIDES, ObstacleTables
from albot_env.sim.walkers import command_walkers, place_walkers

_KEYS = 2**62
"""First counter of the keys of a robot's obstacles; its sensors never draw that far."""


@kernel(nogil=True)
def command_obstacles(
    rows: np.ndarray,
    chipmunk: ChipmunkInterface,
    tables: ObstacleTables,
    states: np.ndarray,
    radius: float,
    duration: float,
) -> None:
    """Set the motion of some robots' doors and walkers for the next `duration` (s).

    `states` (robots, 6) are the robots' states, `radius` is their radius (m).
    """
    for i in rows:
        own = tables.robots[i]
        command_doors(tables, i, states[i], radius, duration)
        for d in range(own.doors, own.doors_end):
            door = tables.doors[d]
            call_with_number(chipmunk.calls[SET_TURN_RATE], door.body_address, door.rate)
        if own.walkers == own.walkers_end:
            continue
        command_walkers(tables, i, states[i], radius, duration)
        at = 0
        for w in range(own.walkers, own.walkers_end):
            chipmunk.buffer[at] = tables.walkers[w].wanted_x
            chipmunk.buffer[at + 1] = tables.walkers[w].wanted_y
            chipmunk.buffer[at + 2] = 0.0
            at += 3
        write_velocities(chipmunk, own.leg_space)


@kernel(nogil=True)
def observe_obstacles(
    rows: np.ndarray, chipmunk: ChipmunkInterface, tables: ObstacleTables
) -> None:
    """Read the positions and velocities of some robots' obstacles."""
    for i in rows:
        read_states(chipmunk, tables.robots[i].space)
        _take_states(chipmunk.buffer, tables, i)
        update_outlines(tables, i)


@kernel()
def place_obstacles(
    tables: ObstacleTables, i: int, key: np.uint64, robot: np.ndarray, radius: float
) -> None:
    """Choose the starts of robot i's doors and walkers; its boxes are already in place.

    `robot` (6,) is the robot's state: x, y, heading, velocity x, y, turn rate.
    """
    own = tables.robots[i]
    place_walkers(tables, i, key, _KEYS + own.doors_end - own.doors, robot, radius)
    place_doors(tables, i, key, _KEYS, robot, radius)
    update_outlines(tables, i)


@kernel()
def _take_states(buffer: np.ndarray, tables: ObstacleTables, i: int) -> None:
    """Copy positions and velocities from the buffer to the tables."""
    own = tables.robots[i]
    for d in range(own.doors, own.doors_end):
        door = tables.doors[d]
        door.angle = buffer[6 * door.body_index + 2]
    for b in range(own.boxes, own.boxes_end):
        box = tables.boxes[b]
        at = 6 * box.body_index
        box.x, box.y, box.heading = buffer[at], buffer[at + 1], buffer[at + 2]
    for w in range(own.walkers, own.walkers_end):
        walker = tables.walkers[w]
        at = 6 * walker.body_index
        walker.x, walker.y = buffer[at], buffer[at + 1]
        walker.vx, walker.vy = buffer[at + 3], buffer[at + 4]


@kernel()
def update_outlines(tables: ObstacleTables, i: int) -> None:
    """Write the segments of robot i's obstacles: doors, then boxes, then walkers."""
    own = tables.robots[i]
    row = own.outlines
    for d in range(own.doors, own.doors_end):
        door = tables.doors[d]
        x, y = door.hinge_x, door.hinge_y
        cos, sin = math.cos(door.angle), math.sin(door.angle)
        _write_segment(tables.outlines, row, x, y, x + door.width * cos, y + door.width * sin)
        row += 1
    for b in range(own.boxes, own.boxes_end):
        for k in range(4):
            x1, y1 = _box_corner(tables.boxes[b], k)
            x2, y2 = _box_corner(tables.boxes[b], (k + 1) % 4)
            _write_segment(tables.outlines, row, x1, y1, x2, y2)
            row += 1
    for w in range(own.walkers, own.walkers_end):
        for k in range(SIDES):
            x1, y1 = _walker_corner(tables.walkers[w], k)
            x2, y2 = _walker_corner(tables.walkers[w], (k + 1) % SIDES)
            _write_segment(tables.outlines, row, x1, y1, x2, y2)
            row += 1


# Adjacent sides compute their shared corner alike, so that no ray slips between them.


@kernel()
def _box_corner(box: Any, k: int) -> tuple[float, float]:
    """Return one of a box's four corners, counter-clockwise."""
    along = box.half_length if k == 1 or k == 2 else -box.half_length
    aside = box.half_width if k >= 2 else -box.half_width
    cos, sin = math.cos(box.heading), math.sin(box.heading)
    return transform_point((box.x, box.y, box.heading), cos, sin, along, aside)


@kernel()
def _walker_corner(walker: Any, k: int) -> tuple[float, float]:
    angle = 2 * math.pi * k / SIDES
    return walker.x + walker.radius * math.cos(angle), walker.y + walker.radius * math.sin(angle)


@kernel()
def _write_segment(
    segments: np.ndarray, row: int, x1: float, y1: float, x2: float, y2: float
) -> None:
    """Write a segment into a row of `segments` (n, 4)."""
    segments[row, 0], segments[row, 1] = x1, y1
    segments[row, 2], segments[row, 3] = x2, y2
