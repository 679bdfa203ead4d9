"""The instruments: the sensors of a fleet's robots, and what they sensed last."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.kernels.arguments import ArgumentsCache
from albot_core.sensing.reading import Readings
from albot_env.sim.chipmunk_kernels import Robots
from albot_env.sim.drive import RobotConfig
from albot_env.sim.laser import normal_table
from albot_env.sim.rays import index_for, make_fan
from albot_env.sim.register import Register
from albot_env.sim.scene_kernels import Scenes
from albot_env.sim.sensing_kernels import Devices, Sensed, Surroundings, sense
from albot_env.sim.sensors import Sensors
from albot_env.sim.sonar import NO_SONARS, audible
from albot_env.sim.thing_arrays import Stage
from albot_env.sim.wall_index import Locator, Walls
from albot_maps.world import World


class Instruments:
    """What the robots of a fleet sense with. What is known of a world's walls, they share.

    Args:
        sensors: What each senses with.
        robot: Body and drive of the robots.
        robots: How they stand: kept up by who moves them.
    """

    def __init__(self, sensors: Sensors, robot: RobotConfig, robots: Robots) -> None:
        self._sensors = sensors
        self._robots = robots
        laser, sonar, count = sensors.laser, sensors.sonar, len(robots.poses)
        self._devices = Devices(
            odometer=sensors.odometer.constants(robot.wheel_base),
            fan=make_fan(laser.geometry),
            normals=normal_table(laser.range_noise),
            dropout=laser.dropout_threshold,
            sonars=NO_SONARS if sonar is None else sonar.constants,
            scenes=np.empty((0, len(Scenes._fields))),
        )
        self.sensed = Sensed(
            keys=np.zeros(count, np.uint64),
            readings=np.zeros(count, np.int64),
            buildings=np.zeros(count, np.int64),
            seeing=np.zeros(count, np.int64),
            hearing=np.zeros(count, np.int64),
            motions=np.zeros((count, 3)),
            ranges=np.full((count, laser.geometry.beams), np.inf),
            echoes=np.full((count, len(self._devices.sonars.mounts)), np.inf),
            scenes=np.full(count, -1),
        )
        """What the robots sensed last."""
        self._opaque = index_for(laser.geometry)
        self._solid = audible(sonar)
        self._locator = Locator(self._opaque, self._solid)
        self._buildings = Register(count, self._take_in, self._forget)
        self._sensing = ArgumentsCache(self._surroundings)

    @property
    def odometer(self) -> Float64[np.ndarray, "constants"]:
        """The errors of the odometers (see `OdometerConfig.constants`)."""
        return self._devices.odometer

    def begin(self, row: int, world: World, key: int) -> None:
        """Let a robot be in a world and begin its readings anew; `key` decides all their noise."""
        for other, building in self._buildings.enter(row, world):
            self.sensed.buildings[other] = building
        self.sensed.keys[row] = key
        self.sensed.readings[row] = 0

    def readings(self, stamps: Float64[np.ndarray, "robots"]) -> Readings:
        """What was sensed last, at these times (s). It is written over at the next sensing."""
        sensors, sensed = self._sensors, self.sensed
        return Readings(
            stamps=stamps,
            motions=sensed.motions,
            laser=sensors.laser.geometry,
            ranges=sensed.ranges,
            sonar=None if sensors.sonar is None else sensors.sonar.geometry,
            echoes=None if sensors.sonar is None else sensed.echoes,
            scenes=None if sensors.scenes is None else sensed.scenes,
        )

    def locate(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Find out where in their buildings some robots are: before `sense`."""
        sensed, poses = self.sensed, self._robots.poses
        self._locator.locate(rows, sensed.buildings, poses, sensed.seeing, sensed.hearing)

    def sense(self, rows: Int64[np.ndarray, "some"], stage: Stage) -> None:
        """Take the readings of some robots, among the things on the stage."""
        tables = self._opaque.tables, self._solid.tables
        sense(rows, self._sensing.arguments(*tables, stage, self._devices))

    def _surroundings(
        self, opaque: Walls, solid: Walls, stage: Stage, devices: Devices
    ) -> tuple[Any, ...]:
        """What the sensors take."""
        around = Surroundings(
            opaque=opaque,
            solid=solid,
            things=stage.segments,
            first=stage.robots["segments"],
            last=stage.robots["segments_end"],
            most_walls=max(self._opaque.most, self._solid.most),
        )
        return self._robots.poses, self._robots.counts, around, devices, self.sensed

    def _take_in(self, world: World) -> int:
        """Note what there is to be sensed in a world; return its building's number."""
        if self._sensors.sonar is not None:
            self._solid.add(world.walls)
        if self._sensors.scenes is not None:
            fields = np.array(self._sensors.scenes.constants(world.bounds), np.float64)
            scenes = np.concatenate((self._devices.scenes, fields[np.newaxis]))
            self._devices = self._devices._replace(scenes=scenes)
        return self._opaque.add(world.opaque)

    def _forget(self) -> None:
        self._opaque.clear()
        self._solid.clear()
        self._devices = self._devices._replace(scenes=self._devices.scenes[:0])
