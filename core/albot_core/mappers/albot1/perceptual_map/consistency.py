"""The consistency check: whether two views contradict each other, as they do if a robot was moved.

This is ours. However new the ground is, a wall of one view is either hidden in the other or seen
there. Where the other view sees past it, one of the two was not taken where the robot believes.
Between views of a driven robot hardly any wall is contradicted, on logs too; between views from
two places half of them are. Recognised landmarks are no evidence: some of another room's walls fit
by chance. Compiled.
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
"""…or if that share is so many times the share of the view that lies on what is expected. The match
must be unsure, too."""
ODD_SHIFT = 7.0
"""A match that leads so many times farther than the odometer is usually off is doubted. The view is
then inconsistent, too, if more contradicts where the odometer says than lies on what is expected
where it was matched."""
SPACING = 0.25
"""Walls are sampled at points so far apart (m)."""
TOLERANCE = 0.5
"""Where a wall lies and where it is seen may differ by so much (m)."""
MIN_POINTS = 12
"""With fewer points in view from both, two views count as consistent."""


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
    """How many of the latest views in a row are inconsistent with what came before them.

    A view that contradicts the previous one is; the next is too if it agrees with that view. If
    it does not, the view between was misread, and the count is 0 again.

    Args:
        before: The count before the current view.
        agreement: The share of the current view's walls that lies on what is expected there.
        motion: The robot's motion between the two views, as the odometer reports it.
        odometer: What has been learnt of the odometer.
        previous: The view before it.
        current: The current view, where it was matched.
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
    """1 if the match is oddly far from where the odometer says, and the views contradict there."""
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
    """The share of the walls of two views, of those in view from both, that contradict."""
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
    """At how many points the view sees the walls, and at how many it sees past them.

    `pose` is that of the view in the frame of the walls.
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
    """How many vectors (x, y) away the first of surfaces (n, 4) along them is; NaN for none.

    They are seen from the origin.
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
