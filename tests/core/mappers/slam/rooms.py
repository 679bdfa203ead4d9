"""Scans of a rectangular room, and of a corridor, whose walls are known exactly."""

from __future__ import annotations

import numpy as np

from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading

LASER = LaserGeometry(beams=180)
ROOM = np.array(
    ((-4, -3, 5, -3), (5, -3, 5, 4), (5, 4, -4, 4), (-4, 4, -4, -3), (1, 4, 1, 2.5)), float
)
"""A room of 9 m by 7 m with a stub of a wall, as segments (m)."""
CORRIDOR = np.array(((-50, -1, 50, -1), (-50, 1, 50, 1)), float)
"""Two parallel walls, which say nothing of where along them one is."""


def scan_from(
    pose: np.ndarray, walls: np.ndarray = ROOM, laser: LaserGeometry = LASER
) -> LaserScan:
    """What the laser of a robot at a pose sees: the nearest wall along each beam, exactly."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    turned = np.array(((cos, sin), (-sin, cos)))
    directions = laser.directions @ turned
    eye = pose[:2] + np.array(laser.mount[:2]) @ turned
    ends = walls[:, 2:] - walls[:, :2]
    to = walls[:, :2] - eye
    cross = directions[:, None, 0] * ends[:, 1] - directions[:, None, 1] * ends[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (to[:, 0] * ends[:, 1] - to[:, 1] * ends[:, 0]) / cross
        at = (to[:, 0] * directions[:, None, 1] - to[:, 1] * directions[:, None, 0]) / cross
    met = (along > 0) & (at >= 0) & (at <= 1)
    ranges = np.where(met, along, np.inf).min(axis=1)
    return LaserScan(ranges=np.where(ranges < laser.max_range, ranges, np.inf), geometry=laser)


def reading_from(
    pose: np.ndarray, motion: np.ndarray, walls: np.ndarray = ROOM, laser: LaserGeometry = LASER
) -> Reading:
    """A reading of a robot at a pose, with what the odometer says of its last motion."""
    return Reading(stamp=0.0, motion=motion, laser=scan_from(pose, walls, laser))
