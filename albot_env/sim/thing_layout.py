"""The arrays of movable things, laid out for a fleet of robots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pymunk
from jaxtyping import Int64

from albot_core.geometry.types import Segments
from albot_env.sim.engine import address
from albot_env.sim.space import Floor
from albot_env.sim.thing_arrays import Boxes, Doors, Stage, Walkers
from albot_env.sim.thing_kernels import SIDES
from albot_maps.movables import Box, Door, Movables, Walker
from albot_maps.world import World


def lay_out(
    worlds: Sequence[World], floors: Sequence[Floor], shelves: Sequence[pymunk.Space]
) -> Stage:
    """The arrays of the things of some worlds, one for each robot, on floors of their own.

    `shelves` are the spaces of the walkers' legs.
    """
    all_movables = [world.movables for world in worlds]
    walls, walls_at = _walls(worlds)
    segments_at = _fences([_outlines(movables) for movables in all_movables])
    spaces = [
        (address(floor.space._space), address(shelf._space))
        for floor, shelf in zip(floors, shelves, strict=True)
    ]
    return Stage(
        doors=_doors(all_movables),
        boxes=_boxes(all_movables),
        walkers=_walkers(all_movables),
        walls=walls,
        walls_at=walls_at,
        spaces=np.array(spaces, np.int64),
        segments=np.zeros((segments_at[-1], 4)),
        segments_at=segments_at,
    )


def _fences(counts: Sequence[int]) -> Int64[np.ndarray, "fences"]:
    """Where runs of so many rows begin, and after the last where it ends."""
    return np.cumsum([0, *counts], dtype=np.int64)


def _outlines(movables: Movables) -> int:
    """How many segments things have."""
    return len(movables.doors) + 4 * len(movables.boxes) + SIDES * len(movables.walkers)


def _walls(worlds: Sequence[World]) -> tuple[Segments, Int64[np.ndarray, "robots 2"]]:
    """The walls of all worlds in which something moves, each once, and each robot's."""
    different = list({id(world): world for world in worlds if world.movables}.values())
    fences = _fences([len(world.walls) for world in different])
    place = {id(world): k for k, world in enumerate(different)}
    walls_at = np.zeros((len(worlds), 2), np.int64)
    for row, world in enumerate(worlds):
        if id(world) in place:
            walls_at[row] = fences[place[id(world)]], fences[place[id(world)] + 1]
    return np.concatenate([np.empty((0, 4)), *(world.walls for world in different)]), walls_at


def _doors(all_movables: Sequence[Movables]) -> Doors:
    doors: list[Door] = [door for movables in all_movables for door in movables.doors]
    count = len(doors)
    leaves = [(door.heading, door.width, door.opening, door.turn_rate) for door in doors]
    return Doors(
        at=_fences([len(movables.doors) for movables in all_movables]),
        rows=np.zeros(count, np.int64),
        hinges=np.array([door.hinge for door in doors], np.float64).reshape(-1, 2),
        leaves=np.array(leaves, np.float64).reshape(-1, 4),
        stays=np.array([(door.shut_for, door.open_for) for door in doors], np.float64).reshape(
            -1, 2, 2
        ),
        angles=np.zeros(count),
        rates=np.zeros(count),
        wanted=np.zeros(count, np.int64),
        waits=np.zeros(count),
        keys=np.zeros(count, np.uint64),
        draws=np.zeros(count, np.int64),
    )


def _boxes(all_movables: Sequence[Movables]) -> Boxes:
    boxes: list[Box] = [box for movables in all_movables for box in movables.boxes]
    beginnings = np.array([(*box.at, box.heading) for box in boxes], np.float64).reshape(-1, 3)
    return Boxes(
        at=_fences([len(movables.boxes) for movables in all_movables]),
        rows=np.zeros(len(boxes), np.int64),
        halves=np.array([(box.length / 2, box.width / 2) for box in boxes]).reshape(-1, 2),
        beginnings=beginnings,
        poses=beginnings.copy(),
    )


def _walkers(all_movables: Sequence[Movables]) -> Walkers:
    walkers: list[Walker] = [walker for movables in all_movables for walker in movables.walkers]
    count = len(walkers)
    points = [point for walker in walkers for point in walker.route]
    return Walkers(
        at=_fences([len(movables.walkers) for movables in all_movables]),
        rows=np.zeros(count, np.int64),
        radii=np.array([walker.radius for walker in walkers], np.float64),
        paces=np.array([walker.speed for walker in walkers], np.float64).reshape(-1, 2),
        route_at=_fences([len(walker.route) for walker in walkers]),
        waypoints=np.array(points, np.float64).reshape(-1, 2),
        closed=np.array([walker.closed for walker in walkers], np.bool_),
        speeds=np.zeros(count),
        courses=np.zeros((count, 3), np.int64),
        idle=np.zeros(count),
        states=np.zeros((count, 4)),
        wanted=np.zeros((count, 2)),
    )
