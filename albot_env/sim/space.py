"""The physics: walls and robots in pymunk spaces."""

from __future__ import annotations

import math

import pymunk
from pymunk.batch import BodyFields, Buffer, get_space_bodies

from albot_core.geometry.types import Pose, Segments
from albot_env.sim.drive import GRAVITY, RobotConfig
from albot_env.sim.engine import address

PHYSICS_STEP = 0.05
"""Duration of one step of the physics (s). In it the robot goes 8 cm at most, far less than
its radius, so that it cannot jump over a wall."""

_ALLOWED_OVERLAP = 0.001
"""How deep (m) a body may rest in a wall before it is pushed out."""
_OVERLAP_LEFT = 0.2
"""Share of an overlap that is left after one physics step."""
_PASSES = 4
"""Passes over all joints and contacts in which pymunk solves them, of its usual ten. A robot that
rolls freely needs one. Where it pushes against a wall, its wheels' grip and the wall agree a step
or two later than with more: it ends up millimetres from where it would."""
_ROBOTS = pymunk.ShapeFilter(group=1)
"""Robots in one space meet the walls and not each other."""

Parts = tuple[pymunk.Body | pymunk.Shape | pymunk.Constraint, ...]


class Floor:
    """A building's static walls in a pymunk space, and robots that drive there.

    A robot is a disc that two wheels carry along and walls stop. A second, massless body
    moves as the wheels would without slip. Two joints pull the disc along with it, a pivot
    its velocity and a gear its turn rate, as hard as the tyres grip the ground. pymunk
    solves them together with the contacts, so that a robot that pushes against a wall
    slides along it or stops, while its wheels slip.

    It is empty at first. The bodies of the wheels are kept in a space of their own, in which
    no time passes: pymunk can write the velocities of all bodies of a space at once.

    Args:
        walls: The walls.
        robot: Body and drive of all robots.
    """

    def __init__(self, walls: Segments, robot: RobotConfig) -> None:
        self._config = robot
        self.space = pymunk.Space()
        self.space.iterations = _PASSES
        # Contacts are forgotten as soon as they part: the shortest memory that pymunk
        # has (with 0 it drops them before they are solved, and nothing collides).
        self.space.collision_persistence = 1
        self.space.collision_slop = _ALLOWED_OVERLAP
        self.space.collision_bias = _OVERLAP_LEFT ** (1 / PHYSICS_STEP)
        ground = self.space.static_body
        for x1, y1, x2, y2 in walls.tolist():
            wall = pymunk.Segment(ground, (x1, y1), (x2, y2), 0.0)
            wall.friction = 1.0
            self.space.add(wall)
        self._shelf = pymunk.Space()
        self._wheels: list[pymunk.Body] = []
        self._parts: list[Parts] = []
        self._robots: dict[int, int] = {}

    @property
    def addresses(self) -> tuple[int, int]:
        """Addresses of the space and of the one with the wheels, for the compiled steps."""
        return address(self.space._space), address(self._shelf._space)

    @property
    def order(self) -> list[tuple[int, int]]:
        """The robots in the order in which pymunk visits their bodies, and the bodies' ids.

        Both are others after each `place` and `remove`. The body that the walls belong to
        comes after all of them, and so do things that were put on the floor after the robots.
        """
        return [(self._robots[id_], id_) for id_ in self.body_ids if id_ in self._robots]

    @property
    def body_ids(self) -> list[int]:
        """Pymunk's ids of all bodies in the order in which it visits them."""
        buffer = Buffer()
        get_space_bodies(self.space, BodyFields.BODY_ID, buffer)
        ids: list[int] = memoryview(buffer.int_buf()).cast("P").tolist()
        return ids

    def clearance(self, pose: Pose, reach: float) -> float:
        """Distance (m) from a pose to the nearest wall; infinite where none is within reach."""
        x, y, _ = pose.tolist()
        nearest = self.space.point_query_nearest((x, y), reach, _ROBOTS)
        return nearest.distance if nearest else math.inf

    def place(self, robot: int, pose: tuple[float, float, float]) -> None:
        """Put a robot at rest at x, y (m) and heading (rad): a new one, or one that is here.

        Robots are numbered from 0. The body is made anew: pymunk keeps impulses of past
        steps in joints and contacts, and what comes next must not depend on where the robot
        was before.
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
        # The joints carry velocities over, never positions.
        pull.error_bias = twist.error_bias = 1.0

        self._robots[body.id] = robot
        self._parts[robot] = (body, disc, pull, twist)
        self.space.add(*self._parts[robot])

    def remove(self, robot: int) -> None:
        """Take a robot off the floor, if it is there."""
        while len(self._wheels) <= robot:
            wheels = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
            self._wheels.append(wheels)
            self._shelf.add(wheels)
            self._parts.append(())
        self.space.remove(*self._parts[robot])
        self._parts[robot] = ()
        self._robots = {id_: r for id_, r in self._robots.items() if r != robot}
