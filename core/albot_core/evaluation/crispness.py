"""How crisp a map is that the scans make: a measure that needs no truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from scipy.spatial import KDTree

from albot_core.errors import InputError
from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Poses
from albot_core.sensing.reading import LaserScan

SMEAR = 0.01
"""Standard deviation (m) of the laser's own noise: what is straighter is not told apart."""
FEWEST = 5
"""Points with fewer neighbours say nothing."""

_Cloud = Float64[np.ndarray, "points 2"]


def laid_points(scans: Sequence[LaserScan], poses: Poses, most: int = 40_000) -> _Cloud:
    """The points of all scans where the poses put them, evenly thinned to `most`."""
    clouds = [transform_points(pose, scan.points) for scan, pose in zip(scans, poses, strict=True)]
    cloud = np.concatenate(clouds) if clouds else np.empty((0, 2))
    return cloud[:: max(1, -(-len(cloud) // most))]


def mean_map_entropy(points: _Cloud, radius: float = 0.3, samples: int = 4_000) -> float | None:
    """Mean differential entropy (nats) of the points around each point; less is crisper.

    The points within `radius` are taken for a normal distribution with covariance S, whose
    entropy is ln |2 pi e S| / 2. Walls that one pass smears or two passes double spread
    their points and raise it. None where no point has neighbours enough.

    Source: Droeschel, Stückler and Behnke, Local multi-resolution representation for 6D
    motion estimation and mapping with a continuously rotating 3D laser scanner, ICRA 2014;
    in the plane here.

    Args:
        points: (points, 2) in any one frame (m).
        radius: How far neighbours reach (m).
        samples: At how many points, evenly chosen, it is measured.

    Raises:
        InputError: The radius is not a positive length.
    """
    if not 0 < radius < np.inf:
        raise InputError("radius", "a positive length (m)", str(radius))
    if not len(points):
        return None
    tree = KDTree(points)
    chosen = points[:: max(1, -(-len(points) // samples))]
    entropies = []
    for neighbours in tree.query_ball_point(chosen, radius):
        if len(neighbours) < FEWEST:
            continue
        covariance = np.cov(points[neighbours].T) + SMEAR**2 * np.eye(2)
        (a, b), (_, d) = covariance
        entropies.append(0.5 * np.log((2 * np.pi * np.e) ** 2 * (a * d - b * b)))
    return float(np.mean(entropies)) if entropies else None
