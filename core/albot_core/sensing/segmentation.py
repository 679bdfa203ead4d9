"""Points of a laser scan, and the spans of points on one wall: steps 1 to 3 of `view`.

Compiled.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.sensing.beam_model import BeamModel, nearer_side
from albot_core.sensing.line_fit import find_bend


@kernel()
def scan_points(
    ranges: np.ndarray,
    directions: np.ndarray,
    mount_x: float,
    mount_y: float,
    max_range: float,
    model: BeamModel,
    points: np.ndarray,
    beams: np.ndarray,
) -> int:
    """Write the points closer than `max_range` (m) to `points` (n, 2); return how many (step 1).

    `beams` (n,) receives the beam of each point. `directions` (beams, 2) are the beams' unit
    vectors in the robot's frame. The range of a wide beam is that of the nearest surface in it: the
    point lies at the edge on the side where its wall is nearer, and with the `model` it is written
    there.
    """
    count, half_width = 0, 0.5 * model.width if model.is_used else 0.0
    for i in range(ranges.shape[0]):
        reach = ranges[i]
        if reach < max_range:
            ux, uy = directions[i, 0], directions[i, 1]
            if half_width > 0.0:
                turn = half_width * nearer_side(ranges, i)
                ux, uy = ux - turn * uy, uy + turn * ux  # so small a turn keeps the length
            points[count, 0] = mount_x + reach * ux
            points[count, 1] = mount_y + reach * uy
            beams[count] = i
            count += 1
    return int(count)


@kernel()
def set_gaps(
    ranges: np.ndarray,
    directions: np.ndarray,
    beams: np.ndarray,
    cluster_gap: float,
    min_incidence: float,
    gaps: np.ndarray,
) -> None:
    """Write for each point the distance from the previous one above which a new cluster begins (m).

    Borges and Aldon, "Line extraction in 2D range images for mobile robotics" (2004): on a wall
    that a beam hits at `min_incidence` (rad) the next point is r sin(step) / sin(min_incidence -
    step) away, at a range r and an angle `step` between the beams. So a wall is not split where
    points are sparse: far away, or with a coarse laser. Ours is that points nearer than
    `cluster_gap`, which replaces the noise in their equation, are never split, and that the rule
    holds only between neighbouring beams: a missing beam between two others saw past the wall.
    """
    growth = 0.0
    if min_incidence > 0.0 and directions.shape[0] > 1:
        sine = directions[0, 0] * directions[1, 1] - directions[0, 1] * directions[1, 0]
        step = np.arcsin(min(abs(sine), 1.0))
        # With coarser lasers a gap would be wider than the range itself: such points may be on two
        # walls as well as on one, and only `cluster_gap` is used.
        if step < 0.5 * min_incidence:
            growth = np.sin(step) / np.sin(min_incidence - step)
    for i in range(beams.shape[0]):
        gaps[i] = cluster_gap
        if i > 0 and beams[i] == beams[i - 1] + 1:
            nearer = min(ranges[beams[i]], ranges[beams[i - 1]])
            gaps[i] = max(cluster_gap, growth * nearer)


@kernel()
def segment_points(
    points: np.ndarray,
    count: int,
    gaps: np.ndarray,
    cluster_size: float,
    break_height: float,
    significance: float,
    stack: np.ndarray,
    spans: np.ndarray,
) -> int:
    """Cluster the points and break the clusters; return the number of spans (steps 2 and 3).

    Row k of `spans` is the first point, the last point and the cluster of span k, in the order of
    the scan. Spans broken from one cluster share the break point. A cluster is broken where a point
    is `break_height` from its chord (m) and, ours, where it is bent (`find_bend`, if `significance`
    is above 0). `stack` (count + 1, 2) int64 is a scratch buffer.
    """
    found, cluster, start = 0, 0, 0
    for i in range(1, count + 1):
        if i < count:
            dx, dy = points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1]
            if dx * dx + dy * dy <= gaps[i] * gaps[i]:
                continue
        stack[0, 0], stack[0, 1] = start, i - 1
        depth = 1
        while depth > 0:
            depth -= 1
            first, last = stack[depth, 0], stack[depth, 1]
            dx = points[last, 0] - points[first, 0]
            dy = points[last, 1] - points[first, 1]
            middle, height = _farthest_from_chord(points, first, last)
            # A closed outline has a short chord and a large height; the larger counts as its size.
            if height <= break_height or max(np.sqrt(dx * dx + dy * dy), height) <= cluster_size:
                middle = -1
                if significance > 0.0:
                    middle = find_bend(points, first, last, significance)
            if middle >= 0:
                stack[depth, 0], stack[depth, 1] = middle, last
                stack[depth + 1, 0], stack[depth + 1, 1] = first, middle
                depth += 2
            else:
                spans[found, 0], spans[found, 1], spans[found, 2] = first, last, cluster
                found += 1
        cluster += 1
        start = i
    return found


@kernel()
def _farthest_from_chord(points: np.ndarray, first: int, last: int) -> tuple[int, float]:
    """Return the point between `first` and `last` farthest from their chord, and its distance."""
    x0, y0 = points[first, 0], points[first, 1]
    dx, dy = points[last, 0] - x0, points[last, 1] - y0
    square = dx * dx + dy * dy
    best, height = first, 0.0
    for i in range(first + 1, last):
        x, y = points[i, 0] - x0, points[i, 1] - y0
        h = abs(dx * y - dy * x) if square > 0.0 else x * x + y * y
        if h > height:
            best, height = i, h
    return best, height / np.sqrt(square) if square > 0.0 else np.sqrt(height)
