"""Registration of a map with a floor plan: where on the floor the map belongs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.fft import irfft2, next_fast_len, rfft2
from scipy.ndimage import distance_transform_edt
from scipy.optimize import minimize
from scipy.spatial import KDTree

from albot_core.errors import InputError
from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Pose

_Cloud = Float64[np.ndarray, "points 2"]

_CELL = 0.2
"""Cell size of the coarse search (m)."""
_NEARNESS_SIGMA = 0.4
"""Coarse search: standard deviation of a point's Gaussian score over its wall distance (m)."""
_HEADINGS = 180
"""Number of rotations in the coarse search, evenly spaced over the circle."""
_REFINED = 5
"""Number of best rotations that are refined."""
_MAX_POINTS = 2000
"""Largest number of points that are aligned, evenly chosen."""
_MAX_DISTANCE = 1.0
"""Largest wall distance that counts (m); points farther away may not be on the plan."""


def register(points: _Cloud, walls: Float64[np.ndarray, "walls 2"]) -> Pose:
    """Return the rigid motion that best aligns `points` with `walls`, both given as points (m).

    All positions and rotations on a grid are searched by correlation. The best ones are refined
    until the mean distance to the nearest wall, cut off at 1 m, is minimal. Olson, *Real-time
    correlative scan matching*, ICRA 2009, searches in a similar way. The result is the pose of the
    points' frame in the walls' frame, for `transform_points`.

    Raises:
        InputError: There are no points or no walls.
    """
    if not len(points) or not len(walls):
        raise InputError("register", "points and walls", f"{len(points)} and {len(walls)}")
    centre = points.mean(axis=0)
    centred = points[:: -(-len(points) // _MAX_POINTS)] - centre
    nearness_grid = _nearness(walls, 2 * float(np.abs(np.hypot(*centred.T)).max()))
    headings = np.arange(_HEADINGS) * (2 * np.pi / _HEADINGS)
    found = [_best_place(centred, nearness_grid, heading) for heading in headings]
    scores = np.array([score for score, _ in found])
    tree = KDTree(walls)
    refined = [
        _refined(centred, tree, found[index][1]) for index in np.argsort(scores)[::-1][:_REFINED]
    ]
    _, pose = min(refined, key=lambda result: result[0])
    x, y = transform_points(pose, -centre)
    return np.array((x, y, pose[2]))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Nearness:
    """The score of each cell by its nearness to walls, in the form for correlation."""

    corner: np.ndarray
    spectrum: np.ndarray
    shape: tuple[int, int]


def _nearness(walls: _Cloud, margin: float) -> _Nearness:
    corner = walls.min(axis=0) - margin
    size = np.ceil((walls.max(axis=0) + margin - corner) / _CELL).astype(int) + 1
    rows, columns = (next_fast_len(int(count)) for count in size)
    empty = np.ones((rows, columns), np.bool_)
    empty[tuple(((walls - corner) / _CELL).astype(int).T)] = False
    nearness = np.exp(-0.5 * (_CELL / _NEARNESS_SIGMA * distance_transform_edt(empty)) ** 2)
    return _Nearness(corner=corner, spectrum=rfft2(nearness), shape=(rows, columns))


def _best_place(centred: _Cloud, nearness_grid: _Nearness, heading: float) -> tuple[float, Pose]:
    """Return the best score for one rotation (the points' summed nearness), and its pose."""
    turned = transform_points(np.array((0.0, 0.0, heading)), centred)
    cells = np.round(turned / _CELL).astype(int) % np.array(nearness_grid.shape)
    mask = np.zeros(nearness_grid.shape)
    np.add.at(mask, tuple(cells.T), 1.0)
    scores = irfft2(nearness_grid.spectrum * np.conj(rfft2(mask)), s=nearness_grid.shape)
    at = np.unravel_index(int(scores.argmax()), nearness_grid.shape)
    x, y = nearness_grid.corner + _CELL * (np.array(at) + 0.5)
    return float(scores[at]), np.array((x, y, heading))


def _refined(centred: _Cloud, tree: KDTree, pose: Pose) -> tuple[float, Pose]:
    def cost(trial: Pose) -> float:
        distances, _ = tree.query(
            transform_points(trial, centred), distance_upper_bound=_MAX_DISTANCE
        )
        return float(np.minimum(distances, _MAX_DISTANCE).mean())

    simplex = pose + np.concatenate(([np.zeros(3)], np.diag((_CELL, _CELL, np.radians(2.0)))))
    best = minimize(cost, pose, method="Nelder-Mead", options={"initial_simplex": simplex})
    return float(best.fun), np.asarray(best.x, np.float64)
