"""Recognising what is remembered nearby and localising by all of it at once.

This is ours, in place of algorithms 1 and 2. The thesis follows landmarks from view to view
under the odometer's turn, and one of them localises the robot. Here the turn is first looked
for (`turning`). Then all that the map holds nearby and that is seen again says together
where the robot is, landmarks by their occluding and corner points and plain walls by their
lines. Only what is remembered around the robot takes part, and nothing remembered is
corrected by it.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Limits
from albot_core.mappers.albot1.memory import NEVER, VISIT, Memory
from albot_core.mappers.albot1.outlook import (
    Outlook,
    describe_expected,
    describe_remembered,
    describe_seen,
)
from albot_core.mappers.albot1.sight import NOT_RECOGNIZED, Sight
from albot_core.mappers.albot1.turning import LINE_GAP, likeliest_turn
from albot_core.mappers.albot1.visits import meet_again
from albot_core.matching.least_squares import held, pulled_by_line, pulled_by_point, solved
from albot_core.matching.lines import beside, moved_ends, wrap
from albot_core.sensing.surfaces import NO_EDGE

ROUNDS, ITERATIONS = 3, 2
"""How often surfaces are matched anew, and the Gauss-Newton steps after each."""

MEETING_GAP, MEETING_COSINE = 1.5, np.cos(np.radians(15.0))
"""A wall this near to one of an earlier visit (m), and turned no more (15°, by its cosine), may be
it: so far a map drifts on its way round. It arouses a suspicion and no more."""

POINT, SIDE, LINE = 0, 1, 2
"""Columns of `matches`: the row of `expected` recognised by an end, which end, and the row
recognised by its line; -1 where none."""


@kernel()
def _turned(row: np.ndarray, cos: float, sin: float) -> tuple[float, float]:
    """The unit vector along a surface after a turn."""
    return cos * row[6] - sin * row[7], sin * row[6] + cos * row[7]


@kernel()
def _match(
    seen: np.ndarray,
    seen_edges: np.ndarray,
    expected: np.ndarray,
    edges: np.ndarray,
    correction: np.ndarray,
    limits: Limits,
    matches: np.ndarray,
) -> int:
    """Match every surface seen to the nearest remembered point and line; count the points."""
    cos, sin = np.cos(correction[2]), np.sin(correction[2])
    points = 0
    for k in range(seen.shape[0]):
        ux, uy = _turned(seen[k], cos, sin)
        ends = moved_ends(seen[k], correction, cos, sin)
        point, side, line = -1, 0, -1
        nearest_gap, nearest_line = limits.landmark_gap**2, LINE_GAP
        for q in range(expected.shape[0]):
            if ux * expected[q, 6] + uy * expected[q, 7] <= limits.landmark_cosine:
                continue
            for end in range(2):
                dx = ends[2 * end] - expected[q, 2 * end]
                dy = ends[2 * end + 1] - expected[q, 2 * end + 1]
                gap = dx * dx + dy * dy
                # In this order, for few are near: what is rare is foreseen by the processor.
                if gap < nearest_gap and seen_edges[k, end] != NO_EDGE != edges[q, end]:
                    nearest_gap, point, side = gap, q, end
            aside = beside(expected[q], ends, seen[k, 4])
            if aside < nearest_line:
                nearest_line, line = aside, q
        matches[k, POINT], matches[k, SIDE], matches[k, LINE] = point, side, line
        points += point >= 0
    return points


@kernel()
def _adjust(
    seen: np.ndarray,
    expected: np.ndarray,
    matches: np.ndarray,
    limits: Limits,
    correction: np.ndarray,
) -> None:
    """Gauss-Newton on the correction, held by the odometer's motion and the likeliest turn."""
    for _ in range(ITERATIONS):
        cos, sin = np.cos(correction[2]), np.sin(correction[2])
        equations = held(correction, 1.0 / limits.motion_error**2, 1.0 / limits.turn_error**2)
        for k in range(seen.shape[0]):
            if matches[k, POINT] >= 0:
                wall, side = expected[matches[k, POINT]], matches[k, SIDE]
                equations = pulled_by_point(equations, side, seen[k], wall, correction, cos, sin)
            if matches[k, LINE] >= 0:
                wall = expected[matches[k, LINE]]
                equations = pulled_by_line(equations, seen[k], wall, correction, cos, sin)
        x, y, turn = solved(equations)
        correction[0] += x
        correction[1] += y
        correction[2] += turn


@kernel()
def _meet_earlier(
    memory: Memory,
    slots: np.ndarray,
    expected: np.ndarray,
    seen: np.ndarray,
    correction: np.ndarray,
) -> None:
    """Note which of the remembered surfaces are of earlier visits and may be in view."""
    cos, sin = np.cos(correction[2]), np.sin(correction[2])
    for q in range(expected.shape[0]):
        visit = memory.marks[slots[q]]
        if visit == memory.counts[VISIT] or memory.met[visit, 1] == NEVER:
            continue
        for k in range(seen.shape[0]):
            ux, uy = _turned(seen[k], cos, sin)
            if ux * expected[q, 6] + uy * expected[q, 7] <= MEETING_COSINE:
                continue
            ends = moved_ends(seen[k], correction, cos, sin)
            if beside(expected[q], ends, seen[k, 4]) < MEETING_GAP:
                meet_again(memory, slots[q])
                break


_correction = scratch(3)


@kernel()
def triangulate(
    memory: Memory,
    previous: Sight,
    current: Sight,
    motion: np.ndarray,
    limits: Limits,
    outlook: Outlook,
) -> int:
    """Move `current.pose` from where the odometer says to where the remembered surfaces say.

    Sets `current.slots` for the landmarks recognised there; returns their number.
    """
    kept = describe_seen(current, limits, outlook)
    which, seen_edges, seen = outlook.which[:kept], outlook.seen_edges[:kept], outlook.seen[:kept]
    kept = describe_expected(previous, motion, limits, outlook)
    edges, expected = outlook.edges[:kept], outlook.expected[:kept]
    turn = likeliest_turn(seen, seen_edges, expected, edges, limits, outlook.votes)
    current.pose[2] = wrap(current.pose[2] + turn)

    kept = describe_remembered(memory, current.pose, seen, limits, outlook)
    slots, edges, expected = outlook.slots[:kept], outlook.edges[:kept], outlook.expected[:kept]
    correction, matches = _correction(), outlook.matches
    correction[0] = correction[1] = correction[2] = 0.0
    for _ in range(ROUNDS):
        _match(seen, seen_edges, expected, edges, correction, limits, matches)
        _adjust(seen, expected, matches, limits, correction)
    recognized = _match(seen, seen_edges, expected, edges, correction, limits, matches)

    for k in range(current.size[0]):
        current.slots[k] = NOT_RECOGNIZED
    for k in range(seen.shape[0]):
        if matches[k, POINT] >= 0:
            current.slots[which[k]] = slots[matches[k, POINT]]
    _meet_earlier(memory, slots, expected, seen, correction)
    cos, sin = np.cos(current.pose[2]), np.sin(current.pose[2])
    current.pose[0] += cos * correction[0] - sin * correction[1]
    current.pose[1] += sin * correction[0] + cos * correction[1]
    current.pose[2] = wrap(current.pose[2] + correction[2])
    return int(recognized)
