"""Looking for the turn under which two views agree best.

This is ours. Recognition (algorithm 1) supposes that the odometer's turn is right to 5°; in
real logs it often is not.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import TURN_STEP, Limits
from albot_core.matching.lines import beside, moved_ends, wrap
from albot_core.sensing.surfaces import NO_EDGE

LINE_GAP = 0.30
"""A wall is taken for the remembered one when it runs no farther than this beside it (m)."""
LINE_VOTE = 0.5
"""How much a wall that lies where it is remembered counts beside a landmark."""


_unmoved = scratch(3)


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
    """Vote for the turns low..high that bring a landmark's points onto a remembered one's."""
    for end in range(2):
        if seen_edges[end] == NO_EDGE or wall_edges[end] == NO_EDGE:
            continue
        x, y = seen[2 * end], seen[2 * end + 1]
        ex, ey = wall[2 * end], wall[2 * end + 1]
        for b in range(low, high + 1):
            cos, sin = turns[b, 0], turns[b, 1]
            dx, dy = cos * x - sin * y - ex, sin * x + cos * y - ey
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
    own: np.ndarray,
) -> None:
    """Vote for the turns low..high that lay a surface along a remembered one.

    How far it runs beside is measured at the turn that aligns the two, `aligned` steps.
    """
    middle = min(max(int(aligned + 0.5), 0), turns.shape[0] - 1)
    unmoved = _unmoved()
    unmoved[0] = unmoved[1] = unmoved[2] = 0.0
    aside = beside(wall, moved_ends(seen, unmoved, turns[middle, 0], turns[middle, 1]), seen[4])
    if aside >= LINE_GAP:
        return
    vote = LINE_VOTE * (1.0 - (aside / LINE_GAP) ** 2)
    for b in range(low, high + 1):
        turned = (b - aligned) * TURN_STEP / angle
        own[b] = max(own[b], vote * (1.0 - turned * turned))


@kernel()
def likeliest_turn(
    seen: np.ndarray,
    seen_edges: np.ndarray,
    expected: np.ndarray,
    edges: np.ndarray,
    limits: Limits,
    room: np.ndarray,
) -> float:
    """The turn (rad) to add to the odometer's under which most surfaces agree.

    Every surface seen votes for the turns that bring it onto an expected one, a landmark
    by its points and a wall by its line, each the more the better it fits. `room` (2, turns) is
    to count in.
    """
    bins = limits.turns.shape[0]
    votes, own = room[0], room[1]
    for b in range(bins):
        votes[b] = -limits.turns[b, 2]
    for k in range(seen.shape[0]):
        _vote(seen[k], seen_edges[k], expected, edges, limits, own)
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
    ends: np.ndarray,
    expected: np.ndarray,
    edges: np.ndarray,
    limits: Limits,
    own: np.ndarray,
) -> None:
    """Let a surface seen vote for the turns that bring it onto an expected one."""
    turns, angle, gap = limits.turns, limits.landmark_angle, limits.landmark_gap
    bins = turns.shape[0]
    for b in range(bins):
        own[b] = 0.0
    for q in range(expected.shape[0]):
        if seen[6] * expected[q, 6] + seen[7] * expected[q, 7] < limits.turn_cosine:
            continue
        aligned = wrap(expected[q, 5] - seen[5]) / TURN_STEP + bins // 2
        low = max(int(np.ceil(aligned - angle / TURN_STEP)), 0)
        high = min(int(np.floor(aligned + angle / TURN_STEP)), bins - 1)
        if low <= high:
            wall = expected[q]
            _vote_by_points(seen, ends, wall, edges[q], turns, low, high, gap, own)
            _vote_by_line(seen, wall, turns, aligned, low, high, angle, own)
