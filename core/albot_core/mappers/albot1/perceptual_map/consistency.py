"""The consistency check: two views that contradict each other show that a robot was moved.

This is ours. Also on new ground, a wall of one view is either hidden in the other view or seen
there. Where the other view sees past the wall, one of the two was not taken where the robot
believes. Between views of a driven robot hardly any wall is contradicted, also on logs; between
views from two places half of them are. Recognised landmarks are no evidence: some of another room's
walls fit by chance. Compiled.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.frames import (
    compose_pose,
    copy_pose,
    relative_pose,
    seen_from,
)
from albot_core.mappers.albot1.perceptual_map.memory import LocatedView
from albot_core.mappers.albot1.perceptual_map.odometer_error import HAS_MOVED, shift_scale
from albot_core.matching.lines import line_length

CONTRADICTED = 0.45
"""Two views are inconsistent if a larger share of their walls contradicts…"""
CONTRADICTING = 3.0
"""…or if that share is more than this many times the share of the view that lies on expected walls.
In both cases the match must be unsure."""
ODD_SHIFT = 7.0
"""A match is doubted if it differs from the odometer's motion by more than this many times the
usual error. Its view is inconsistent if, at the pose that the odometer gives, a larger share of
walls contradicts than the share that lies on expected walls at the matched pose."""
SPACING = 0.25
"""Distance between the points at which walls are sampled (m)."""
TOLERANCE = 0.5
"""A wall agrees with a view that sees a surface within this distance of it, along the ray (m)."""
MIN_POINTS = 12
"""With fewer points in view from both poses, two views count as consistent."""


@kernel()
def inconsistent_views(
    before: int,
    agreement: float,
    motion: np.ndarray,
    odometer: np.ndarray,
    previous: LocatedView,
    current: LocatedView,
    limits: Albot1Limits,
) -> int:
    """Return how many of the latest views in a row are inconsistent with those before them.

    A view that contradicts the previous one is inconsistent. The next view is inconsistent as well
    if it agrees with that view. If it does not, the view between was misread, and the count is 0
    again.

    Args:
        before: The count before the current view.
        agreement: The share of the current view's walls that lies on expected walls.
        motion: The robot's motion between the two views, as the odometer reports it.
        odometer: The learnt errors of the odometer.
        previous: The view before the current one.
        current: The current view, at its matched pose.
        limits: All thresholds.
    """
    if before > 0:
        return 0 if inconsistency(previous, current, limits) > CONTRADICTED else before + 1
    if agreement >= limits.unsure:
        return 0
    allowed = min(CONTRADICTED, CONTRADICTING * agreement)
    if inconsistency(previous, current, limits) > allowed:
        return 1
    return _is_led_astray(agreement, motion, odometer, previous, current, limits)


_matched = scratch(3)


@kernel()
def _is_led_astray(
    agreement: float,
    motion: np.ndarray,
    odometer: np.ndarray,
    previous: LocatedView,
    current: LocatedView,
    limits: Albot1Limits,
) -> int:
    """Return 1 if the match is oddly far from the odometer's pose, where the views contradict."""
    if odometer[HAS_MOVED] == 0.0:
        return 0
    matched = _matched()
    copy_pose(current.pose, matched)
    compose_pose(previous.pose, motion, current.pose)
    dx, dy = matched[0] - current.pose[0], matched[1] - current.pose[1]
    is_odd = np.sqrt(dx * dx + dy * dy) > ODD_SHIFT * shift_scale(odometer, limits)
    contradicting = inconsistency(previous, current, limits) if is_odd else 0.0
    copy_pose(matched, current.pose)
    return 1 if is_odd and contradicting > agreement else 0


@kernel()
def inconsistency(one: LocatedView, other: LocatedView, limits: Albot1Limits) -> float:
    """Return the share of contradicting walls among those of two views in view from both."""
    total = against = 0
    for turn in range(2):
        view, walls = (one, other) if turn == 0 else (other, one)
        pose = _pose()
        relative_pose(walls.pose, view.pose, pose)
        agreeing, seen_past = _compare(view, walls, pose, limits)
        total, against = total + agreeing + seen_past, against + seen_past
    return against / total if total >= MIN_POINTS else 0.0


_wall, _pose = scratch(4), scratch(3)


@kernel()
def _compare(
    view: LocatedView, walls: LocatedView, pose: np.ndarray, limits: Albot1Limits
) -> tuple[int, int]:
    """Return at how many points the view sees the walls, and at how many it sees past them.

    `pose` is the view's pose in the frame of the walls.
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    wall, agreeing, seen_past = _wall(), 0, 0
    for k in range(walls.size[0]):
        length = line_length(walls.surfaces[k])
        if length < limits.landmark_length:
            continue
        seen_from(pose, cos, sin, walls.surfaces[k], wall)
        parts = max(int(length / SPACING), 1)
        for part in range(parts):
            share = (part + 0.5) / parts
            x = wall[0] + share * (wall[2] - wall[0])
            y = wall[1] + share * (wall[3] - wall[1])
            past = (range_along(view.surfaces[: view.size[0]], x, y) - 1.0) * np.sqrt(x * x + y * y)
            if past > TOLERANCE:
                seen_past += 1
            elif past >= -TOLERANCE:
                agreeing += 1
    return agreeing, seen_past


@kernel()
def range_along(surfaces: np.ndarray, x: float, y: float) -> float:
    """Return the distance to the first of surfaces (n, 4) along (x, y), in lengths of that vector.

    The ray starts at the origin. Returns NaN if it meets no surface.
    """
    nearest = np.inf
    for k in range(surfaces.shape[0]):
        ax, ay, bx, by = surfaces[k, 0], surfaces[k, 1], surfaces[k, 2], surfaces[k, 3]
        if ax * y - ay * x < 0.0 or x * by - y * bx < 0.0:
            continue  # surfaces run from right to left: not between the two ends
        across = x * (by - ay) - y * (bx - ax)
        if across > 0.0:
            along = (ax * (by - ay) - ay * (bx - ax)) / across
            if 0.0 < along < nearest:
                nearest = along
    return nearest if nearest < np.inf else np.nan
