"""Matching the lines of two places: which are the same, and where one place lies in the other.

This is the search of Hossain (2014), algorithms 6 and 8, for any two sets of line segments. Each
line of one set is assumed to be the same as each of the other, which gives a pose. The best of all
these poses is the one under which most lines coincide. It is refined by Gauss-Newton steps.

Compiled code takes lines as rows (`lines`). A pose is that of the second set's frame in the first
set's frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.pose_kernels import rotate, rotate_back, transform_point
from albot_core.geometry.types import Pose, Segments
from albot_core.kernels.compiled import kernel
from albot_core.matching.least_squares import pulled_by_line, solved, stiff
from albot_core.matching.lines import beside, describe_all, moved_ends, wrap
from albot_core.ranges import POSITIVE, Range, check_fields

MAX_LINES = 48
"""Largest number of lines that are compared, the longest ones: the work grows with the fourth power
of their number."""
ROUNDS = 3
"""Number of times that the pose is refined."""
_ROUNDING = 1e-9
"""What rounding may make of a heading (rad)."""


class MatchLimits(NamedTuple):
    """`MatchConfig` as compiled code takes it (m, rad)."""

    min_length: float
    max_gap: float
    max_angle: float
    max_shift: float
    max_turn: float


ALIKE = MatchLimits(0.0, 0.0, 0.0, max_shift=1.0, max_turn=float(np.radians(20.0)))
"""Two matches within these limits, seen from the robot, are one."""


_SHIFT = Range("a positive number, or infinity", 0.0, beyond=True, infinite=True)


@dataclass(frozen=True, kw_only=True)
class MatchConfig:
    """When two lines, and two places, match."""

    min_length: float = 0.40
    """Shorter lines are not compared (m)."""
    max_gap: float = 0.20
    """Two lines match only if they are closer to each other than this (m)."""
    max_angle: float = np.radians(5.0)
    """Two lines match only if their headings differ by less than this (rad)."""
    max_shift: float = 3.0
    """Largest distance of the place from the guess (m); may be infinite."""
    max_turn: float = np.radians(20.0)
    """Largest rotation of the place from the guess (rad)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "min_length", "max_gap", "max_angle", "max_turn")
        check_fields(self, _SHIFT, "max_shift")

    @property
    def limits(self) -> MatchLimits:
        """The same values as compiled code takes them."""
        return MatchLimits(
            self.min_length, self.max_gap, self.max_angle, self.max_shift, self.max_turn
        )


class ByHeading(NamedTuple):
    """Lines in the order of their headings."""

    headings: Float64[np.ndarray, "n"]
    """Their headings, ascending within [-pi, pi] (rad)."""
    order: Int64[np.ndarray, "n"]
    """The index of each of these lines."""


class LineMatch(NamedTuple):
    """Result of matching the lines of two places."""

    pose: Pose
    """Pose of the other place's frame."""
    matches: int
    """Number of lines that are the same."""
    left: int
    """Number of these lines that are to the left of the robot."""
    right: int
    """Number of these lines that are to the right of the robot."""
    share: float
    """Match score: the share of the shorter description's total length that is the same."""


def match_lines(
    mine: Segments, theirs: Segments, guess: Pose, robot: Pose, config: MatchConfig
) -> LineMatch:
    """Find the lines of a remembered place among those of the present one (algorithm 6).

    Args:
        mine: Lines of the present place (n, 4), in the map's frame (m).
        theirs: Lines of the remembered place (m, 4), in its own frame (m).
        guess: The expected pose of its frame, in the map's frame.
        robot: The robot's pose, in the map's frame.
        config: When lines and places match.
    """
    here, there, limits = line_rows(mine, config), line_rows(theirs, config), config.limits
    poses = np.array(guess, float)[None]
    most = np.zeros(1, np.int64)
    _search(here, there, guess, robot, limits, ALIKE, poses, most)
    return _refined(here, there, poses[0], int(most[0]), robot, limits)


def match_everywhere(
    mine: Segments, theirs: Segments, robot: Pose, config: MatchConfig, count: int
) -> list[LineMatch]:
    """Find the best matches of a place that may be anywhere, the best first.

    They differ in where the robot is in the place: by more than 1 m or 20° (ALIKE).

    Args:
        mine: Lines of the present place (n, 4), in the map's frame (m).
        theirs: Lines of the remembered place (m, 4), in its own frame (m).
        robot: The robot's pose, in the map's frame.
        config: When lines match; its limits of where the place is do not count.
        count: How many matches are looked for; fewer may be found.
    """
    here, there = line_rows(mine, config), line_rows(theirs, config)
    limits = config.limits._replace(max_shift=np.inf, max_turn=np.pi)
    poses, most = np.zeros((count, 3)), np.zeros(count, np.int64)
    _search(here, there, np.zeros(3), robot, limits, ALIKE, poses, most)
    return [
        _refined(here, there, poses[k], int(most[k]), robot, limits)
        for k in np.argsort(-most, kind="stable")
        if most[k] > 0
    ]


def _refined(
    here: Float64[np.ndarray, "n 8"],
    there: Float64[np.ndarray, "m 8"],
    pose: Pose,
    most: int,
    robot: Pose,
    limits: MatchLimits,
) -> LineMatch:
    """Return the match of two places' rows near a pose under which `most` lines are the same."""
    counts = np.zeros(3, np.int64)
    share = _refine_match(here, there, robot, limits, pose, counts) if most else 0.0
    return LineMatch(pose, int(counts[0]), int(counts[1]), int(counts[2]), float(share))


def line_rows(lines: Segments, config: MatchConfig) -> Float64[np.ndarray, "n 8"]:
    """Return the rows of the lines that are compared: the longest, in their order (m; n, 8)."""
    rows = np.empty((len(lines), 8))
    rows = rows[: describe_all(np.ascontiguousarray(lines), config.min_length, rows)]
    if len(rows) > MAX_LINES:
        rows = rows[np.sort(np.argsort(-rows[:, 4], kind="stable")[:MAX_LINES])]
    return rows


@kernel(arrays=True)
def _refine_match(
    mine: np.ndarray,
    theirs: np.ndarray,
    robot: np.ndarray,
    limits: MatchLimits,
    best: np.ndarray,
    counts: np.ndarray,
) -> float:
    """Refine a pose and count the lines that are the same under it; return their share."""
    pairs, taken = np.empty(theirs.shape[0], np.int64), np.empty(mine.shape[0], np.bool_)
    turned = by_heading(mine)
    for _ in range(ROUNDS):
        _pair(mine, turned, theirs, best, limits, -1, pairs, taken)
        _refine(mine, theirs, pairs, best)
    counts[0] = _pair(mine, turned, theirs, best, limits, -1, pairs, taken)
    return _count_sides(mine, theirs, pairs, robot, counts)


@kernel(arrays=True)
def _search(
    mine: np.ndarray,
    theirs: np.ndarray,
    guess: np.ndarray,
    robot: np.ndarray,
    limits: MatchLimits,
    alike: MatchLimits,
    best: np.ndarray,
    most: np.ndarray,
) -> None:
    """Set the poses (n, 3), no two alike, under which most lines are the same, and how many.

    Lines are paired under a pose only where so many may be the same that the pose would be kept:
    in the open, where a place is large, that is so of few poses.
    """
    pose, pairs, last = np.empty(3), np.empty(theirs.shape[0], np.int64), np.argmin(most)
    turned, taken = by_heading(mine), np.empty(mine.shape[0], np.bool_)
    alike_headings = np.empty((theirs.shape[0] * mine.shape[0], 2), np.int64)
    for j in range(mine.shape[0]):
        for k in range(theirs.shape[0]):
            turn = wrap(mine[j, 5] - theirs[k, 5])
            if abs(wrap(turn - guess[2])) > limits.max_turn:
                continue
            count = _find_alike_headings(turned, theirs, turn, limits, alike_headings)
            for anchor in range(3):
                lay_on(mine[j], theirs[k], anchor, pose)
                if not is_near(pose, guess, robot, limits):
                    continue
                if _most_pairs(mine, theirs, alike_headings[:count], pose, limits) <= most[last]:
                    continue
                found = _pair(mine, turned, theirs, pose, limits, most[last], pairs, taken)
                if found > most[last] and _keep(pose, found, robot, alike, best, most):
                    last = np.argmin(most)


@kernel()
def _find_alike_headings(
    turned: ByHeading, theirs: np.ndarray, turn: float, limits: MatchLimits, found: np.ndarray
) -> int:
    """Fill in (q, k) for each line q of theirs and k of mine that have about one heading.

    They are in the order of q. Returns their number.
    """
    size, count = turned.order.shape[0], 0
    widest = limits.max_angle + _ROUNDING
    for q in range(theirs.shape[0]):
        heading = wrap(theirs[q, 5] + turn)
        first = _first_from(turned.headings, wrap(heading - widest)) if widest < np.pi else 0
        for step in range(size):
            place = first + step if first + step < size else first + step - size
            if widest < np.pi and abs(wrap(turned.headings[place] - heading)) > widest + _ROUNDING:
                break
            found[count, 0], found[count, 1] = q, turned.order[place]
            count += 1
    return count


@kernel()
def _most_pairs(
    mine: np.ndarray,
    theirs: np.ndarray,
    alike_headings: np.ndarray,
    pose: np.ndarray,
    limits: MatchLimits,
) -> int:
    """Return a number that the lines which are the same under a pose do not exceed.

    It is how many of theirs have one of mine, of about their heading, with its middle so near that
    the two can overlap.
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    count, last = 0, -1
    for n in range(alike_headings.shape[0]):
        q, k = alike_headings[n, 0], alike_headings[n, 1]
        if q == last:
            continue
        x, y = 0.5 * (theirs[q, 0] + theirs[q, 2]), 0.5 * (theirs[q, 1] + theirs[q, 3])
        x, y = transform_point(pose, cos, sin, x, y)
        x, y = x - 0.5 * (mine[k, 0] + mine[k, 2]), y - 0.5 * (mine[k, 1] + mine[k, 3])
        along = 0.5 * (theirs[q, 4] + mine[k, 4])
        if x * x + y * y <= along * along + limits.max_gap * limits.max_gap + _ROUNDING:
            count, last = count + 1, q
    return count


@kernel()
def _keep(
    pose: np.ndarray,
    found: int,
    robot: np.ndarray,
    alike: MatchLimits,
    best: np.ndarray,
    most: np.ndarray,
) -> bool:
    """Keep a pose instead of those alike, or of the worst; false where one alike is as good."""
    slot = int(np.argmin(most))
    for q in range(most.shape[0]):
        if most[q] >= found and is_near(pose, best[q], robot, alike):
            return False
    for q in range(most.shape[0]):
        if most[q] > 0 and is_near(pose, best[q], robot, alike):
            most[q], slot = 0, q
    most[slot] = found
    for i in range(3):
        best[slot, i] = pose[i]
    return True


@kernel()
def lay_on(one: np.ndarray, other: np.ndarray, anchor: int, pose: np.ndarray) -> None:
    """Set the pose under which `other` lies on `one`.

    The anchor says which of their points coincide: 0 the first ends, 1 the middles, 2 the last
    ends.
    """
    pose[2] = wrap(one[5] - other[5])
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    first, last = 1.0 - 0.5 * anchor, 0.5 * anchor
    x, y = first * other[0] + last * other[2], first * other[1] + last * other[3]
    x, y = rotate(cos, sin, x, y)
    pose[0] = first * one[0] + last * one[2] - x
    pose[1] = first * one[1] + last * one[3] - y


@kernel()
def is_near(pose: np.ndarray, guess: np.ndarray, robot: np.ndarray, limits: MatchLimits) -> bool:
    """Return whether a place at `pose` is near the guess, seen from the robot."""
    turn = wrap(pose[2] - guess[2])
    if abs(turn) > limits.max_turn:
        return False
    # Where the point of the guessed place at the robot would move to.
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = robot[0] - guess[0], robot[1] - guess[1]
    x, y = transform_point(pose, cos, sin, x, y)
    dx, dy = x - robot[0], y - robot[1]
    return bool(dx * dx + dy * dy <= limits.max_shift * limits.max_shift)


@kernel(arrays=True)
def by_heading(lines: np.ndarray) -> ByHeading:
    """Return the lines in the order of their headings."""
    order = np.argsort(lines[:, 5])
    return ByHeading(lines[order, 5], order)


@kernel()
def _first_from(headings: np.ndarray, least: float) -> int:
    """Return the index of the first heading that is not below the least."""
    low, high = 0, headings.shape[0]
    while low < high:
        middle = (low + high) // 2
        if headings[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low


@kernel()
def _pair(
    mine: np.ndarray,
    turned: ByHeading,
    theirs: np.ndarray,
    pose: np.ndarray,
    limits: MatchLimits,
    most: int,
    pairs: np.ndarray,
    taken: np.ndarray,
) -> int:
    """Fill `pairs` (m,) with the line of `mine` that equals each of `theirs`; -1 for none.

    Each takes the nearest of mine that is not yet taken; of equally near ones, the first. Returns
    the number of pairs; it stops where there can no longer be more than `most`.

    Only lines of about the same heading are looked at. In a building they are a share of all; in
    the open, where headings are many and a place is large, they are few of many.

    Args:
        mine: Lines of the present place, as rows (n, 8).
        turned: The same by heading.
        theirs: Lines of the remembered place, as rows (m, 8).
        pose: Pose of its frame.
        limits: When lines match.
        most: As above.
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
        # Slightly more than those of the same heading, which are then told exactly.
        widest = limits.max_angle + _ROUNDING
        first = _first_from(turned.headings, wrap(heading - widest)) if widest < np.pi else 0
        for step in range(count):
            place = first + step if first + step < count else first + step - count
            if widest < np.pi and abs(wrap(turned.headings[place] - heading)) > widest + _ROUNDING:
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
    """Apply a Gauss-Newton step to the pose, which lays the paired lines on each other."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    # A single wall leaves the position along it open; the weak prior holds it.
    equations = stiff(1.0, 1e-3)
    for q in range(theirs.shape[0]):
        if pairs[q] >= 0:
            equations = pulled_by_line(equations, theirs[q], mine[pairs[q]], pose, cos, sin)
    x, y, turn = solved(equations)
    pose[0] += x
    pose[1] += y
    pose[2] = wrap(pose[2] + turn)


@kernel()
def _count_sides(
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
