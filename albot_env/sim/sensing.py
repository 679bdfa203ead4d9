"""Sensing: odometer, laser, sonar, camera and compass readings of many robots.

Each reading uses fixed counters for its random numbers, whatever the ranges are. The odometer's
come first, then one per beam. The sonars', the camera's and the compass's start at SONAR_COUNTER,
CAMERA_COUNTER and COMPASS_COUNTER.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.kernels.arguments import ArgumentsCache, KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_core.robot import RobotConfig
from albot_core.sensing.reading import Readings
from albot_env.sim.chipmunk import RobotArrays
from albot_env.sim.compass import NO_COMPASS, CompassConstants, read_compass
from albot_env.sim.laser import beam_geometry, laser_wall_index
from albot_env.sim.noise import normal_table
from albot_env.sim.obstacle_tables import ObstacleTables
from albot_env.sim.odometer import ODOMETER_DRAWS, OdometerConstants, read_odometer
from albot_env.sim.plane_geometry import transform_of
from albot_env.sim.ray_casting import (
    BeamGeometry,
    ScanBuffers,
    make_scan_buffers,
    measure_ranges,
    scan,
)
from albot_env.sim.scenes import (
    CAMERA_STATE,
    SCENE_DRAWS,
    SceneConstants,
    recognise_scene,
    start_camera,
)
from albot_env.sim.sensors import Sensors
from albot_env.sim.sonar import NO_SONARS, SonarConstants, sonar_wall_index
from albot_env.sim.sonar_echoes import SonarBuffers, make_sonar_buffers
from albot_env.sim.sonar_kernels import SONAR_DRAWS, measure_echoes
from albot_env.sim.visibility import WallTables
from albot_env.sim.wall_index import Locator
from albot_env.sim.world_cache import WorldCache
from albot_maps.world import World

SONAR_COUNTER, CAMERA_COUNTER, COMPASS_COUNTER = 2**40, 2**41, 2**42
"""First counters of the sonars', the camera's and the compass's random numbers."""


class SensorSuite:
    """The sensors of a batch of robots. Robots in the same world share its wall index.

    Args:
        sensors: The sensors of each robot.
        robot: Body and drive of the robots.
        robots: State arrays of the robots; the caller keeps them up to date.
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
            compass=NO_COMPASS if sensors.compass is None else sensors.compass.constants,
        )
        self.outputs = SensorOutputs(
            keys=np.zeros(count, np.uint64),
            readings=np.zeros(count, np.int64),
            buildings=np.zeros(count, np.int64),
            laser_cells=np.zeros(count, np.int64),
            sonar_cells=np.zeros(count, np.int64),
            motions=np.zeros((count, 3)),
            true_ranges=np.full((count, laser.geometry.beams), np.inf),
            ranges=np.full((count, laser.geometry.beams), np.inf),
            echoes=np.full((count, len(self._constants.sonars.mounts)), np.inf),
            scenes=np.full(count, -1),
            cameras=np.zeros((count, 0 if sensors.scenes is None else CAMERA_STATE), np.int64),
            compasses=np.zeros(count),
        )
        """The latest sensor outputs."""
        self._laser_index = laser_wall_index(laser.geometry)
        self._sonar_index = sonar_wall_index(sonar)
        self._locator = Locator(self._laser_index, self._sonar_index)
        self._worlds = WorldCache(count, self._add_world, self._forget)
        self._arguments = ArgumentsCache(self._arrange)

    @property
    def odometer(self) -> OdometerConstants:
        """Constants of the odometers."""
        return self._constants.odometer

    def begin(self, row: int, world: World, key: int) -> None:
        """Put a robot into a world and restart its readings; `key` decides all their noise."""
        for other, building in self._worlds.enter(row, world):
            self.outputs.buildings[other] = building
        self.outputs.keys[row] = key
        self.outputs.readings[row] = 0
        if self._sensors.scenes is not None:
            start_camera(self.outputs.cameras[row])

    def readings(self, stamps: Float64[np.ndarray, "robots"]) -> Readings:
        """Return the latest readings with these stamps (s). The next `sense` overwrites them."""
        sensors, outputs = self._sensors, self.outputs
        return Readings(
            stamps=stamps,
            motions=outputs.motions,
            laser=None if sensors.laser is None else sensors.laser.geometry,
            ranges=None if sensors.laser is None else outputs.ranges,
            sonar=None if sensors.sonar is None else sensors.sonar.geometry,
            echoes=None if sensors.sonar is None else outputs.echoes,
            scenes=None if sensors.scenes is None else outputs.scenes,
            compasses=None if sensors.compass is None else outputs.compasses,
        )

    def locate(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Find the wall-index cells of some robots; call it before `sense`."""
        outputs, poses = self.outputs, self._robots.poses
        self._locator.locate(
            rows, outputs.buildings, poses, outputs.laser_cells, outputs.sonar_cells
        )

    def sense(self, rows: Int64[np.ndarray, "some"], obstacles: ObstacleTables) -> None:
        """Take the readings of some robots among dynamic obstacles."""
        walls = self._laser_index.tables, self._sonar_index.tables
        sense(rows, self._arguments.arguments(*walls, obstacles, self._constants))

    def _arrange(
        self,
        laser_walls: WallTables,
        sonar_walls: WallTables,
        obstacles: ObstacleTables,
        constants: SensorConstants,
    ) -> tuple[Any, ...]:
        """Return the arguments of `sense`."""
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
        """Add a world to the wall indexes and scenes; return its building number."""
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
    """Constants of the sensors."""

    odometer: OdometerConstants
    beams: BeamGeometry
    """The laser's beams."""
    normals: np.ndarray
    """(NORMALS,) float64: equally likely range errors of a beam (m)."""
    dropout: int
    """The probability that a beam is lost, times 2^32."""
    sonars: SonarConstants
    """The sonars; empty if the robots have none."""
    scenes: np.ndarray
    """(buildings, fields) float64: the fields of `SceneConstants` for each building; empty if the
    robots have no cameras."""
    compass: CompassConstants
    """The compass."""


class SensedWorld(NamedTuple):
    """What the robots can sense around them."""

    laser_walls: WallTables
    """The walls that lasers see, listed by the cell that they are seen from."""
    sonar_walls: WallTables
    """All walls, listed by the cell that they are in sonar range of."""
    obstacles: np.ndarray
    """(n, 4) float64: outlines of the dynamic obstacles, x1, y1, x2, y2 (m)."""
    first: np.ndarray
    """(robots,) int64: first row of `obstacles` that belongs to each robot."""
    last: np.ndarray
    """(robots,) int64: row of `obstacles` after the last that belongs to each robot."""
    max_walls: int
    """Number of walls in the largest building."""


class SensorOutputs(NamedTuple):
    """Sensor outputs, one row per robot."""

    keys: np.ndarray
    """(n,) uint64: keys of the robots' noise."""
    readings: np.ndarray
    """(n,) int64: number of readings taken so far."""
    buildings: np.ndarray
    """(n,) int64: building that each robot is in."""
    laser_cells: np.ndarray
    """(n,) int64: cell of each robot in the laser's wall index."""
    sonar_cells: np.ndarray
    """(n,) int64: cell of each robot in the sonars' wall index."""
    motions: np.ndarray
    """(n, 3) float64: motions measured by the odometers: x, y, heading (m, rad)."""
    true_ranges: np.ndarray
    """(n, beams) float64: distances of what the lasers' beams meet (m); infinite beyond range."""
    ranges: np.ndarray
    """(n, beams) float64: ranges of the lasers (m)."""
    echoes: np.ndarray
    """(n, sonars) float64: ranges of the sonars (m)."""
    scenes: np.ndarray
    """(n,) int64: scenes recognised by the cameras; -1 for none."""
    cameras: np.ndarray
    """(n, CAMERA_STATE) int64: states of the cameras; (n, 0) without cameras."""
    compasses: np.ndarray
    """(n,) float64: headings by the compasses (rad); 0 without compasses."""


@KernelDispatcher
@kernel(arrays=True, nogil=True)
def sense(rows: np.ndarray, arguments: KernelArguments) -> None:
    """Read the sensors of the robots `rows`, whose cells have been located.

    `arguments` holds `poses` (n, 3), the world-frame poses; `counts` (n,) of
    ODOMETER_COUNT; `SensedWorld`; `SensorConstants`; and `SensorOutputs`.
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
    """Run `sense` with its scratch buffers."""
    poses, counts, world, constants, outputs = unpack(arguments)
    beams, sonars, sonar_walls = constants.beams, constants.sonars, world.sonar_walls
    draws, count = ODOMETER_DRAWS + beams.number, sonars.mounts.shape[0]
    for i in rows:
        key, reading = outputs.keys[i], outputs.readings[i]
        outputs.readings[i] += 1
        robot, first, last = transform_of(poses[i]), world.first[i], world.last[i]

        counter = reading * draws
        read_odometer(counts[i], constants.odometer, key, counter, outputs.motions[i])

        met, cell, obstacles = outputs.true_ranges[i], outputs.laser_cells[i], world.obstacles
        scan(beams, world.laser_walls, cell, obstacles, first, last, robot, scan_buffers, met)
        errors = constants.normals, constants.dropout, beams.max_range
        noise = key, counter + ODOMETER_DRAWS
        measure_ranges(met, *noise, *errors, scan_buffers.bits, outputs.ranges[i])

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
            camera = outputs.cameras[i]
            outputs.scenes[i] = recognise_scene(
                x, y, heading, scenes, key, counter, reading, camera
            )

        if constants.compass.is_carried:
            outputs.compasses[i] = read_compass(
                poses[i, 2], constants.compass, key, COMPASS_COUNTER, reading
            )


@kernel()
def _scene_constants(fields: np.ndarray) -> SceneConstants:
    """Return the scene constants of one building from its row of `SensorConstants.scenes`."""
    (
        left, bottom, cell, columns, rows, sectors, scenes, stride, position, heading,
        missed, begins, shortest, longest, familiar,
    ) = fields  # fmt: skip
    return SceneConstants(
        left, bottom, cell, int(columns), int(rows), int(sectors), int(scenes), int(stride),
        position, heading, int(missed), int(begins), int(shortest), int(longest), int(familiar),
    )  # fmt: skip
