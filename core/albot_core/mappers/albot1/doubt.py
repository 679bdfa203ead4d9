"""Whether two views contradict each other: what tells a robot that it was moved. Compiled.

This is ours. However new the ground is, a wall of one view is either hidden in the other or
seen there; where the other view sees past it, one of the two is not from where it is
believed to be. Between views of a driven robot hardly any wall is contradicted, on logs too;
between views from two places half of them are.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Limits
from albot_core.mappers.albot1.recognition import seen_along
from albot_core.mappers.albot1.sight import Sight
from albot_core.matching.lines import length_of, wrap

SPACING = 0.25
"""Walls are looked at in points so far apart (m)."""
TOLERANCE = 0.5
"""Where a wall lies and where it is seen may differ by so much (m)."""
FEWEST_POINTS = 12
"""With fewer points to go by nothing is said."""


@kernel()
def _range_along(view: Sight, x: float, y: float) -> float:
    """How many vectors (x, y) away the first surface along them is; NaN where none is seen."""
    nearest = np.inf
    for k in range(view.size[0]):
        ax, ay = view.surfaces[k, 0], view.surfaces[k, 1]
        bx, by = view.surfaces[k, 2], view.surfaces[k, 3]
        if ax * y - ay * x < 0.0 or x * by - y * bx < 0.0:
            continue  # surfaces run from right to left: not between the two ends
        across = x * (by - ay) - y * (bx - ax)
        if across > 0.0:
            along = (ax * (by - ay) - ay * (bx - ax)) / across
            if 0.0 < along < nearest:
                nearest = along
    return nearest if nearest < np.inf else np.nan


_wall, _pose = scratch(4), scratch(3)


@kernel()
def _look_past(view: Sight, walls: Sight, pose: np.ndarray, limits: Limits) -> tuple[int, int]:
    """In how many points the view sees the walls, and in how many it sees past them.

    `pose` is that of the view in the other's frame.
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    wall, met, passed = _wall(), 0, 0
    for k in range(walls.size[0]):
        length = length_of(walls.surfaces[k])
        if length < limits.landmark_length:
            continue
        seen_along(pose, cos, sin, walls.surfaces[k], wall)
        parts = max(int(length / SPACING), 1)
        for part in range(parts):
            share = (part + 0.5) / parts
            x = wall[0] + share * (wall[2] - wall[0])
            y = wall[1] + share * (wall[3] - wall[1])
            past = (_range_along(view, x, y) - 1.0) * np.sqrt(x * x + y * y)
            if past > TOLERANCE:
                passed += 1
            elif past >= -TOLERANCE:
                met += 1
    return met, passed


@kernel()
def contradiction(one: Sight, other: Sight, limits: Limits) -> float:
    """The share of the walls of two views, of those in view from both, that contradict."""
    total = against = 0
    for turn in range(2):
        view, walls = (one, other) if turn == 0 else (other, one)
        pose = _pose()
        cos, sin = np.cos(walls.pose[2]), np.sin(walls.pose[2])
        dx, dy = view.pose[0] - walls.pose[0], view.pose[1] - walls.pose[1]
        pose[0], pose[1] = cos * dx + sin * dy, cos * dy - sin * dx
        pose[2] = wrap(view.pose[2] - walls.pose[2])
        met, passed = _look_past(view, walls, pose, limits)
        total, against = total + met + passed, against + passed
    return against / total if total >= FEWEST_POINTS else 0.0
