"""How far a map's surfaces are from the true walls."""

from __future__ import annotations

import numpy as np
import shapely
from jaxtyping import Float64
from scipy.spatial import KDTree

from albot_core.errors import InputError
from albot_core.geometry.poses import transform_segments
from albot_core.geometry.types import Pose, Segments

_Surfaces = Float64[np.ndarray, "surfaces 4"]
_Walls = Float64[np.ndarray, "walls 4"]

_ROUNDING = 1e-6


def sample_segments(segments: Segments, spacing: float) -> Float64[np.ndarray, "points 2"]:
    """Points at the middles of equal pieces of the segments, none longer than `spacing` (m).

    So a surface counts by its length; one that is a point gives one point.
    """
    if not 0 < spacing < np.inf:
        raise InputError("spacing", "a positive length (m)", str(spacing))
    runs = segments[:, 2:] - segments[:, :2]
    # A length that is a multiple of the spacing but for rounding makes no piece more.
    lengths = np.hypot(runs[:, 0], runs[:, 1]) / spacing - _ROUNDING
    pieces = np.maximum(np.ceil(lengths), 1).astype(np.int64)
    which = np.repeat(np.arange(len(segments)), pieces)
    first = np.cumsum(pieces) - pieces
    step = np.arange(len(which)) - first[which]
    along = (step + 0.5) / pieces[which]
    return np.asarray(segments[which, :2] + along[:, None] * runs[which])


def surface_distances(
    surfaces: _Surfaces, walls: _Walls, frame: Pose, spacing: float = 0.05
) -> Float64[np.ndarray, "points"]:
    """Distance (m) from points along the surfaces to the nearest wall.

    Args:
        surfaces: The map's surfaces, in the map's frame.
        walls: The true walls, in the world's frame.
        frame: The map's frame as a pose in the world's: how the map is laid on the world.
        spacing: Largest distance (m) between neighbouring points on a surface.

    Raises:
        InputError: There are no walls, or `spacing` is not a positive length.
    """
    if not len(walls):
        raise InputError("walls", "at least one wall", "none")
    points = sample_segments(transform_segments(frame, surfaces), spacing)
    tree = shapely.STRtree(shapely.linestrings(walls.reshape(-1, 2, 2)))
    _, distances = tree.query_nearest(
        shapely.points(points), all_matches=False, return_distance=True
    )
    return np.asarray(distances, np.float64)


def surface_error(
    surfaces: _Surfaces, walls: _Walls, frame: Pose, spacing: float = 0.05
) -> float | None:
    """Median distance (m) from the surfaces' points to the nearest true wall.

    The arguments are those of `surface_distances`. None where the map has no surfaces.
    """
    if not len(surfaces):
        return None
    return float(np.median(surface_distances(surfaces, walls, frame, spacing)))


def cloud_error(
    surfaces: _Surfaces, cloud: Float64[np.ndarray, "cloud 2"], frame: Pose, spacing: float = 0.05
) -> float | None:
    """As `surface_error`, where the walls are known only as the points of a cloud (m).

    Raises:
        InputError: The cloud is empty, or `spacing` is not a positive length.
    """
    if not len(cloud):
        raise InputError("cloud", "at least one point", "none")
    if not len(surfaces):
        return None
    points = sample_segments(transform_segments(frame, surfaces), spacing)
    distances, _ = KDTree(cloud).query(points)
    return float(np.median(distances))
