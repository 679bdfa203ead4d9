"""How far it is from anywhere to the nearest of some echoes, on a grid."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy.ndimage import distance_transform_edt, maximum_filter

from albot_core.geometry.types import Points
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
        margin = farthest + 2 * _CELL
        self._corner = points.min(axis=0) - margin
        size = self._cells(points.max(axis=0) + margin) + 1
        is_free, is_known = np.ones(size, np.bool_), np.zeros(size, np.bool_)
        is_free[tuple(self._cells(points).T)] = False
        is_known[tuple(np.clip(self._cells(steps.clear_points), 0, size - 1).T)] = True
        limits = np.where(maximum_filter(is_known, _WIDE), farthest, unknown)
        self._distances = np.minimum(_CELL * distance_transform_edt(is_free), limits)

    def distances(self, points: Float64[np.ndarray, "*some 2"]) -> Float64[np.ndarray, "*some"]:
        """The distance of each point to the nearest echo, or the limit (m)."""
        cells = self._cells(points)
        limits = np.array(self._distances.shape)
        is_inside = np.asarray(((cells >= 0) & (cells < limits)).all(axis=-1))
        cells = np.where(is_inside[..., None], cells, 0)
        found = self._distances[cells[..., 0], cells[..., 1]]
        return np.asarray(np.where(is_inside, found, self._unknown))

    def _cells(self, points: Points) -> np.ndarray:
        return np.floor((points - self._corner) / _CELL).astype(np.int64)
