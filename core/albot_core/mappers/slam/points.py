"""What is matched of a laser scan, and what it is matched with.

Beams crowd on what is near and are far apart on what is far away. So a scan is matched by points
that are thinned (`matched_points`), and remembered by points that are filled in along the surfaces
(`surface_points`): between two beams on one wall there is wall. Without that, points slip into the
places where earlier beams ended.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from albot_core.kernels.compiled import kernel
from albot_core.sensing.reading import LaserScan

_STRAIGHT = math.cos(math.radians(30.0))
"""Three neighbouring points lie on one surface where the lines between them turn no more."""


def matched_points(
    scan: LaserScan, reach: float, spacing: float
) -> tuple[Float64[np.ndarray, "points 2"], Float64[np.ndarray, "points 2"]]:
    """The points of a scan that are matched, and the normals of the surfaces there.

    Beams crowd on what is near. So a point is left out that is nearer to the one kept before it
    than `spacing`.

    Args:
        scan: The scan.
        reach: Points farther from the laser than this (m) are left out, as are those at the
            laser's own greatest range, where nothing came back.
        spacing: Least distance between two successive points (m).

    Returns:
        The points in the robot's frame (m), and a unit normal for each; (0, 0) where its
        neighbours do not lie on one line with it.
    """
    most = min(reach, scan.geometry.max_range)
    return _thin(scan.ranges, scan.geometry.directions, scan.geometry.mount[:2], most, spacing)


def surface_points(
    scan: LaserScan, reach: float, spacing: float
) -> Float64[np.ndarray, "points 2"]:
    """All points of a scan, and between two that lie on one surface as many as are needed.

    Two neighbouring beams are taken to lie on one surface where each of them is in one line with
    its own two neighbours.

    Args:
        scan: The scan.
        reach: As for `matched_points`.
        spacing: Two points on a surface are no farther apart (m).

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
        # A product of 0 where either has no normal.
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
    """Fill in where beams ended, in the robot's frame, and which they are; return how many."""
    count = 0
    for k in range(len(ranges)):
        # Nothing is as near as nought: some lasers say so where nothing came back.
        if 0.0 < ranges[k] < reach:
            hit[count, 0] = mount[0] + ranges[k] * directions[k, 0]
            hit[count, 1] = mount[1] + ranges[k] * directions[k, 1]
            beams[count] = k
            count += 1
    return count


@kernel()
def _normal(hit: np.ndarray, beams: np.ndarray, k: int, count: int) -> tuple[float, float]:
    """The unit normal at a point by its neighbours; (0, 0) where they are not in one line."""
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
