"""How much a scan speaks for a pose in a known map.

The beam model is a mixture (S. Thrun, W. Burgard and D. Fox, Probabilistic Robotics, 2005, section
6.3): a beam ends at a wall of the map, or at something that the map lacks, or passes through a wall
that is no longer there. What counts is the ratio of its likelihood to that in an unknown building:
so it can be said that a robot is nowhere in the map. Beams that end over unknown ground say
nothing. Neighbouring beams err together, so the sum counts as that of a few independent ones.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Points, Poses
from albot_core.kernels.compiled import kernel
from albot_core.localisation.config import EvidenceConfig
from albot_core.localisation.known_map import CELL, UNKNOWN, Ground

_STEP = 0.1
"""Spacing of the points along a beam at which walls are looked for (m)."""
_AT_WALL, _BEYOND = 5, 25
"""A beam meets a wall up to the first distance from it, and has passed it from the second on (cm).
A beam along a wall, which a small error of the pose moves into it, never gets so far from it."""
_BEFORE_END = 0.3
"""Walls nearer than this to a beam's end are not passed (m)."""
EXPLAINED = 15
"""A beam is explained if it ends within this distance of a wall (cm)."""


def weigh_poses(
    ground: Ground,
    poses: Poses,
    points: Points,
    eye: Points,
    config: EvidenceConfig,
) -> tuple[Float64[np.ndarray, "poses"], Float64[np.ndarray, "poses"]]:
    """Weigh poses by a scan.

    Args:
        ground: The map.
        poses: The robot's poses (poses, 3).
        points: The ends of the scan's beams, in the robot's frame (m).
        eye: The laser's position in the robot's frame (m), (2,).
        config: The beam model.

    Returns:
        Logarithm of the likelihood ratio of each pose and of no pose; and the share of the beams
        over known ground that the map explains (0 if there are none).
    """
    return weigh_all(
        ground, poses, points, eye, config.beams, ratios_of(config), config.through - config.bias
    )


def ratios_of(config: EvidenceConfig) -> Float64[np.ndarray, "256"]:
    """Return the logarithm of a beam's likelihood ratio by the distance of its end (cm)."""
    away = np.arange(256) / 100.0
    near = config.explained * config.gain * np.exp(-0.5 * (away / config.sigma) ** 2)
    ratios: Float64[np.ndarray, "256"] = np.log(1.0 - config.explained + near) - config.bias
    return ratios


@kernel(arrays=True)
def weigh_all(
    ground: Ground,
    poses: np.ndarray,
    points: np.ndarray,
    eye: np.ndarray,
    beams: float,
    ratios: np.ndarray,
    through: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Run `weigh_poses` on arrays.

    Args:
        ground: The map.
        poses: The robot's poses.
        points: The ends of the beams (robot's frame, m).
        eye: The laser's position (robot's frame, m).
        beams: Number of beams that count as independent.
        ratios: Logarithm of a beam's ratio by the distance of its end from a wall (cm).
        through: Logarithm of the ratio of a beam that passes through a wall.
    """
    evidence, shares = np.zeros(len(poses)), np.zeros(len(poses))
    if not len(points):
        return evidence, shares
    # With few beams each counts at most as one.
    weight = min(1.0, beams / len(points))
    for p in range(len(poses)):
        cos, sin = math.cos(poses[p, 2]), math.sin(poses[p, 2])
        x0 = poses[p, 0] + cos * eye[0] - sin * eye[1]
        y0 = poses[p, 1] + sin * eye[0] + cos * eye[1]
        known, explained, total = 0, 0, 0.0
        for k in range(len(points)):
            x = poses[p, 0] + cos * points[k, 0] - sin * points[k, 1]
            y = poses[p, 1] + sin * points[k, 0] + cos * points[k, 1]
            kind, away = _cell_at(ground, x, y)
            if _passes_wall(ground, x0, y0, x, y):
                known += 1
                total += through
            elif away <= EXPLAINED:
                known += 1
                explained += 1
                total += ratios[away]
            elif kind != UNKNOWN:
                known += 1
                total += ratios[away]
        evidence[p] = weight * total
        shares[p] = explained / max(known, 1)
    return evidence, shares


@kernel()
def _cell_at(ground: Ground, x: float, y: float) -> tuple[int, int]:
    """Return a point's kind of cell and its distance from a wall (cm)."""
    column = math.floor((x - ground.corner[0]) / CELL)
    row = math.floor((y - ground.corner[1]) / CELL)
    if 0 <= row < ground.kinds.shape[0] and 0 <= column < ground.kinds.shape[1]:
        return int(ground.kinds[row, column]), int(ground.distances[row, column])
    return 0, 100


@kernel()
def _passes_wall(ground: Ground, x0: float, y0: float, x: float, y: float) -> bool:
    """Return whether a beam passes through a wall of the map well before its end."""
    dx, dy = x - x0, y - y0
    length = math.sqrt(dx * dx + dy * dy)
    count = int((length - _BEFORE_END) / _STEP)
    if count <= 0:
        return False
    ux, uy = _STEP * dx / length, _STEP * dy / length
    has_met = False
    n = 1
    while n <= count:
        _, away = _cell_at(ground, x0 + n * ux, y0 + n * uy)
        if away <= _AT_WALL:
            has_met = True
        elif has_met and away >= _BEYOND:
            return True
        # No wall is nearer than `away`, so as many steps may be left out.
        n += max(1, (away - _AT_WALL - 4) // 10)
    return False
