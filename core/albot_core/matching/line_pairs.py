"""Pairing of the lines of two places at a pose, and refinement of the pose.

In compiled code lines are rows (`lines`). A pose is that of the second set's frame in the first
set's frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.pose_kernels import rotate_back
from albot_core.kernels.compiled import kernel
from albot_core.matching.least_squares import pulled_by_line, solved, stiff
from albot_core.matching.lines import beside, moved_ends, wrap

ROUNDS = 3
"""Number of times that the pose is refined."""
ROUNDING = 1e-9
"""Upper bound of rounding errors of a heading (rad) or a distance (m)."""


class MatchLimits(NamedTuple):
    """The values of `MatchConfig` that compiled code takes (m, rad)."""

    min_length: float
    max_gap: float
    max_angle: float
    max_shift: float
    max_turn: float


class ByHeading(NamedTuple):
    """Lines ordered by their headings."""

    headings: Float64[np.ndarray, "n"]
    """The headings, ascending within [-pi, pi] (rad)."""
    order: Int64[np.ndarray, "n"]
    """The index of each of these lines."""


@kernel(arrays=True)
def refine_match(
    mine: np.ndarray,
    theirs: np.ndarray,
    robot: np.ndarray,
    limits: MatchLimits,
    best: np.ndarray,
    counts: np.ndarray,
    rounds: int,
) -> float:
    """Refine a pose, so many times, and count the lines that match at it; return their share."""
    pairs, taken = np.empty(theirs.shape[0], np.int64), np.empty(mine.shape[0], np.bool_)
    turned = by_heading(mine)
    for _ in range(rounds):
        pair_lines(mine, turned, theirs, best, limits, -1, pairs, taken)
        _refine(mine, theirs, pairs, best)
    counts[0] = pair_lines(mine, turned, theirs, best, limits, -1, pairs, taken)
    return count_sides(mine, theirs, pairs, robot, counts)


@kernel(arrays=True)
def by_heading(lines: np.ndarray) -> ByHeading:
    """Return the lines in the order of their headings."""
    order = np.argsort(lines[:, 5])
    return ByHeading(lines[order, 5], order)


@kernel()
def first_from(headings: np.ndarray, least: float) -> int:
    """Return the index of the first heading that is not below `least`."""
    low, high = 0, headings.shape[0]
    while low < high:
        middle = (low + high) // 2
        if headings[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low


@kernel()
def pair_lines(
    mine: np.ndarray,
    turned: ByHeading,
    theirs: np.ndarray,
    pose: np.ndarray,
    limits: MatchLimits,
    most: int,
    pairs: np.ndarray,
    taken: np.ndarray,
) -> int:
    """Fill `pairs` (m,) with the line of `mine` that matches each of `theirs`; -1 for none.

    Each line gets the nearest of mine that is not yet taken; of equally near ones, the first.
    Returns the number of pairs; the loop stops when there can no longer be more than `most`.

    Only lines of about the same heading are compared. In a building these are a share of all lines;
    in the open, where headings are many and a place is large, they are few.

    Args:
        mine: Lines of the present place, as rows (n, 8).
        turned: The same lines by heading.
        theirs: Lines of the remembered place, as rows (m, 8).
        pose: Pose of the remembered place's frame.
        limits: When lines match.
        most: Number of pairs that must be exceeded.
        pairs: Filled in (m,).
        taken: Scratch buffer (n,).
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    count = mine.shape[0]
    for k in range(count):
        taken[k] = False
    found = 0
    for q in range(theirs.shape[0]):
        if found + theirs.shape[0] - q <= most:
            break
        pairs[q] = -1
        best = limits.max_gap
        heading, ends = wrap(theirs[q, 5] + pose[2]), moved_ends(theirs[q], pose, cos, sin)
        # Slightly more than the lines of the same heading, which are then tested exactly.
        widest = limits.max_angle + ROUNDING
        first = first_from(turned.headings, wrap(heading - widest)) if widest < np.pi else 0
        for step in range(count):
            place = first + step if first + step < count else first + step - count
            if widest < np.pi and abs(wrap(turned.headings[place] - heading)) > widest + ROUNDING:
                break
            k = turned.order[place]
            if taken[k] or abs(wrap(heading - mine[k, 5])) >= limits.max_angle:
                continue
            aside = beside(mine[k], ends, theirs[q, 4])
            if aside < best or (aside == best and k < pairs[q]):
                best = aside
                pairs[q] = k
        if pairs[q] >= 0:
            taken[pairs[q]] = True
            found += 1
    return found


@kernel()
def _refine(mine: np.ndarray, theirs: np.ndarray, pairs: np.ndarray, pose: np.ndarray) -> None:
    """Apply a Gauss-Newton step to the pose, which aligns the paired lines."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    # A single wall does not fix the position along it; the weak prior does.
    equations = stiff(1.0, 1e-3)
    for q in range(theirs.shape[0]):
        if pairs[q] >= 0:
            equations = pulled_by_line(equations, theirs[q], mine[pairs[q]], pose, cos, sin)
    x, y, turn = solved(equations)
    pose[0] += x
    pose[1] += y
    pose[2] = wrap(pose[2] + turn)


@kernel()
def count_sides(
    mine: np.ndarray,
    theirs: np.ndarray,
    pairs: np.ndarray,
    robot: np.ndarray,
    counts: np.ndarray,
) -> float:
    """Count the pairs to the robot's left and right; return their share of the total length."""
    same = total_mine = total_theirs = 0.0
    cos, sin = np.cos(robot[2]), np.sin(robot[2])
    for q in range(theirs.shape[0]):
        total_theirs += theirs[q, 4]
        if pairs[q] >= 0:
            wall = mine[pairs[q]]
            same += min(theirs[q, 4], wall[4])
            x, y = 0.5 * (wall[0] + wall[2]) - robot[0], 0.5 * (wall[1] + wall[3]) - robot[1]
            counts[1 if rotate_back(cos, sin, x, y)[1] > 0.0 else 2] += 1
    for k in range(mine.shape[0]):
        total_mine += mine[k, 4]
    return same / min(total_mine, total_theirs)
