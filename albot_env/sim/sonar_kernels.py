"""Compiled sonars: what the sonars of a robot report, with cross-talk, noise and misses."""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.directions import length_of
from albot_core.kernels.compiled import kernel
from albot_env.sim.cone_kernels import find_echoes
from albot_env.sim.noise_kernels import draw
from albot_env.sim.plane_kernels import Stance
from albot_env.sim.sonar_arrays import Sonars
from albot_env.sim.surface_kernels import Cones, Ear, gather, look

SONAR_DRAWS = 1
"""Places in the robot's stream that each sonar takes at a reading."""


@kernel()
def listen(
    walls: np.ndarray,
    nearby: np.ndarray,
    things: np.ndarray,
    robot: Stance,
    sonars: Sonars,
    key: np.uint64,
    place: int,
    cones: Cones,
    echoes: np.ndarray,
) -> None:
    """Fill `echoes` (sonars,) with the ranges (m) that a robot's sonars report.

    Args:
        walls: All walls of the world (n, 4) float64, world frame (m).
        nearby: Which of them may be in reach (int32).
        things: Surfaces that move (k, 4) float64, world frame (m).
        robot: Where the robot is, world frame.
        sonars: The sonars.
        key: Key of the robot's stream.
        place: First of the places in it that the reading takes: SONAR_DRAWS for each sonar.
        cones: Room for so many surfaces, to work in.
        echoes: Filled; infinite where nothing came back.
    """
    _, _, cos, sin = robot
    count = gather(walls, nearby, things, robot, sonars.behind, cones.table)
    mounts, heard = sonars.mounts, cones.echoes
    for s in range(mounts.shape[0]):
        look(cones, s, count, _ear(mounts, s, cos, sin), sonars)
    find_echoes(cones, sonars)
    for s in range(mounts.shape[0]):
        reach = heard[s, 0]
        bits = draw(key, place + s)
        if np.int64((bits >> np.uint64(26)) & np.uint64(0x1FFFFFF)) < sonars.crosstalk:
            other = s + 1 if (bits >> np.uint64(51)) & np.uint64(1) else s - 1
            if 0 <= other < mounts.shape[0]:
                ear, mouth = _ear(mounts, s, cos, sin), _ear(mounts, other, cos, sin)
                reach = min(reach, _overheard(ear, mouth, heard[other, 0], heard[other, 1]))
        echoes[s] = _reported(reach, bits, sonars)


@kernel()
def _ear(mounts: np.ndarray, s: int, cos: float, sin: float) -> Ear:
    """Where a sonar is and points to, for a robot with this cosine and sine of its heading."""
    mx, my, mc, ms = mounts[s, 0], mounts[s, 1], mounts[s, 2], mounts[s, 3]
    return (
        cos * mx - sin * my,
        sin * mx + cos * my,
        cos * mc - sin * ms,
        sin * mc + cos * ms,
    )


@kernel()
def _overheard(ear: Ear, mouth: Ear, out: float, tangent: float) -> float:
    """Range (m) at which one sonar hears another's echo, which that hears at `out`.

    Half the way from the other to the point that echoes and on to this sonar.
    """
    if out == np.inf:
        return np.inf
    along = out / math.sqrt(1.0 + tangent * tangent)
    across = along * tangent
    x = mouth[0] + mouth[2] * along - mouth[3] * across
    y = mouth[1] + mouth[3] * along + mouth[2] * across
    return (out + length_of(x - ear[0], y - ear[1])) / 2


@kernel()
def _reported(reach: float, bits: np.uint64, sonars: Sonars) -> float:
    """What a sonar reports of an echo at this range: noise, misses, and both limits."""
    if np.int64(bits & np.uint64(0x3FFFFFF)) < sonars.dropout:
        return np.inf
    share = sonars.proportional_noise * reach
    deviation = math.sqrt(sonars.noise * sonars.noise + share * share)
    reach += deviation * sonars.normals[bits >> np.uint64(52)]
    return max(reach, sonars.min_range) if reach < sonars.max_range else np.inf
