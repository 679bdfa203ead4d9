"""Comparing the structure of two places (algorithms 6 and 8), and joining their surfaces.

Compiled. Surfaces come as rows (see `outlook.describe`); a pose says where the one place's
frame lies in the other's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Pose, Segments
from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.config import Alike
from albot_core.mappers.albot1.equations import pulled_by_line, solved, stiff
from albot_core.mappers.albot1.outlook import beside, describe, moved_ends
from albot_core.mappers.albot1.recognition import length_of, wrap

MOST_COMPARED = 48
"""Of larger descriptions only so many surfaces are compared, the longest: the work grows with
the fourth power of their number."""
ROUNDS = 3
"""How often matched surfaces draw the alignment nearer."""
AGAIN = 0.8
"""A surface seen anew takes the place of one remembered from this share of its length on."""


class Likeness(NamedTuple):
    """How the structure of one place was found in another's."""

    pose: Pose
    """Where the other place's frame lies."""
    matches: int
    """How many surfaces are the same."""
    left: int
    """How many of them are to the left of the robot."""
    right: int
    """How many are to its right."""
    share: float
    """Which share of the smaller description's length is the same."""


def compare(mine: Segments, theirs: Segments, guess: Pose, robot: Pose, alike: Alike) -> Likeness:
    """Look for the structure of a remembered place in the present one (algorithm 6).

    Every surface of the one is supposed to be every surface of the other, and what else
    then falls into place is counted; the supposition that explains most is the answer.

    Args:
        mine: Surfaces of the present place (n, 4), in the map's frame (m).
        theirs: Surfaces of the remembered place (m, 4), in its own frame (m).
        guess: Where its frame would lie, in the map's frame.
        robot: Where the robot is, in the map's frame.
        alike: What is taken for the same.
    """
    pose, count = np.array(guess, float), np.zeros(3, np.int64)
    share = _compare(
        described(mine, alike), described(theirs, alike), guess, robot, alike, pose, count
    )
    return Likeness(pose, int(count[0]), int(count[1]), int(count[2]), float(share))


def described(surfaces: Segments, alike: Alike) -> Float64[np.ndarray, "n 8"]:
    """The rows of the surfaces that are compared: the longest, in their order (m; n, 8)."""
    rows = np.empty((len(surfaces), 8))
    rows = rows[: _describe_all(np.ascontiguousarray(surfaces), alike.shortest, rows)]
    if len(rows) > MOST_COMPARED:
        rows = rows[np.sort(np.argsort(-rows[:, 4], kind="stable")[:MOST_COMPARED])]
    return rows


@kernel()
def _describe_all(surfaces: np.ndarray, shortest: float, rows: np.ndarray) -> int:
    kept = 0
    for k in range(surfaces.shape[0]):
        if length_of(surfaces[k]) >= shortest:
            describe(surfaces[k], rows[kept])
            kept += 1
    return kept


@kernel(arrays=True)
def _pair(
    mine: np.ndarray, theirs: np.ndarray, pose: np.ndarray, alike: Alike, pairs: np.ndarray
) -> int:
    """Fill `pairs` (m,) with the surface of `mine` that each of `theirs` is, -1 for none.

    `pose` says where their frame lies in mine. No surface of mine is two of theirs.
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    taken = np.zeros(mine.shape[0], np.bool_)
    found = 0
    for q in range(theirs.shape[0]):
        pairs[q] = -1
        best = alike.gap
        for k in range(mine.shape[0]):
            if taken[k] or abs(wrap(wrap(theirs[q, 5] + pose[2]) - mine[k, 5])) >= alike.angle:
                continue
            aside = beside(mine[k], moved_ends(theirs[q], pose, cos, sin), theirs[q, 4])
            if aside < best:
                best = aside
                pairs[q] = k
        if pairs[q] >= 0:
            taken[pairs[q]] = True
            found += 1
    return found


@kernel()
def suppose(one: np.ndarray, other: np.ndarray, anchor: int, pose: np.ndarray) -> None:
    """The pose under which `other` lies on `one`: by first ends, last ends, or middles."""
    pose[2] = wrap(one[5] - other[5])
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    first, last = 1.0 - 0.5 * anchor, 0.5 * anchor
    x, y = first * other[0] + last * other[2], first * other[1] + last * other[3]
    pose[0] = first * one[0] + last * one[2] - (cos * x - sin * y)
    pose[1] = first * one[1] + last * one[3] - (sin * x + cos * y)


@kernel()
def is_near(pose: np.ndarray, guess: np.ndarray, robot: np.ndarray, alike: Alike) -> bool:
    """Whether a place at `pose` is about where it is looked for, seen from the robot."""
    turn = wrap(pose[2] - guess[2])
    if abs(turn) > alike.turn:
        return False
    # Where the guessed place's point under the robot would come to lie.
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = robot[0] - guess[0], robot[1] - guess[1]
    dx = pose[0] + cos * x - sin * y - robot[0]
    dy = pose[1] + sin * x + cos * y - robot[1]
    return bool(dx * dx + dy * dy <= alike.shift * alike.shift)


@kernel()
def _draw_nearer(mine: np.ndarray, theirs: np.ndarray, pairs: np.ndarray, pose: np.ndarray) -> None:
    """A Gauss-Newton step on the pose that lays the paired surfaces on each other."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    # Along a single wall nothing says where: then the place stays where it is.
    equations = stiff(1.0, 1e-3)
    for q in range(theirs.shape[0]):
        if pairs[q] >= 0:
            equations = pulled_by_line(equations, theirs[q], mine[pairs[q]], pose, cos, sin)
    x, y, turn = solved(equations)
    pose[0] += x
    pose[1] += y
    pose[2] = wrap(pose[2] + turn)


@kernel(arrays=True)
def _likeliest(
    mine: np.ndarray,
    theirs: np.ndarray,
    guess: np.ndarray,
    robot: np.ndarray,
    alike: Alike,
    best: np.ndarray,
    pairs: np.ndarray,
) -> int:
    """Set the pose under which most surfaces are the same; return how many."""
    pose = np.empty(3)
    most = 0
    for j in range(mine.shape[0]):
        for k in range(theirs.shape[0]):
            for anchor in range(3):
                suppose(mine[j], theirs[k], anchor, pose)
                if not is_near(pose, guess, robot, alike):
                    continue
                found = _pair(mine, theirs, pose, alike, pairs)
                if found > most:
                    most = found
                    for i in range(3):
                        best[i] = pose[i]
    return most


@kernel(arrays=True)
def _compare(
    mine: np.ndarray,
    theirs: np.ndarray,
    guess: np.ndarray,
    robot: np.ndarray,
    alike: Alike,
    best: np.ndarray,
    counts: np.ndarray,
) -> float:
    """`compare` on rows; sets the best pose and the counts, returns the share."""
    pairs = np.empty(theirs.shape[0], np.int64)
    if _likeliest(mine, theirs, guess, robot, alike, best, pairs) == 0:
        return 0.0
    for _ in range(ROUNDS):
        _pair(mine, theirs, best, alike, pairs)
        _draw_nearer(mine, theirs, pairs, best)
    counts[0] = _pair(mine, theirs, best, alike, pairs)
    return _count_sides(mine, theirs, pairs, robot, counts)


@kernel()
def _count_sides(
    mine: np.ndarray,
    theirs: np.ndarray,
    pairs: np.ndarray,
    robot: np.ndarray,
    counts: np.ndarray,
) -> float:
    """Count the pairs to the robot's left and right; return their share of the whole."""
    same = total_mine = total_theirs = 0.0
    cos, sin = np.cos(robot[2]), np.sin(robot[2])
    for q in range(theirs.shape[0]):
        total_theirs += theirs[q, 4]
        if pairs[q] >= 0:
            wall = mine[pairs[q]]
            same += min(theirs[q, 4], wall[4])
            x, y = 0.5 * (wall[0] + wall[2]) - robot[0], 0.5 * (wall[1] + wall[3]) - robot[1]
            counts[1 if cos * y - sin * x > 0.0 else 2] += 1
    for k in range(mine.shape[0]):
        total_mine += mine[k, 4]
    return same / min(total_mine, total_theirs)


def joined(old: Segments, new: Segments, alike: Alike) -> Segments:
    """The surfaces of a place's description together with those seen there anew.

    Of two that are the same the newer stays, unless it shows much less of it.
    """
    keep_old, keep_new = np.ones(len(old), np.bool_), np.ones(len(new), np.bool_)
    _join(_all_rows(old), _all_rows(new), alike, keep_old, keep_new)
    return np.concatenate((old[keep_old], new[keep_new]))


def _all_rows(surfaces: Segments) -> Float64[np.ndarray, "n 8"]:
    rows = np.empty((len(surfaces), 8))
    _describe_all(np.ascontiguousarray(surfaces), 0.0, rows)
    return rows


@kernel()
def _join(
    old: np.ndarray, new: np.ndarray, alike: Alike, keep_old: np.ndarray, keep_new: np.ndarray
) -> None:
    for q in range(new.shape[0]):
        ends = new[q, 0], new[q, 1], new[q, 2], new[q, 3]
        for k in range(old.shape[0]):
            if not keep_old[k] or abs(wrap(new[q, 5] - old[k, 5])) >= 2 * alike.angle:
                continue
            if beside(old[k], ends, new[q, 4]) >= alike.gap:
                continue
            if new[q, 4] >= AGAIN * old[k, 4]:
                keep_old[k] = False
            else:
                keep_new[q] = False
