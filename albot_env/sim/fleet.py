"""The fleet: many robots, each with a laser and an odometer, stepped together.

A single simulator is a fleet of one. What a robot does and senses depends on its own
world, start, commands and key alone, to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64, UInt64

from albot_core.errors import InputError
from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Pose
from albot_env.sim.chipmunk_kernels import Floors, Robots, advance
from albot_env.sim.drive import RobotConfig
from albot_env.sim.engine import Bridge
from albot_env.sim.laser import LaserConfig, normal_table
from albot_env.sim.odometer import OdometerConfig
from albot_env.sim.odometer_kernels import COUNTS
from albot_env.sim.rays import RayCaster
from albot_env.sim.sensing_kernels import sense
from albot_env.sim.space import PHYSICS_STEP, Floor
from albot_maps.world import World

CROWD = 16
"""Most robots on a floor: bodies that overlap, though they never touch, cost pymunk time."""


def draw_key(rng: np.random.Generator) -> int:
    """64 bits from a generator: the key to all of a robot's noise."""
    return int(rng.integers(2**64, dtype=np.uint64))


class _Place(NamedTuple):
    """Where a robot's body is: on which floor, and as which of the floor's robots."""

    floor: int
    number: int


class Fleet:
    """Robots of one make. Place each before it drives; sense to have readings.

    Args:
        worlds: The world of each robot. Robots in one and the same world share its floors.
        robot: Body and drive of the robots.
        laser: Beams and errors of the lasers.
        odometer: Errors of the odometers.
    """

    def __init__(
        self,
        worlds: Sequence[World],
        *,
        robot: RobotConfig,
        laser: LaserConfig,
        odometer: OdometerConfig,
    ) -> None:
        count = len(worlds)
        self.worlds = tuple(worlds)
        self.robot = robot
        self.laser = laser
        self._errors = odometer.constants(robot.wheel_base)
        self._normals = normal_table(laser.range_noise)
        self._robots = Robots(
            targets=np.zeros((count, 2)),
            wheels=np.zeros((count, 2)),
            counts=np.zeros((count, COUNTS)),
            states=np.zeros((count, 6)),
            poses=np.zeros((count, 3)),
            touched=np.zeros((count, 2), np.bool_),
            ids=np.zeros(count, np.int64),
        )
        self.motions: Float64[np.ndarray, "robots 3"] = np.zeros((count, 3))
        """What the odometers measured at the last sensing."""
        self.ranges: Float64[np.ndarray, "robots beams"] = np.full(
            (count, laser.geometry.beams), np.inf
        )
        """What the lasers saw at the last sensing (m); infinite where nothing came back."""
        self._keys: UInt64[np.ndarray, "robots"] = np.zeros(count, np.uint64)
        self._readings: Int64[np.ndarray, "robots"] = np.zeros(count, np.int64)
        self._build()

    def _build(self) -> None:
        """Lay the floors out: a robot's world is known by the object that it is."""
        groups: dict[int, list[int]] = {}
        for row, world in enumerate(self.worlds):
            groups.setdefault(id(world), []).append(row)
        self._places: list[_Place] = [_Place(-1, -1)] * len(self.worlds)
        self._floors: list[Floor] = []
        self._crews: list[list[int]] = []
        self._rays: list[tuple[RayCaster, np.ndarray]] = []
        for rows in groups.values():
            walls = self.worlds[rows[0]].walls
            self._rays.append((RayCaster(walls, self.laser.geometry), np.array(rows)))
            for first in range(0, len(rows), CROWD):
                crew = rows[first : first + CROWD]
                for number, row in enumerate(crew):
                    self._places[row] = _Place(len(self._floors), number)
                self._floors.append(Floor(walls, self.robot, len(crew)))
                self._crews.append(crew)
        self._bridge = Bridge(max(len(crew) for crew in self._crews))
        self._tables = Floors(
            spaces=np.array([floor.addresses for floor in self._floors], np.int64),
            starts=np.cumsum([0, *(len(crew) for crew in self._crews)]),
            members=np.concatenate(self._crews),
            places=np.array([place.number for place in self._places]),
        )
        for floor in range(len(self._floors)):
            self._enlist(floor)

    def _enlist(self, floor: int) -> None:
        """Note in which order pymunk now visits a floor's robots, and as whom it knows them."""
        crew = self._crews[floor]
        start = self._tables.starts[floor]
        order = self._floors[floor].order
        self._tables.members[start : start + len(crew)] = [crew[number] for number in order]
        self._robots.ids[crew] = self._floors[floor].ids

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """Where the robots are, in the world frame; headings in [-pi, pi)."""
        return self._robots.poses

    @property
    def collided(self) -> Bool[np.ndarray, "robots"]:
        """Whether a wall pushed the robot back since `clear_contacts`."""
        return self._robots.touched[:, 1]

    @property
    def pushed(self) -> Bool[np.ndarray, "robots"]:
        """Whether a wall pushed the robot back in the last physics step."""
        return self._robots.touched[:, 0]

    @property
    def wheels(self) -> Float64[np.ndarray, "robots 2"]:
        """Speeds of the left and right wheels (m/s)."""
        return self._robots.wheels

    @property
    def states(self) -> Float64[np.ndarray, "robots 6"]:
        """x, y, heading, velocity x, y and turn rate (m, rad, s; world frame)."""
        return self._robots.states

    def check_start(self, row: int, pose: Pose) -> None:
        """Refuse a start.

        Raises:
            InputError: It is not finite, or the robot would touch a wall there.
        """
        if not np.isfinite(pose).all():
            raise InputError("start", "a finite pose", str(pose.tolist()))
        radius = self.robot.radius
        room = self._floors[self._places[row].floor].clearance(pose, radius)
        if room < radius:
            raise InputError(
                "start",
                f"a pose {radius:g} m clear of the walls of {self.worlds[row].name}",
                f"{pose.tolist()}, {room:.3f} m from one",
            )

    def place(self, row: int, pose: Pose, key: int) -> None:
        """Put a robot at rest and begin anew.

        Args:
            row: The robot.
            pose: Where, in the world frame (see `check_start`).
            key: 64 bits, of which all its random numbers are a function from now on.
        """
        floor, number = self._places[row]
        self._floors[floor].place(number, (float(pose[0]), float(pose[1]), float(pose[2])))
        self._enlist(floor)
        robots = self._robots
        for array in (robots.targets, robots.wheels, robots.counts, robots.touched):
            array[row] = 0
        robots.states[row] = *pose, 0.0, 0.0, 0.0
        robots.poses[row] = *pose[:2], wrap_angle(pose[2])
        self._keys[row] = key
        self._readings[row] = 0

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
        advance(
            self._bridge.engine,
            self._tables,
            self._robots,
            self._errors,
            drive,
            PHYSICS_STEP,
            steps,
        )

    def sense(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Take the readings of all robots, or some, into `motions` and `ranges`."""
        laser = self.laser
        for rays, inhabitants in self._rays:
            here = inhabitants if rows is None else np.intersect1d(inhabitants, rows)
            sense(
                here,
                rays.scan_batch(self.poses[here]),
                self._robots.counts,
                self._errors,
                self._keys,
                self._readings,
                self._normals,
                laser.dropout_threshold,
                laser.geometry.max_range,
                self.motions,
                self.ranges,
            )
