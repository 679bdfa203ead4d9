"""The likeliest motions between two views: those under which their range profiles agree. Compiled.

The turn is searched under the odometer's translation, or under those of a grid around it. Few
motions are aligned, so each that is taken out of a search differs in its turn from the others.
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
"""How many motions are aligned at the most: the likeliest turn, and another that is nearly as
likely; then, as long as no match is sure, the odometer's own, a further turn, and motions of other
translations."""
NEARLY = 0.15
"""A turn is nearly as likely as another with a score no more than this below it."""
ODD_TURN = 5.0
"""Turns are first sought up to so many times the scale of the odometer's errors: a misread view
fits somewhere, too, but seldom where the odometer may have led."""
WIDEST_TURN = np.radians(90.0)
"""Turns are sought up to this where no match is sure (rad)."""
REACH = 0.5
"""How far around the expected motion others are tried, at least (m)."""
GUESSES, GUESS_CELLS, GUESS_SPACING = 16, 6, 0.2
"""Without an odometer so many motions are aligned at the most, of so many translations either way,
so far apart (m)."""
GUESS_NEARLY = 0.5
"""Without an odometer, where the translation has to be found as well, a motion is nearly as likely
as another with a score no more than this below it."""
SHIFT_COST = 0.1
"""Where the odometer is off by its scale, the translation costs log 2 times this, in shares of
agreeing directions (as for a turn, see `turn_cost`)."""
CHANGE_COST = 0.1
"""Without an odometer a translation that differs by 1 m from the last one costs so much, in shares
of agreeing directions: along a corridor the views cannot tell it."""
STANDING, ALIKE = 0.05, 0.9
"""Without an odometer a robot that moved less than this between the last two views (m) stands still
where the next view's profile agrees with the last one's by more than this: with a few centimetres'
motion it does not."""

_trial, _of_one = scratch(3), scratch(TURNS)


class MotionSearch(NamedTuple):
    """What a search of motions has found, and what was made of it."""

    scores: np.ndarray
    """(TURNS,) float64: each turn's best score of all translations…"""
    shifts: np.ndarray
    """(TURNS, 2) float64: …and with that translation (m)."""
    turns: np.ndarray
    """(BY_TURN,) float64: the turns with which motions of the odometer's translation were aligned
    (rad); NaN for none."""


@kernel()
def most_motions(pair: ViewPair) -> int:
    """Return how many motions may be aligned.

    It is one, of the odometer's translation, where there is no odometer, or the robot has not moved
    yet, and the view shows it to stand as it stood before. Most robots do so before they first
    move, and to look for a motion takes twenty times as long as all the rest.
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
    """Propose the motion that is aligned as the `k`-th, as `take_motion` does.

    `first` is the score of the one before all others, `most` as `most_motions` says.
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
        # The two views may hardly agree under any turn; the map may know better.
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
    """Whether the `k`-th motion is likely enough to be aligned, where `first` is the first's score.

    With an odometer a motion of its translation is aligned if its score is at most NEARLY below the
    first's, and one of another translation always. Without an odometer every motion is as long as
    no match `is_sure`; then only one whose score is at most GUESS_NEARLY below the first's.
    """
    if score == -np.inf:
        return False
    if odometer[HAS_MOVED] == 0.0:
        return not is_sure or score >= first - GUESS_NEARLY
    return k >= BY_TURN or score >= first - NEARLY


@kernel()
def _is_aligned(turn: float, trial: np.ndarray, motion: np.ndarray, turns: np.ndarray) -> bool:
    """Whether a motion was aligned before: with the odometer's translation and one of `turns`."""
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
    """Compare the profile of the view, which is in the buffers, with that of the previous one.

    Args:
        pair: The two views.
        cells: So many translations either way along each axis are tried around the motion's…
        spacing: …so far apart (m).
        widest: The largest turn (rad) that is added to the motion's.
        nearly: Turns whose score is farther than this below the best one may be left out.
        search: Filled with each turn's best score, and its translation.
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
    """Take the likeliest motion out of what `search_motions` has found: its score, and its turn.

    `likely` becomes the motion's translation, with the turn of `motion` (rad), to which the turn
    returned is to be added. The score is -inf where none is left.
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
    """What a translation costs that differs from that of the odometer's `motion` (see SHIFT_COST).

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
    """What it costs that the robot moved otherwise than the odometer's `motion`.

    `scale` is that of the odometer's errors of turn (rad).
    """
    turn = turn_cost(wrap(moved[2] - motion[2]), scale)
    return float(turn + shift_cost(moved, motion, odometer, limits))


@kernel()
def agreement_after(pair: ViewPair, motion: np.ndarray) -> float:
    """How well the profiles of the two views agree if the robot moved by `motion` between them."""
    # Behind all that is expected, whose rows are still of use.
    previous, buffers = pair.previous, pair.buffers
    first = buffers.expected.shape[0] - previous.size[0]
    total = describe_previous(previous, motion, first, buffers)
    fill_profile(buffers.expected[first:total], UNSEEN_THERE, buffers.profiles[1])
    return agreement(buffers.profiles[0], pair.directions, buffers.profiles[1], 0)
