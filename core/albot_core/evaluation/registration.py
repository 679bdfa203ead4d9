"""Laying a map on a floor when it is not known where on it the robot began."""

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

_CELL = 0.2
"""Cells of the first, coarse search (m)."""
_REACH = 0.4
"""How near to a wall a point counts in the coarse search: a normal bell's deviation (m)."""
_HEADINGS = 180
"""Turns tried in the coarse search, evenly over the circle."""
_BEST = 5
"""How many of the turns are then refined."""
_MOST = 2000
"""How many of the points, evenly chosen, are laid."""
_FAR = 1.0
"""Points farther than this from all walls count as this far (m): they may not be on the plan."""

_Points = Float64[np.ndarray, "points 2"]
_Walls = Float64[np.ndarray, "walls 2"]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Bells:
    """Every cell's nearness to the walls, ready for correlation."""

    corner: np.ndarray
    spectrum: np.ndarray
    shape: tuple[int, int]


def register(points: _Points, walls: _Walls) -> Pose:
    """The rigid motion that lays `points` best on `walls`, both sampled as points (m).

    All places and turns are searched on a grid, by correlation; the best are refined until
    the mean distance to the nearest wall, cut off at 1 m, falls no more. Olson, *Real-time
    correlative scan matching*, ICRA 2009, searches alike. Returns the frame of the points as
    a pose in the frame of the walls; for `transform_points`.

    Raises:
        InputError: There are no points or no walls.
    """
    if not len(points) or not len(walls):
        raise InputError("register", "points and walls", f"{len(points)} and {len(walls)}")
    centre = points.mean(axis=0)
    centred = points[:: -(-len(points) // _MOST)] - centre
    bells = _bells(walls, 2 * float(np.abs(np.hypot(*centred.T)).max()))
    headings = np.arange(_HEADINGS) * (2 * np.pi / _HEADINGS)
    found = [_best_place(centred, bells, heading) for heading in headings]
    scores = np.array([score for score, _ in found])
    tree = KDTree(walls)
    refined = [
        _refined(centred, tree, found[index][1]) for index in np.argsort(scores)[::-1][:_BEST]
    ]
    _, pose = min(refined, key=lambda result: result[0])
    x, y = transform_points(pose, -centre)
    return np.array((x, y, pose[2]))


def _bells(walls: _Walls, margin: float) -> _Bells:
    corner = walls.min(axis=0) - margin
    size = np.ceil((walls.max(axis=0) + margin - corner) / _CELL).astype(int) + 1
    rows, columns = (next_fast_len(int(count)) for count in size)
    empty = np.ones((rows, columns), np.bool_)
    empty[tuple(((walls - corner) / _CELL).astype(int).T)] = False
    nearness = np.exp(-0.5 * (_CELL / _REACH * distance_transform_edt(empty)) ** 2)
    return _Bells(corner=corner, spectrum=rfft2(nearness), shape=(rows, columns))


def _best_place(centred: _Points, bells: _Bells, heading: float) -> tuple[float, Pose]:
    """The best place under one turn, and the sum of all points' nearness there."""
    turned = transform_points(np.array((0.0, 0.0, heading)), centred)
    cells = np.round(turned / _CELL).astype(int) % np.array(bells.shape)
    mask = np.zeros(bells.shape)
    np.add.at(mask, tuple(cells.T), 1.0)
    scores = irfft2(bells.spectrum * np.conj(rfft2(mask)), s=bells.shape)
    at = np.unravel_index(int(scores.argmax()), bells.shape)
    x, y = bells.corner + _CELL * (np.array(at) + 0.5)
    return float(scores[at]), np.array((x, y, heading))


def _refined(centred: _Points, tree: KDTree, pose: Pose) -> tuple[float, Pose]:
    def cost(trial: Pose) -> float:
        distances, _ = tree.query(transform_points(trial, centred), distance_upper_bound=_FAR)
        return float(np.minimum(distances, _FAR).mean())

    simplex = pose + np.concatenate(([np.zeros(3)], np.diag((_CELL, _CELL, np.radians(2.0)))))
    best = minimize(cost, pose, method="Nelder-Mead", options={"initial_simplex": simplex})
    return float(best.fun), np.asarray(best.x, np.float64)
