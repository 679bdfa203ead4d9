"""The physics: robots and the walls that stop them, as bodies in pymunk spaces."""

from __future__ import annotations

import math
from collections import OrderedDict

import numpy as np
import pymunk
from jaxtyping import Int64
from pymunk.batch import BodyFields, Buffer, get_space_bodies

from albot_core.geometry.types import Pose, Segments
from albot_core.robot import CONTROL_STEP, RobotConfig
from albot_env.sim.chipmunk import SpaceTables, address
from albot_env.sim.drive import GRAVITY
from albot_maps.movables import Movables
from albot_maps.world import World

SUBSTEPS = 2
"""Number of physics steps in a control step."""
PHYSICS_STEP = CONTROL_STEP / SUBSTEPS
"""Duration of one physics step (s). In it a robot moves 8 cm at most, far less than its
radius, so it cannot jump through a wall."""
SHORT_STEPS = 5
"""Number of Chipmunk's steps in a physics step in a world with boxes or people.

In one step of 0.05 s a box of 0.3 m can turn by more than its angle to a wall and go a third of
its half width into it, and `_PASSES` do not stop a robot of 13.5 kg that pushes a box of 0.5 kg
against a wall. So boxes get through walls, with a hundred passes too; five short steps hold them.
"""

_ALLOWED_OVERLAP = 0.001
"""Depth (m) to which a body may overlap a wall before it is pushed out."""
_OVERLAP_LEFT = 0.2
"""Share of an overlap that remains after one physics step."""
_PASSES = 4
"""Number of pymunk's solver iterations over joints and contacts (its default is ten). A robot
that rolls freely needs one. With four, a robot that pushes against a wall settles a step or two
later and ends up millimetres from where it would with ten."""
_ROBOTS = pymunk.ShapeFilter(group=1)
"""Robots in one space collide with walls but not with each other."""
MAX_ROBOTS = 16
"""Maximum number of robots in a space: overlapping bodies cost pymunk time even if they do
not collide."""
_EMPTY_SPACES_KEPT = 64
"""Number of empty spaces kept for robots that enter their worlds later."""
_NONE = -1
"""Marks a robot without a space, and a free slot."""

PymunkObject = pymunk.Body | pymunk.Shape | pymunk.Constraint
"""What a pymunk space holds."""


def solver_steps(movables: Movables) -> int:
    """Return the number of Chipmunk's steps in a physics step among these movables."""
    return SHORT_STEPS if movables.boxes or movables.walkers else 1


class PhysicsSpace:
    """A building's static walls in a pymunk space, and the robots that drive there.

    A robot is a disc that two wheels move and walls stop. A second, massless body moves as the
    wheels would without slip. Two joints pull the disc along with it, limited by the tyres'
    grip: a pivot joint for the velocity and a gear joint for the turn rate. pymunk solves them
    together with the contacts, so a robot that pushes against a wall slides along it or stops
    while its wheels slip.

    The space is empty at first. The wheel bodies are in a separate space that is never stepped,
    because pymunk can write the velocities of all bodies of a space at once.

    Args:
        walls: The walls.
        robot: Body and drive of all robots.
    """

    def __init__(self, walls: Segments, robot: RobotConfig) -> None:
        self._config = robot
        self.space = pymunk.Space()
        self.space.iterations = _PASSES
        # Contacts are forgotten as soon as they part: the shortest memory that pymunk supports
        # (with 0 it drops them before they are solved, and nothing collides).
        self.space.collision_persistence = 1
        self.space.collision_slop = _ALLOWED_OVERLAP
        self.space.collision_bias = _OVERLAP_LEFT ** (1 / PHYSICS_STEP)
        ground = self.space.static_body
        shapes = [
            pymunk.Segment(ground, (x1, y1), (x2, y2), 0.0) for x1, y1, x2, y2 in walls.tolist()
        ]
        for shape in shapes:
            shape.friction = 1.0
        self.space.add(*shapes)
        self._wheel_space = pymunk.Space()
        self._wheels: list[pymunk.Body] = []
        self._robot_parts: list[tuple[PymunkObject, ...]] = []
        self._robots: dict[int, int] = {}

    @property
    def addresses(self) -> tuple[int, int]:
        """Addresses of this space and of the wheels' space, for the compiled steps."""
        return address(self.space._space), address(self._wheel_space._space)

    @property
    def order(self) -> list[tuple[int, int]]:
        """Robots in the order in which pymunk visits their bodies, each with the body's id.

        Both change with each `place` and `remove`. The walls' body comes after all robots, and
        so do obstacles that were added after them.
        """
        return [(self._robots[id_], id_) for id_ in self.body_ids if id_ in self._robots]

    @property
    def body_ids(self) -> list[int]:
        """Pymunk's ids of all bodies, in the order in which pymunk visits them."""
        buffer = Buffer()
        get_space_bodies(self.space, BodyFields.BODY_ID, buffer)
        ids: list[int] = memoryview(buffer.int_buf()).cast("P").tolist()
        return ids

    def clearance(self, pose: Pose, reach: float) -> float:
        """Return the distance (m) from a pose to the nearest wall; infinite if beyond `reach`."""
        x, y, _ = pose.tolist()
        nearest = self.space.point_query_nearest((x, y), reach, _ROBOTS)
        return nearest.distance if nearest else math.inf

    def place(self, robot: int, pose: tuple[float, float, float]) -> None:
        """Put a robot, new or already in the space, at rest at x, y (m) and heading (rad).

        Robots are numbered from 0. The body is made again: pymunk keeps impulses of past steps in
        joints and contacts, and the motion must not depend on where the robot was before.
        """
        config = self._config
        body = pymunk.Body(config.mass, config.moment)
        body.position = pose[0], pose[1]
        body.angle = pose[2]
        disc = pymunk.Circle(body, config.radius)
        disc.friction = config.hull_friction
        disc.filter = _ROBOTS

        self.remove(robot)
        wheels = self._wheels[robot]
        wheels.velocity, wheels.angular_velocity = (0.0, 0.0), 0.0
        grip = config.grip * config.mass * GRAVITY
        pull = pymunk.PivotJoint(wheels, body, (0, 0), (0, 0))
        pull.max_force = grip
        twist = pymunk.GearJoint(wheels, body, 0.0, 1.0)
        twist.max_force = grip * config.wheel_base / 2
        # The joints transfer velocities, never positions.
        pull.error_bias = twist.error_bias = 1.0

        self._robots[body.id] = robot
        self._robot_parts[robot] = (body, disc, pull, twist)
        self.space.add(*self._robot_parts[robot])

    def remove(self, robot: int) -> None:
        """Take a robot out of the space if it is there."""
        while len(self._wheels) <= robot:
            wheels = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
            self._wheels.append(wheels)
            self._wheel_space.add(wheels)
            self._robot_parts.append(())
        self.space.remove(*self._robot_parts[robot])
        self._robot_parts[robot] = ()
        self._robots = {id_: r for id_, r in self._robots.items() if r != robot}


class PhysicsSpaces:
    """Assignment of robots to physics spaces.

    Robots in the same world (the same object) share spaces. In a world with dynamic obstacles
    each robot has its own space, because its obstacles exist for it alone.

    Args:
        robots: Number of robots. At first no robot is in a space.
        robot: Body and drive of all robots.
        movables: Whether the worlds' doors, boxes and people are simulated.
    """

    def __init__(self, robots: int, robot: RobotConfig, *, movables: bool) -> None:
        self._robot = robot
        self._movables = movables
        self._worlds: list[World | None] = []
        self._spaces: list[PhysicsSpace | None] = []
        self._slots: list[list[int]] = []  # by space: the robots in it
        self._open: dict[int, list[int]] = {}  # by world: its spaces with room for more
        self._empty: OrderedDict[int, None] = OrderedDict()
        self.space_of: Int64[np.ndarray, "robots"] = np.full(robots, _NONE)
        """The space of each robot."""
        self.occupied: Int64[np.ndarray, "spaces"] = np.zeros(0, np.int64)
        """The spaces with robots in them."""
        self.tables = SpaceTables(
            spaces=np.zeros((0, 2), np.int64),
            robot_counts=np.zeros(0, np.int64),
            rows=np.zeros((0, MAX_ROBOTS), np.int64),
            slots=np.zeros(robots, np.int64),
            solver_steps=np.zeros(0, np.int64),
        )

    def clearance(self, world: World, pose: Pose, reach: float) -> float:
        """Return the distance (m) from a pose to the nearest wall; infinite if beyond `reach`."""
        space = self._spaces[self._space_with_room(world)]
        assert space is not None
        return space.clearance(pose, reach)

    def moves(self, world: World) -> bool:
        """Whether a world has dynamic obstacles."""
        return self._movables and bool(world.movables)

    def place(
        self, row: int, world: World, pose: Pose, ids: Int64[np.ndarray, "robots"]
    ) -> PhysicsSpace:
        """Put a robot at rest at a pose in a world; return its space.

        Args:
            row: The robot.
            world: The world.
            pose: Pose in the world frame.
            ids: Filled with pymunk's ids of the robots' bodies.
        """
        number = int(self.space_of[row])
        if number == _NONE or self._worlds[number] is not world:
            self._leave(row, ids)
            number = self._space_with_room(world)
            self._enter(row, number)
        space = self._spaces[number]
        assert space is not None
        x, y, heading = pose.tolist()
        space.place(int(self.tables.slots[row]), (x, y, heading))
        self._update_order(number, ids)
        return space

    def isolate(self, row: int, world: World, ids: Int64[np.ndarray, "robots"]) -> None:
        """Give a robot a space of a world for itself; call `place` next.

        Robots that are placed later may join it there.

        Args:
            row: The robot.
            world: The world.
            ids: As for `place`.
        """
        number = int(self.space_of[row])
        is_alone = number != _NONE and self.tables.robot_counts[number] == 1
        if is_alone and self._worlds[number] is world:
            return
        self._leave(row, ids)
        numbers = self._open.setdefault(id(world), [])
        empty = [number for number in numbers if not self.tables.robot_counts[number]]
        if not empty:
            empty.append(self._make_space(world))
            # `_make_space` may have dropped the last open space of this world, and the list.
            self._open.setdefault(id(world), []).append(empty[0])
        self._enter(row, empty[0])

    def _enter(self, row: int, number: int) -> None:
        slots = self._slots[number]
        slot = slots.index(_NONE) if _NONE in slots else len(slots)
        slots[slot : slot + 1] = [row]
        self.space_of[row], self.tables.slots[row] = number, slot
        self._empty.pop(number, None)
        if self._is_full(number):
            self._open[id(self._worlds[number])].remove(number)

    def _leave(self, row: int, ids: Int64[np.ndarray, "robots"]) -> None:
        number = int(self.space_of[row])
        if number == _NONE:
            return
        space, world, slots = self._spaces[number], self._worlds[number], self._slots[number]
        assert space is not None and world is not None
        if self._is_full(number):
            self._open.setdefault(id(world), []).append(number)
        slot = int(self.tables.slots[row])
        slots[slot] = _NONE
        space.remove(slot)
        self.space_of[row] = _NONE
        self._update_order(number, ids)
        if not self.tables.robot_counts[number]:
            self._empty[number] = None

    def _is_full(self, number: int) -> bool:
        world, slots = self._worlds[number], self._slots[number]
        assert world is not None
        most = 1 if self.moves(world) else MAX_ROBOTS
        return len(slots) == most and _NONE not in slots

    def _space_with_room(self, world: World) -> int:
        """Return a space of this world with room for one more robot."""
        numbers = self._open.setdefault(id(world), [])
        if not numbers:
            numbers.append(self._make_space(world))
        return numbers[0]

    def _make_space(self, world: World) -> int:
        """Make a space; return its number."""
        while self._empty and len(self._empty) >= _EMPTY_SPACES_KEPT:
            self._drop(self._empty.popitem(last=False)[0])
        space = PhysicsSpace(world.walls, self._robot)
        if None in self._spaces:
            number = self._spaces.index(None)
        else:
            number = len(self._spaces)
            self._spaces.append(None)
            self._worlds.append(None)
            self._slots.append([])
            self._grow_tables()
        self._spaces[number], self._worlds[number], self._slots[number] = space, world, []
        self.tables.spaces[number] = space.addresses
        self.tables.solver_steps[number] = solver_steps(world.movables) if self._movables else 1
        self._empty[number] = None
        return number

    def _drop(self, number: int) -> None:
        world = self._worlds[number]
        self._open[id(world)].remove(number)
        if not self._open[id(world)]:
            del self._open[id(world)]
        self._spaces[number] = self._worlds[number] = None

    def _grow_tables(self) -> None:
        """Make room for all spaces in the tables; at least double their length."""
        old, room = self.tables, len(self.tables.robot_counts)
        if len(self._spaces) <= room:
            return
        added = max(4, room)
        self.tables = SpaceTables(
            spaces=np.concatenate((old.spaces, np.zeros((added, 2), np.int64))),
            robot_counts=np.concatenate((old.robot_counts, np.zeros(added, np.int64))),
            rows=np.concatenate((old.rows, np.zeros((added, MAX_ROBOTS), np.int64))),
            slots=old.slots,
            solver_steps=np.concatenate((old.solver_steps, np.zeros(added, np.int64))),
        )

    def _update_order(self, number: int, ids: Int64[np.ndarray, "robots"]) -> None:
        """Update the order in which pymunk visits a space's robots, and the ids of their bodies."""
        space = self._spaces[number]
        assert space is not None
        order = space.order
        if bool(order) != bool(self.tables.robot_counts[number]):
            others = self.occupied[self.occupied != number]
            self.occupied = np.append(others, number) if order else others
        self.tables.robot_counts[number] = len(order)
        for k, (slot, id_) in enumerate(order):
            row = self._slots[number][slot]
            self.tables.rows[number, k] = row
            ids[row] = id_
