"""Range profiles: the range of the nearest surface in each direction, and the turn between two.

This is ours. The thesis assumes that the odometer's turn is right to 5°; in real logs it often is
not. Two profiles are compared at every turn (correlative scan matching, in its simplest form), so
that no lines have to be paired. Compiled.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel

BINS = 120
"""Number of directions in a profile, all around the robot."""
BIN = 2.0 * np.pi / BINS
"""Angle between two directions (rad), and between two turns that are tried."""
OFFSET = 0.37
"""The first direction, in BINs, and an offset added to each range (cm). Neither is 0: in generated
worlds walls meet at round angles and distances, and rounding would decide the bin."""
COSINES = np.cos(BIN * (np.arange(BINS) + OFFSET))
SINES = np.sin(BIN * (np.arange(BINS) + OFFSET))
SAME_RANGE = 50
"""Ranges that differ by this (cm) or more do not agree at all…"""
FARTHEST = 100_000.0
"""Maximum range (cm)."""
PENALTY = 1
"""…and count this much against a turn, where equal ranges count 1 for it."""
TURN_COST = 0.2
"""A turn that differs from the odometer's by the scale of its errors costs log 2 times this, in
shares of agreeing directions. The cost is minus the logarithm of the density of Student's t
distribution, because an odometer that slips may be off by much."""
MIN_OVERLAP = 7
"""The number of directions in which both profiles see a surface counts as at least this…"""
MIN_SHARE = 0.5
"""…and as at least this share of the view's: a few directions agree by chance."""
DISTINCT = 2
"""A turn that is taken excludes the turns up to this many BINs beside it: they lead to one pose."""
TURNS = BINS + 1
"""Number of turns that may be scored, from -180° to 180°."""
UNSEEN_HERE, UNSEEN_THERE, UNSEEN = 1 << 20, 1 << 24, 1 << 18
"""Ranges (cm) in directions without a surface, in the view and in the expected profile; any two
ranges of which one is of these differ by more than the last value, also these two."""


@kernel()
def fill_profile(walls: np.ndarray, unseen: int, profile: np.ndarray) -> int:
    """Write the range (cm) of the nearest wall in each direction, `unseen` where there is none.

    Returns the number of directions in which a wall is seen.

    Direction b is b BIN (rad) from the x axis of the walls' frame, in which the robot is at the
    origin. The profile repeats all directions three times. Walls run counterclockwise as seen from
    the robot; any others are seen from behind and left out. Ranges are integers, whose sums are the
    same in any order, so that the processor can add many at once.
    """
    for b in range(BINS):
        profile[b] = unseen
    for k in range(walls.shape[0]):
        ax, ay, bx, by = walls[k, 0], walls[k, 1], walls[k, 2], walls[k, 3]
        area = ax * by - ay * bx
        if area <= 0.0:
            continue
        first = np.arctan2(ay, ax) / BIN - OFFSET
        last = np.arctan2(by, bx) / BIN - OFFSET
        if last < first:
            last += BINS
        height = 100.0 * area / walls[k, 4]
        for b in range(int(np.ceil(first)), int(np.floor(last)) + 1):
            place = b % BINS
            across = COSINES[place] * walls[k, 7] - SINES[place] * walls[k, 6]
            if across > 0.0:
                profile[place] = min(profile[place], int(min(height / across, FARTHEST) + OFFSET))
    directions = 0
    for b in range(BINS):
        profile[b + BINS] = profile[b + 2 * BINS] = profile[b]
        directions += 1 if profile[b] < UNSEEN else 0
    return int(directions)


@kernel()
def agreement(seen: np.ndarray, directions: int, expected: np.ndarray, turn: int) -> float:
    """Return how well two profiles agree, the view's turned by `turn` BINs; 1 for equal ranges.

    `directions` is the number of directions in which the view sees a wall.
    """
    apart = both = 0
    for b in range(BINS):
        off = abs(seen[b] - expected[BINS + turn + b])
        apart += min(off, SAME_RANGE) if off < UNSEEN else 0
        both += 1 if off < UNSEEN else 0
    agreeing = SAME_RANGE * both - (1 + PENALTY) * apart
    return float(agreeing / (SAME_RANGE * max(both, MIN_OVERLAP, MIN_SHARE * directions)))


@kernel()
def turn_cost(turn: float, scale: float) -> float:
    """Return the cost of a turn (rad) by its difference from the odometer's (see TURN_COST)."""
    turned = turn / scale
    return float(TURN_COST * np.log1p(turned * turned))


@kernel()
def score_turns(
    seen: np.ndarray,
    directions: int,
    expected: np.ndarray,
    widest: float,
    scale: float,
    scores: np.ndarray,
    nearly: float = np.inf,
) -> None:
    """Write each turn's score, its agreement less its cost, to `scores` (TURNS,).

    A turn (rad) is what to add to the expected one. The score is -inf for turns beyond `widest`,
    and for those whose cost alone puts them farther than `nearly` below the best score.
    """
    bins = min(int(widest / BIN), BINS // 2)
    for place in range(TURNS):
        scores[place] = -np.inf
    best = -np.inf
    for turn in range(bins + 1):
        cost = turn_cost(turn * BIN, scale)
        # No agreement is above 1, and wider turns cost more.
        if 1.0 - cost < best - nearly:
            break
        for either in (turn, -turn):
            score = agreement(seen, directions, expected, either) - cost
            scores[either + BINS // 2] = score
            best = max(best, score)


@kernel()
def take_likeliest(scores: np.ndarray) -> tuple[int, float]:
    """Return the index of the best score, and the score; set it and those beside it to -inf."""
    best, score = 0, scores[0]
    for place in range(1, TURNS):
        if scores[place] > score:
            best, score = place, scores[place]
    for place in range(max(best - DISTINCT, 0), min(best + DISTINCT + 1, TURNS)):
        scores[place] = -np.inf
    return int(best), float(score)


@kernel()
def turn_at(place: int) -> float:
    """Return the turn (rad) whose score has the given index."""
    return float((place - BINS // 2) * BIN)
