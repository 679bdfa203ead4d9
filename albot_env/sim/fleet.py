"""The fleet: many robots, each with sensors of its own, stepped together.

A single simulator is a fleet of one. What a robot does and senses depends on its own
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
from albot_env.sim import chipmunk_kernels
from albot_env.sim.chipmunk_kernels import Engine, Robots, advance
from albot_env.sim.crew import Crew
from albot_env.sim.drive import RobotConfig
from albot_env.sim.engine import Bridge
from albot_env.sim.floors import CROWD, Floors
from albot_env.sim.instruments import Instruments
from albot_env.sim.odometer_kernels import COUNTS
from albot_env.sim.sensors import Sensors
from albot_env.sim.space import PHYSICS_STEP
from albot_env.sim.things import Still
from albot_maps.world import World


class Halt(NamedTuple):
    """How a robot stands that has come to rest, and what moves around it."""

    pose: Pose
    """Where it is (world frame); the heading counts full turns."""
    key: int
    """The key to its noise."""
    readings: int
    """How many readings it has taken since it was placed."""
    counts: Float64[np.ndarray, "counts"]
    """What its odometer has counted."""
    things: Still
    """Where the things around it are."""


def draw_key(rng: np.random.Generator) -> int:
    """64 bits from a generator: the key to all of a robot's noise."""
    return int(rng.integers(2**64, dtype=np.uint64))


class Fleet:
    """Robots of one make. Place each before it drives; sense to have readings.

    Args:
        robots: How many there are.
        robot: Body and drive of the robots.
        sensors: What each senses with.
        crew: Threads that share the work.
        movables: Whether things move in worlds that have any; if not, they are left out.
    """

    def __init__(
        self,
        robots: int,
        *,
        robot: RobotConfig,
        sensors: Sensors,
        crew: Crew | None = None,
        movables: bool = True,
    ) -> None:
        self.robot = robot
        self._crew = crew or Crew(1)
        self._robots = Robots(
            targets=np.zeros((robots, 2)),
            wheels=np.zeros((robots, 2)),
            counts=np.zeros((robots, COUNTS)),
            states=np.zeros((robots, 6)),
            poses=np.zeros((robots, 3)),
            touched=np.zeros((robots, 2), np.bool_),
            ids=np.zeros(robots, np.int64),
        )
        self._everyone: Int64[np.ndarray, "robots"] = np.arange(robots)
        self._instruments = Instruments(sensors, robot, self._robots)
        self._floors = Floors(robots, robot, movables=movables)
        self._bridged = 0
        self._build_bridges(CROWD)

    @property
    def motions(self) -> Float64[np.ndarray, "robots 3"]:
        """What the odometers measured at the last sensing."""
        return self._instruments.sensed.motions

    @property
    def ranges(self) -> Float64[np.ndarray, "robots beams"]:
        """What the lasers saw at the last sensing (m); infinite where nothing came back."""
        return self._instruments.sensed.ranges

    @property
    def echoes(self) -> Float64[np.ndarray, "robots sonars"]:
        """What the sonars heard at the last sensing (m); infinite where nothing came back."""
        return self._instruments.sensed.echoes

    @property
    def scenes(self) -> Int64[np.ndarray, "robots"]:
        """The scenes that the cameras recognised at the last sensing; -1 where none."""
        return self._instruments.sensed.scenes

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """Where the robots are, in the world frame; headings in [-pi, pi)."""
        return self._robots.poses

    @property
    def collided(self) -> Bool[np.ndarray, "robots"]:
        """Whether a wall or a thing pushed the robot back since `clear_contacts`."""
        return self._robots.touched[:, 1]

    @property
    def pushed(self) -> Bool[np.ndarray, "robots"]:
        """Whether a wall or a thing pushed the robot back in the last physics step."""
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
        """Refuse a start.

        Raises:
            InputError: It is not finite, or the robot would touch a wall there, a box, or a
                door as it swings.
        """
        if not np.isfinite(pose).all():
            raise InputError("start", "a finite pose", str(pose.tolist()))
        radius = self.robot.radius
        if self._floors.moves(world) and world.movables.gap(*pose[:2].tolist()) < radius:
            expected = f"a pose {radius:g} m clear of the boxes and doors of {world.name}"
            raise InputError("start", expected, str(pose.tolist()))
        room = self._floors.clearance(world, pose, radius)
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
                floors and what is known of its walls.
            pose: Where in the world's frame (see `check_start`).
            key: 64 bits, of which all its random numbers are a function from now on.
        """
        robots = self._robots
        self._floors.place(row, world, pose, key, robots.ids)
        self._build_bridges(1 + self._floors.things.most_bodies)
        for array in (robots.targets, robots.wheels, robots.counts, robots.touched):
            array[row] = 0
        robots.states[row] = *pose, 0.0, 0.0, 0.0
        robots.poses[row] = *pose[:2], wrap_angle(pose[2])
        self._instruments.begin(row, world, key)

    def halt(self, row: int) -> Halt:
        """How a robot stands that has come to rest."""
        sensed = self._instruments.sensed
        return Halt(
            pose=self.states[row, :3].copy(),
            key=int(sensed.keys[row]),
            readings=int(sensed.readings[row]),
            counts=self._robots.counts[row].copy(),
            things=self._floors.things.halt(row),
        )

    def resume(self, row: int, world: World, halt: Halt) -> None:
        """Let a robot stand as one in this world did, of this fleet or another of its make.

        What comes next is a function of that alone. Where nothing moves it is to the last bit
        what would have come; pushed things lose what pymunk remembers of their last contacts.
        """
        self.place(row, world, halt.pose, halt.key)
        self._robots.counts[row] = halt.counts
        self._instruments.sensed.readings[row] = halt.readings
        self._floors.things.resume(row, halt.things)

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
        self._crew.share(self._floors.inhabited, partial(self._move, acceleration, steps))

    def _move(
        self, acceleration: float, steps: int, floors: Int64[np.ndarray, "some"], member: int
    ) -> None:
        """Let some physics steps pass on some floors, by the bridge of a member of the crew.

        The wheels are accelerated so much (m/s²).
        """
        things, tables = self._floors.things, self._floors.tables
        engine = self._bridges[member].engine
        # Where things move there is one robot alone on a floor.
        among = tables.members[floors, 0] if things.most_bodies else floors[:0]
        among = among[things.present[among]]
        if len(among):
            things.command(among, engine, self.states, steps * PHYSICS_STEP)
        arguments = self._driving[member].arguments(engine, tables)
        advance(floors, arguments, acceleration, PHYSICS_STEP, steps)
        if len(among):
            things.observe(among, engine)

    def things(self, row: int) -> Segments:
        """The outlines of the things around a robot, where they are now (world frame)."""
        return self._floors.things.segments(row)

    def _build_bridges(self, bodies: int) -> None:
        """Have bridges to pymunk for so many robots and things on a floor."""
        if bodies > self._bridged:
            self._bridges = [Bridge(bodies) for _ in range(self._crew.size)]
            self._driving = [ArgumentsCache(self._machinery) for _ in range(self._crew.size)]
            self._bridged = bodies

    def _machinery(self, engine: Engine, tables: chipmunk_kernels.Floors) -> tuple[Any, ...]:
        """What the physics takes."""
        return engine, tables, self._robots, self._instruments.odometer, self.robot.wheel_base

    def readings(self, stamps: Float64[np.ndarray, "robots"]) -> Readings:
        """What was sensed last, at these times (s). It is written over at the next sensing."""
        return self._instruments.readings(stamps)

    def locate(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Find out where in their buildings all robots, or some, are: before `sense`."""
        self._instruments.locate(self._everyone if rows is None else rows)

    def sense(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Take the readings of all robots, or some: `motions`, `ranges` and so on."""
        chosen = self._everyone if rows is None else rows
        self._instruments.sense(chosen, self._floors.things.stage)
