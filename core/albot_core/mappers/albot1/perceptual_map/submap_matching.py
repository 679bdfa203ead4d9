"""Matching the view with the local submap: where the robot is, by all that is nearby. Compiled.

This is ours, in place of algorithms 1 and 2. The thesis follows landmarks from view to view under
the odometer's turn, which it supposes to be right to 5°, and one landmark localises the robot. In
real logs the turn often is not so good. Here

1. all surfaces of the two views vote for the turn under which they agree best,
2. what the map holds nearby and what is seen are matched: landmarks by their occluding and corner
   points, plain walls by their lines,
3. Gauss-Newton steps on the pose draw the matched ones together, and they are matched anew.

Only what is remembered around the robot takes part, and nothing remembered is corrected.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.pose_kernels import rotate
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import TURN_STEP, Albot1Limits
from albot_core.mappers.albot1.perceptual_map.memory import (
    GATE,
    NEVER,
    NOT_RECOGNIZED,
    VISIT,
    LocatedView,
    PerceptualMap,
    count_reobserved,
)
from albot_core.mappers.albot1.perceptual_map.submap import (
    MatchBuffers,
    describe_expected,
    describe_remembered,
    describe_seen,
)
from albot_core.matching.least_squares import held, pulled_by_line, pulled_by_point, solved
from albot_core.matching.lines import beside, moved_ends, wrap
from albot_core.sensing.view import NO_EDGE

ROUNDS, ITERATIONS = 3, 2
"""How often surfaces are matched anew, and the Gauss-Newton steps after each."""
LINE_GAP = 0.30
"""A wall is taken for the remembered one if it runs no farther than this beside it (m)."""
LINE_VOTE = 0.5
"""How much a wall that lies where it is remembered counts beside a landmark."""
REVISIT_GAP, REVISIT_COSINE = 1.5, np.cos(np.radians(15.0))
"""A wall this near to one of an earlier visit (m), and turned no more (15°, by its cosine), may be
it: so far a map drifts on its way round. It counts for a loop-closure candidate and no more."""

POINT, SIDE, LINE = 0, 1, 2
"""Columns of `matches`, one row a surface seen: the row of `expected` matched by an end, which end,
and the row matched by its line; -1 where none."""

_correction, _no_motion = scratch(3), scratch(3)


@kernel()
def match_submap(
    pm: PerceptualMap,
    previous: LocatedView,
    current: LocatedView,
    motion: np.ndarray,
    limits: Albot1Limits,
    buffers: MatchBuffers,
) -> int:
    """Move `current.pose` from where the odometer says to where the remembered surfaces say.

    Sets `current.slots` for the landmarks recognised there; returns their number.
    """
    kept = describe_seen(current, limits, buffers)
    which, seen_edges, seen = buffers.which[:kept], buffers.seen_edges[:kept], buffers.seen[:kept]
    kept = describe_expected(previous, motion, limits, buffers)
    edges, expected = buffers.edges[:kept], buffers.expected[:kept]
    turn = likeliest_turn(seen, seen_edges, expected, edges, limits, buffers.votes)
    current.pose[2] = wrap(current.pose[2] + turn)

    kept = describe_remembered(pm, current.pose, seen, limits, buffers)
    slots, edges, expected = buffers.slots[:kept], buffers.edges[:kept], buffers.expected[:kept]
    correction, matches = _correction(), buffers.matches
    correction[0] = correction[1] = correction[2] = 0.0
    for _ in range(ROUNDS):
        match_surfaces(seen, seen_edges, expected, edges, correction, limits, matches)
        _refine(seen, expected, matches, limits, correction)
    recognized = match_surfaces(seen, seen_edges, expected, edges, correction, limits, matches)

    for k in range(current.size[0]):
        current.slots[k] = NOT_RECOGNIZED
    for k in range(seen.shape[0]):
        if matches[k, POINT] >= 0:
            current.slots[which[k]] = slots[matches[k, POINT]]
    _note_visits(pm, slots, expected, seen, correction)
    cos, sin = np.cos(current.pose[2]), np.sin(current.pose[2])
    x, y = rotate(cos, sin, correction[0], correction[1])
    current.pose[0] += x
    current.pose[1] += y
    current.pose[2] = wrap(current.pose[2] + correction[2])
    return int(recognized)


@kernel()
def likeliest_turn(
    seen: np.ndarray,
    seen_edges: np.ndarray,
    expected: np.ndarray,
    edges: np.ndarray,
    limits: Albot1Limits,
    buffer: np.ndarray,
) -> float:
    """The turn (rad) to add to the odometer's under which most surfaces agree.

    Every surface seen votes for the turns that bring it onto an expected one, a landmark
    by its points and a wall by its line, each the more the better it fits. `buffer` (2, turns) is
    to count in.
    """
    bins = limits.turns.shape[0]
    votes, own = buffer[0], buffer[1]
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
    seen_edges: np.ndarray,
    expected: np.ndarray,
    edges: np.ndarray,
    limits: Albot1Limits,
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
        # Only turns that leave no more than `landmark_angle` between the two can be voted for.
        aligned = wrap(expected[q, 5] - seen[5]) / TURN_STEP + bins // 2
        low = max(int(np.ceil(aligned - angle / TURN_STEP)), 0)
        high = min(int(np.floor(aligned + angle / TURN_STEP)), bins - 1)
        if low <= high:
            wall = expected[q]
            _vote_by_points(seen, seen_edges, wall, edges[q], turns, low, high, gap, own)
            _vote_by_line(seen, wall, turns, aligned, low, high, angle, own)


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
    own: np.ndarray,
) -> None:
    """Vote for the turns low..high that lay a surface along an expected one.

    How far it runs beside is measured at the turn that aligns the two, `aligned` steps.
    """
    middle = min(max(int(aligned + 0.5), 0), turns.shape[0] - 1)
    no_motion = _no_motion()
    no_motion[0] = no_motion[1] = no_motion[2] = 0.0
    aside = beside(wall, moved_ends(seen, no_motion, turns[middle, 0], turns[middle, 1]), seen[4])
    if aside >= LINE_GAP:
        return
    vote = LINE_VOTE * (1.0 - (aside / LINE_GAP) ** 2)
    for b in range(low, high + 1):
        turned = (b - aligned) * TURN_STEP / angle
        own[b] = max(own[b], vote * (1.0 - turned * turned))


@kernel()
def match_surfaces(
    seen: np.ndarray,
    seen_edges: np.ndarray,
    expected: np.ndarray,
    edges: np.ndarray,
    correction: np.ndarray,
    limits: Albot1Limits,
    matches: np.ndarray,
) -> int:
    """Match every surface seen to the nearest remembered point and line; count the points."""
    cos, sin = np.cos(correction[2]), np.sin(correction[2])
    points = 0
    for k in range(seen.shape[0]):
        ux, uy = rotate(cos, sin, seen[k, 6], seen[k, 7])
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
def _refine(
    seen: np.ndarray,
    expected: np.ndarray,
    matches: np.ndarray,
    limits: Albot1Limits,
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
def _note_visits(
    pm: PerceptualMap,
    slots: np.ndarray,
    expected: np.ndarray,
    seen: np.ndarray,
    correction: np.ndarray,
) -> None:
    """Count the remembered surfaces of earlier visits that may be in view, each for its visit."""
    cos, sin = np.cos(correction[2]), np.sin(correction[2])
    for q in range(expected.shape[0]):
        visit = pm.marks[slots[q]]
        if visit == pm.counts[VISIT] or pm.reobserved[visit, GATE] == NEVER:
            continue
        for k in range(seen.shape[0]):
            ux, uy = rotate(cos, sin, seen[k, 6], seen[k, 7])
            if ux * expected[q, 6] + uy * expected[q, 7] <= REVISIT_COSINE:
                continue
            ends = moved_ends(seen[k], correction, cos, sin)
            if beside(expected[q], ends, seen[k, 4]) < REVISIT_GAP:
                count_reobserved(pm, slots[q])
                break
