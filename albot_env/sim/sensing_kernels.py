"""Compiled sensing: what the sensors of many robots report, with their errors.

Each reading of a robot takes its random numbers from places of its own in the robot's
stream, whatever the ranges are: the odometer's and then one for each beam; and, far
away from these, one for each sonar, and the camera's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel, load_element
from albot_env.sim.noise_kernels import draw
from albot_env.sim.odometer_kernels import ODOMETER_DRAWS, read
from albot_env.sim.plane_kernels import stance_at
from albot_env.sim.ray_kernels import Desk, Fan, make_desk, scan
from albot_env.sim.scene_kernels import SCENE_DRAWS, Scenes, look
from albot_env.sim.sonar_arrays import Sonars
from albot_env.sim.sonar_kernels import SONAR_DRAWS, listen
from albot_env.sim.surface_kernels import Cones, make_cones
from albot_env.sim.wall_index import Walls

NORMALS = 4096
"""Length of the table of normal numbers: as many as 12 bits can choose from."""
SONAR_PLACES, CAMERA_PLACES = 2**40, 2**41
"""Where in a robot's stream the sonars' and the camera's numbers begin."""


class Devices(NamedTuple):
    """What the robots sense with."""

    odometer: np.ndarray
    """The odometer's errors (see `OdometerConfig.constants`)."""
    fan: Fan
    """The laser's beams."""
    normals: np.ndarray
    """(NORMALS,) float64: the errors (m) that a beam may have, each as likely as the others."""
    dropout: int
    """The probability that a beam is lost, times 2^32."""
    sonars: Sonars
    """The sonars; none of them on a robot without."""
    scenes: np.ndarray
    """(buildings, fields) float64: the fields of `Scenes` for each building; no building at
    all where the robots have no cameras."""


class Surroundings(NamedTuple):
    """What there is around the robots to be sensed."""

    opaque: Walls
    """The walls that lasers see, listed by where they are seen from."""
    solid: Walls
    """All walls, listed by where they are near enough to be heard."""
    things: np.ndarray
    """(n, 4) float64: outlines of what moves x1, y1, x2, y2 (m)."""
    first: np.ndarray
    """(robots,) int64: which of them are around each robot: from here…"""
    last: np.ndarray
    """(robots,) int64: … up to here, without it."""
    most_walls: int
    """Walls of the building that has most."""


class Sensed(NamedTuple):
    """What the robots sense; a row each."""

    keys: np.ndarray
    """(n,) uint64: the keys to their noise."""
    readings: np.ndarray
    """(n,) int64: how many readings each has taken."""
    buildings: np.ndarray
    """(n,) int64: the building that each is in."""
    seeing: np.ndarray
    """(n,) int64: the cell of the opaque walls that each is in."""
    hearing: np.ndarray
    """(n,) int64: the cell of the solid walls that each is in."""
    motions: np.ndarray
    """(n, 3) float64: what the odometers measured."""
    ranges: np.ndarray
    """(n, beams) float64: what the lasers saw (m)."""
    echoes: np.ndarray
    """(n, sonars) float64: what the sonars heard (m)."""
    scenes: np.ndarray
    """(n,) int64: the scenes that the cameras recognised; -1 for none."""


@kernel()
def disturb(
    ranges: np.ndarray,
    key: np.uint64,
    place: int,
    normals: np.ndarray,
    dropout: int,
    max_range: float,
    bits: np.ndarray,
) -> None:
    """Make of a laser's true `ranges` (m) what it reports; `bits` (beams,) is room to work in."""
    for k in range(ranges.shape[0]):
        bits[k] = draw(key, place + k)
    for k in range(ranges.shape[0]):
        ranges[k] += load_element(normals, bits[k] >> np.uint64(52))
    for k in range(ranges.shape[0]):
        reach = max(ranges[k], 0.0)
        lost = np.int64(bits[k] & np.uint64(0xFFFFFFFF)) < dropout
        ranges[k] = np.inf if lost or reach >= max_range else reach


@KernelDispatcher
@kernel(arrays=True, nogil=True)
def sense(rows: np.ndarray, arguments: KernelArguments) -> None:
    """Read the sensors of the robots `rows`, whose cells are known.

    `arguments` holds `poses` (n, 3), where they are; `counts` (n, …), what their odometers have
    counted; `Surroundings`; `Devices`; and `Sensed`.
    """
    _, _, around, devices, _ = unpack(arguments)
    most = 0
    for i in rows:
        most = max(most, around.last[i] - around.first[i])
    desk = make_desk(devices.fan, around.most_walls + most)
    cones = make_cones(around.most_walls + most, devices.sonars.mounts.shape[0])
    _sense_all(rows, arguments, desk, cones)


@kernel()
def _sense_all(rows: np.ndarray, arguments: KernelArguments, desk: Desk, cones: Cones) -> None:
    """`sense`, with room to work in."""
    poses, counts, around, devices, sensed = unpack(arguments)
    fan, sonars, solid = devices.fan, devices.sonars, around.solid
    draws, count = ODOMETER_DRAWS + fan.beams, sonars.mounts.shape[0]
    for i in rows:
        key, reading = sensed.keys[i], sensed.readings[i]
        sensed.readings[i] += 1
        place = reading * draws
        read(counts[i], devices.odometer, key, place, sensed.motions[i])
        ranges, first, last = sensed.ranges[i], around.first[i], around.last[i]
        cell, robot = sensed.seeing[i], stance_at(poses[i])
        scan(fan, around.opaque, cell, around.things, first, last, robot, desk, ranges)
        errors = devices.normals, devices.dropout, fan.reach
        disturb(ranges, key, place + ODOMETER_DRAWS, *errors, desk.bits)
        if count > 0:
            start, end = solid.spans[sensed.hearing[i]]
            nearby = solid.members[start:end]
            place = SONAR_PLACES + reading * count * SONAR_DRAWS
            things = around.things[first:last]
            listen(solid.walls, nearby, things, robot, sonars, key, place, cones, sensed.echoes[i])
        if devices.scenes.shape[0] > 0:
            scenes = _scenes_of(devices.scenes[sensed.buildings[i]])
            place = CAMERA_PLACES + reading * SCENE_DRAWS
            x, y, heading = poses[i]
            sensed.scenes[i] = look(x, y, heading, scenes, key, place)


@kernel()
def _scenes_of(fields: np.ndarray) -> Scenes:
    """The scenes of one building."""
    left, bottom, cell, columns, rows, sectors, scenes, stride, position, heading, missed, false = (
        fields
    )
    return Scenes(
        left, bottom, cell, int(columns), int(rows), int(sectors), int(scenes), int(stride),
        position, heading, int(missed), int(false),
    )  # fmt: skip
