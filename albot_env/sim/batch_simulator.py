"""The batch simulator: many robots, each with its own sensors, stepped together.

`Simulator` is a batch of one. A robot's motion and readings depend only on its own world,
start, commands and key; they are bit-identical in any batch.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Pose, Segments
from albot_core.kernels.arguments import ArgumentsCache
from albot_core.robot import RobotConfig
from albot_core.sensing.reading import Readings
from albot_env.sim.chipmunk import (
    ChipmunkBuffers,
    ChipmunkInterface,
    RobotArrays,
    SpaceTables,
    advance,
)
from albot_env.sim.command_log import CommandLog, Targets
from albot_env.sim.obstacles import DynamicObstacles, ObstacleSnapshot
from albot_env.sim.odometer import ODOMETER_COUNT
from albot_env.sim.physics import MAX_ROBOTS, PHYSICS_STEP, PhysicsSpaces
from albot_env.sim.sensing import SensorSuite
from albot_env.sim.sensors import Sensors
from albot_env.sim.thread_pool import ThreadPool
from albot_maps.world import World


class RobotSnapshot(NamedTuple):
    """State of a robot at rest and of the obstacles around it."""

    pose: Pose
    """Pose in the world frame; the heading is not wrapped."""
    key: int
    """Key of the robot's noise."""
    readings: int
    """Number of readings taken since the robot was placed."""
    odometer: np.ndarray
    """Count of its odometer, one ODOMETER_COUNT."""
    obstacles: ObstacleSnapshot
    """State of the obstacles around it."""


class Placement(NamedTuple):
    """How a robot was put at rest in its world, before its first command."""

    pose: Pose
    """Pose in the world frame; the heading is not wrapped."""
    key: int
    """Key of the obstacles' random numbers."""
    obstacles: ObstacleSnapshot | None
    """State of the obstacles around it; None if the key decides it."""


class SimulatorState(NamedTuple):
    """State of a robot, moving or not, and of all around it: all that its future depends on.

    The physics is in it as its history: a placement, and the commands since then.
    """

    placement: Placement
    targets: Targets
    """Commands since the placement."""
    robot: dict[str, np.ndarray]
    """Its rows of `RobotArrays`."""
    sensors: dict[str, np.ndarray]
    """Its rows of `SensorOutputs`."""


_KEPT_OF_ROBOTS = ("targets", "wheels", "counts", "states", "poses", "touched")
_KEPT_OF_SENSORS = (
    "keys", "readings", "motions", "true_ranges", "ranges", "echoes", "scenes", "cameras",
    "compasses",
)  # fmt: skip
"""The arrays in a state. The others hold indices and ids, which differ between simulators."""


def draw_key(rng: np.random.Generator) -> int:
    """Draw 64 bits from a generator: the key of all of a robot's noise."""
    return int(rng.integers(2**64, dtype=np.uint64))


def check_start(world: World, pose: Pose, radius: float, clearance: Callable[[], float]) -> None:
    """Raise InputError if a robot cannot start at a pose among a world's walls.

    Args:
        world: The world.
        pose: The pose (world frame).
        radius: Radius of the robot (m).
        clearance: Returns the distance from a finite pose to the nearest wall (m).

    Raises:
        InputError: The pose is not finite, the robot would touch a wall, or it cannot come there
            from a start of the world.
    """
    if not np.isfinite(pose).all():
        raise InputError("start", "a finite pose", str(pose.tolist()))
    room = clearance()
    if room < radius:
        expected = f"a pose {radius:g} m clear of the walls of {world.name}"
        raise InputError("start", expected, f"{pose.tolist()}, {room:.3f} m from one")
    if not world.reaches(pose[:2]):
        expected = f"a pose that a robot can come to from a start of {world.name}"
        raise InputError("start", expected, str(pose.tolist()))


class BatchSimulator:
    """Robots with the same body and sensors. Place each before it drives; `sense` takes readings.

    Args:
        robots: Number of robots.
        robot: Body and drive of the robots.
        sensors: The sensors of each robot.
        threads: Threads that share the work.
        movables: Whether the worlds' doors, boxes and people are simulated.
        control_steps: Number of physics steps in each `drive`, if `state` shall be possible; 0 if
            not.
    """

    def __init__(
        self,
        robots: int,
        *,
        robot: RobotConfig,
        sensors: Sensors,
        threads: ThreadPool | None = None,
        movables: bool = True,
        control_steps: int = 0,
    ) -> None:
        self.robot = robot
        self._control_steps = control_steps
        self._log = CommandLog(robots)
        self._placements: list[Placement | None] = [None] * robots
        self._threads = threads or ThreadPool(1)
        self._robots = RobotArrays(
            targets=np.zeros((robots, 2)),
            wheels=np.zeros((robots, 2)),
            counts=np.zeros(robots, ODOMETER_COUNT),
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
        """Motions that the odometers measured at the last sensing: x, y, heading (m, rad)."""
        return self._sensors.outputs.motions

    @property
    def ranges(self) -> Float64[np.ndarray, "robots beams"]:
        """Ranges of the lasers at the last sensing (m); infinite where no beam came back.

        Robots without a laser have the ranges of `Sensors.ground_laser` here.
        """
        return self._sensors.outputs.ranges

    @property
    def true_ranges(self) -> Float64[np.ndarray, "robots beams"]:
        """Distances of what the beams met at the last sensing (m); infinite beyond their range."""
        return self._sensors.outputs.true_ranges

    @property
    def echoes(self) -> Float64[np.ndarray, "robots sonars"]:
        """Ranges of the sonars at the last sensing (m); infinite where no echo came back."""
        return self._sensors.outputs.echoes

    @property
    def scenes(self) -> Int64[np.ndarray, "robots"]:
        """Scenes that the cameras recognised at the last sensing; -1 for none."""
        return self._sensors.outputs.scenes

    @property
    def readings_taken(self) -> Int64[np.ndarray, "robots"]:
        """Number of readings that each robot has taken since it was placed."""
        return self._sensors.outputs.readings

    @property
    def compasses(self) -> Float64[np.ndarray, "robots"]:
        """Headings by the compasses at the last sensing (rad); 0 without compasses."""
        return self._sensors.outputs.compasses

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """Poses of the robots in the world frame; headings in [-pi, pi)."""
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
            InputError: The pose is not finite, cannot be reached from a start of the world, or
                the robot would touch a wall, a box or the area that a door sweeps.
        """
        radius = self.robot.radius
        check_start(world, pose, radius, lambda: self._spaces.clearance(world, pose, radius))
        if self._spaces.moves(world) and world.movables.gap(*pose[:2].tolist()) < radius:
            expected = f"a pose {radius:g} m clear of the boxes and doors of {world.name}"
            raise InputError("start", expected, str(pose.tolist()))

    def place(self, row: int, world: World, pose: Pose, key: int) -> None:
        """Put a robot at rest and start a new episode for it.

        Args:
            row: The robot.
            world: The world. Worlds are told apart by object identity; robots in the same world
                share its physics spaces and wall index.
            pose: Pose in the world frame (see `check_start`).
            key: 64 bits; all random numbers of the robot are a function of them.
        """
        robots = self._robots
        self._placements[row] = Placement(pose.copy(), key, None)
        self._log.restart(row)
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
        """Return the state of a robot that is at rest (copies)."""
        outputs = self._sensors.outputs
        return RobotSnapshot(
            pose=self.states[row, :3].copy(),
            key=int(outputs.keys[row]),
            readings=int(outputs.readings[row]),
            odometer=self._robots.counts[row, ...].copy(),
            obstacles=self._obstacles.snapshot(row),
        )

    def restore(self, row: int, world: World, snapshot: RobotSnapshot) -> None:
        """Put a robot into the state of a snapshot, from this batch or a similarly configured one.

        The continuation depends on the snapshot alone. Without dynamic obstacles it is identical to
        the original one, to the bit; pushed obstacles lose pymunk's memory of their last contacts.
        """
        self.place(row, world, snapshot.pose, snapshot.key)
        self._robots.counts[row] = snapshot.odometer
        self._sensors.outputs.readings[row] = snapshot.readings
        self._obstacles.restore(row, snapshot.obstacles)
        self._placements[row] = Placement(snapshot.pose, snapshot.key, snapshot.obstacles)

    def relocate(self, row: int, world: World, pose: Pose | None, boxes: int) -> None:
        """Put a robot at rest in mid-episode, elsewhere or into a changed world.

        Its sensors count on, and the obstacles stay as they are. A robot's motion depends on this
        and on what follows alone.

        Args:
            row: The robot.
            world: The world: the robot's own; or the same with other walls, or with other boxes
                after the first ones.
            pose: Where it is put (world frame); None for where it is.
            boxes: Number of boxes that stay as they are; the others begin anew.
        """
        before, outputs = self.snapshot(row), self._sensors.outputs
        camera, touched = outputs.cameras[row].copy(), self._robots.touched[row].copy()
        self.place(row, world, before.pose if pose is None else pose, before.key)
        obstacles = self._obstacles.snapshot(row).with_known(before.obstacles, boxes)
        self._robots.counts[row], self._robots.touched[row] = before.odometer, touched
        outputs.readings[row], outputs.cameras[row] = before.readings, camera
        self._obstacles.restore(row, obstacles)
        self._placements[row] = Placement(self.states[row, :3].copy(), before.key, obstacles)

    def state(self, row: int) -> SimulatorState:
        """Return the state of a robot that has been placed (copies).

        The simulator must have been made with `control_steps`.
        """
        assert self._control_steps, "its commands have not been kept"
        placement, robots, outputs = self._placements[row], self._robots, self._sensors.outputs
        assert placement is not None, "a robot is nowhere before it is placed"
        return SimulatorState(
            placement=placement,
            targets=self._log.of(row),
            # With the ellipsis a record, too, is an array, of which `copy` makes a copy.
            robot={name: getattr(robots, name)[row, ...].copy() for name in _KEPT_OF_ROBOTS},
            sensors={name: getattr(outputs, name)[row, ...].copy() for name in _KEPT_OF_SENSORS},
        )

    def set_state(self, row: int, world: World, state: SimulatorState) -> None:
        """Put a robot into a state, from this simulator or one with the same configuration.

        It is placed as in that state and repeats the commands, alone in its space. So this takes
        longer the more steps there were.

        Raises:
            InputError: The commands do not lead to the same pose, to the bit, because the state is
                from another kind of processor or other versions of the libraries.
        """
        placement, robots = state.placement, self._robots
        self._obstacles.remove(row)
        self._spaces.isolate(row, world, robots.body_ids)
        self.place(row, world, placement.pose, placement.key)
        if placement.obstacles is not None:
            self._obstacles.restore(row, placement.obstacles)
        self._placements[row] = placement
        self._log.restart(row, state.targets)
        space = self._spaces.space_of[row : row + 1]
        for targets in state.targets:
            robots.targets[row] = targets
            self._move(self.robot.acceleration, self._control_steps, space, 0)
        if robots.states[row].tobytes() != state.robot["states"].tobytes():
            expected = "one from such a processor and with these versions of pymunk and numpy"
            raise InputError("state", expected, "one whose motion is another here")
        for arrays, kept in ((robots, state.robot), (self._sensors.outputs, state.sensors)):
            for name, values in kept.items():
                getattr(arrays, name)[row] = values

    def clear_contacts(self) -> None:
        """Reset `collided` to False for all robots."""
        self._robots.touched[:] = False

    def drive(
        self, targets: Float64[np.ndarray, "robots 2"], steps: int, *, at_once: bool = False
    ) -> None:
        """Run physics steps in which the wheels approach the speeds left, right (m/s) of `targets`.

        They approach at the maximum acceleration, or reach them immediately if `at_once`.
        """
        self._robots.targets[:] = targets
        if self._control_steps:
            assert steps == self._control_steps and not at_once, "such a step is not kept"
            self._log.append(targets)
        acceleration = np.inf if at_once else self.robot.acceleration
        self._threads.share(self._spaces.occupied, partial(self._move, acceleration, steps))

    def _move(
        self, acceleration: float, steps: int, spaces: Int64[np.ndarray, "some"], thread: int
    ) -> None:
        """Run physics steps in some spaces, with the buffers of a thread.

        `acceleration` is that of the wheels (m/s²).
        """
        obstacles, tables = self._obstacles, self._spaces.tables
        chipmunk = self._buffers[thread].interface
        # A space with dynamic obstacles has a single robot.
        among = tables.rows[spaces, 0] if obstacles.most_bodies else spaces[:0]
        among = among[obstacles.present[among]]
        if len(among):
            obstacles.command(among, chipmunk, self.states, steps * PHYSICS_STEP)
        arguments = self._arguments[thread].arguments(chipmunk, tables)
        advance(spaces, arguments, acceleration, PHYSICS_STEP, steps)
        if len(among):
            obstacles.observe(among, chipmunk)

    def obstacles(self, row: int) -> Segments:
        """Return the current outlines of the obstacles around a robot (world frame)."""
        return self._obstacles.outlines(row)

    @property
    def outlines(self) -> tuple[Segments, Int64[np.ndarray, "robots 2"]]:
        """Outlines of all obstacles now, and each robot's first row and end row of them."""
        tables = self._obstacles.tables
        spans = np.stack((tables.robots["outlines"], tables.robots["outlines_end"]), axis=1)
        return tables.outlines, spans

    def _reserve_buffers(self, bodies: int) -> None:
        """Make sure the buffers hold `bodies` robot and obstacle bodies per space."""
        if bodies > self._buffered_bodies:
            self._buffers = [ChipmunkBuffers(bodies) for _ in range(self._threads.size)]
            self._arguments = [ArgumentsCache(self._arrange) for _ in range(self._threads.size)]
            self._buffered_bodies = bodies

    def _arrange(self, chipmunk: ChipmunkInterface, tables: SpaceTables) -> tuple[Any, ...]:
        """Return the arguments of `advance`."""
        return chipmunk, tables, self._robots, self._sensors.odometer, self.robot.wheel_base

    def readings(self, stamps: Float64[np.ndarray, "robots"]) -> Readings:
        """Return the latest readings with these stamps (s). The next `sense` overwrites them."""
        return self._sensors.readings(stamps)

    def locate(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Find the wall-index cells of all robots, or of some; call it before `sense`."""
        self._sensors.locate(self._all_rows if rows is None else rows)

    def sense(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Take the readings of all robots, or of some; fills `motions`, `ranges` and so on."""
        chosen = self._all_rows if rows is None else rows
        self._sensors.sense(chosen, self._obstacles.tables)
