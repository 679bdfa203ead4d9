"""Compiled sensing: the scans and the odometers of many robots, with their errors.

Each reading of a robot takes its random numbers from places of its own in the robot's
stream: two for the odometer, then one for each beam, whatever the ranges are.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from albot_env.sim.noise_kernels import draw
from albot_env.sim.odometer_kernels import ODOMETER_DRAWS, read

NORMALS = 4096
"""Length of the table of normal numbers: as many as 12 bits can choose from."""


@njit(cache=True, error_model="numpy")
def disturb(
    ranges: np.ndarray,
    key: np.uint64,
    place: int,
    normals: np.ndarray,
    dropout: int,
    max_range: float,
    sensed: np.ndarray,
) -> None:
    """Fill `sensed` with what a laser reports of the true `ranges` (m).

    `normals` (NORMALS,) are the errors (m) that a beam may have, each as likely as the
    others; `dropout` is the probability that a beam is lost, times 2^32.
    """
    for k in range(ranges.shape[0]):
        bits = draw(key, place + k)
        reach = max(ranges[k] + normals[bits >> np.uint64(52)], 0.0)
        lost = np.int64(bits & np.uint64(0xFFFFFFFF)) < dropout
        sensed[k] = np.inf if lost or reach >= max_range else reach


@njit(cache=True, error_model="numpy")
def sense(
    rows: np.ndarray,
    true_ranges: np.ndarray,
    counts: np.ndarray,
    errors: np.ndarray,
    keys: np.ndarray,
    readings: np.ndarray,
    normals: np.ndarray,
    dropout: int,
    max_range: float,
    motions: np.ndarray,
    ranges: np.ndarray,
) -> None:
    """Read the odometers and lasers of the robots `rows`, whose true ranges are given in turn.

    Of the other arrays each robot has its row; `readings` counts them.
    """
    draws = ODOMETER_DRAWS + true_ranges.shape[1]
    for k in range(rows.shape[0]):
        i = rows[k]
        place = readings[i] * draws
        read(counts[i], errors, keys[i], place, motions[i])
        beams = place + ODOMETER_DRAWS
        disturb(true_ranges[k], keys[i], beams, normals, dropout, max_range, ranges[i])
        readings[i] += 1
