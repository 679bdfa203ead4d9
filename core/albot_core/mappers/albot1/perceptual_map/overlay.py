"""Geometry of algorithm 3: what a view covers, and which surfaces show the same wall.

All surfaces are in the map's frame (m); `in_map` (n, 4) are those of the view. Compiled.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.segment_kernels import nearest_share
from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.matching.lines import line_length


@kernel(arrays=True)
def view_boundary(in_map: np.ndarray, pose: np.ndarray, with_robot: bool) -> np.ndarray:
    """Return the view's boundary (corners, 2), its surfaces' ends in order (Alg. 3, line 7).

    The thesis joins the ends alone. With `with_robot` the robot's position is a corner, too.
    """
    count = in_map.shape[0]
    polygon = np.empty((2 * count + 1, 2))
    for k in range(count):
        polygon[2 * k, 0], polygon[2 * k, 1] = in_map[k, 0], in_map[k, 1]
        polygon[2 * k + 1, 0], polygon[2 * k + 1, 1] = in_map[k, 2], in_map[k, 3]
    polygon[2 * count, 0], polygon[2 * count, 1] = pose[0], pose[1]
    # An empty view still has the position from which it was taken.
    return polygon if with_robot or count == 0 else polygon[: 2 * count]


@kernel()
def box_around(polygon: np.ndarray, margin: float, box: np.ndarray) -> None:
    """Write the bounding box (x_min, y_min, x_max, y_max) of the polygon, enlarged by `margin`."""
    box[0] = box[1] = np.inf
    box[2] = box[3] = -np.inf
    for i in range(polygon.shape[0]):
        for axis in range(2):
            box[axis] = min(box[axis], polygon[i, axis] - margin)
            box[2 + axis] = max(box[2 + axis], polygon[i, axis] + margin)


@kernel()
def is_covered(polygon: np.ndarray, box: np.ndarray, margin: float, x: float, y: float) -> bool:
    """Return whether a point is inside the polygon or within `margin` of its boundary.

    `box` bounds all such points (x_min, y_min, x_max, y_max).
    """
    if x < box[0] or y < box[1] or x > box[2] or y > box[3]:
        return False
    return _is_inside(polygon, x, y) or _is_at_boundary(polygon, margin, x, y)


@kernel()
def _is_inside(polygon: np.ndarray, x: float, y: float) -> bool:
    """Return whether a point is inside the polygon (even-odd rule)."""
    inside = False
    corners = polygon.shape[0]
    ax, ay = polygon[corners - 1, 0], polygon[corners - 1, 1]
    for i in range(corners):
        bx, by = polygon[i, 0], polygon[i, 1]
        # Does a ray from the point along +x cross the edge? Computed without a division.
        if (by > y) != (ay > y) and ((x - bx) * (ay - by) < (ax - bx) * (y - by)) == (ay > by):
            inside = not inside
        ax, ay = bx, by
    return inside


@kernel()
def _is_at_boundary(polygon: np.ndarray, margin: float, x: float, y: float) -> bool:
    """Return whether a point is within `margin` of the polygon's boundary (m)."""
    corners = polygon.shape[0]
    # A little more than the margin, so that no edge is left out because of rounding.
    reach = margin + 1e-9
    ax, ay = polygon[corners - 1, 0] - x, polygon[corners - 1, 1] - y
    for i in range(corners):
        bx, by = polygon[i, 0] - x, polygon[i, 1] - y
        aside = min(ax, bx) > reach or max(ax, bx) < -reach
        aside = aside or min(ay, by) > reach or max(ay, by) < -reach
        if not aside and _comes_near(polygon, i, margin, x, y):
            return True
        ax, ay = bx, by
    return False


@kernel()
def _comes_near(polygon: np.ndarray, corner: int, margin: float, x: float, y: float) -> bool:
    """Return whether the polygon's edge that ends at a corner is within `margin` of a point (m)."""
    before = corner - 1 if corner > 0 else polygon.shape[0] - 1
    ax, ay, bx, by = (
        polygon[before, 0],
        polygon[before, 1],
        polygon[corner, 0],
        polygon[corner, 1],
    )
    share = nearest_share(x, y, ax, ay, bx, by)
    dx, dy = x - ax - share * (bx - ax), y - ay - share * (by - ay)
    return bool(dx * dx + dy * dy <= margin * margin)


@kernel()
def same_wall(
    old: np.ndarray, in_map: np.ndarray, is_used: np.ndarray, limits: Albot1Limits
) -> int:
    """Return the unused surface of the view that shows the same wall as the old one, or -1.

    It has nearly the same direction, lies beside the old one or end to end with it, and is the
    nearest such surface.
    """
    length = line_length(old)
    x0, y0 = old[0], old[1]
    ux, uy = (old[2] - x0) / length, (old[3] - y0) / length
    steepest = np.tan(limits.landmark_angle)
    best, found = limits.landmark_gap, -1
    for k in range(in_map.shape[0]):
        if is_used[k]:
            continue
        first_x, first_y = in_map[k, 0] - x0, in_map[k, 1] - y0
        last_x, last_y = in_map[k, 2] - x0, in_map[k, 3] - y0
        first, last = ux * first_x + uy * first_y, ux * last_x + uy * last_y
        first_aside, last_aside = ux * first_y - uy * first_x, ux * last_y - uy * last_x
        if last <= first or abs(last_aside - first_aside) >= steepest * (last - first):
            continue
        if first > length + limits.landmark_gap or last < -limits.landmark_gap:
            continue
        aside = 0.5 * abs(first_aside + last_aside)
        if aside < best:
            best, found = aside, k
    return found


@kernel()
def extend_surface(
    new: np.ndarray, old: np.ndarray, outer: int, keeps_end: bool, out: np.ndarray
) -> bool:
    """Write the new surface, extended to the old one's outer end; return whether it got longer.

    With `keeps_end` it ends at the old end. Without, it is extended in its own direction as far as
    that end, so that a short new surface rotates a long old wall.
    """
    length = line_length(new)
    ux, uy = (new[2] - new[0]) / length, (new[3] - new[1]) / length
    x, y = old[2 * outer], old[2 * outer + 1]
    along = (x - new[0]) * ux + (y - new[1]) * uy
    for i in range(4):
        out[i] = new[i]
    if (outer == 0 and along >= 0.0) or (outer == 1 and along <= length):
        return False
    out[2 * outer] = x if keeps_end else new[0] + along * ux
    out[2 * outer + 1] = y if keeps_end else new[1] + along * uy
    return True


@kernel()
def bend_height(new: np.ndarray, drawn_out: np.ndarray, outer: int) -> float:
    """Return the distance of the new surface's end `outer` from the line of `drawn_out` (m)."""
    dx, dy = drawn_out[2] - drawn_out[0], drawn_out[3] - drawn_out[1]
    x, y = new[2 * outer] - drawn_out[0], new[2 * outer + 1] - drawn_out[1]
    return float(abs(dx * y - dy * x) / np.sqrt(dx * dx + dy * dy))


@kernel()
def cut_at_boundary(
    old: np.ndarray,
    outer: int,
    polygon: np.ndarray,
    box: np.ndarray,
    margin: float,
    out: np.ndarray,
) -> None:
    """Write the part of the old surface at its outer end that the polygon does not cover."""
    kept, lost = 1.0, 0.0  # fractions of the way from the covered end to the outer one
    inner = 1 - outer
    ix, iy = old[2 * inner], old[2 * inner + 1]
    run_x, run_y = old[2 * outer] - ix, old[2 * outer + 1] - iy
    for _ in range(12):  # to a 4000th of its length
        middle = 0.5 * (kept + lost)
        if is_covered(polygon, box, margin, ix + middle * run_x, iy + middle * run_y):
            lost = middle
        else:
            kept = middle
    for i in range(4):
        out[i] = old[i]
    out[2 * inner], out[2 * inner + 1] = ix + kept * run_x, iy + kept * run_y
