"""Compiled sensing: the scans and the odometers of many robots, with their errors.

Each reading of a robot takes its random numbers from places of its own in the robot's
stream: two for the odometer, then one for each beam, whatever the ranges are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from albot_env.sim.noise_kernels import draw
from albot_env.sim.odometer_kernels import read
from albot_env.sim.ray_kernels import Fan, make_desk, scan
from albot_env.sim.wall_index import Walls

NORMALS = 4096
"""Length of the table of normal numbers: as many as 12 bits can choose from."""


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


class Moving(NamedTuple):
    """What moves around the robots."""

    segments: np.ndarray
    """(n, 4) float64: outlines of things x1, y1, x2, y2 (m)."""
    first: np.ndarray
    """(robots,) int64: which of them are each robot's: from here…"""
    last: np.ndarray
    """(robots,) int64: … up to here, without it."""


class Sensed(NamedTuple):
    """What the robots sense; a row each."""

    keys: np.ndarray
    """(n,) uint64: the keys to their noise."""
    readings: np.ndarray
    """(n,) int64: how many readings each has taken."""
    buildings: np.ndarray
    """(n,) int64: the building that each is in."""
    cells: np.ndarray
    """(n,) int64: where in the index of what can be seen each is."""
    motions: np.ndarray
    """(n, 3) float64: what the odometers measured."""
    ranges: np.ndarray
    """(n, beams) float64: what the lasers saw (m)."""


@njit(cache=True, error_model="numpy")
def disturb(
    ranges: np.ndarray,
    key: np.uint64,
    place: int,
    normals: np.ndarray,
    dropout: int,
    max_range: float,
) -> None:
    """Make of a laser's true `ranges` (m) what it reports."""
    for k in range(ranges.shape[0]):
        bits = draw(key, place + k)
        reach = max(ranges[k] + normals[bits >> np.uint64(52)], 0.0)
        lost = np.int64(bits & np.uint64(0xFFFFFFFF)) < dropout
        ranges[k] = np.inf if lost or reach >= max_range else reach


@njit(cache=True, error_model="numpy", nogil=True)
def sense(
    rows: np.ndarray,
    poses: np.ndarray,
    counts: np.ndarray,
    index: Walls,
    moving: Moving,
    devices: Devices,
    sensed: Sensed,
) -> None:
    """Read the odometers and lasers of the robots `rows`, whose cells are known.

    `poses` (n, 3) are where they are, `counts` (n, …) what their odometers have counted.
    The lasers see walls and what moves.
    """
    fan = devices.fan
    draws = 2 + fan.beams
    things = 0
    for k in range(rows.shape[0]):
        things = max(things, moving.last[rows[k]] - moving.first[rows[k]])
    desk = make_desk(fan, index.walls.shape[0] + things)
    for k in range(rows.shape[0]):
        i = rows[k]
        key, place = sensed.keys[i], sensed.readings[i] * draws
        sensed.readings[i] += 1
        read(counts[i], devices.odometer, key, place, sensed.motions[i])
        ranges = sensed.ranges[i]
        first, last = moving.first[i], moving.last[i]
        scan(fan, index, sensed.cells[i], moving.segments, first, last, poses[i], desk, ranges)
        disturb(ranges, key, place + 2, devices.normals, devices.dropout, fan.reach)
