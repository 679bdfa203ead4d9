"""The physics: walls and robots in one pymunk space."""

from __future__ import annotations

import math

import numpy as np
import pymunk
from pymunk._chipmunk_cffi import lib

from albot_core.geometry.types import Pose, Segments
from albot_env.sim.drive import GRAVITY, STANDSTILL, RobotConfig, Wheels

PHYSICS_STEP = 0.02
"""Duration of one step of the physics (s). In it the robot goes 3.2 cm at most, far less
than its radius, so that it cannot jump over a wall."""

_ALLOWED_OVERLAP = 0.001
"""How deep (m) a body may rest in a wall before it is pushed out."""
_OVERLAP_LEFT = 0.2
"""Share of an overlap that is left after one physics step."""
_WALL = 1
_ROBOT = 2
"""Collision types: which pairs of shapes the floor listens to."""
_ROBOTS = pymunk.ShapeFilter(group=1)
"""Robots in one space meet the walls and not each other."""


class Floor:
    """A building's static walls in a pymunk space, and the robots that drive there."""

    def __init__(self, walls: Segments) -> None:
        self.space = pymunk.Space()
        # Contacts are forgotten as soon as they part: the shortest memory that pymunk
        # has (with 0 it drops them before they are solved, and nothing collides).
        self.space.collision_persistence = 1
        self.space.collision_slop = _ALLOWED_OVERLAP
        self.space.collision_bias = _OVERLAP_LEFT ** (1 / PHYSICS_STEP)
        self.space.on_collision(_WALL, _ROBOT, post_solve=self._note_push)
        self.pushed: set[int] = set()
        """The bodies, by pymunk's id, that a wall pushed back in the last physics step."""
        ground = self.space.static_body
        for x1, y1, x2, y2 in walls.tolist():
            wall = pymunk.Segment(ground, (x1, y1), (x2, y2), 0.0)
            wall.friction = 1.0
            wall.collision_type = _WALL
            self.space.add(wall)

    def clearance(self, pose: Pose, reach: float) -> float:
        """Distance (m) from a pose to the nearest wall; infinite where none is within reach."""
        x, y, _ = pose.tolist()
        nearest = self.space.point_query_nearest((x, y), reach, _ROBOTS)
        return nearest.distance if nearest else math.inf

    def step(self) -> None:
        """Let one physics step pass."""
        self.pushed.clear()
        self.space.step(PHYSICS_STEP)

    def _note_push(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        if arbiter.total_impulse != (0.0, 0.0):
            self.pushed.update(body.id for body in arbiter.bodies)


class Robot:
    """The robot's body on a floor: a disc that two wheels carry along and walls stop.

    A second, massless body moves as the wheels would without slip. Two joints pull the
    disc along with it, a pivot its velocity and a gear its turn rate, as hard as
    the tyres grip the ground. pymunk solves them together with the contacts, so that a
    robot that pushes against a wall slides along it or stops, while its wheels slip.

    In a physics step pymunk first moves bodies with the velocities they have and then
    finds the new ones: a wheel speed given to `drive` moves the body in the physics
    step after.
    """

    def __init__(self, floor: Floor, config: RobotConfig) -> None:
        self.config = config
        self._floor = floor
        self._parts: tuple[pymunk.Body | pymunk.Shape | pymunk.Constraint, ...] = ()
        self.place(np.zeros(3))

    @property
    def pose(self) -> Pose:
        """Where the robot is, in the world frame; the heading is in [-pi, pi)."""
        x, y = self._body.position
        return np.array((x, y, (self._body.angle + math.pi) % (2 * math.pi) - math.pi))

    @property
    def motion(self) -> tuple[float, float]:
        """Speed along the heading (m/s) and turn rate (rad/s)."""
        turn_rate = self._body.angular_velocity
        vx, vy = self._body.velocity
        direction, shortening = _chord(self._body.angle, turn_rate)
        along = vx * math.cos(direction) + vy * math.sin(direction)
        return along / shortening, turn_rate

    @property
    def pushed(self) -> bool:
        """Whether a wall pushed the robot back in the last physics step."""
        return self._body_id in self._floor.pushed

    def place(self, pose: Pose) -> None:
        """Put the robot at rest at `pose`.

        The body is made anew: pymunk keeps impulses of past steps in joints and contacts,
        and what comes next must not depend on where the robot was before.
        """
        config = self.config
        self._body = pymunk.Body(config.mass, config.moment)
        self._body.position = float(pose[0]), float(pose[1])
        self._body.angle = float(pose[2])
        disc = pymunk.Circle(self._body, config.radius)
        disc.friction = config.hull_friction
        disc.filter = _ROBOTS
        disc.collision_type = _ROBOT

        self._wheel_motion = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        grip = config.grip * config.mass * GRAVITY
        pull = pymunk.PivotJoint(self._wheel_motion, self._body, (0, 0), (0, 0))
        pull.max_force = grip
        twist = pymunk.GearJoint(self._wheel_motion, self._body, 0.0, 1.0)
        twist.max_force = grip * config.wheel_base / 2
        # The joints carry velocities over, never positions.
        pull.max_bias = twist.max_bias = 0.0

        space = self._floor.space
        space.remove(*self._parts)
        self._body_id = self._body.id
        self._parts = (self._body, disc, pull, twist)
        space.add(*self._parts)
        self.wheels = STANDSTILL

    def drive(self, wheels: Wheels) -> None:
        """Turn the wheels at these speeds, which the motors must be able to reach.

        In the physics step after, the body moves along the chord of its arc, so that
        without slip it stays on the arc exactly.
        """
        self.wheels = wheels
        speed, turn_rate = self.config.motion_of(wheels)
        # Chipmunk's functions themselves: pymunk's properties would take half of a step.
        body, wheel_motion = self._body._body, self._wheel_motion._body
        heading = lib.cpBodyGetAngle(body) + lib.cpBodyGetAngularVelocity(body) * PHYSICS_STEP
        direction, shortening = _chord(heading, turn_rate)
        speed *= shortening
        velocity = speed * math.cos(direction), speed * math.sin(direction)
        lib.cpBodySetVelocity(wheel_motion, velocity)
        lib.cpBodySetAngularVelocity(wheel_motion, turn_rate)


def _chord(heading: float, turn_rate: float) -> tuple[float, float]:
    """Direction of an arc's chord over one physics step, and its length over the arc's."""
    half_turn = turn_rate * PHYSICS_STEP / 2
    return heading + half_turn, math.sin(half_turn) / half_turn if half_turn else 1.0
