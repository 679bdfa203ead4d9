"""The batch simulator: many robots, each with sensors of its own, stepped together.

`Simulator` is a batch of one. What a robot does and senses depends on its own
world, start, commands and key alone, to the last bit.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Pose, Segments
from albot_core.kernels.arguments import ArgumentsCache
from albot_core.sensing.reading import Readings
from albot_env.sim.chipmunk import (
    ChipmunkBuffers,
    ChipmunkInterface,
    RobotArrays,
    SpaceTables,
    advance,
)
from albot_env.sim.drive import RobotConfig
from albot_env.sim.obstacles import DynamicObstacles, ObstacleSnapshot
from albot_env.sim.odometer import COUNTS
from albot_env.sim.physics import MAX_ROBOTS, PHYSICS_STEP, PhysicsSpaces
from albot_env.sim.sensing import SensorSuite
from albot_env.sim.sensors import Sensors
from albot_env.sim.thread_pool import ThreadPool
from albot_maps.world import World


class RobotSnapshot(NamedTuple):
    """The state of a robot at rest, and of the obstacles around it."""

    pose: Pose
    """Where it is (world frame); the heading is not wrapped."""
    key: int
    """The key to its noise."""
    readings: int
    """How many readings it has taken since it was placed."""
    counts: Float64[np.ndarray, "counts"]
    """What its odometer has counted."""
    obstacles: ObstacleSnapshot
    """Where the obstacles around it are."""


def draw_key(rng: np.random.Generator) -> int:
    """64 bits from a generator: the key to all of a robot's noise."""
    return int(rng.integers(2**64, dtype=np.uint64))


class BatchSimulator:
    """Robots with the same body and sensors. Place each before it drives; sense to have readings.

    Args:
        robots: How many there are.
        robot: Body and drive of the robots.
        sensors: What each senses with.
        threads: Threads that share the work.
        movables: Whether worlds have their doors, boxes and people; if not, they are left out.
    """

    def __init__(
        self,
        robots: int,
        *,
        robot: RobotConfig,
        sensors: Sensors,
        threads: ThreadPool | None = None,
        movables: bool = True,
    ) -> None:
        self.robot = robot
        self._threads = threads or ThreadPool(1)
        self._robots = RobotArrays(
            targets=np.zeros((robots, 2)),
            wheels=np.zeros((robots, 2)),
            counts=np.zeros((robots, COUNTS)),
            states=np.zeros((robots, 6)),
            poses=np.zeros((robots, 3)),
            touched=np.zeros((robots, 2), np.bool_),
            body_ids=np.zeros(robots, np.int64),
        )
        self._all_rows: Int64[np.ndarray, "robots"] = np.arange(robots)
        self._sensors = SensorSuite(sensors, robot, self._robots)
        self._spaces = PhysicsSpaces(robots, robot, movables=movables)
        self._obstacles = DynamicObstacles(robots, robot.radius)
        self._buffered_bodies = 0
        self._reserve_buffers(MAX_ROBOTS)

    @property
    def motions(self) -> Float64[np.ndarray, "robots 3"]:
        """What the odometers measured at the last sensing."""
        return self._sensors.outputs.motions

    @property
    def ranges(self) -> Float64[np.ndarray, "robots beams"]:
        """What the lasers saw at the last sensing (m); infinite where nothing came back.

        On robots without, what `Sensors.ground_laser` would have seen.
        """
        return self._sensors.outputs.ranges

    @property
    def echoes(self) -> Float64[np.ndarray, "robots sonars"]:
        """What the sonars heard at the last sensing (m); infinite where nothing came back."""
        return self._sensors.outputs.echoes

    @property
    def scenes(self) -> Int64[np.ndarray, "robots"]:
        """The scenes that the cameras recognised at the last sensing; -1 where none."""
        return self._sensors.outputs.scenes

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """Where the robots are, in the world frame; headings in [-pi, pi)."""
        return self._robots.poses

    @property
    def collided(self) -> Bool[np.ndarray, "robots"]:
        """Whether a wall or an obstacle pushed the robot back since `clear_contacts`."""
        return self._robots.touched[:, 1]

    @property
    def pushed(self) -> Bool[np.ndarray, "robots"]:
        """Whether a wall or an obstacle pushed the robot back in the last physics step."""
        return self._robots.touched[:, 0]

    @property
    def wheels(self) -> Float64[np.ndarray, "robots 2"]:
        """Speeds of the left and right wheels (m/s)."""
        return self._robots.wheels

    @property
    def states(self) -> Float64[np.ndarray, "robots 6"]:
        """x, y, heading, velocity x, y and turn rate (m, rad, s; world frame)."""
        return self._robots.states

    def check_start(self, world: World, pose: Pose) -> None:
        """Raise InputError if a robot cannot start at a pose.

        Raises:
            InputError: It is not finite, or the robot would touch a wall there, a box, or a
                door as it swings.
        """
        if not np.isfinite(pose).all():
            raise InputError("start", "a finite pose", str(pose.tolist()))
        radius = self.robot.radius
        if self._spaces.moves(world) and world.movables.gap(*pose[:2].tolist()) < radius:
            expected = f"a pose {radius:g} m clear of the boxes and doors of {world.name}"
            raise InputError("start", expected, str(pose.tolist()))
        room = self._spaces.clearance(world, pose, radius)
        if room < radius:
            raise InputError(
                "start",
                f"a pose {radius:g} m clear of the walls of {world.name}",
                f"{pose.tolist()}, {room:.3f} m from one",
            )
        if not world.reaches(pose[:2]):
            expected = f"a pose that a robot can come to from a start of {world.name}"
            raise InputError("start", expected, str(pose.tolist()))

    def place(self, row: int, world: World, pose: Pose, key: int) -> None:
        """Put a robot at rest and begin anew.

        Args:
            row: The robot.
            world: Where. Which world it is goes by the object: robots in one share its
                spaces and what is known of its walls.
            pose: Where in the world's frame (see `check_start`).
            key: 64 bits, of which all its random numbers are a function from now on.
        """
        robots = self._robots
        self._obstacles.remove(row)
        space = self._spaces.place(row, world, pose, robots.body_ids)
        if self._spaces.moves(world):
            self._obstacles.place(row, world, space, pose, key)
        self._reserve_buffers(1 + self._obstacles.most_bodies)
        for array in (robots.targets, robots.wheels, robots.counts, robots.touched):
            array[row] = 0
        robots.states[row] = *pose, 0.0, 0.0, 0.0
        robots.poses[row] = *pose[:2], wrap_angle(pose[2])
        self._sensors.begin(row, world, key)

    def snapshot(self, row: int) -> RobotSnapshot:
        """The state of a robot that has come to rest (copies)."""
        outputs = self._sensors.outputs
        return RobotSnapshot(
            pose=self.states[row, :3].copy(),
            key=int(outputs.keys[row]),
            readings=int(outputs.readings[row]),
            counts=self._robots.counts[row].copy(),
            obstacles=self._obstacles.snapshot(row),
        )

    def restore(self, row: int, world: World, snapshot: RobotSnapshot) -> None:
        """Put a robot into the state of one in this world, of this batch or another like it.

        What comes next is a function of that alone. Where nothing moves it is to the last bit
        what would have come; pushed obstacles lose what pymunk remembers of their last contacts.
        """
        self.place(row, world, snapshot.pose, snapshot.key)
        self._robots.counts[row] = snapshot.counts
        self._sensors.outputs.readings[row] = snapshot.readings
        self._obstacles.restore(row, snapshot.obstacles)

    def clear_contacts(self) -> None:
        """From now on a robot counts as collided only when pushed again."""
        self._robots.touched[:] = False

    def drive(
        self, targets: Float64[np.ndarray, "robots 2"], steps: int, *, at_once: bool = False
    ) -> None:
        """Let some physics steps pass in which the wheels approach speeds left, right (m/s).

        They do so as fast as the motors can, or `at_once`.
        """
        self._robots.targets[:] = targets
        acceleration = np.inf if at_once else self.robot.acceleration
        self._threads.share(self._spaces.occupied, partial(self._move, acceleration, steps))

    def _move(
        self, acceleration: float, steps: int, spaces: Int64[np.ndarray, "some"], thread: int
    ) -> None:
        """Let some physics steps pass in some spaces, with the buffers of a thread.

        The wheels are accelerated so much (m/s²).
        """
        obstacles, tables = self._obstacles, self._spaces.tables
        chipmunk = self._buffers[thread].interface
        # Where obstacles move there is one robot alone in a space.
        among = tables.rows[spaces, 0] if obstacles.most_bodies else spaces[:0]
        among = among[obstacles.present[among]]
        if len(among):
            obstacles.command(among, chipmunk, self.states, steps * PHYSICS_STEP)
        arguments = self._arguments[thread].arguments(chipmunk, tables)
        advance(spaces, arguments, acceleration, PHYSICS_STEP, steps)
        if len(among):
            obstacles.observe(among, chipmunk)

    def obstacles(self, row: int) -> Segments:
        """The outlines of the obstacles around a robot, where they are now (world frame)."""
        return self._obstacles.outlines(row)

    def _reserve_buffers(self, bodies: int) -> None:
        """Have buffers for so many bodies of robots and obstacles in a space."""
        if bodies > self._buffered_bodies:
            self._buffers = [ChipmunkBuffers(bodies) for _ in range(self._threads.size)]
            self._arguments = [ArgumentsCache(self._arrange) for _ in range(self._threads.size)]
            self._buffered_bodies = bodies

    def _arrange(self, chipmunk: ChipmunkInterface, tables: SpaceTables) -> tuple[Any, ...]:
        """The arguments of `advance`."""
        return chipmunk, tables, self._robots, self._sensors.odometer, self.robot.wheel_base

    def readings(self, stamps: Float64[np.ndarray, "robots"]) -> Readings:
        """What was sensed last, at these times (s). It is written over at the next sensing."""
        return self._sensors.readings(stamps)

    def locate(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Find out where in their buildings all robots, or some, are: before `sense`."""
        self._sensors.locate(self._all_rows if rows is None else rows)

    def sense(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Take the readings of all robots, or some: `motions`, `ranges` and so on."""
        chosen = self._all_rows if rows is None else rows
        self._sensors.sense(chosen, self._obstacles.tables)
