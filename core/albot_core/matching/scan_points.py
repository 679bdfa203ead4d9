"""The points of a laser scan that are matched, and those with which later scans are matched.

Points are dense on near surfaces and sparse on far ones. So a scan is matched by thinned points
(`matched_points`), and the local map holds points that are filled in along surfaces
(`surface_points`), since there is wall between two beams that hit the same wall. Otherwise points
would be drawn to the positions where earlier beams ended.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from albot_core.kernels.compiled import kernel
from albot_core.sensing.reading import LaserScan

_STRAIGHT = math.cos(math.radians(30.0))
"""Largest turn between the lines of three neighbouring points on one surface, as its cosine."""


def matched_points(
    scan: LaserScan, reach: float, spacing: float
) -> tuple[Float64[np.ndarray, "points 2"], Float64[np.ndarray, "points 2"]]:
    """Return the points of a scan that are matched, and the surface normals there.

    A point is left out if it is nearer than `spacing` to the last kept one, because points are
    dense on near surfaces.

    Args:
        scan: The scan.
        reach: Largest distance of a point from the laser (m). Ranges of the laser's maximum or
            above are no returns, and left out.
        spacing: Smallest distance between two successive points (m).

    Returns:
        The points in the robot's frame (m), and a unit normal for each; (0, 0) where the
        neighbours are not on one line with the point.
    """
    most = min(reach, scan.geometry.max_range)
    return _thin(scan.ranges, scan.geometry.directions, scan.geometry.mount[:2], most, spacing)


def surface_points(
    scan: LaserScan, reach: float, spacing: float
) -> Float64[np.ndarray, "points 2"]:
    """Return all points of a scan, and additional points between neighbours on one surface.

    Two neighbouring points count as on one surface if each is on one line with its own two
    neighbours.

    Args:
        scan: The scan.
        reach: As for `matched_points`.
        spacing: Largest distance between two neighbouring points on a surface (m).

    Returns:
        The points in the robot's frame (m).
    """
    most = min(reach, scan.geometry.max_range)
    return _fill(scan.ranges, scan.geometry.directions, scan.geometry.mount[:2], most, spacing)


@kernel(arrays=True)
def _thin(
    ranges: np.ndarray,
    directions: np.ndarray,
    mount: tuple[float, float],
    reach: float,
    spacing: float,
) -> tuple[np.ndarray, np.ndarray]:
    hit, beams = np.empty((len(ranges), 2)), np.empty(len(ranges), np.int64)
    count = _find_hits(ranges, directions, mount, reach, hit, beams)
    points, normals = np.empty((count, 2)), np.empty((count, 2))
    kept = 0
    for k in range(count):
        if kept:
            dx, dy = hit[k, 0] - points[kept - 1, 0], hit[k, 1] - points[kept - 1, 1]
            if dx * dx + dy * dy < spacing * spacing:
                continue
        points[kept, 0], points[kept, 1] = hit[k, 0], hit[k, 1]
        normals[kept, 0], normals[kept, 1] = _normal(hit, beams, k, count)
        kept += 1
    return points[:kept].copy(), normals[:kept].copy()


@kernel(arrays=True)
def _fill(
    ranges: np.ndarray,
    directions: np.ndarray,
    mount: tuple[float, float],
    reach: float,
    spacing: float,
) -> np.ndarray:
    hit, beams = np.empty((len(ranges), 2)), np.empty(len(ranges), np.int64)
    count = _find_hits(ranges, directions, mount, reach, hit, beams)
    pieces = np.ones(count, np.int64)
    last_x, last_y = 0.0, 0.0
    for k in range(count):
        x, y = _normal(hit, beams, k, count)
        # The product is 0 if either point has no normal.
        if k > 0 and x * last_x + y * last_y > _STRAIGHT:
            dx, dy = hit[k, 0] - hit[k - 1, 0], hit[k, 1] - hit[k - 1, 1]
            pieces[k] = max(1, math.ceil(math.sqrt(dx * dx + dy * dy) / spacing))
        last_x, last_y = x, y
    points = np.empty((pieces.sum(), 2))
    n = 0
    for k in range(count):
        for piece in range(1, pieces[k] + 1):
            share = piece / pieces[k]
            before = max(k - 1, 0)
            points[n, 0] = hit[before, 0] + share * (hit[k, 0] - hit[before, 0])
            points[n, 1] = hit[before, 1] + share * (hit[k, 1] - hit[before, 1])
            n += 1
    return points


@kernel()
def _find_hits(
    ranges: np.ndarray,
    directions: np.ndarray,
    mount: tuple[float, float],
    reach: float,
    hit: np.ndarray,
    beams: np.ndarray,
) -> int:
    """Fill in the beams' ends in the robot's frame, and the beams' indices; return their number."""
    count = 0
    for k in range(len(ranges)):
        # A range of 0 is invalid: some lasers report it for no return.
        if 0.0 < ranges[k] < reach:
            hit[count, 0] = mount[0] + ranges[k] * directions[k, 0]
            hit[count, 1] = mount[1] + ranges[k] * directions[k, 1]
            beams[count] = k
            count += 1
    return count


@kernel()
def _normal(hit: np.ndarray, beams: np.ndarray, k: int, count: int) -> tuple[float, float]:
    """Return the unit normal at a point from its neighbours; (0, 0) if they are not on a line."""
    if k == 0 or k == count - 1 or beams[k + 1] - beams[k - 1] > 2:
        return 0.0, 0.0
    ax, ay = hit[k, 0] - hit[k - 1, 0], hit[k, 1] - hit[k - 1, 1]
    bx, by = hit[k + 1, 0] - hit[k, 0], hit[k + 1, 1] - hit[k, 1]
    lengths = math.sqrt((ax * ax + ay * ay) * (bx * bx + by * by))
    if ax * bx + ay * by < _STRAIGHT * lengths or lengths == 0.0:
        return 0.0, 0.0
    tx, ty = ax + bx, ay + by
    length = math.sqrt(tx * tx + ty * ty)
    return -ty / length, tx / length
