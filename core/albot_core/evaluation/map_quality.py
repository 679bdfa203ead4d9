"""Map quality: the distance from the true walls, and the entropy, which needs no ground truth.

If the robot's start on the floor is unknown, `registration` aligns the map with the floor first.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from jaxtyping import Float64
from scipy.spatial import KDTree

from albot_core.errors import InputError
from albot_core.geometry.poses import transform_points, transform_segments
from albot_core.geometry.types import Pose, Poses, Segments
from albot_core.sensing.reading import LaserScan

_Surfaces = Float64[np.ndarray, "surfaces 4"]
_Walls = Float64[np.ndarray, "walls 4"]
_Cloud = Float64[np.ndarray, "points 2"]

LASER_NOISE = 0.01
"""Standard deviation of the laser's noise (m); sharper walls do not lower the entropy."""
MIN_NEIGHBOURS = 5
"""Least number of neighbours of a point that counts for the entropy."""
_BLOCK = 256
"""Number of neighbourhoods measured at once; bounds the memory where all points are neighbours."""
_ROUNDING = 1e-6
"""Tolerance when lengths are divided into pieces, as a share of the spacing."""


def sample_segments(segments: Segments, spacing: float) -> Float64[np.ndarray, "points 2"]:
    """Return the centres of equal pieces of the segments, each at most `spacing` long (m).

    A segment is thus weighted by its length; a segment of length 0 gives one point.
    """
    if not 0 < spacing < np.inf:
        raise InputError("spacing", "a positive length (m)", str(spacing))
    runs = segments[:, 2:] - segments[:, :2]
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
    """Return the distances (m) from points along the surfaces to the nearest wall.

    Args:
        surfaces: The map's surfaces (m, map frame).
        walls: The true walls (m, world frame).
        frame: Pose of the map's frame in the world frame.
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
    """Return the median distance (m) from the surfaces' points to the nearest true wall.

    Arguments and errors are those of `surface_distances`. None if the map has no surfaces.
    """
    if not len(surfaces):
        return None
    return float(np.median(surface_distances(surfaces, walls, frame, spacing)))


def cloud_error(
    surfaces: _Surfaces, cloud: Float64[np.ndarray, "cloud 2"], frame: Pose, spacing: float = 0.05
) -> float | None:
    """Return `surface_error` with respect to walls that are given as a cloud of points (m).

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


def precision_and_recall(
    points: _Cloud,
    walls: Float64[np.ndarray, "walls 2"],
    seen: Float64[np.ndarray, "seen 2"],
    within: float,
) -> tuple[float, float]:
    """How much of a map is right, and how much of what was seen it holds, as shares from 0 to 1.

    Precision is the share of the map's points that lie within `within` (m) of a wall; recall the
    share of the walls seen that lie as near to the map. Points evenly spaced along lines (see
    `sample_segments`) make both shares of wall length. Both are 0 for a map of nothing.

    Args:
        points: Points of the map, laid on the floor (m).
        walls: Points of all true walls (m).
        seen: Those of them that the map could hold.
        within: The largest distance that is no error (m).

    Raises:
        InputError: There are no walls, or none was seen.
    """
    if not len(walls) or not len(seen):
        raise InputError("walls", "walls, and some seen", f"{len(walls)}, {len(seen)} seen")
    if not len(points):
        return 0.0, 0.0
    right = KDTree(walls).query(points)[0] <= within
    found = KDTree(points).query(seen)[0] <= within
    return float(right.mean()), float(found.mean())


def scan_cloud(scans: Sequence[LaserScan], poses: Poses, most: int = 40_000) -> _Cloud:
    """Return the points of all scans, transformed by the poses and evenly thinned to `most`."""
    clouds = [transform_points(pose, scan.points) for scan, pose in zip(scans, poses, strict=True)]
    cloud = np.concatenate(clouds) if clouds else np.empty((0, 2))
    return cloud[:: max(1, -(-len(cloud) // most))]


def mean_map_entropy(points: _Cloud, radius: float = 0.3, samples: int = 4_000) -> float | None:
    """Return the mean differential entropy (nats) of each point's neighbourhood; less is sharper.

    The points within `radius` are modelled by a normal distribution with covariance S, whose
    entropy is ln |2 pi e S| / 2. Walls that are blurred or doubled have more widely spread points,
    which raises the entropy. None if no point has enough neighbours.

    Source: Droeschel, Stückler and Behnke, Local multi-resolution representation for 6D
    motion estimation and mapping with a continuously rotating 3D laser scanner, ICRA 2014;
    in the plane here.

    Args:
        points: (points, 2), all in one frame (m).
        radius: Radius of a neighbourhood (m).
        samples: Number of points, evenly chosen, whose neighbourhoods are measured.

    Raises:
        InputError: The radius is not a positive length.
    """
    if not 0 < radius < np.inf:
        raise InputError("radius", "a positive length (m)", str(radius))
    if not len(points):
        return None
    tree = KDTree(points)
    chosen = points[:: max(1, -(-len(points) // samples))]
    entropies = np.concatenate(
        [
            _neighbourhood_entropies(points, tree, chosen[start : start + _BLOCK], radius)
            for start in range(0, len(chosen), _BLOCK)
        ]
    )
    return float(entropies.mean()) if len(entropies) else None


def _neighbourhood_entropies(
    points: _Cloud, tree: KDTree, centres: Float64[np.ndarray, "centres 2"], radius: float
) -> Float64[np.ndarray, "measured"]:
    """Return the entropy (nats) of each centre's neighbourhood, of those with enough neighbours."""
    pairs = KDTree(centres).sparse_distance_matrix(tree, radius, output_type="ndarray")
    centre = pairs["i"]
    # Offsets from the centre are small, so the sums of their squares lose no digits.
    x, y = (points[pairs["j"]] - centres[centre]).T
    counts = np.bincount(centre, minlength=len(centres))
    enough = counts >= MIN_NEIGHBOURS
    n = counts[enough]
    sum_x, sum_y, sum_xx, sum_xy, sum_yy = (
        np.bincount(centre, terms, len(centres))[enough] for terms in (x, y, x * x, x * y, y * y)
    )
    a = (sum_xx - sum_x * sum_x / n) / (n - 1) + LASER_NOISE**2
    b = (sum_xy - sum_x * sum_y / n) / (n - 1)
    d = (sum_yy - sum_y * sum_y / n) / (n - 1) + LASER_NOISE**2
    return np.asarray(0.5 * np.log((2 * np.pi * np.e) ** 2 * (a * d - b * b)))
