"""Matching of a view with the local submap: the pose by all walls nearby. Compiled.

This is ours, in place of algorithms 1 and 2. The thesis follows landmarks from view to view under
the odometer's turn, which it assumes to be right to 5°, and one landmark localises the robot. In
real logs the turn is often worse. Here

1. the range profiles of the two views give the turns under which the views agree best,
2. the view is matched with the walls in the map nearby and those of the previous view,
3. Gauss-Newton steps on the pose move landmarks onto each other, by their occluding and corner
   points, and points along all walls onto the nearest wall: iterative closest points with the
   distance from a line (Censi, "An ICP variant using a point-to-line metric", 2008).

The certainty of a match decides how widely to search. Where two turns are about equally likely,
both are aligned. Where little of the view is explained, the odometer's motion is aligned as well,
and then motions farther from it, one after another. Without an odometer all motions found are
aligned as long as no match is sure; after that only those about as likely as the likeliest. Where
such a robot seems to stand still, no motion is searched.

Only walls remembered around the robot take part, and no remembered wall is corrected.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.pose_kernels import rotate, rotate_back
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.frames import compose_pose, copy_pose, relative_pose
from albot_core.mappers.albot1.perceptual_map.memory import NOT_RECOGNIZED, PerceptualMap
from albot_core.mappers.albot1.perceptual_map.motion_search import (
    ALWAYS,
    BY_TURN,
    MotionSearch,
    agreement_after,
    is_likely,
    most_motions,
    motion_cost,
    propose_motion,
)
from albot_core.mappers.albot1.perceptual_map.near_walls import list_ends_near, list_walls_along
from albot_core.mappers.albot1.perceptual_map.odometer_error import (
    HAS_MOVED,
    LAST_X,
    LAST_Y,
    shift_scale,
)
from albot_core.mappers.albot1.perceptual_map.range_profile import TURNS
from albot_core.mappers.albot1.perceptual_map.submap import (
    MatchBuffers,
    ViewPair,
    describe_nearby,
    note_reobserved,
)
from albot_core.matching.least_squares import (
    Equations,
    held,
    pulled_along,
    pulled_by_point,
    solved,
)
from albot_core.matching.lines import moved_ends, wrap
from albot_core.sensing.beam_model import BeamModel, variance_across
from albot_core.sensing.view import NO_EDGE

SAME_WORTH = 1e-6
"""A motion must be better by more than this, so that rounding does not choose between two
equals."""
PROFILE_WEIGHT = 0.5
"""Weight of the profiles' agreement at an aligned pose; the share of the view that is explained
there has weight 1."""
ROUNDS, CONVERGED = 5, 1e-4
"""Maximum number of Gauss-Newton steps, each after a new matching; and the size below which a step
is the last (m, rad)."""
WIDEN, NARROWING = 2.0, 0.5
"""In the first step the distance at which points are matched, and their standard deviation, are
this many times the final ones; each later step multiplies them by the second value, down to 1."""
POINT_SPACING = 0.247
"""Distance between the points at which walls are matched (m). It is not round, because the lengths
of generated walls are, and rounding would decide whether they have one point more…"""
MAX_POINTS = 80.0
"""…and it grows, so that there are hardly more points than this."""
POINT_GAP = 0.5
"""A point is matched to a wall at most this far away (m)…"""
POINT_END = 0.05
"""…at most this far beyond its ends (m)…"""
POINT_COSINE = np.cos(np.radians(30.0))
"""…and turned by at most this (30°, by its cosine)."""
POINT_SCALE, POINT_NOISE = 0.08, 0.03
"""Residual (m) at which a point has half its weight (Cauchy weights), and a point's standard
deviation (m)."""
POINT_WEIGHT = 0.5
"""Weight of a point whose position is well known (`beams_wanted`): the errors of neighbouring
points of a wall are correlated."""
NO_BEAMS = 1e-9
"""Lower bound on a number of beams, for a wall whose line leads to the laser."""
ROW, SIDE = 0, 1
"""Columns of `landmarks`, one row for each wall in view: the row of `expected` that it is
recognised as, or -1, and the end by which it is."""

_correction, _chosen, _start = scratch(3), scratch(3), scratch(3)
_trial, _there, _moved = scratch(3), scratch(3), scratch(3)
_scores, _shifts, _turns = scratch(TURNS), scratch(TURNS, 2), scratch(BY_TURN)


@kernel()
def match_submap(pm: PerceptualMap, pair: ViewPair) -> tuple[int, float]:
    """Move the current view's pose from where its motion leads to where the remembered walls say.

    Sets the view's `slots` for the landmarks recognised there. Returns their number, and the share
    of the walls in view that lies on expected walls.
    """
    pose, limits, is_missing = pair.current.pose, pair.limits, pair.odometer[HAS_MOVED] == 0.0
    correction, chosen, start, trial = _correction(), _chosen(), _start(), _trial()
    search = MotionSearch(_scores(), _shifts(), _turns())
    search.turns[:] = np.nan
    share = best = worth = first = 0.0
    kept = aligned = remembered = 0
    most = most_motions(pair)
    for k in range(most):
        is_sure = share >= limits.unsure
        if not is_missing and k >= ALWAYS and is_sure:
            break
        # Step 1: a motion under which the range profiles agree.
        score, turn = propose_motion(k, first, most, pair, search, trial)
        first = score if k == 0 else first
        if not is_likely(k, score, first, is_sure, pair.odometer):
            continue
        if not is_missing and k < BY_TURN:
            search.turns[k] = turn
        if k > 0 and aligned == 0:
            # Only now, because the first motion, which is always aligned, mostly has no rival.
            best = _worth(share, start, chosen, pair)
        # Step 2: the walls remembered nearby, and those of the previous view.
        compose_pose(pair.previous.pose, trial, pose)
        pose[2] = wrap(pose[2] + turn)
        remembered, total = describe_nearby(pm, pair)
        # Step 3: the pose at which the view lies on them.
        its_share = _align(pm, pair, trial, turn, remembered, total, correction)
        aligned = k
        if k > 0:
            worth = _worth(its_share, pose, correction, pair)
        if k == 0 or worth > best + SAME_WORTH:
            best, share, kept = worth, its_share, k
            copy_pose(correction, chosen)
            copy_pose(pose, start)
    if kept != aligned:
        copy_pose(start, pose)
        remembered, _ = describe_nearby(pm, pair)
    found = _recognise_landmarks(pm, pair, remembered, chosen)
    note_reobserved(pm, pair, remembered, chosen)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x, y = rotate(cos, sin, chosen[0], chosen[1])
    pose[0] += x
    pose[1] += y
    pose[2] = wrap(pose[2] + chosen[2])
    return int(found), float(share)


@kernel()
def _align(
    pm: PerceptualMap,
    pair: ViewPair,
    motion: np.ndarray,
    turn: float,
    remembered: int,
    total: int,
    correction: np.ndarray,
) -> float:
    """Compute the correction of the pose to which `motion` and a further turn lead (step 3).

    Returns the share of the walls in view that lies on the `total` expected walls, of which the
    first are `remembered`. The pose is held where it is or, without an odometer, where the robot's
    last translation would lead if repeated.
    """
    odometer, limits, buffers = pair.odometer, pair.limits, pair.buffers
    expected, wide, share = buffers.expected[:total], WIDEN, 0.0
    correction[0] = correction[1] = correction[2] = 0.0
    motion_weight = 1.0 / shift_scale(odometer, limits) ** 2
    turn_weight = 1.0 / limits.turn_error**2
    goal = 0.0, 0.0
    if odometer[HAS_MOVED] == 0.0:
        x, y = odometer[LAST_X] - motion[0], odometer[LAST_Y] - motion[1]
        goal = rotate_back(np.cos(motion[2] + turn), np.sin(motion[2] + turn), x, y)
    for _ in range(ROUNDS):
        moved = correction, np.cos(correction[2]), np.sin(correction[2])
        match_landmarks(
            pair.current.edges, pair.seen, pm.edges, remembered, *moved, limits, buffers
        )
        equations = held(correction, goal, motion_weight, turn_weight)
        equations = _pulled_by_landmarks(equations, pair.seen, expected, buffers.landmarks, *moved)
        equations, share = _pulled_by_walls(equations, pair, remembered, total, wide, *moved)
        x, y, step = solved(equations)
        correction[0] += x
        correction[1] += y
        correction[2] += step
        if wide == 1.0 and abs(x) + abs(y) < CONVERGED and abs(step) < CONVERGED:
            break
        wide = max(wide * NARROWING, 1.0)
    return share


@kernel()
def _worth(share: float, start: np.ndarray, correction: np.ndarray, pair: ViewPair) -> float:
    """Return the score of the pose to which `start` and its correction lead.

    It is the `share` of the view that is explained there, plus the agreement of the two views'
    profiles, minus the cost of the difference from the odometer. The matched pose counts, not the
    motion with which the match began: matches of different motions may end at the same pose.
    """
    there, moved = _there(), _moved()
    compose_pose(start, correction, there)
    relative_pose(pair.previous.pose, there, moved)
    cost = motion_cost(moved, pair.motion, pair.turn_scale, pair.odometer, pair.limits)
    return share + PROFILE_WEIGHT * agreement_after(pair, moved) - cost


@kernel()
def _recognise_landmarks(
    pm: PerceptualMap, pair: ViewPair, remembered: int, correction: np.ndarray
) -> int:
    """Set the slots of the landmarks recognised at the corrected pose; return their number."""
    current, buffers = pair.current, pair.buffers
    turned = np.cos(correction[2]), np.sin(correction[2])
    found = match_landmarks(
        current.edges, pair.seen, pm.edges, remembered, correction, *turned, pair.limits, buffers
    )
    for k in range(current.size[0]):
        row = buffers.landmarks[k, ROW]
        current.slots[k] = buffers.slots[row] if row >= 0 else NOT_RECOGNIZED
    return int(found)


@kernel()
def match_landmarks(
    seen_edges: np.ndarray,
    seen: np.ndarray,
    edges: np.ndarray,
    remembered: int,
    correction: np.ndarray,
    cos: float,
    sin: float,
    limits: Albot1Limits,
    buffers: MatchBuffers,
) -> int:
    """Match every landmark in view to the nearest point of a remembered one; return their number.

    `seen_edges` and `edges` are the kinds of the ends of the surfaces in view, in the order of
    `seen`, and of those in the map. The buffers hold the remembered surfaces (`table`, `slots`);
    `landmarks` is filled.
    """
    landmarks, table, slots, near = buffers.landmarks, buffers.table, buffers.slots, buffers.near
    least = (limits.landmark_cosine, limits.landmark_length, limits.landmark_gap)
    found = 0
    for k in range(seen.shape[0]):
        landmarks[k, ROW] = -1
        is_stable = seen_edges[k, 0] != NO_EDGE or seen_edges[k, 1] != NO_EDGE
        if seen[k, 4] < limits.landmark_length or not is_stable:
            continue
        heading = rotate(cos, sin, seen[k, 6], seen[k, 7])
        ends = moved_ends(seen[k], correction, cos, sin)
        nearest = limits.landmark_gap**2
        for c in range(list_ends_near(table, remembered, ends, heading, *least, near)):
            q = near[c]
            for end in range(2):
                dx = ends[2 * end] - table[2 * end, q]
                dy = ends[2 * end + 1] - table[2 * end + 1, q]
                gap = dx * dx + dy * dy
                if gap < nearest and seen_edges[k, end] != NO_EDGE != edges[slots[q], end]:
                    nearest = gap
                    landmarks[k, ROW], landmarks[k, SIDE] = q, end
        found += landmarks[k, ROW] >= 0
    return found


@kernel()
def _pulled_by_landmarks(
    equations: Equations,
    seen: np.ndarray,
    expected: np.ndarray,
    landmarks: np.ndarray,
    correction: np.ndarray,
    cos: float,
    sin: float,
) -> Equations:
    """Add the equations that move each landmark's point onto the one it is recognised as."""
    for k in range(seen.shape[0]):
        if landmarks[k, ROW] >= 0:
            wall, side = expected[landmarks[k, ROW]], landmarks[k, SIDE]
            equations = pulled_by_point(equations, side, seen[k], wall, correction, cos, sin)
    return equations


@kernel()
def _pulled_by_walls(
    equations: Equations,
    pair: ViewPair,
    remembered: int,
    total: int,
    wide: float,
    correction: np.ndarray,
    cos: float,
    sin: float,
) -> tuple[Equations, float]:
    """Add the equations that move points along the walls onto the nearest expected wall.

    Returns also the share of the walls' length that lies on an expected wall.
    """
    seen, beam_model, buffers = pair.seen, pair.beam_model, pair.buffers
    expected, near = buffers.expected[:total], buffers.near
    gap, scale, matched, length = wide * POINT_GAP, wide * POINT_SCALE, 0.0, 0.0
    for k in range(seen.shape[0]):
        length += seen[k, 4]
    apart = max(POINT_SPACING, length / MAX_POINTS)
    for k in range(seen.shape[0]):
        parts = max(int(seen[k, 4] / apart + 0.5), 1)
        step = seen[k, 4] / parts
        weight = POINT_WEIGHT * step / POINT_SPACING / (wide * POINT_NOISE) ** 2
        distance = seen[k, 0] * seen[k, 7] - seen[k, 1] * seen[k, 6]
        ux, uy = rotate(cos, sin, seen[k, 6], seen[k, 7])
        x0, y0 = rotate(cos, sin, seen[k, 0], seen[k, 1])
        line = (correction[0] + x0, correction[1] + y0), (ux, uy)
        points = 0.5 * step, seen[k, 4] - 0.5 * step
        args = (*line, *points, POINT_COSINE, gap, POINT_END, near)
        count = list_walls_along(buffers.table, total, *args)
        for part in range(parts):
            x, y = x0 + (part + 0.5) * step * ux, y0 + (part + 0.5) * step * uy
            nearest, which, off = gap, -1, 0.0
            for c in range(count):
                # Remembered walls take precedence: matching with the last view would let errors add
                # up.
                if which >= 0 and near[c] >= remembered:
                    break
                wall = expected[near[c]]
                dx, dy = correction[0] + x - wall[0], correction[1] + y - wall[1]
                along, aside = wall[6] * dx + wall[7] * dy, wall[6] * dy - wall[7] * dx
                beyond = along < -POINT_END or along > wall[4] + POINT_END
                if abs(aside) < nearest and not beyond:
                    nearest, which, off = abs(aside), near[c], aside
            if which >= 0:
                matched += step / (1.0 + (off / scale) ** 2)
                wx, wy = -expected[which, 7], expected[which, 6]
                doubt = 1.0 + (off / scale) ** 2
                if beam_model.is_used:
                    doubt *= max(beams_wanted(x * x + y * y, distance, beam_model), 1.0)
                own = weight / doubt
                equations = pulled_along(equations, x, y, wx, wy, -off, own)
    return equations, matched / max(length, POINT_SPACING)


@kernel()
def beams_wanted(square: float, aside: float, model: BeamModel) -> float:
    """Return how many times too few beams hit POINT_SPACING of a wall.

    It is 1 where they carry as much information as one beam that hits a wall at a right angle.
    `square` is the square of the point's distance from the robot (m²), `aside` the distance of the
    wall's line (m).
    """
    beams_at_one_metre = POINT_SPACING * abs(aside) / model.spacing
    return float(variance_across(square, aside, model) / max(beams_at_one_metre, NO_BEAMS))
