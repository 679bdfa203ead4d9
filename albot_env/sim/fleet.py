"""The fleet: many robots, each with a laser and an odometer, stepped together.

A single simulator is a fleet of one. What a robot does and senses depends on its own
world, start, commands and key alone, to the last bit.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Pose, Segments
from albot_env.sim.chipmunk_kernels import Robots, advance
from albot_env.sim.crew import Crew
from albot_env.sim.drive import RobotConfig
from albot_env.sim.engine import Bridge
from albot_env.sim.floors import CROWD, Floors
from albot_env.sim.laser import LaserConfig, normal_table
from albot_env.sim.odometer import OdometerConfig
from albot_env.sim.rays import index_for, make_fan
from albot_env.sim.register import Register
from albot_env.sim.sensing_kernels import Devices, Moving, Sensed, sense
from albot_env.sim.space import PHYSICS_STEP
from albot_maps.world import World


def draw_key(rng: np.random.Generator) -> int:
    """64 bits from a generator: the key to all of a robot's noise."""
    return int(rng.integers(2**64, dtype=np.uint64))


class Fleet:
    """Robots of one make. Place each before it drives; sense to have readings.

    Args:
        robots: How many there are.
        robot: Body and drive of the robots.
        laser: Beams and errors of the lasers.
        odometer: Errors of the odometers.
        crew: Threads that share the work.
        movables: Whether things move in worlds that have any; if not, they are left out.
    """

    def __init__(
        self,
        robots: int,
        *,
        robot: RobotConfig,
        laser: LaserConfig,
        odometer: OdometerConfig,
        crew: Crew | None = None,
        movables: bool = True,
    ) -> None:
        self.robot = robot
        self.laser = laser
        self._crew = crew or Crew(1)
        self._robots = Robots(
            targets=np.zeros((robots, 2)),
            wheels=np.zeros((robots, 2)),
            counts=np.zeros((robots, 5)),
            states=np.zeros((robots, 6)),
            poses=np.zeros((robots, 3)),
            touched=np.zeros((robots, 2), np.bool_),
            ids=np.zeros(robots, np.int64),
        )
        self._devices = Devices(
            odometer=odometer.constants(robot.wheel_base),
            fan=make_fan(laser.geometry),
            normals=normal_table(laser.range_noise),
            dropout=laser.dropout_threshold,
        )
        self._sensed = Sensed(
            keys=np.zeros(robots, np.uint64),
            readings=np.zeros(robots, np.int64),
            buildings=np.zeros(robots, np.int64),
            cells=np.zeros(robots, np.int64),
            motions=np.zeros((robots, 3)),
            ranges=np.full((robots, laser.geometry.beams), np.inf),
        )
        self._everyone: Int64[np.ndarray, "robots"] = np.arange(robots)
        self._floors = Floors(robots, robot, movables=movables)
        self._bridged = 0
        self._build_bridges(CROWD)
        self._index = index_for(laser.geometry)
        self._buildings = Register(
            robots, lambda world: self._index.add(world.walls), self._index.clear
        )

    @property
    def motions(self) -> Float64[np.ndarray, "robots 3"]:
        """What the odometers measured at the last sensing."""
        return self._sensed.motions

    @property
    def ranges(self) -> Float64[np.ndarray, "robots beams"]:
        """What the lasers saw at the last sensing (m); infinite where nothing came back."""
        return self._sensed.ranges

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
        for other, building in self._buildings.enter(row, world):
            self._sensed.buildings[other] = building
        for array in (robots.targets, robots.wheels, robots.counts, robots.touched):
            array[row] = 0
        robots.states[row] = *pose, 0.0, 0.0, 0.0
        robots.poses[row] = *pose[:2], wrap_angle(pose[2])
        self._sensed.keys[row] = key
        self._sensed.readings[row] = 0

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
        drive = self.robot.wheel_base, np.inf if at_once else self.robot.acceleration
        errors = self._devices.odometer

        things, tables = self._floors.things, self._floors.tables

        def move(floors: Int64[np.ndarray, "some"], member: int) -> None:
            engine = self._bridges[member].engine
            # Where things move there is one robot alone on a floor.
            among = tables.members[floors, 0]
            among = among[things.present[among]]
            if len(among):
                things.command(among, engine, self.states, steps * PHYSICS_STEP)
            advance(floors, engine, tables, self._robots, errors, drive, PHYSICS_STEP, steps)
            if len(among):
                things.observe(among, engine)

        self._crew.share(self._floors.inhabited, move)

    def things(self, row: int) -> Segments:
        """The outlines of the things around a robot, where they are now (world frame)."""
        return self._floors.things.segments(row)

    def _build_bridges(self, bodies: int) -> None:
        """Have bridges to pymunk for so many robots and things on a floor."""
        if bodies > self._bridged:
            self._bridges = [Bridge(bodies) for _ in range(self._crew.size)]
            self._bridged = bodies

    def locate(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Find out where in their buildings all robots, or some, are: before `sense`."""
        chosen = self._everyone if rows is None else rows
        self._index.locate(chosen, self._sensed.buildings, self.poses, self._sensed.cells)

    def sense(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Take the readings of all robots, or some, into `motions` and `ranges`."""
        chosen = self._everyone if rows is None else rows
        robots, stage = self._robots, self._floors.things.stage
        moving = Moving(stage.segments, stage.robots["segments"], stage.robots["segments_end"])
        walls = self._index.tables
        sense(chosen, robots.poses, robots.counts, walls, moving, self._devices, self._sensed)
