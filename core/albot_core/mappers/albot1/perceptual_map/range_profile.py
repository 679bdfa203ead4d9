"""Range profiles: how far the nearest surface is in each direction, and the turn between two.

This is ours. The thesis supposes that the odometer's turn is right to 5°; in real logs it often is
not. Two profiles are compared at every turn (correlative scan matching, in its simplest form), so
that no line of one has to be told to be a line of the other. Compiled.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel

BINS = 120
"""Directions in a profile, all around the robot."""
BIN = 2.0 * np.pi / BINS
"""Angle between them (rad), and between the turns that are tried."""
OFFSET = 0.37
"""The first direction, in BINs, and what is added to a range (cm). Neither is 0: in generated
worlds walls meet at round angles and distances, and would be in one bin or the next by chance."""
COSINES = np.cos(BIN * (np.arange(BINS) + OFFSET))
SINES = np.sin(BIN * (np.arange(BINS) + OFFSET))
SAME_RANGE = 50
"""Ranges that differ by this (cm) do not agree at all…"""
FARTHEST = 100_000.0
"""Ranges are this at most (cm)."""
PENALTY = 1
"""…and count so much against a turn, where equal ranges count 1 for it."""
TURN_COST = 0.3
"""The most that a turn costs, in shares of agreeing directions: a slipping odometer may be off by
any turn."""
MIN_OVERLAP = 7
"""Fewer directions in which both profiles see a surface count as so many."""


UNSEEN_HERE, UNSEEN_THERE, UNSEEN = 1 << 20, 1 << 24, 1 << 18
"""Ranges (cm) where the view and what is expected show no surface; both differ by more than the
last from any range, and from each other."""


@kernel()
def fill_profile(walls: np.ndarray, unseen: int, profile: np.ndarray) -> None:
    """Write the range (cm) of the nearest of the walls' rows in each direction; `unseen` for none.

    Direction b is b BIN (rad) from the x axis of the walls' frame, in which the robot is at 0, 0;
    all directions stand in the profile three times. Walls run counterclockwise as seen from there;
    those that do not are seen from behind. Whole numbers, for their sums are the same in any order:
    so the processor adds many at once.
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
    for b in range(BINS):
        profile[b + BINS] = profile[b + 2 * BINS] = profile[b]


@kernel()
def likeliest_turns(
    seen: np.ndarray, expected: np.ndarray, widest: float, scale: float
) -> tuple[float, float, float]:
    """The turns (rad) to add to the expected one under which two profiles agree best.

    The first is the best where a turn costs its square by `scale` (rad), up to TURN_COST in all:
    minus the logarithm of a normal density with a uniform one added. The second is the best where
    turns cost nothing. The third result is the first one's score.
    """
    bins = min(int(widest / BIN), BINS)
    most, best, free_most, free_best = -np.inf, 0, -np.inf, 0
    for turn in range(-bins, bins + 1):
        agreement = both = 0
        for b in range(BINS):
            off = abs(seen[b] - expected[BINS + turn + b])
            agreement += SAME_RANGE - (1 + PENALTY) * min(off, SAME_RANGE) if off < UNSEEN else 0
            both += 1 if off < UNSEEN else 0
        turned = turn * BIN / scale
        score = agreement / (SAME_RANGE * max(both, MIN_OVERLAP))
        if score > free_most:
            free_most, free_best = score, turn
        score -= TURN_COST * min(turned * turned, 1.0)
        if score > most:
            most, best = score, turn
    return float(best * BIN), float(free_best * BIN), float(most)
