"""The tables of movable things, laid out for a fleet of robots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from albot_env.sim.thing_arrays import BLOCKS, BOX, DOOR, ROBOT, WALKER, Stage
from albot_env.sim.thing_kernels import SIDES
from albot_maps.movables import Box, Door, Movables, Walker
from albot_maps.world import World


class Layout:
    """Tables in which each robot has a block of rows, as long as any robot's has to be.

    Args:
        robots: How many robots there are. None is among things at first.
    """

    def __init__(self, robots: int) -> None:
        self._robots = robots
        self.stage = Stage(
            robots=np.zeros(robots, ROBOT),
            doors=np.zeros(0, DOOR),
            boxes=np.zeros(0, BOX),
            walkers=np.zeros(0, WALKER),
            waypoints=np.zeros((0, 2)),
            walls=np.zeros((0, 4)),
            segments=np.zeros((0, 4)),
        )

    def fill(self, row: int, world: World | None) -> None:
        """Write the things of a world into a robot's rows, as an episode begins; or none."""
        movables = world.movables if world is not None else Movables()
        # Only walkers need to know where walls are.
        walls = world.walls if world is not None and movables.walkers else np.empty((0, 4))
        points = [point for walker in movables.walkers for point in walker.route]
        tables = {
            "doors": _doors(movables.doors),
            "boxes": _boxes(movables.boxes),
            "walkers": _walkers(movables.walkers),
            "waypoints": np.array(points, np.float64).reshape(-1, 2),
            "walls": walls,
            "segments": np.zeros((_outlines(movables), 4)),
        }
        for block in BLOCKS:
            self._put(row, block, tables[block])

    def _put(self, row: int, block: str, table: np.ndarray) -> None:
        """Write a robot's rows of one table, which grows where they are too many."""
        whole: np.ndarray = getattr(self.stage, block)
        room = len(whole) // self._robots
        if len(table) > room:
            self._grow(block, room, len(table))
            whole = getattr(self.stage, block)
        robots = self.stage.robots
        begin = row * (len(whole) // self._robots)
        robots[block][row], robots[f"{block}_end"][row] = begin, begin + len(table)
        whole[begin : begin + len(table)] = table

    def _grow(self, block: str, room: int, needed: int) -> None:
        """Give every robot more rows in one table."""
        old: np.ndarray = getattr(self.stage, block)
        rest = old.shape[1:]
        new = np.zeros((self._robots, needed, *rest), old.dtype)
        new[:, :room] = old.reshape(self._robots, room, *rest)
        self.stage = self.stage._replace(**{block: new.reshape(-1, *rest)})
        robots = self.stage.robots
        counts = robots[f"{block}_end"] - robots[block]
        robots[block] = np.arange(self._robots) * needed
        robots[f"{block}_end"] = robots[block] + counts


def _outlines(movables: Movables) -> int:
    """How many segments things have."""
    return len(movables.doors) + 4 * len(movables.boxes) + SIDES * len(movables.walkers)


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
        (record["x"], record["y"]), record["heading"] = box.at, box.heading
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
