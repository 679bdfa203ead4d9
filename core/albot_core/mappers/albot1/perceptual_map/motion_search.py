"""Search for the likeliest motions between two views: those at which their range profiles agree.

The turn is searched at the odometer's translation, or at the translations of a grid around it. Only
a few motions are aligned, so the motions taken from one search differ in their turns. Compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.frames import copy_pose
from albot_core.mappers.albot1.perceptual_map.odometer_error import (
    HAS_MOVED,
    LAST_X,
    LAST_Y,
    shift_scale,
)
from albot_core.mappers.albot1.perceptual_map.range_profile import (
    TURNS,
    UNSEEN_THERE,
    agreement,
    fill_profile,
    score_turns,
    take_likeliest,
    turn_at,
    turn_cost,
)
from albot_core.mappers.albot1.perceptual_map.submap import ViewPair, describe_previous
from albot_core.matching.lines import wrap

ALWAYS, BY_TURN, MOTIONS = 2, 4, 8
"""Bounds on the number of motions that are aligned: first the likeliest turn and another that is
nearly as likely; then, as long as no match is sure, the odometer's own motion and a further turn;
at last motions of other translations."""
NEARLY = 0.15
"""A turn is nearly as likely as the best one if its score is at most this much lower."""
ODD_TURN = 5.0
"""Turns are first searched up to this many times the scale of the odometer's errors. A misread view
fits somewhere else as well, but seldom where the odometer may have led."""
WIDEST_TURN = np.radians(90.0)
"""Turns are searched up to this where no match is sure (rad)."""
REACH = 0.5
"""Other translations are tried up to at least this far from the expected one (m)."""
GUESSES, GUESS_CELLS, GUESS_SPACING = 16, 6, 0.2
"""Without an odometer: maximum number of motions that are aligned, number of translations tried in
each direction along each axis, and their spacing (m)."""
GUESS_NEARLY = 0.5
"""The same as NEARLY, without an odometer, where the translation has to be found as well."""
SHIFT_COST = 0.1
"""A translation that differs from the odometer's by the scale of its errors costs log 2 times this,
in shares of agreeing directions (as for a turn, see `turn_cost`)."""
CHANGE_COST = 0.1
"""Without an odometer, the cost of a translation that differs by 1 m from the last one, in shares
of agreeing directions. It is needed along a corridor, where the views do not show the
translation."""
STANDING, ALIKE = 0.05, 0.9
"""Without an odometer, a robot is taken to stand still if it moved less than the first value
between the last two views (m) and the next view's profile agrees with the last one's by more than
the second. After a motion of a few centimetres the agreement is lower."""

_trial, _of_one = scratch(3), scratch(TURNS)


class MotionSearch(NamedTuple):
    """The result of a search of motions, from which motions are taken one by one."""

    scores: np.ndarray
    """(TURNS,) float64: each turn's best score of all translations."""
    shifts: np.ndarray
    """(TURNS, 2) float64: the translation with that score (m)."""
    turns: np.ndarray
    """(BY_TURN,) float64: the turns (rad) at which motions with the odometer's translation were
    aligned; NaN for none."""


@kernel()
def most_motions(pair: ViewPair) -> int:
    """Return the maximum number of motions to be aligned.

    It is 1 if there is no odometer, or the robot has not moved yet, and the view shows that the
    robot stands still. This is common before a robot first moves, and a search takes twenty times
    as long as all the rest.
    """
    if pair.odometer[HAS_MOVED] > 0.0:
        return MOTIONS
    x, y = pair.odometer[LAST_X], pair.odometer[LAST_Y]
    if x * x + y * y >= STANDING * STANDING:
        return GUESSES
    return 1 if agreement_after(pair, pair.motion) > ALIKE else GUESSES


@kernel()
def propose_motion(
    k: int, first: float, most: int, pair: ViewPair, search: MotionSearch, trial: np.ndarray
) -> tuple[float, float]:
    """Propose the `k`-th motion to be aligned. Returns its score and turn, as `take_motion` does.

    `first` is the score of the first motion, `most` the result of `most_motions`.
    """
    motion, scale, limits = pair.motion, pair.turn_scale, pair.limits
    if pair.odometer[HAS_MOVED] == 0.0:
        if k == 0:
            cells = GUESS_CELLS if most > 1 else 0
            search_motions(pair, cells, GUESS_SPACING, np.pi, np.inf, search)
    elif k == 0:
        widest = min(limits.turn_search, ODD_TURN * scale)
        search_motions(pair, 0, 0.0, widest, NEARLY, search)
    elif k == ALWAYS:
        # Where the two views hardly agree under any turn, the map may show that this motion is
        # right.
        copy_pose(motion, trial)
        return first, 0.0
    elif k == BY_TURN:
        reach = max(REACH, 2.0 * shift_scale(pair.odometer, limits))
        search_motions(pair, 1, reach, WIDEST_TURN, np.inf, search)
    score, turn = take_motion(search, motion, trial)
    while score > -np.inf and _is_aligned(turn, trial, motion, search.turns):
        score, turn = take_motion(search, motion, trial)
    return score, turn


@kernel()
def is_likely(k: int, score: float, first: float, is_sure: bool, odometer: np.ndarray) -> bool:
    """Return whether to align the `k`-th motion, by its score and that of the `first` one.

    With an odometer, a motion with its translation is aligned if its score is at most NEARLY below
    the first's; a motion with another translation is always aligned. Without an odometer, every
    motion is aligned as long as no match `is_sure`, and then only those with a score at most
    GUESS_NEARLY below the first's.
    """
    if score == -np.inf:
        return False
    if odometer[HAS_MOVED] == 0.0:
        return not is_sure or score >= first - GUESS_NEARLY
    return k >= BY_TURN or score >= first - NEARLY


@kernel()
def _is_aligned(turn: float, trial: np.ndarray, motion: np.ndarray, turns: np.ndarray) -> bool:
    """Return whether a motion with the odometer's translation and one of `turns` was aligned."""
    if trial[0] == motion[0] and trial[1] == motion[1]:
        for aligned in turns:
            if turn == aligned:
                return True
    return False


@kernel()
def search_motions(
    pair: ViewPair,
    cells: int,
    spacing: float,
    widest: float,
    nearly: float,
    search: MotionSearch,
) -> None:
    """Compare the profile of the view, which is in the buffers, with that of the previous view.

    Args:
        pair: The two views.
        cells: Number of translations tried in each direction along each axis, around the motion's.
        spacing: Distance between these translations (m).
        widest: The largest turn (rad) that is added to the motion's.
        nearly: Turns whose score is farther than this below the best one may be left out.
        search: Filled with each turn's best score and the translation of that score.
    """
    buffers, motion, trial, of_one = pair.buffers, pair.motion, _trial(), _of_one()
    copy_pose(motion, trial)
    for place in range(TURNS):
        search.scores[place] = -np.inf
    side = 2 * cells + 1
    for cell in range(side * side):
        trial[0] = motion[0] + spacing * (cell // side - cells)
        trial[1] = motion[1] + spacing * (cell % side - cells)
        total = describe_previous(pair.previous, trial, 0, buffers)
        fill_profile(buffers.expected[:total], UNSEEN_THERE, buffers.profiles[1])
        profiles = buffers.profiles[0], pair.directions, buffers.profiles[1]
        score_turns(*profiles, widest, pair.turn_scale, of_one, nearly)
        cost = shift_cost(trial, motion, pair.odometer, pair.limits)
        for place in range(TURNS):
            if of_one[place] - cost > search.scores[place]:
                search.scores[place] = of_one[place] - cost
                search.shifts[place, 0], search.shifts[place, 1] = trial[0], trial[1]


@kernel()
def take_motion(
    search: MotionSearch, motion: np.ndarray, likely: np.ndarray
) -> tuple[float, float]:
    """Take the likeliest motion out of a search; return its score and its turn.

    `likely` is set to the motion's translation with the turn of `motion` (rad); the turn returned
    is to be added to it. The score is -inf where no motion is left.
    """
    place, score = take_likeliest(search.scores)
    copy_pose(motion, likely)
    if score > -np.inf:
        likely[0], likely[1] = search.shifts[place, 0], search.shifts[place, 1]
    return score, turn_at(place)


@kernel()
def shift_cost(
    moved: np.ndarray, motion: np.ndarray, odometer: np.ndarray, limits: Albot1Limits
) -> float:
    """Return the cost of a translation that differs from the odometer's `motion` (see SHIFT_COST).

    Without an odometer it is compared with the last translation (see CHANGE_COST).
    """
    if odometer[HAS_MOVED] == 0.0:
        dx, dy = moved[0] - odometer[LAST_X], moved[1] - odometer[LAST_Y]
        return float(CHANGE_COST * (dx * dx + dy * dy))
    scale = shift_scale(odometer, limits)
    dx, dy = (moved[0] - motion[0]) / scale, (moved[1] - motion[1]) / scale
    return float(SHIFT_COST * np.log1p(dx * dx + dy * dy))


@kernel()
def motion_cost(
    moved: np.ndarray,
    motion: np.ndarray,
    scale: float,
    odometer: np.ndarray,
    limits: Albot1Limits,
) -> float:
    """Return the cost of a motion that differs from the odometer's `motion`.

    `scale` is that of the odometer's turn errors (rad).
    """
    turn = turn_cost(wrap(moved[2] - motion[2]), scale)
    return float(turn + shift_cost(moved, motion, odometer, limits))


@kernel()
def agreement_after(pair: ViewPair, motion: np.ndarray) -> float:
    """Return how well the two views' profiles agree if the robot moved by `motion` between them."""
    # Written behind the rows of all expected walls, which are still needed.
    previous, buffers = pair.previous, pair.buffers
    first = buffers.expected.shape[0] - previous.size[0]
    total = describe_previous(previous, motion, first, buffers)
    fill_profile(buffers.expected[first:total], UNSEEN_THERE, buffers.profiles[1])
    return agreement(buffers.profiles[0], pair.directions, buffers.profiles[1], 0)
