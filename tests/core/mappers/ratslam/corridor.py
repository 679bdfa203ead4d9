"""A robot with a laser of 180° between walls, in closed form."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from albot_core.geometry.poses import relative
from albot_core.geometry.types import Pose, Poses, Segments
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading

LASER = LaserGeometry()


def chain(*points: tuple[float, float]) -> Segments:
    """Walls from point to point."""
    ends = np.array(points)
    return np.concatenate((ends[:-1], ends[1:]), axis=1)


SQUARE = chain((-3, -2), (3, -2), (3, 4), (-3, 4), (-3, -2))
"""A square room; the origin is off its middle."""
CORRIDOR = chain(
    (-2, -1), (3, -1), (3, -2.2), (4.1, -2.2), (4.1, -1), (9, -1), (9, -1.6), (11.5, -1.6),
    (11.5, -1), (18, -1), (18, 1), (13.2, 1), (13.2, 2.5), (12, 2.5), (12, 1), (6.5, 1),
    (6.5, 1.5), (5.8, 1.5), (5.8, 1), (0.7, 1), (0.7, 1.9), (-0.4, 1.9), (-0.4, 1), (-2, 1),
    (-2, -1),
)  # fmt: skip
"""A corridor of 20 m with alcoves."""


def scan(walls: Segments, pose: Pose) -> LaserScan:
    """What the laser sees, without noise."""
    angles = pose[2] + LASER.bearings
    direction = np.stack((np.cos(angles), np.sin(angles)), axis=1)[:, np.newaxis]
    start, along = walls[:, :2] - pose[:2], walls[:, 2:] - walls[:, :2]
    cross = direction[..., 0] * along[:, 1] - direction[..., 1] * along[:, 0]
    with np.errstate(all="ignore"):
        far = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
        at = (start[:, 0] * direction[..., 1] - start[:, 1] * direction[..., 0]) / cross
    hits = np.where((far > 0) & (at >= 0) & (at <= 1), far, np.inf)
    return LaserScan(ranges=hits.min(axis=1), geometry=LASER)


def there_and_back(length: float = 15.0, step: float = 0.1) -> Poses:
    """Along a corridor, round on the spot, and back."""
    out = np.arange(0.0, length + step / 2, step)
    ahead = np.column_stack((out, np.zeros((len(out), 2))))
    turns = np.arange(0.1, np.pi, 0.1)
    turning = np.column_stack((np.full(len(turns), length), np.zeros(len(turns)), turns))
    back = np.column_stack((out[::-1], np.zeros(len(out)), np.full(len(out), np.pi)))
    return np.concatenate((ahead, turning, back))


def drive(
    walls: Segments, truth: Poses, rng: np.random.Generator, scale: float = 1.0, bias: float = 0.0
) -> Iterator[Reading]:
    """What it senses; its odometer measures ways too long and turns in excess (rad/m)."""
    for k, pose in enumerate(truth):
        motion = relative(truth[max(k - 1, 0)], pose)
        motion[2] += bias * np.hypot(*motion[:2]) + 0.02 * motion[2] * rng.normal()
        motion[:2] *= scale
        yield Reading(stamp=0.2 * k, motion=motion, laser=scan(walls, pose))
