"""Tables of all dynamic obstacles of a batch of robots, with one record per obstacle.

Passing one table of records to compiled code is cheaper than passing a dozen arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from albot_maps.movables import Box, Door, Movables, Walker
from albot_maps.world import World

DOOR = np.dtype(
    [
        ("body_index", np.int64),  # index of the body in pymunk's batched read-out
        ("body_address", np.int64),
        ("hinge_x", np.float64),  # position of the hinge (m)
        ("hinge_y", np.float64),
        ("heading", np.float64),  # of the closed leaf (rad)
        ("width", np.float64),  # of the leaf (m)
        ("opening", np.float64),  # from closed to open (rad)
        ("turn_rate", np.float64),  # while the door swings (rad/s)
        ("least_shut", np.float64),  # range of the time that it stays closed (s)
        ("most_shut", np.float64),
        ("least_open", np.float64),  # range of the time that it stays open (s)
        ("most_open", np.float64),
        ("angle", np.float64),  # direction of the leaf (rad)
        ("rate", np.float64),  # current turn rate (rad/s)
        ("wanted", np.int64),  # 1 if the door shall be open, 0 if closed
        ("wait", np.float64),  # remaining time in the wanted state, once reached (s)
        ("key", np.uint64),  # key of its random numbers
        ("draws", np.int64),  # how many random numbers it has used
    ]
)
BOX = np.dtype(
    [
        ("body_index", np.int64),  # index of the body in pymunk's batched read-out
        ("half_length", np.float64),  # (m)
        ("half_width", np.float64),
        ("x", np.float64),  # position of the centre (m)
        ("y", np.float64),
        ("heading", np.float64),  # direction of its length (rad)
    ]
)
WALKER = np.dtype(
    [
        ("body_index", np.int64),  # index of the body in pymunk's batched read-out
        ("radius", np.float64),  # (m)
        ("slowest", np.float64),  # range of speeds when nothing is in the way (m/s)
        ("fastest", np.float64),
        ("first", np.int64),  # index of its first waypoint among its robot's waypoints
        ("count", np.int64),  # number of its waypoints
        ("closed", np.int64),  # 1 if the last waypoint is joined to the first, else 0
        ("speed", np.float64),  # speed in this episode when nothing is in the way (m/s)
        ("last", np.int64),  # indices of the last waypoint and of the next
        ("next", np.int64),
        ("sense", np.int64),  # 1 or -1: direction along the route
        ("idle", np.float64),  # time without progress (s)
        ("x", np.float64),  # position (m)
        ("y", np.float64),
        ("vx", np.float64),  # velocity (m/s)
        ("vy", np.float64),
        ("wanted_x", np.float64),  # velocity that it tries to reach (m/s)
        ("wanted_y", np.float64),
    ]
)
SIDES = 8
"""Number of sides of the regular polygon that stands for a walker in contacts and ray casting."""
TABLES = ("doors", "boxes", "walkers", "waypoints", "walls", "outlines")
"""The tables in which each robot has its own rows."""
ROBOT = np.dtype(
    [(field, np.int64) for name in TABLES for field in (name, f"{name}_end")]  # first row, end row
    + [
        ("space", np.int64),  # addresses of its space and of the space with the walkers' legs
        ("leg_space", np.int64),
    ]
)


class ObstacleTables(NamedTuple):
    """All dynamic obstacles, with the walls and waypoints that walkers need."""

    robots: np.ndarray
    """(robots,) of ROBOT: the rows of each robot in the other tables."""
    doors: np.ndarray
    """(n,) of DOOR."""
    boxes: np.ndarray
    """(n,) of BOX."""
    walkers: np.ndarray
    """(n,) of WALKER."""
    waypoints: np.ndarray
    """(n, 2) float64: waypoints of the walkers' routes (m)."""
    walls: np.ndarray
    """(n, 4) float64: walls of the worlds that have walkers, x1, y1, x2, y2 (m)."""
    outlines: np.ndarray
    """(n, 4) float64: outlines of all obstacles, x1, y1, x2, y2 (m), for ray casting."""


class ObstacleStore:
    """Tables in which each robot has a block of rows. All blocks of a table are equally long.

    Args:
        robots: Number of robots. At first no robot has obstacles.
    """

    def __init__(self, robots: int) -> None:
        self._robots = robots
        self.tables = ObstacleTables(
            robots=np.zeros(robots, ROBOT),
            doors=np.zeros(0, DOOR),
            boxes=np.zeros(0, BOX),
            walkers=np.zeros(0, WALKER),
            waypoints=np.zeros((0, 2)),
            walls=np.zeros((0, 4)),
            outlines=np.zeros((0, 4)),
        )

    def fill(self, row: int, world: World | None) -> None:
        """Write the obstacles of a world, as an episode begins, to a robot's rows; None clears."""
        movables = world.movables if world is not None else Movables()
        # Only walkers need the walls.
        walls = world.walls if world is not None and movables.walkers else np.empty((0, 4))
        points = [point for walker in movables.walkers for point in walker.route]
        tables = {
            "doors": _doors(movables.doors),
            "boxes": _boxes(movables.boxes),
            "walkers": _walkers(movables.walkers),
            "waypoints": np.array(points, np.float64).reshape(-1, 2),
            "walls": walls,
            "outlines": np.zeros((_outlines(movables), 4)),
        }
        for name in TABLES:
            self._put(row, name, tables[name])

    def _put(self, row: int, name: str, table: np.ndarray) -> None:
        """Write a robot's rows of one table; the table grows if there are too many."""
        whole: np.ndarray = getattr(self.tables, name)
        room = len(whole) // self._robots
        if len(table) > room:
            self._grow(name, room, len(table))
            whole = getattr(self.tables, name)
        robots = self.tables.robots
        begin = row * (len(whole) // self._robots)
        robots[name][row], robots[f"{name}_end"][row] = begin, begin + len(table)
        whole[begin : begin + len(table)] = table

    def _grow(self, name: str, room: int, needed: int) -> None:
        """Give every robot more rows in one table."""
        old: np.ndarray = getattr(self.tables, name)
        rest = old.shape[1:]
        new = np.zeros((self._robots, needed, *rest), old.dtype)
        new[:, :room] = old.reshape(self._robots, room, *rest)
        self.tables = self.tables._replace(**{name: new.reshape(-1, *rest)})
        robots = self.tables.robots
        counts = robots[f"{name}_end"] - robots[name]
        robots[name] = np.arange(self._robots) * needed
        robots[f"{name}_end"] = robots[name] + counts


def _outlines(movables: Movables) -> int:
    """Return the number of segments in the obstacles' outlines."""
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
