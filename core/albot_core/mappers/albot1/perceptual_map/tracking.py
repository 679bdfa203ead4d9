"""Localising by several tracked landmarks at once, as `albot1-tracked` does. Compiled.

This is ours, a step between the thesis and `albot1`. As in the thesis, landmarks are followed from
view to view, which alone identifies their surfaces in the map: no view is matched with the map. But
the turn between two views is searched, and all recognised landmarks localise the robot together, by
their points and their lines.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.pose_kernels import rotate
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.frames import seen_from
from albot_core.mappers.albot1.perceptual_map.memory import (
    NOT_RECOGNIZED,
    LocatedView,
    PerceptualMap,
)
from albot_core.mappers.albot1.perceptual_map.range_profile import (
    TURNS,
    UNSEEN_HERE,
    UNSEEN_THERE,
    fill_profile,
    score_turns,
    take_likeliest,
    turn_at,
)
from albot_core.mappers.albot1.perceptual_map.submap import (
    MatchBuffers,
    describe_previous,
    describe_seen,
)
from albot_core.matching.least_squares import held, pulled_by_line, pulled_by_point, solved
from albot_core.matching.lines import describe, wrap

ITERATIONS = 6
"""Number of Gauss-Newton steps."""

_scores = scratch(TURNS)


@kernel()
def search_turn(
    previous: LocatedView,
    current: LocatedView,
    motion: np.ndarray,
    limits: Albot1Limits,
    buffers: MatchBuffers,
) -> float:
    """Return the turn (rad) to add to the odometer's under which the two views agree best."""
    seen = buffers.seen[: describe_seen(current, buffers)]
    directions = fill_profile(seen, UNSEEN_HERE, buffers.profiles[0])
    total = describe_previous(previous, motion, 0, buffers)
    fill_profile(buffers.expected[:total], UNSEEN_THERE, buffers.profiles[1])
    scores, widest, scale = _scores(), limits.turn_search, limits.turn_cost
    score_turns(buffers.profiles[0], directions, buffers.profiles[1], widest, scale, scores)
    return turn_at(take_likeliest(scores)[0])


@kernel(arrays=True)
def localize_jointly(
    pm: PerceptualMap, current: LocatedView, pairs: np.ndarray, limits: Albot1Limits
) -> None:
    """Move `current.pose` so that the recognised landmarks lie on their surfaces in the map.

    `ends` (views' surfaces,) are the ends by which they were recognised. The least squares hold the
    pose at the initial one, given by the odometer and the searched turn, as in `albot1`.
    """
    room = current.size[0]
    seen, expected = np.empty((room, 10)), np.empty((room, 8))
    sides, from_here = np.empty(room, np.int64), np.empty(4)
    pose, found = current.pose, 0
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    for k in range(room):
        if current.slots[k] == NOT_RECOGNIZED:
            continue
        row = seen[found]
        describe(current.surfaces[k], row)
        row[8], row[9] = np.hypot(row[0], row[1]), np.hypot(row[2], row[3])
        seen_from(pose, cos, sin, pm.surfaces[current.slots[k]], from_here)
        describe(from_here, expected[found])
        sides[found] = pairs[k].end
        found += 1
    correction = np.zeros(3)
    for _ in range(ITERATIONS):
        turned_cos, turned_sin = np.cos(correction[2]), np.sin(correction[2])
        equations = held(
            correction, (0.0, 0.0), 1.0 / limits.motion_error**2, 1.0 / limits.turn_error**2
        )
        for k in range(found):
            wall, args = expected[k], (correction, turned_cos, turned_sin)
            equations = pulled_by_point(equations, sides[k], seen[k], wall, *args)
            equations = pulled_by_line(equations, seen[k], wall, *args)
        x, y, turn = solved(equations)
        correction[0] += x
        correction[1] += y
        correction[2] += turn
    x, y = rotate(cos, sin, correction[0], correction[1])
    pose[0] += x
    pose[1] += y
    pose[2] = wrap(pose[2] + correction[2])
