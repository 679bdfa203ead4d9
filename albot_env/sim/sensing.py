"""Sensing: what the odometer, laser, sonars and camera of many robots report.

Each reading of a robot has counters of its own for its random numbers, whatever the ranges
are: the odometer's and then one for each beam; and, far away from these, one for each sonar,
and the camera's.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.kernels.arguments import ArgumentsCache, KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_core.sensing.reading import Readings
from albot_env.sim.chipmunk import RobotArrays
from albot_env.sim.drive import RobotConfig
from albot_env.sim.laser import beam_geometry, laser_wall_index
from albot_env.sim.noise import normal_table
from albot_env.sim.obstacle_tables import ObstacleTables
from albot_env.sim.odometer import ODOMETER_DRAWS, read_odometer
from albot_env.sim.plane_geometry import transform_of
from albot_env.sim.ray_casting import (
    BeamGeometry,
    ScanBuffers,
    add_range_errors,
    make_scan_buffers,
    scan,
)
from albot_env.sim.scenes import SCENE_DRAWS, SceneConstants, recognise_scene
from albot_env.sim.sensors import Sensors
from albot_env.sim.sonar import NO_SONARS, SonarConstants, sonar_wall_index
from albot_env.sim.sonar_echoes import SonarBuffers, make_sonar_buffers
from albot_env.sim.sonar_kernels import SONAR_DRAWS, measure_echoes
from albot_env.sim.visibility import WallTables
from albot_env.sim.wall_index import Locator
from albot_env.sim.world_cache import WorldCache
from albot_maps.world import World

SONAR_COUNTER, CAMERA_COUNTER = 2**40, 2**41
"""The first counters of the sonars' and the camera's random numbers."""


class SensorSuite:
    """The sensors of a batch of robots, which share what is known of a world's walls.

    Args:
        sensors: What each senses with.
        robot: Body and drive of the robots.
        robots: Where they are, kept up to date by whoever moves them.
    """

    def __init__(self, sensors: Sensors, robot: RobotConfig, robots: RobotArrays) -> None:
        self._sensors = sensors
        self._robots = robots
        laser, sonar, count = sensors.ground_laser, sensors.sonar, len(robots.poses)
        self._constants = SensorConstants(
            odometer=sensors.odometer.constants(robot.wheel_base),
            beams=beam_geometry(laser.geometry),
            normals=normal_table(laser.range_noise),
            dropout=laser.dropout_threshold,
            sonars=NO_SONARS if sonar is None else sonar.constants,
            scenes=np.empty((0, len(SceneConstants._fields))),
        )
        self.outputs = SensorOutputs(
            keys=np.zeros(count, np.uint64),
            readings=np.zeros(count, np.int64),
            buildings=np.zeros(count, np.int64),
            laser_cells=np.zeros(count, np.int64),
            sonar_cells=np.zeros(count, np.int64),
            motions=np.zeros((count, 3)),
            ranges=np.full((count, laser.geometry.beams), np.inf),
            echoes=np.full((count, len(self._constants.sonars.mounts)), np.inf),
            scenes=np.full(count, -1),
        )
        """What the robots sensed last."""
        self._laser_index = laser_wall_index(laser.geometry)
        self._sonar_index = sonar_wall_index(sonar)
        self._locator = Locator(self._laser_index, self._sonar_index)
        self._worlds = WorldCache(count, self._add_world, self._forget)
        self._arguments = ArgumentsCache(self._arrange)

    @property
    def odometer(self) -> Float64[np.ndarray, "constants"]:
        """The errors of the odometers (see `OdometerConfig.constants`)."""
        return self._constants.odometer

    def begin(self, row: int, world: World, key: int) -> None:
        """Let a robot be in a world and begin its readings anew; `key` decides all their noise."""
        for other, building in self._worlds.enter(row, world):
            self.outputs.buildings[other] = building
        self.outputs.keys[row] = key
        self.outputs.readings[row] = 0

    def readings(self, stamps: Float64[np.ndarray, "robots"]) -> Readings:
        """What was sensed last, at these times (s). It is written over at the next sensing."""
        sensors, outputs = self._sensors, self.outputs
        return Readings(
            stamps=stamps,
            motions=outputs.motions,
            laser=None if sensors.laser is None else sensors.laser.geometry,
            ranges=None if sensors.laser is None else outputs.ranges,
            sonar=None if sensors.sonar is None else sensors.sonar.geometry,
            echoes=None if sensors.sonar is None else outputs.echoes,
            scenes=None if sensors.scenes is None else outputs.scenes,
        )

    def locate(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Find out where in their buildings some robots are: before `sense`."""
        outputs, poses = self.outputs, self._robots.poses
        self._locator.locate(
            rows, outputs.buildings, poses, outputs.laser_cells, outputs.sonar_cells
        )

    def sense(self, rows: Int64[np.ndarray, "some"], obstacles: ObstacleTables) -> None:
        """Take the readings of some robots, among obstacles."""
        walls = self._laser_index.tables, self._sonar_index.tables
        sense(rows, self._arguments.arguments(*walls, obstacles, self._constants))

    def _arrange(
        self,
        laser_walls: WallTables,
        sonar_walls: WallTables,
        obstacles: ObstacleTables,
        constants: SensorConstants,
    ) -> tuple[Any, ...]:
        """The arguments of `sense`."""
        world = SensedWorld(
            laser_walls=laser_walls,
            sonar_walls=sonar_walls,
            obstacles=obstacles.outlines,
            first=obstacles.robots["outlines"],
            last=obstacles.robots["outlines_end"],
            max_walls=max(self._laser_index.max_walls, self._sonar_index.max_walls),
        )
        return self._robots.poses, self._robots.counts, world, constants, self.outputs

    def _add_world(self, world: World) -> int:
        """Note what there is to be sensed in a world; return its building's number."""
        if self._sensors.sonar is not None:
            self._sonar_index.add(world.walls)
        if self._sensors.scenes is not None:
            fields = np.array(self._sensors.scenes.constants(world.bounds), np.float64)
            scenes = np.concatenate((self._constants.scenes, fields[np.newaxis]))
            self._constants = self._constants._replace(scenes=scenes)
        return self._laser_index.add(world.opaque)

    def _forget(self) -> None:
        self._laser_index.clear()
        self._sonar_index.clear()
        self._constants = self._constants._replace(scenes=self._constants.scenes[:0])


class SensorConstants(NamedTuple):
    """What the sensors are like."""

    odometer: np.ndarray
    """The odometer's errors (see `OdometerConfig.constants`)."""
    beams: BeamGeometry
    """The laser's beams."""
    normals: np.ndarray
    """(NORMALS,) float64: the errors (m) that a beam may have, each as likely as the others."""
    dropout: int
    """The probability that a beam is lost, times 2^32."""
    sonars: SonarConstants
    """The sonars; none of them on a robot without."""
    scenes: np.ndarray
    """(buildings, fields) float64: the fields of `SceneConstants` for each building; no building at
    all where the robots have no cameras."""


class SensedWorld(NamedTuple):
    """What there is around the robots to be sensed."""

    laser_walls: WallTables
    """The walls that lasers see, listed by where they are seen from."""
    sonar_walls: WallTables
    """All walls, listed by where they are near enough to be heard."""
    obstacles: np.ndarray
    """(n, 4) float64: outlines of what moves x1, y1, x2, y2 (m)."""
    first: np.ndarray
    """(robots,) int64: which of them are around each robot: from here…"""
    last: np.ndarray
    """(robots,) int64: … up to here, without it."""
    max_walls: int
    """Walls of the building that has most."""


class SensorOutputs(NamedTuple):
    """What the robots sense; a row each."""

    keys: np.ndarray
    """(n,) uint64: the keys to their noise."""
    readings: np.ndarray
    """(n,) int64: how many readings each has taken."""
    buildings: np.ndarray
    """(n,) int64: the building that each is in."""
    laser_cells: np.ndarray
    """(n,) int64: the cell of the laser's walls that each is in."""
    sonar_cells: np.ndarray
    """(n,) int64: the cell of the sonars' walls that each is in."""
    motions: np.ndarray
    """(n, 3) float64: what the odometers measured."""
    ranges: np.ndarray
    """(n, beams) float64: what the lasers saw (m)."""
    echoes: np.ndarray
    """(n, sonars) float64: what the sonars heard (m)."""
    scenes: np.ndarray
    """(n,) int64: the scenes that the cameras recognised; -1 for none."""


@KernelDispatcher
@kernel(arrays=True, nogil=True)
def sense(rows: np.ndarray, arguments: KernelArguments) -> None:
    """Read the sensors of the robots `rows`, whose cells are known.

    `arguments` holds `poses` (n, 3), where they are; `counts` (n, …), what their odometers have
    counted; `SensedWorld`; `SensorConstants`; and `SensorOutputs`.
    """
    _, _, world, constants, _ = unpack(arguments)
    most = 0
    for i in rows:
        most = max(most, world.last[i] - world.first[i])
    scan_buffers = make_scan_buffers(constants.beams, world.max_walls + most)
    sonar_buffers = make_sonar_buffers(world.max_walls + most, constants.sonars.mounts.shape[0])
    _sense_all(rows, arguments, scan_buffers, sonar_buffers)


@kernel()
def _sense_all(
    rows: np.ndarray,
    arguments: KernelArguments,
    scan_buffers: ScanBuffers,
    sonar_buffers: SonarBuffers,
) -> None:
    """`sense`, with room to work in."""
    poses, counts, world, constants, outputs = unpack(arguments)
    beams, sonars, sonar_walls = constants.beams, constants.sonars, world.sonar_walls
    draws, count = ODOMETER_DRAWS + beams.number, sonars.mounts.shape[0]
    for i in rows:
        key, reading = outputs.keys[i], outputs.readings[i]
        outputs.readings[i] += 1
        robot, first, last = transform_of(poses[i]), world.first[i], world.last[i]

        counter = reading * draws
        read_odometer(counts[i], constants.odometer, key, counter, outputs.motions[i])

        ranges, cell, obstacles = outputs.ranges[i], outputs.laser_cells[i], world.obstacles
        scan(beams, world.laser_walls, cell, obstacles, first, last, robot, scan_buffers, ranges)
        errors = constants.normals, constants.dropout, beams.max_range
        add_range_errors(ranges, key, counter + ODOMETER_DRAWS, *errors, scan_buffers.bits)

        if count > 0:
            start, end = sonar_walls.spans[outputs.sonar_cells[i]]
            surfaces = sonar_walls.walls, sonar_walls.members[start:end], obstacles[first:last]
            counter = SONAR_COUNTER + reading * count * SONAR_DRAWS
            echoes = outputs.echoes[i]
            measure_echoes(*surfaces, robot, sonars, key, counter, sonar_buffers, echoes)

        if constants.scenes.shape[0] > 0:
            scenes = _scene_constants(constants.scenes[outputs.buildings[i]])
            counter = CAMERA_COUNTER + reading * SCENE_DRAWS
            x, y, heading = poses[i]
            outputs.scenes[i] = recognise_scene(x, y, heading, scenes, key, counter)


@kernel()
def _scene_constants(fields: np.ndarray) -> SceneConstants:
    """The scenes of one building."""
    left, bottom, cell, columns, rows, sectors, scenes, stride, position, heading, missed, false = (
        fields
    )
    return SceneConstants(
        left, bottom, cell, int(columns), int(rows), int(sectors), int(scenes), int(stride),
        position, heading, int(missed), int(false),
    )  # fmt: skip
