"""The floors that the robots of a fleet drive on, and who is where."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
from jaxtyping import Int64

from albot_core.geometry.types import Pose
from albot_env.sim.chipmunk_kernels import Floors as Tables
from albot_env.sim.drive import RobotConfig
from albot_env.sim.space import Floor
from albot_env.sim.things import Things
from albot_maps.world import World

CROWD = 16
"""Most robots on a floor: bodies that overlap, though they never touch, cost pymunk time."""
_KEPT = 64
"""Empty floors that are kept for whoever comes to their worlds next."""
NOWHERE = -1


class Floors:
    """Robots that drive in one and the same world (which goes by the object) share floors.

    Where things move a robot has a floor of its own, for the things are there for it alone.

    Args:
        robots: How many robots there are. None is anywhere at first.
        robot: Body and drive of all of them.
        movables: Whether anything moves; if not, worlds are as if nothing did.
    """

    def __init__(self, robots: int, robot: RobotConfig, *, movables: bool) -> None:
        self._robot = robot
        self._movables = movables
        self.things = Things(robots, robot.radius)
        self._worlds: list[World | None] = []
        self._floors: list[Floor | None] = []
        self._slots: list[list[int]] = []
        self._open: dict[int, list[int]] = {}
        self._empty: OrderedDict[int, None] = OrderedDict()
        self.of: Int64[np.ndarray, "robots"] = np.full(robots, NOWHERE)
        """The floor that each robot is on."""
        self.inhabited: Int64[np.ndarray, "floors"] = np.zeros(0, np.int64)
        """The floors with robots on them."""
        self.tables = Tables(
            spaces=np.zeros((0, 2), np.int64),
            crews=np.zeros(0, np.int64),
            members=np.zeros((0, CROWD), np.int64),
            places=np.zeros(robots, np.int64),
        )

    def clearance(self, world: World, pose: Pose, reach: float) -> float:
        """Distance (m) from a pose to the world's nearest wall; infinite if none is in reach."""
        floor = self._floors[self._vacant(world)]
        assert floor is not None
        return floor.clearance(pose, reach)

    def moves(self, world: World) -> bool:
        """Whether anything moves in a world."""
        return self._movables and bool(world.movables)

    def place(
        self, row: int, world: World, pose: Pose, key: int, ids: Int64[np.ndarray, "robots"]
    ) -> None:
        """Put a robot at rest at a pose in a world, and the world's things about it.

        Args:
            row: The robot.
            world: The world.
            pose: Where in the world's frame.
            key: 64 bits, of which all random numbers of the things are a function.
            ids: Takes pymunk's ids of the robots' bodies.
        """
        self.things.leave(row)
        number = int(self.of[row])
        if number == NOWHERE or self._worlds[number] is not world:
            self._leave(row, ids)
            number = self._enter(row, world)
        floor = self._floors[number]
        assert floor is not None
        x, y, heading = pose.tolist()
        floor.place(int(self.tables.places[row]), (x, y, heading))
        self._enlist(number, ids)
        if self.moves(world):
            self.things.begin(row, world, floor, pose, key)

    def _enter(self, row: int, world: World) -> int:
        number = self._vacant(world)
        slots = self._slots[number]
        place = slots.index(NOWHERE) if NOWHERE in slots else len(slots)
        slots[place : place + 1] = [row]
        self.of[row], self.tables.places[row] = number, place
        self._empty.pop(number, None)
        if self._is_full(number):
            self._open[id(world)].remove(number)
        return number

    def _leave(self, row: int, ids: Int64[np.ndarray, "robots"]) -> None:
        number = int(self.of[row])
        if number == NOWHERE:
            return
        floor, world, slots = self._floors[number], self._worlds[number], self._slots[number]
        assert floor is not None and world is not None
        if self._is_full(number):
            self._open.setdefault(id(world), []).append(number)
        place = int(self.tables.places[row])
        slots[place] = NOWHERE
        floor.remove(place)
        self.of[row] = NOWHERE
        self._enlist(number, ids)
        if not self.tables.crews[number]:
            self._empty[number] = None

    def _is_full(self, number: int) -> bool:
        world, slots = self._worlds[number], self._slots[number]
        assert world is not None
        most = 1 if self.moves(world) else CROWD
        return len(slots) == most and NOWHERE not in slots

    def _vacant(self, world: World) -> int:
        """A floor of this world with room for one more robot."""
        numbers = self._open.setdefault(id(world), [])
        if not numbers:
            numbers.append(self._lay(world))
        return numbers[0]

    def _lay(self, world: World) -> int:
        """Make a floor; return its number."""
        while self._empty and len(self._empty) >= _KEPT:
            self._close(self._empty.popitem(last=False)[0])
        floor = Floor(world.walls, self._robot)
        if None in self._floors:
            number = self._floors.index(None)
        else:
            number = len(self._floors)
            self._floors.append(None)
            self._worlds.append(None)
            self._slots.append([])
            self._widen()
        self._floors[number], self._worlds[number], self._slots[number] = floor, world, []
        self.tables.spaces[number] = floor.addresses
        self._empty[number] = None
        return number

    def _close(self, number: int) -> None:
        world = self._worlds[number]
        self._open[id(world)].remove(number)
        if not self._open[id(world)]:
            del self._open[id(world)]
        self._floors[number] = self._worlds[number] = None

    def _widen(self) -> None:
        """Make room in the tables for all floors, twice as much as there was."""
        old, room = self.tables, len(self.tables.crews)
        if len(self._floors) <= room:
            return
        added = max(4, room)
        self.tables = Tables(
            spaces=np.concatenate((old.spaces, np.zeros((added, 2), np.int64))),
            crews=np.concatenate((old.crews, np.zeros(added, np.int64))),
            members=np.concatenate((old.members, np.zeros((added, CROWD), np.int64))),
            places=old.places,
        )

    def _enlist(self, number: int, ids: Int64[np.ndarray, "robots"]) -> None:
        """Note in which order pymunk now visits a floor's robots, and as whom it knows them."""
        floor = self._floors[number]
        assert floor is not None
        order = floor.order
        if bool(order) != bool(self.tables.crews[number]):
            others = self.inhabited[self.inhabited != number]
            self.inhabited = np.append(others, number) if order else others
        self.tables.crews[number] = len(order)
        for k, (place, id_) in enumerate(order):
            row = self._slots[number][place]
            self.tables.members[number, k] = row
            ids[row] = id_
