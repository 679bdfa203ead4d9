"""The arrays of movable things, laid out for a fleet of robots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pymunk

from albot_core.geometry.types import Segments
from albot_env.sim.engine import address
from albot_env.sim.space import Floor
from albot_env.sim.thing_arrays import BOX, DOOR, ROBOT, WALKER, Stage
from albot_env.sim.thing_kernels import SIDES
from albot_maps.movables import Box, Door, Movables, Walker
from albot_maps.world import World


def lay_out(
    worlds: Sequence[World], floors: Sequence[Floor], shelves: Sequence[pymunk.Space]
) -> Stage:
    """The tables of the things of some worlds, one for each robot, on floors of their own.

    `shelves` are the spaces of the walkers' legs.
    """
    moving = [world.movables for world in worlds]
    robots = np.zeros(len(worlds), ROBOT)
    _number(robots, "doors", [len(movables.doors) for movables in moving])
    _number(robots, "boxes", [len(movables.boxes) for movables in moving])
    _number(robots, "walkers", [len(movables.walkers) for movables in moving])
    _number(robots, "segments", [_outlines(movables) for movables in moving])
    robots["space"] = [address(floor.space._space) for floor in floors]
    robots["shelf"] = [address(shelf._space) for shelf in shelves]
    walkers = [walker for movables in moving for walker in movables.walkers]
    return Stage(
        robots=robots,
        doors=_doors([door for movables in moving for door in movables.doors]),
        boxes=_boxes([box for movables in moving for box in movables.boxes]),
        walkers=_walkers(walkers),
        waypoints=np.array([point for w in walkers for point in w.route], float).reshape(-1, 2),
        walls=_walls(worlds, robots),
        segments=np.zeros((robots["segments_end"][-1], 4)),
    )


def _number(robots: np.ndarray, kind: str, counts: Sequence[int]) -> None:
    """Note which rows are each robot's where it has so many of a kind."""
    fences = np.cumsum([0, *counts])
    robots[kind], robots[f"{kind}_end"] = fences[:-1], fences[1:]


def _outlines(movables: Movables) -> int:
    """How many segments things have."""
    return len(movables.doors) + 4 * len(movables.boxes) + SIDES * len(movables.walkers)


def _walls(worlds: Sequence[World], robots: np.ndarray) -> Segments:
    """The walls of all worlds in which something moves, each once; note each robot's."""
    walls: list[Segments] = [np.empty((0, 4))]
    rows: dict[int, tuple[int, int]] = {}
    for world, robot in zip(worlds, robots, strict=True):
        if world.movables and id(world) not in rows:
            before = sum(map(len, walls))
            rows[id(world)] = before, before + len(world.walls)
            walls.append(world.walls)
        robot["walls"], robot["walls_end"] = rows.get(id(world), (0, 0))
    return np.concatenate(walls)


def _doors(doors: Sequence[Door]) -> np.ndarray:
    table = np.zeros(len(doors), DOOR)
    for record, door in zip(table, doors, strict=True):
        record["hinge_x"], record["hinge_y"] = door.hinge
        record["least_shut"], record["most_shut"] = door.shut_for
        record["least_open"], record["most_open"] = door.open_for
        for name in ("heading", "width", "opening", "turn_rate"):
            record[name] = getattr(door, name)
    return table


def _boxes(boxes: Sequence[Box]) -> np.ndarray:
    table = np.zeros(len(boxes), BOX)
    for record, box in zip(table, boxes, strict=True):
        record["half_length"], record["half_width"] = box.length / 2, box.width / 2
    return table


def _walkers(walkers: Sequence[Walker]) -> np.ndarray:
    table = np.zeros(len(walkers), WALKER)
    first = 0
    for record, walker in zip(table, walkers, strict=True):
        record["radius"], record["closed"] = walker.radius, walker.closed
        record["slowest"], record["fastest"] = walker.speed
        record["first"], record["count"] = first, len(walker.route)
        first += len(walker.route)
    return table
