"""The likeliest turn between two views: all surfaces vote for the turns that bring them together.

This is ours (see `submap_matching`). Compiled.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.pose_kernels import rotate
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import TURN_STEP, Albot1Limits
from albot_core.matching.lines import beside, moved_ends, wrap
from albot_core.sensing.view import NO_EDGE

LINE_GAP = 0.30
"""A wall is taken for the remembered one if it runs no farther than this beside it (m)."""
LINE_VOTE = 0.5
"""How much a wall that lies where it is remembered counts beside a landmark."""
LARGEST_COST = 1.0
"""Votes that a turn costs at most: an odometer that slips may be off by any turn."""

_no_motion = scratch(3)


@kernel()
def likeliest_turn(
    seen: np.ndarray,
    seen_edges: np.ndarray,
    expected: np.ndarray,
    edges: np.ndarray,
    limits: Albot1Limits,
    scale: float,
    wide: float,
    buffer: np.ndarray,
) -> float:
    """The turn (rad) to add to the expected one under which most surfaces agree.

    Every surface seen votes for the turns that bring it onto an expected one, a landmark
    by its points and a wall by its line, each the more the better it fits. A turn other than the
    expected one costs the square of the difference by `scale` (rad), but LARGEST_COST at most.
    Surfaces are searched for `wide` times as far as usual. `buffer` (2, turns) is to count in.
    """
    bins = limits.turns.shape[0]
    votes, own = buffer[0], buffer[1]
    for b in range(bins):
        turned = (b - bins // 2) * TURN_STEP / scale
        votes[b] = -min(turned * turned, LARGEST_COST)
    for k in range(seen.shape[0]):
        _vote(seen[k], seen_edges[k], expected, edges, limits, wide, own)
        for b in range(bins):
            votes[b] += own[b]
    best = 0
    for b in range(bins):
        if votes[b] > votes[best]:
            best = b
    return float((best - bins // 2) * TURN_STEP)


@kernel()
def _vote(
    seen: np.ndarray,
    seen_edges: np.ndarray,
    expected: np.ndarray,
    edges: np.ndarray,
    limits: Albot1Limits,
    wide: float,
    own: np.ndarray,
) -> None:
    """Let a surface seen vote for the turns that bring it onto an expected one."""
    turns, angle, gap = limits.turns, limits.landmark_angle, wide * limits.landmark_gap
    bins = turns.shape[0]
    for b in range(bins):
        own[b] = 0.0
    for q in range(expected.shape[0]):
        if seen[6] * expected[q, 6] + seen[7] * expected[q, 7] < limits.turn_cosine:
            continue
        # Only turns that leave no more than `landmark_angle` between the two can be voted for.
        aligned = wrap(expected[q, 5] - seen[5]) / TURN_STEP + bins // 2
        low = max(int(np.ceil(aligned - angle / TURN_STEP)), 0)
        high = min(int(np.floor(aligned + angle / TURN_STEP)), bins - 1)
        if low <= high:
            wall = expected[q]
            _vote_by_points(seen, seen_edges, wall, edges[q], turns, low, high, gap, own)
            _vote_by_line(seen, wall, turns, aligned, low, high, angle, wide * LINE_GAP, own)


@kernel()
def _vote_by_points(
    seen: np.ndarray,
    seen_edges: np.ndarray,
    wall: np.ndarray,
    wall_edges: np.ndarray,
    turns: np.ndarray,
    low: int,
    high: int,
    gap: float,
    own: np.ndarray,
) -> None:
    """Vote for the turns low..high that bring a landmark's points onto an expected one's."""
    for end in range(2):
        if seen_edges[end] == NO_EDGE or wall_edges[end] == NO_EDGE:
            continue
        x, y = seen[2 * end], seen[2 * end + 1]
        ex, ey = wall[2 * end], wall[2 * end + 1]
        for b in range(low, high + 1):
            east, north = rotate(turns[b, 0], turns[b, 1], x, y)
            dx, dy = east - ex, north - ey
            own[b] = max(own[b], 1.0 - (dx * dx + dy * dy) / gap**2)


@kernel()
def _vote_by_line(
    seen: np.ndarray,
    wall: np.ndarray,
    turns: np.ndarray,
    aligned: float,
    low: int,
    high: int,
    angle: float,
    gap: float,
    own: np.ndarray,
) -> None:
    """Vote for the turns low..high that lay a surface along an expected one.

    How far it runs beside is measured at the turn that aligns the two, `aligned` steps.
    """
    middle = min(max(int(aligned + 0.5), 0), turns.shape[0] - 1)
    no_motion = _no_motion()
    no_motion[0] = no_motion[1] = no_motion[2] = 0.0
    aside = beside(wall, moved_ends(seen, no_motion, turns[middle, 0], turns[middle, 1]), seen[4])
    if aside >= gap:
        return
    vote = LINE_VOTE * (1.0 - (aside / gap) ** 2)
    for b in range(low, high + 1):
        turned = (b - aligned) * TURN_STEP / angle
        own[b] = max(own[b], vote * (1.0 - turned * turned))
