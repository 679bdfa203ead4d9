"""How far it is from anywhere to the nearest of some echoes, on a grid."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64
from scipy.ndimage import distance_transform_edt, maximum_filter

from albot_core.geometry.types import Points, Poses
from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot0.paths import Steps

_CELL = 0.1
"""Size of a cell (m)."""
_WIDE = 3
"""The sound's way is so many cells wide."""


class EchoField:
    """A likelihood field: the distance to the nearest echo, up to a limit.

    The limit is lower where no sound went: there an echo may come from what was not heard yet.

    Args:
        steps: On which the echoes were heard.
        farthest: The limit where the sound went freely (m).
        unknown: The limit elsewhere (m).
    """

    def __init__(self, steps: Steps, farthest: float, unknown: float) -> None:
        self._unknown = unknown
        self._corner = np.zeros(2)
        self._distances = np.full((1, 1), unknown)
        points = steps.echo_points
        if not len(points):
            return
        clear = steps.clear_points
        covered, margin = np.concatenate((points, clear)), farthest + 2 * _CELL
        self._corner = covered.min(axis=0) - margin
        size = self._cells(covered.max(axis=0) + margin) + 1
        is_free, is_known = np.ones(size, np.bool_), np.zeros(size, np.bool_)
        is_free[tuple(self._cells(points).T)] = False
        is_known[tuple(self._cells(clear).T)] = True
        limits = np.where(maximum_filter(is_known, _WIDE), farthest, unknown)
        self._distances = np.minimum(_CELL * distance_transform_edt(is_free), limits)

    def misfits(self, poses: Poses, points: Points) -> Float64[np.ndarray, "poses"]:
        """Squared distances to the nearest echo, or the limit, summed over some points (m²).

        Args:
            poses: From which the points may be seen.
            points: In the frame of each pose (m).
        """
        return np.asarray(sum_squares(poses, points, self._corner, self._distances, self._unknown))

    def _cells(self, points: Points) -> np.ndarray:
        return np.floor((points - self._corner) / _CELL).astype(np.int64)


@kernel(arrays=True)
def sum_squares(
    poses: np.ndarray,
    points: np.ndarray,
    corner: np.ndarray,
    distances: np.ndarray,
    unknown: float,
) -> np.ndarray:
    """What `EchoField.misfits` returns; `unknown` counts outside the grid."""
    sums = np.zeros(poses.shape[0])
    for k in range(poses.shape[0]):
        cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        x, y = poses[k, 0] - corner[0], poses[k, 1] - corner[1]
        for i in range(points.shape[0]):
            column = math.floor((x + cos * points[i, 0] - sin * points[i, 1]) / _CELL)
            row = math.floor((y + sin * points[i, 0] + cos * points[i, 1]) / _CELL)
            away = unknown
            if 0 <= column < distances.shape[0] and 0 <= row < distances.shape[1]:
                away = distances[int(column), int(row)]
            sums[k] += away * away
    return sums
