"""How the local map of one visit lies on that of another, and how much of them agrees."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.types import Points, Pose
from albot_core.kernels.compiled import kernel
from albot_core.mappers.hssh.topological_map import Common
from albot_core.mappers.hssh.visit import SPACING, Visit

_STEPS = 8
"""Steps of the alignment of the local maps."""


class Alignment(NamedTuple):
    """How one visit's local map lies on that of another."""

    pose: Pose
    """The pose of the later odometry frame in the earlier one."""
    error: float
    """Root mean square distance of the gateways' ends (m)."""
    overlap: float
    """Share of the points on walls that are found again, of those that the other map knows: where
    it has neither a wall nor free ground, nothing was seen. 1 if there are none."""
    evidence: int
    """Number of the points on walls that the other map knows, of both maps."""


@kernel(arrays=True)
def rigid_fit(points: Points, onto: Points) -> tuple[Pose, float]:
    """Return the pose that moves points onto others, and the root mean square distance left (m).

    K. Arun, T. Huang and S. Blostein, Least-squares fitting of two 3-D point sets, PAMI 1987, in
    the plane.
    """
    count = len(points)
    middle, target = np.zeros(2), np.zeros(2)
    for k in range(count):
        for axis in range(2):
            middle[axis] += points[k, axis] / count
            target[axis] += onto[k, axis] / count
    sine = cosine = 0.0
    for k in range(count):
        x, y = points[k, 0] - middle[0], points[k, 1] - middle[1]
        right, up = onto[k, 0] - target[0], onto[k, 1] - target[1]
        sine += x * up - y * right
        cosine += x * right + y * up
    turn = math.atan2(sine, cosine)
    cos, sin = math.cos(turn), math.sin(turn)
    left = 0.0
    for k in range(count):
        x, y = points[k, 0] - middle[0], points[k, 1] - middle[1]
        right, up = onto[k, 0] - target[0], onto[k, 1] - target[1]
        left += (cos * x - sin * y - right) ** 2 + (sin * x + cos * y - up) ** 2
    pose = np.empty(3)
    pose[0] = target[0] - cos * middle[0] + sin * middle[1]
    pose[1] = target[1] - sin * middle[0] - cos * middle[1]
    pose[2] = turn
    return pose, math.sqrt(left / count)


def align(later: Visit, earlier: Visit, common: Common, reach: float) -> Alignment:
    """Align two visits' local maps: by the gateways, and then by the points on walls near by.

    Args:
        later: The later visit.
        earlier: The earlier one.
        common: The pairs of gateways, of the later and of the earlier one, that are the same.
        reach: Largest distance of a point from the same wall (m).
    """
    lines, onto = paired_ends(later, earlier, common)
    pose, error = rigid_fit(lines, onto)
    starts = [pose]
    if error > reach:  # Some gateways lie elsewhere in the place than on the other visit.
        starts += [rigid_fit(lines[k : k + 2], onto[k : k + 2])[0] for k in range(0, len(lines), 2)]
    if not len(later.surface) or not len(earlier.surface):
        return Alignment(pose, error, 1.0, 0)
    maps = later.surface, later.open_ground, earlier.surface, earlier.open_ground
    found = [_laid_on(*maps, start, reach) for start in starts]
    pose, overlap, evidence = max(found, key=lambda each: each[1])
    return Alignment(pose, error, overlap, evidence)


def paired_ends(later: Visit, earlier: Visit, common: Common) -> tuple[Points, Points]:
    """Return the ends of the common gateways of two visits; without any the places' middles."""
    if not common:
        return later.middle[None], earlier.middle[None]
    ours, theirs = (list(chosen) for chosen in zip(*common, strict=True))
    return later.gateways[ours].reshape(-1, 2), earlier.gateways[theirs].reshape(-1, 2)


@kernel(arrays=True)
def _laid_on(
    walls: np.ndarray,
    free: np.ndarray,
    other_walls: np.ndarray,
    other_free: np.ndarray,
    pose: np.ndarray,
    reach: float,
) -> tuple[np.ndarray, float, int]:
    """Return pose, overlap and evidence of local maps, by the points on walls near one another.

    P. Besl and N. McKay, A method for registration of 3-D shapes, PAMI 1992 (ICP).

    Args:
        walls: Points on the walls of the later visit (points, 2) (m).
        free: Points on its free ground (points, 2) (m).
        other_walls: Those of the earlier visit.
        other_free: Those of the earlier visit.
        pose: The pose of the later visit's frame in the other one to begin with.
        reach: Largest distance of a point from the same wall (m).
    """
    close, onto = np.empty_like(walls), np.empty_like(walls)
    for _ in range(_STEPS):
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        count = 0
        for k in range(len(walls)):
            x = pose[0] + cos * walls[k, 0] - sin * walls[k, 1]
            y = pose[1] + sin * walls[k, 0] + cos * walls[k, 1]
            nearest, away = _nearest(other_walls, x, y)
            if away < 2.0 * reach:
                close[count, 0], close[count, 1] = walls[k, 0], walls[k, 1]
                onto[count, 0], onto[count, 1] = other_walls[nearest, 0], other_walls[nearest, 1]
                count += 1
        if count < 3:
            break
        pose, _ = rigid_fit(close[:count], onto[:count])
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    back = np.empty(3)
    back[0] = -cos * pose[0] - sin * pose[1]
    back[1] = sin * pose[0] - cos * pose[1]
    back[2] = -pose[2]
    found, missed = _agreement(walls, other_walls, other_free, pose, reach)
    more, fewer = _agreement(other_walls, walls, free, back, reach)
    known = found + more + missed + fewer
    return pose, (found + more) / max(known, 1), known


@kernel()
def _agreement(
    points: np.ndarray, walls: np.ndarray, free: np.ndarray, pose: np.ndarray, reach: float
) -> tuple[int, int]:
    """Return how many points on walls another map has as a wall, and how many as free ground.

    Args:
        points: The points (points, 2) (m).
        walls: The other map's points on walls (points, 2) (m).
        free: Its points on free ground (points, 2) (m).
        pose: The pose of the points' frame in that of the other map.
        reach: Largest distance of a point from the same wall (m).
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    found = missed = 0
    for k in range(len(points)):
        x = pose[0] + cos * points[k, 0] - sin * points[k, 1]
        y = pose[1] + sin * points[k, 0] + cos * points[k, 1]
        if _nearest(walls, x, y)[1] < reach:
            found += 1
        elif _nearest(free, x, y)[1] < SPACING * math.sqrt(0.5):
            missed += 1
    return found, missed


@kernel()
def _nearest(points: np.ndarray, x: float, y: float) -> tuple[int, float]:
    """Return the point nearest to x, y, and its distance (m); -1 and infinity without any.

    Of the few points of a place all are looked at.
    """
    nearest, least = -1, np.inf
    for k in range(len(points)):
        across, up = points[k, 0] - x, points[k, 1] - y
        away = across * across + up * up
        if away < least:
            nearest, least = k, away
    return nearest, math.sqrt(least)
