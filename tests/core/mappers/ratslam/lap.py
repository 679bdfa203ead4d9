"""A robot that goes round a square, sees scenes, and has an odometer with a bias."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from albot_core.geometry.types import Poses
from albot_core.mappers.ratslam.mapper import RatSlam
from albot_core.sensing.reading import Reading

SIDE, SPEED, TURN_RATE, STEP = 5.0, 0.5, np.pi / 4, 0.2
"""Side of the square (m), speed (m/s), turn rate (rad/s) and time of a step (s)."""
SCENES = 1000


def scene_at(pose: np.ndarray) -> int:
    """The scene in a square of 1 m, seen in one of eight directions."""
    column, row = np.floor(pose[:2] + 0.37).astype(int) + 5
    return int((row * 20 + column) * 8 + int(pose[2] % (2 * np.pi) / (np.pi / 4)) % 8) % SCENES


def true_laps(laps: int) -> Poses:
    """Where it is at every step, headings unwrapped."""
    pose, poses = np.array((0.0, 0.0, 0.1)), []
    for _ in range(4 * laps):
        for _ in range(round(SIDE / SPEED / STEP)):
            poses.append(pose)
            pose = pose + SPEED * STEP * np.array((np.cos(pose[2]), np.sin(pose[2]), 0))
        for _ in range(round(np.pi / 2 / TURN_RATE / STEP)):
            poses.append(pose)
            pose = pose + TURN_RATE * STEP * np.array((0, 0, 1))
    return np.array(poses)


def readings(truth: Poses, bias: float, rng: np.random.Generator, false: float = 0.0) -> Iterator:
    """What it senses.

    Args:
        truth: Where it is.
        bias: The odometer's (rad/s).
        rng: Draws noise.
        false: Share of looks that show any scene.
    """
    for k, pose in enumerate(truth):
        motion = np.zeros(3)
        if k:
            way = truth[k] - truth[k - 1]
            motion[:] = np.hypot(*way[:2]), 0.0, way[2] + bias * STEP + rng.normal(0, 0.002)
        scene = int(rng.integers(SCENES)) if rng.random() < false else scene_at(pose)
        yield Reading(stamp=STEP * k, motion=motion, scene=scene)


def lead(mapper: RatSlam, truth: Poses, bias: float, *, seed: int = 0, false: float = 0.0) -> None:
    """Lead a mapper round."""
    for reading in readings(truth, bias, np.random.default_rng(seed), false):
        mapper.update(reading)
