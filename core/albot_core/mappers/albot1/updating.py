"""Laying a view over the perceptual map (algorithm 3)."""

from __future__ import annotations

import numpy as np
from numba import types

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Limits
from albot_core.mappers.albot1.memory import (
    ALIVE,
    VISIT,
    Memory,
    add_surface,
    move_surface,
    remove_surface,
)
from albot_core.mappers.albot1.search import surfaces_ending_in
from albot_core.mappers.albot1.sight import NOT_RECOGNIZED, Sight
from albot_core.mappers.albot1.visits import meet_again
from albot_core.matching.lines import length_of
from albot_core.sensing.surfaces import NO_EDGE

SHORTEST = 0.10
"""What is left of a surface after a cut is forgotten below this length (m)."""


@kernel()
def placed(pose: np.ndarray, surface: np.ndarray, out: np.ndarray) -> None:
    """Write into `out` the surface seen from `pose`, in the map's frame."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    for end in range(2):
        x, y = surface[2 * end], surface[2 * end + 1]
        out[2 * end] = pose[0] + cos * x - sin * y
        out[2 * end + 1] = pose[1] + sin * x + cos * y


@kernel(arrays=True)
def view_polygon(laid: np.ndarray, pose: np.ndarray, eye: bool) -> np.ndarray:
    """The view's boundary (corners, 2): the surfaces' ends in the order seen (Alg. 3, line 7).

    With `eye` the robot's own place closes it.
    """
    count = laid.shape[0]
    polygon = np.empty((2 * count + 1, 2))
    for k in range(count):
        polygon[2 * k, 0], polygon[2 * k, 1] = laid[k, 0], laid[k, 1]
        polygon[2 * k + 1, 0], polygon[2 * k + 1, 1] = laid[k, 2], laid[k, 3]
    polygon[2 * count, 0], polygon[2 * count, 1] = pose[0], pose[1]
    # A view of nothing still has the place that it is seen from.
    return polygon if eye or count == 0 else polygon[: 2 * count]


@kernel()
def box_around(polygon: np.ndarray, margin: float, box: np.ndarray) -> None:
    """Write the box (x_min, y_min, x_max, y_max) that leaves `margin` around the polygon."""
    box[0] = box[1] = np.inf
    box[2] = box[3] = -np.inf
    for i in range(polygon.shape[0]):
        for axis in range(2):
            box[axis] = min(box[axis], polygon[i, axis] - margin)
            box[2 + axis] = max(box[2 + axis], polygon[i, axis] + margin)


@kernel()
def is_inside(polygon: np.ndarray, x: float, y: float) -> bool:
    """Whether a point is inside the polygon (even-odd rule)."""
    inside = False
    corners = polygon.shape[0]
    ax, ay = polygon[corners - 1, 0], polygon[corners - 1, 1]
    for i in range(corners):
        bx, by = polygon[i, 0], polygon[i, 1]
        # Does a ray from the point along +x cross the edge? Written without a division.
        if (by > y) != (ay > y) and ((x - bx) * (ay - by) < (ax - bx) * (y - by)) == (ay > by):
            inside = not inside
        ax, ay = bx, by
    return inside


@kernel()
def is_at_boundary(polygon: np.ndarray, margin: float, x: float, y: float) -> bool:
    """Whether a point is within `margin` of the polygon's boundary (m)."""
    corners = polygon.shape[0]
    # A little more than the margin, so that rounding passes over no edge.
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
    """Whether the polygon's edge that ends at a corner comes within `margin` of a point (m)."""
    before = corner - 1 if corner > 0 else polygon.shape[0] - 1
    ax, ay = polygon[before, 0], polygon[before, 1]
    run_x, run_y = polygon[corner, 0] - ax, polygon[corner, 1] - ay
    square = run_x * run_x + run_y * run_y
    along = 0.0
    if square > 0.0:
        along = min(1.0, max(0.0, ((x - ax) * run_x + (y - ay) * run_y) / square))
    dx, dy = x - ax - along * run_x, y - ay - along * run_y
    return bool(dx * dx + dy * dy <= margin * margin)


@kernel()
def is_covered(polygon: np.ndarray, box: np.ndarray, margin: float, x: float, y: float) -> bool:
    """Whether a point is inside the polygon or within `margin` of its boundary.

    `box` bounds all such points (x_min, y_min, x_max, y_max).
    """
    if x < box[0] or y < box[1] or x > box[2] or y > box[3]:
        return False
    return is_inside(polygon, x, y) or is_at_boundary(polygon, margin, x, y)


@kernel()
def counterpart(old: np.ndarray, laid: np.ndarray, taken: np.ndarray, limits: Limits) -> int:
    """The surface of the view that shows the same wall as the old one, or -1.

    The same wall: nearly the same direction, side by side or end to end, and the nearest.
    """
    length = length_of(old)
    x0, y0 = old[0], old[1]
    ux, uy = (old[2] - x0) / length, (old[3] - y0) / length
    steepest = np.tan(limits.landmark_angle)
    best, found = limits.landmark_gap, -1
    for k in range(laid.shape[0]):
        if taken[k]:
            continue
        first_x, first_y = laid[k, 0] - x0, laid[k, 1] - y0
        last_x, last_y = laid[k, 2] - x0, laid[k, 3] - y0
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
def extended(new: np.ndarray, old: np.ndarray, outer: int, out: np.ndarray) -> bool:
    """Write the new surface drawn out to the old one's outer end; false where it reaches it."""
    length = length_of(new)
    ux, uy = (new[2] - new[0]) / length, (new[3] - new[1]) / length
    along = (old[2 * outer] - new[0]) * ux + (old[2 * outer + 1] - new[1]) * uy
    for i in range(4):
        out[i] = new[i]
    if (outer == 0 and along >= 0.0) or (outer == 1 and along <= length):
        return False
    out[2 * outer] = new[0] + along * ux
    out[2 * outer + 1] = new[1] + along * uy
    return True


@kernel()
def _cut(
    old: np.ndarray,
    outer: int,
    polygon: np.ndarray,
    box: np.ndarray,
    margin: float,
    out: np.ndarray,
) -> None:
    """Write the part of the old surface that the polygon does not cover at its outer end."""
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


@kernel()
def _look_whose(
    memory: Memory,
    slot: int,
    laid: np.ndarray,
    nothing: np.ndarray,
    limits: Limits,
    covered: bool,
) -> None:
    """Before a covered surface goes, see to which visit it belongs, if the view has it too.

    This is how a familiar place is suspected (section 4.1.2).
    """
    old = memory.surfaces[slot]
    if not covered or memory.marks[slot] == memory.counts[VISIT]:
        return
    if length_of(old) < limits.landmark_length:
        return
    if counterpart(old, laid, nothing, limits) >= 0:
        meet_again(memory, slot)


_bounds = scratch(4)


@kernel(arrays=True)
def update_map(memory: Memory, sight: Sight, limits: Limits) -> None:
    """Algorithm 3: lay the view, seen from `sight.pose`, over the map.

    Surfaces with both ends inside the view's boundary are removed. Of those with one end
    inside the part outside stays: drawn together with the view's surface of the same wall
    where there is one, cut at the boundary where there is none. Then the rest of the view
    is added, and all its landmarks are recognised ones (algorithm 4, lines 17 and 22).
    """
    count = sight.size[0]
    laid = np.empty((count, 4))
    _place_all(sight, laid)
    polygon = view_polygon(laid, sight.pose, limits.eye_in_boundary)
    box, found = _bounds(), np.empty(2 * memory.counts[ALIVE] + 1, np.int64)
    box_around(polygon, limits.margin, box)
    nearby = found[: surfaces_ending_in(memory, box, found)]
    slots = np.empty(count, np.int64)
    taken, nothing = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    _lay(memory, sight, limits, laid, polygon, box, nearby, slots, taken, nothing)


@kernel()
def _place_all(sight: Sight, laid: np.ndarray) -> None:
    """Write a view's surfaces, in the map's frame, into `laid`."""
    for k in range(sight.size[0]):
        placed(sight.pose, sight.surfaces[k], laid[k])


_changed, _edges = scratch(4), scratch(2, kind=types.int8)


@kernel()
def _lay(
    memory: Memory,
    sight: Sight,
    limits: Limits,
    laid: np.ndarray,
    polygon: np.ndarray,
    box: np.ndarray,
    nearby: np.ndarray,
    slots: np.ndarray,
    taken: np.ndarray,
    nothing: np.ndarray,
) -> None:
    """Lay a view, whose surfaces are `laid` within a boundary, over what is nearby.

    `slots` and `taken`, which is all false as `nothing` is, have an element for each of them.
    """
    count = sight.size[0]
    changed, edges = _changed(), _edges()
    for slot in nearby:
        old = memory.surfaces[slot]
        first = is_covered(polygon, box, limits.margin, old[0], old[1])
        second = is_covered(polygon, box, limits.margin, old[2], old[3])
        _look_whose(memory, slot, laid, nothing, limits, first or second)
        if first and second:  # Alg. 3, line 9
            remove_surface(memory, slot)
        elif first or second:  # Alg. 3, line 11
            outer = 1 if first else 0
            k = counterpart(old, laid, taken, limits)
            if k < 0:
                _cut(old, outer, polygon, box, limits.margin, changed)
                edges[outer], edges[1 - outer] = memory.edges[slot, outer], NO_EDGE
                if length_of(changed) < SHORTEST:
                    remove_surface(memory, slot)
                else:
                    move_surface(memory, slot, changed, edges)
                continue
            edges[0], edges[1] = sight.edges[k, 0], sight.edges[k, 1]
            if extended(laid[k], old, outer, changed):
                edges[outer] = memory.edges[slot, outer]
                # The end in view is no longer the end in the map.
                sight.edges[k, outer] = NO_EDGE
            move_surface(memory, slot, changed, edges)
            memory.marks[slot] = memory.counts[VISIT]
            slots[k] = slot
            taken[k] = True
    for k in range(count):  # Alg. 3, line 15
        if not taken[k]:
            slots[k] = add_surface(memory, laid[k], sight.edges[k])
        sight.slots[k] = slots[k] if sight.landmark[k] else NOT_RECOGNIZED
