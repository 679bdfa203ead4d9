"""Matching of the lines of two places: which lines match, and the pose of one place in the other.

This is the search of Hossain (2014), algorithms 6 and 8, for any two sets of line segments. Each
pair of one line of either set is assumed to match, which gives a pose. The best of these poses is
the one at which most lines coincide. It is refined by Gauss-Newton steps.

In compiled code lines are rows (`lines`). A pose is that of the second set's frame in the first
set's frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.pose_kernels import rotate, transform_point
from albot_core.geometry.types import Pose, Segments
from albot_core.kernels.compiled import kernel
from albot_core.matching.line_pairs import (
    ROUNDING,
    ROUNDS,
    MatchLimits,
    by_heading,
    count_sides,
    first_from,
    pair_lines,
    refine_match,
)
from albot_core.matching.lines import MIN_OVERLAP, describe_all, wrap
from albot_core.ranges import POSITIVE, Range, check_fields

MAX_LINES = 48
"""Maximum number of lines that are compared, the longest ones: the work grows with the fourth power
of their number."""


NEVER_ENOUGH = int(np.iinfo(np.int64).max)
"""No number of matching lines ends a search: all poses are compared."""
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
        """The values that compiled code takes."""
        return MatchLimits(
            self.min_length, self.max_gap, self.max_angle, self.max_shift, self.max_turn
        )


class ByTurn(NamedTuple):
    """Pairs of a line of mine and one of theirs, ordered by the turn between their headings.

    The turn rotates the heading of their line to that of mine.
    """

    angles: Float64[np.ndarray, "pairs"]
    """The turns, ascending within [-pi, pi] (rad)."""
    theirs: Int64[np.ndarray, "pairs"]
    """The index of their line."""
    mine: Int64[np.ndarray, "pairs"]
    """The index of mine."""


class AlikeHeadings(NamedTuple):
    """The pairs of lines that have about the same heading under a pose."""

    turns: ByTurn
    """All pairs."""
    first: int
    """The index of the first of these pairs in `turns`."""
    size: int
    """The number of these pairs; after the last pair of `turns` they continue with its first
    one."""
    counted: Int64[np.ndarray, "theirs"]
    """Scratch: the number of the pose at which each of their lines was last counted."""
    number: int
    """The number of this pose, from 1."""


class LineMatch(NamedTuple):
    """Result of matching the lines of two places."""

    pose: Pose
    """Pose of the other place's frame."""
    matches: int
    """Number of lines that match."""
    left: int
    """Number of these lines that are to the left of the robot."""
    right: int
    """Number of these lines that are to the right of the robot."""
    share: float
    """Match score: the share of the shorter description's total length that matches."""


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
    _search(here, there, guess, robot, limits, ALIKE, NEVER_ENOUGH, poses, most)
    return _refined(here, there, poses[0], int(most[0]), robot, limits)


def match_first(
    mine: Segments, theirs: Segments, guess: Pose, robot: Pose, config: MatchConfig, enough: int
) -> LineMatch:
    """Find the first pose at which enough lines match, to the letter of algorithm 6.

    The poses are tried in the order of the lines: each of mine, with each of theirs, laid on it by
    the first ends, the middles, the last ends. The lines that match are those at this pose. How the
    place is then aligned is not said there: the pose returned is refined, as in `match_lines`.

    Args:
        mine: Lines of the present place (n, 4), in the map's frame (m).
        theirs: Lines of the remembered place (m, 4), in its own frame (m).
        guess: The expected pose of its frame, in the map's frame.
        robot: The robot's pose, in the map's frame.
        config: When lines and places match.
        enough: More lines than this must match, on both sides of the robot.

    Returns:
        The first such match; if there is none, the match of most lines.
    """
    here, there, limits = line_rows(mine, config), line_rows(theirs, config), config.limits
    poses = np.array(guess, float)[None]
    most = np.zeros(1, np.int64)
    _search(here, there, guess, robot, limits, ALIKE, enough, poses, most)
    confirmed = _refined(here, there, poses[0].copy(), int(most[0]), robot, limits, rounds=0)
    aligned = _refined(here, there, poses[0], int(most[0]), robot, limits)
    return confirmed._replace(pose=aligned.pose)


def match_everywhere(
    mine: Segments, theirs: Segments, robot: Pose, config: MatchConfig, count: int
) -> list[LineMatch]:
    """Find the best matches of a place that may be anywhere, the best first.

    The robot's poses in the place, by these matches, differ by more than 1 m or 20° (ALIKE).

    Args:
        mine: Lines of the present place (n, 4), in the map's frame (m).
        theirs: Lines of the remembered place (m, 4), in its own frame (m).
        robot: The robot's pose, in the map's frame.
        config: When lines match; its limits of the place's position are not used.
        count: Maximum number of matches.
    """
    here, there = line_rows(mine, config), line_rows(theirs, config)
    limits = config.limits._replace(max_shift=np.inf, max_turn=np.pi)
    poses, most = np.zeros((count, 3)), np.zeros(count, np.int64)
    _search(here, there, np.zeros(3), robot, limits, ALIKE, NEVER_ENOUGH, poses, most)
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
    rounds: int = ROUNDS,
) -> LineMatch:
    """Return the match of two places' rows, near a pose at which `most` lines match."""
    counts = np.zeros(3, np.int64)
    share = refine_match(here, there, robot, limits, pose, counts, rounds) if most else 0.0
    return LineMatch(pose, int(counts[0]), int(counts[1]), int(counts[2]), float(share))


def line_rows(lines: Segments, config: MatchConfig) -> Float64[np.ndarray, "n 8"]:
    """Return the rows of the lines that are compared: the longest, in their order (m; n, 8)."""
    rows = np.empty((len(lines), 8))
    rows = rows[: describe_all(np.ascontiguousarray(lines), config.min_length, rows)]
    if len(rows) > MAX_LINES:
        rows = rows[np.sort(np.argsort(-rows[:, 4], kind="stable")[:MAX_LINES])]
    return rows


@kernel(arrays=True)
def _search(
    mine: np.ndarray,
    theirs: np.ndarray,
    guess: np.ndarray,
    robot: np.ndarray,
    limits: MatchLimits,
    alike: MatchLimits,
    enough: int,
    best: np.ndarray,
    most: np.ndarray,
) -> None:
    """Set `best` (n, 3) to distinct poses at which most lines match, `most` to their number.

    The search ends at the first pose at which more than `enough` lines match, on both sides of the
    robot; this pose alone is set. Lines are paired at a pose only if enough lines may match for the
    pose to be kept.
    """
    pose, pairs, last = np.empty(3), np.empty(theirs.shape[0], np.int64), np.argmin(most)
    turned, taken = by_heading(mine), np.empty(mine.shape[0], np.bool_)
    turns, middles = _by_turn(mine, theirs), np.empty((theirs.shape[0], 2))
    counted, poses, sides = np.zeros(theirs.shape[0], np.int64), 0, np.empty(3, np.int64)
    for j in range(mine.shape[0]):
        for k in range(theirs.shape[0]):
            turn = wrap(mine[j, 5] - theirs[k, 5])
            if abs(wrap(turn - guess[2])) > limits.max_turn:
                continue
            first, count = _find_turn(turns, turn, limits.max_angle + ROUNDING)
            _turn_middles(theirs, turn, middles)
            for anchor in range(3):
                lay_on(mine[j], theirs[k], anchor, pose)
                if not is_near(pose, guess, robot, limits):
                    continue
                poses += 1
                near = AlikeHeadings(turns, first, count, counted, poses)
                least = min(most[last], enough)
                if _most_pairs(mine, theirs, near, middles, pose, limits.max_gap) <= least:
                    continue
                found = pair_lines(mine, turned, theirs, pose, limits, least, pairs, taken)
                if found > enough:  # Alg. 6, lines 11 to 13
                    sides[:] = 0
                    count_sides(mine, theirs, pairs, robot, sides)
                    if min(sides[1], sides[2]) > 0:
                        most[:], most[0], best[0] = 0, found, pose
                        return
                if found > most[last] and _keep(pose, found, robot, alike, best, most):
                    last = np.argmin(most)


@kernel(arrays=True)
def _by_turn(mine: np.ndarray, theirs: np.ndarray) -> ByTurn:
    """Return all pairs of lines in the order of the turn between them."""
    size = mine.shape[0]
    angles = np.empty(theirs.shape[0] * size)
    for q in range(theirs.shape[0]):
        for k in range(size):
            angles[q * size + k] = wrap(mine[k, 5] - theirs[q, 5])
    order = np.argsort(angles)
    return ByTurn(angles[order], order // size, order % size)


@kernel()
def _find_turn(turns: ByTurn, turn: float, width: float) -> tuple[int, int]:
    """Return the first of the pairs whose turn differs by at most the width (rad).

    Returns also the number of these pairs, which continue with the first of all after the last.
    """
    size = turns.angles.shape[0]
    if width >= np.pi:
        return 0, size
    first = first_from(turns.angles, wrap(turn - width))
    end = first_from(turns.angles, wrap(turn + width))
    # A turn that differs by exactly the width is included; rounding does not matter at the limit.
    return first, end - first if wrap(turn - width) <= wrap(turn + width) else end + size - first


@kernel()
def _turn_middles(lines: np.ndarray, turn: float, middles: np.ndarray) -> None:
    """Set `middles` (n, 2) to the lines' middles after a turn."""
    cos, sin = np.cos(turn), np.sin(turn)
    for q in range(lines.shape[0]):
        x, y = 0.5 * (lines[q, 0] + lines[q, 2]), 0.5 * (lines[q, 1] + lines[q, 3])
        middles[q, 0], middles[q, 1] = rotate(cos, sin, x, y)


@kernel()
def _most_pairs(
    mine: np.ndarray,
    theirs: np.ndarray,
    alike: AlikeHeadings,
    middles: np.ndarray,
    pose: np.ndarray,
    max_gap: float,
) -> int:
    """Return an upper bound of the number of lines that match at a pose.

    It is the number of their lines that may match one of mine, even if another matches the same
    one.

    Args:
        mine: Lines of the present place, as rows (n, 8).
        theirs: Lines of the remembered place, as rows (m, 8).
        alike: The pairs of about the same heading at the pose.
        middles: The middles of their lines after the pose's turn (m, 2).
        pose: The pose.
        max_gap: The largest mean distance of two matching lines (m).
    """
    turns, bound = alike.turns, 0
    for n in range(alike.first, alike.first + alike.size):
        one = n if n < turns.angles.shape[0] else n - turns.angles.shape[0]
        q = turns.theirs[one]
        if alike.counted[q] == alike.number:
            continue
        x, y = middles[q, 0] + pose[0], middles[q, 1] + pose[1]
        if _may_be_same(mine[turns.mine[one]], x, y, theirs[q, 4], max_gap):
            alike.counted[q] = alike.number
            bound += 1
    return bound


@kernel()
def _may_be_same(wall: np.ndarray, x: float, y: float, length: float, max_gap: float) -> bool:
    """Return whether a line of about a wall's heading can be near the wall and overlap it.

    Args:
        wall: The wall, as a row.
        x: The x coordinate of the line's middle (m).
        y: The y coordinate of the line's middle (m).
        length: The line's length (m).
        max_gap: The largest mean distance of the two (m).
    """
    dx, dy = x - wall[0], y - wall[1]
    if abs(wall[6] * dy - wall[7] * dx) > max_gap + ROUNDING:
        return False
    along = wall[6] * dx + wall[7] * dy
    overlap = min(along + 0.5 * length, wall[4]) - max(along - 0.5 * length, 0.0)
    return bool(overlap >= MIN_OVERLAP * min(length, wall[4]) - ROUNDING)


@kernel()
def _keep(
    pose: np.ndarray,
    found: int,
    robot: np.ndarray,
    alike: MatchLimits,
    best: np.ndarray,
    most: np.ndarray,
) -> bool:
    """Keep a pose for similar ones or the worst; return False if a similar one is as good."""
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
    """Set the pose at which `other` lies on `one`.

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
    # The point to which the guessed place's point at the robot would move.
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = robot[0] - guess[0], robot[1] - guess[1]
    x, y = transform_point(pose, cos, sin, x, y)
    dx, dy = x - robot[0], y - robot[1]
    return bool(dx * dx + dy * dy <= limits.max_shift * limits.max_shift)
