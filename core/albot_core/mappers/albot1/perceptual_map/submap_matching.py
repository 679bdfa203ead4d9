"""Matching the view with the local submap: where the robot is, by all that is nearby. Compiled.

This is ours, in place of algorithms 1 and 2. The thesis follows landmarks from view to view under
the odometer's turn, which it supposes to be right to 5°, and one landmark localises the robot. In
real logs the turn often is not so good. Here

1. all surfaces of the two views vote for the turn under which they agree best,
2. what the map holds nearby and what is seen are matched: landmarks by their occluding and corner
   points, plain walls by their lines,
3. Gauss-Newton steps on the pose draw the matched ones together, and they are matched anew.

How sure the match is decides how widely to search: where what is seen hardly agrees with what is
remembered there, all three are done again with wider bounds, and the better match counts.

Only what is remembered around the robot takes part, and nothing remembered is corrected.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.pose_kernels import rotate
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import TURN_STEP, Albot1Limits
from albot_core.mappers.albot1.perceptual_map.consistency import CONTRADICTED, inconsistency
from albot_core.mappers.albot1.perceptual_map.frames import compose_pose, copy_pose
from albot_core.mappers.albot1.perceptual_map.memory import (
    GATE,
    NEVER,
    NOT_RECOGNIZED,
    VISIT,
    LocatedView,
    PerceptualMap,
    count_reobserved,
)
from albot_core.mappers.albot1.perceptual_map.odometer_error import (
    HAS_MOVED,
    LAST_X,
    LAST_Y,
    turn_scale,
)
from albot_core.mappers.albot1.perceptual_map.submap import (
    MatchBuffers,
    describe_expected,
    describe_remembered,
    describe_seen,
)
from albot_core.mappers.albot1.perceptual_map.turn_search import (
    LINE_GAP,
    LINE_VOTE,
    likeliest_turn,
)
from albot_core.matching.least_squares import held, pulled_by_line, pulled_by_point, solved
from albot_core.matching.lines import beside, moved_ends, wrap
from albot_core.sensing.view import NO_EDGE

ROUNDS, ITERATIONS = 3, 2
"""How often surfaces are matched anew, and the Gauss-Newton steps after each."""
WIDER_GAIN = 0.5
"""A wider search is believed only if its agreement is larger by more than this…"""
ODD_TURN = 5.0
"""…if the turn is off by no more than so many times the scale of the odometer's errors, and if the
view does not contradict the one before."""
GUESS_SPACING, GUESS_CELLS = 0.4, 3
"""Without an odometer translations are tried so far apart (m), and so many cells either way…"""
GUESS_WIDTH = 1.5
"""…and surfaces are searched for so many times wider than usual."""
GUESS_TURN = np.radians(60.0)
"""…around no turn and this one to either side (rad)…"""
GUESS_COST = 0.25
"""Votes that a translation costs which differs by 1 m from the last, and a turn to either side."""
REVISIT_GAP, REVISIT_COSINE = 1.5, np.cos(np.radians(15.0))
"""A wall this near to one of an earlier visit (m), and turned no more (15°, by its cosine), may be
it: so far a map drifts on its way round. It counts for a loop-closure candidate and no more."""

POINT, SIDE, LINE = 0, 1, 2
"""Columns of `matches`, one row a surface seen: the row of `expected` matched by an end, which end,
and the row matched by its line; -1 where none."""

_correction, _expected_motion, _trial = scratch(3), scratch(3), scratch(3)


@kernel()
def match_submap(
    pm: PerceptualMap,
    previous: LocatedView,
    current: LocatedView,
    motion: np.ndarray,
    limits: Albot1Limits,
    odometer: np.ndarray,
    buffers: MatchBuffers,
) -> tuple[int, float]:
    """Move `current.pose` from where `motion` leads to where the remembered surfaces say.

    Sets `current.slots` for the landmarks recognised there; returns their number, and how far what
    is seen agrees with what is remembered. Where it hardly does, it is searched for more widely.
    """
    kept = describe_seen(current, limits, buffers)
    which, seen_edges, seen = buffers.which[:kept], buffers.seen_edges[:kept], buffers.seen[:kept]
    expected_motion, wide = _expected_motion(), 1.0
    copy_pose(motion, expected_motion)
    scale = turn_scale(odometer, limits)
    if odometer[HAS_MOVED] == 0.0:
        wide = GUESS_WIDTH
        known = (limits, odometer, scale, buffers)
        _guess_motion(previous, seen, seen_edges, *known, expected_motion)
    correction, matches = _correction(), buffers.matches
    args = (seen, seen_edges, limits, buffers, correction)
    kept, recognized, agreement = _search(
        pm, previous, current, expected_motion, scale, wide, *args
    )
    if agreement < limits.unsure and wide < limits.wider:
        factor = limits.wider / wide
        _, _, wider = _search(
            pm, previous, current, expected_motion, scale * factor, limits.wider, *args
        )
        turn = current.pose[2] + correction[2] - previous.pose[2] - expected_motion[2]
        # A misread view fits somewhere, too, but seldom where the odometer may have led.
        is_odd = abs(wrap(turn)) > ODD_TURN * scale
        contradicted = inconsistency(previous, current, limits) > CONTRADICTED
        if is_odd or contradicted or wider <= agreement + WIDER_GAIN:
            factor = 1.0
        kept, recognized, agreement = _search(
            pm, previous, current, expected_motion, scale * factor, wide * factor, *args
        )
    slots, expected = buffers.slots[:kept], buffers.expected[:kept]

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
    return int(recognized), float(agreement)


@kernel()
def _guess_motion(
    previous: LocatedView,
    seen: np.ndarray,
    seen_edges: np.ndarray,
    limits: Albot1Limits,
    odometer: np.ndarray,
    scale: float,
    buffers: MatchBuffers,
    motion: np.ndarray,
) -> None:
    """Write the motion under which the two views agree best, for a robot without an odometer.

    It is searched on a grid. A translation that differs from the last costs votes, for along a
    corridor the views cannot tell, and so does a turn.
    """
    trial, most = _trial(), -np.inf
    for cell in range((2 * GUESS_CELLS + 1) ** 2):
        column, row = cell // (2 * GUESS_CELLS + 1), cell % (2 * GUESS_CELLS + 1)
        trial[0] = (column - GUESS_CELLS) * GUESS_SPACING
        trial[1] = (row - GUESS_CELLS) * GUESS_SPACING
        dx, dy = trial[0] - odometer[LAST_X], trial[1] - odometer[LAST_Y]
        for side in range(-1, 2):
            trial[2] = side * GUESS_TURN
            kept = describe_expected(previous, trial, limits, buffers)
            edges, expected = buffers.edges[:kept], buffers.expected[:kept]
            args = (limits, scale, GUESS_WIDTH, buffers.votes)
            turn = likeliest_turn(seen, seen_edges, expected, edges, *args)
            place = int(np.round(turn / TURN_STEP)) + limits.turns.shape[0] // 2
            votes = buffers.votes[0, place] - GUESS_COST * (dx * dx + dy * dy + abs(side))
            if votes > most:
                most = votes
                copy_pose(trial, motion)


@kernel()
def _search(
    pm: PerceptualMap,
    previous: LocatedView,
    current: LocatedView,
    motion: np.ndarray,
    scale: float,
    wide: float,
    seen: np.ndarray,
    seen_edges: np.ndarray,
    limits: Albot1Limits,
    buffers: MatchBuffers,
    correction: np.ndarray,
) -> tuple[int, int, float]:
    """Steps 1 to 3 from where `motion` leads: set `current.pose`, and find its correction.

    Returns how many surfaces are remembered there, how many landmarks were recognised, and the
    agreement. `wide` is how many times wider than usual surfaces are searched for.
    """
    compose_pose(previous.pose, motion, current.pose)
    kept = describe_expected(previous, motion, limits, buffers)
    edges, expected = buffers.edges[:kept], buffers.expected[:kept]
    args = (limits, scale, wide, buffers.votes)
    turn = likeliest_turn(seen, seen_edges, expected, edges, *args)
    current.pose[2] = wrap(current.pose[2] + turn)
    kept = describe_remembered(pm, current.pose, seen, limits, buffers)
    edges, expected, matches = buffers.edges[:kept], buffers.expected[:kept], buffers.matches
    correction[0] = correction[1] = correction[2] = 0.0
    narrower = wide
    for _ in range(ROUNDS):
        match_surfaces(seen, seen_edges, expected, edges, correction, limits, narrower, matches)
        _refine(seen, expected, matches, limits, wide, correction)
        narrower = np.sqrt(narrower)
    found = match_surfaces(seen, seen_edges, expected, edges, correction, limits, 1.0, matches)
    agreement = _agreement(seen, expected, matches, correction, limits)
    return int(kept), int(found), float(agreement)


@kernel()
def _agreement(
    seen: np.ndarray,
    expected: np.ndarray,
    matches: np.ndarray,
    correction: np.ndarray,
    limits: Albot1Limits,
) -> float:
    """How well what is seen lies on what is remembered; a match counts as it votes for a turn."""
    cos, sin = np.cos(correction[2]), np.sin(correction[2])
    total = 0.0
    for k in range(seen.shape[0]):
        ends = moved_ends(seen[k], correction, cos, sin)
        own = 0.0
        if matches[k, POINT] >= 0:
            q, end = matches[k, POINT], matches[k, SIDE]
            dx = ends[2 * end] - expected[q, 2 * end]
            dy = ends[2 * end + 1] - expected[q, 2 * end + 1]
            own = 1.0 - (dx * dx + dy * dy) / limits.landmark_gap**2
        if matches[k, LINE] >= 0:
            aside = beside(expected[matches[k, LINE]], ends, seen[k, 4])
            own = max(own, LINE_VOTE * (1.0 - (aside / LINE_GAP) ** 2))
        total += own
    return total


@kernel()
def match_surfaces(
    seen: np.ndarray,
    seen_edges: np.ndarray,
    expected: np.ndarray,
    edges: np.ndarray,
    correction: np.ndarray,
    limits: Albot1Limits,
    wide: float,
    matches: np.ndarray,
) -> int:
    """Match every surface seen to the nearest remembered point and line; count the points."""
    cos, sin = np.cos(correction[2]), np.sin(correction[2])
    points = 0
    for k in range(seen.shape[0]):
        ux, uy = rotate(cos, sin, seen[k, 6], seen[k, 7])
        ends = moved_ends(seen[k], correction, cos, sin)
        point, side, line = -1, 0, -1
        nearest_gap, nearest_line = (wide * limits.landmark_gap) ** 2, wide * LINE_GAP
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
    wide: float,
    correction: np.ndarray,
) -> None:
    """Gauss-Newton on the correction, held by the odometer's motion and the likeliest turn."""
    motion = 1.0 / (wide * limits.motion_error) ** 2
    for _ in range(ITERATIONS):
        cos, sin = np.cos(correction[2]), np.sin(correction[2])
        equations = held(correction, motion, 1.0 / limits.turn_error**2)
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
