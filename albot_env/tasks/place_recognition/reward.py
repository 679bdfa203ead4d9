"""The compiled worth of judging where one is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.observation_parts import find_home
from albot_env.tasks.core.reward import Weights
from albot_env.tasks.core.state import Senses, Standing

TERMS = ("right_known", "right_new", "false_known", "missed")
"""The reward's terms, in the order of the columns of `Standing.terms`: a place known as the one
that it is; a new one known as new; a place taken for one that it is not; one taken for new."""


class Sheets(NamedTuple):
    """The tours of all robots, a row each; column k is the k-th arrival, the start the first."""

    counts: np.ndarray
    """(n,) int64: how many arrivals there are."""
    questions: np.ndarray
    """(n, arrivals, length) float32: what is observed at each."""
    same: np.ndarray
    """(n, arrivals, arrivals) bool: which arrivals truly were at one place."""
    rooms: np.ndarray
    """(n, arrivals) int64: in which room of its world the robot truly is; -1 between rooms."""
    poses: np.ndarray
    """(n, arrivals, 3) float64: where it truly is (world frame)."""
    beliefs: np.ndarray
    """(n, arrivals, 3) float64: where it believes to be (map frame)."""
    errors: np.ndarray
    """(n, arrivals) float64: how far that is from where it truly is (m)."""
    path_lengths: np.ndarray
    """(n, arrivals) float64: how far it has driven (m)."""
    times: np.ndarray
    """(n, arrivals) float64: simulated time since it set out (s)."""
    collided: np.ndarray
    """(n, arrivals) bool: whether it has touched something since the arrival before."""
    ranges: np.ndarray
    """(n, arrivals, beams) float64: what its laser sees (m)."""
    echoes: np.ndarray
    """(n, arrivals, sonars) float64: what its sonars hear (m)."""


class Judgement(NamedTuple):
    """How well robots judge, a row each."""

    answers: np.ndarray
    """(n,) int64: the answer last given."""
    right_answers: np.ndarray
    """(n,) int64: the latest earlier arrival at the present place, from 1; 0 if it is new."""
    arrivals: np.ndarray
    """(n,) int64: how often it has arrived."""
    rooms: np.ndarray
    """(n,) int64: the room of its world that it is in; -1 between rooms."""
    tallies: np.ndarray
    """(n, 4) int64: how many answers were of which kind, in the order of `TERMS`."""
    revisits: np.ndarray
    """(n,) int64: how many of the places judged had been visited before."""
    precision: np.ndarray
    """(n,) float64: share of the places taken for known ones that were right; 1 where none was."""
    recall: np.ndarray
    """(n,) float64: share of the places revisited that were known; 1 where none was."""
    success: np.ndarray
    """(n,) bool: whether all is judged, no place falsely known, and enough were known."""
    ended: np.ndarray
    """(n,) bool: whether all is judged."""
    collided: np.ndarray
    """(n,) bool: whether it has touched something since the arrival before."""
    times: np.ndarray
    """(n,) float64: simulated time since it set out (s)."""


@KernelDispatcher
@kernel(arrays=True, nogil=True)
def judge(rows: np.ndarray, arguments: KernelArguments, observations: np.ndarray) -> None:
    """Judge the answers of robots `rows`, and show them where they have arrived next.

    Each one's observation goes into its row of `observations`. `arguments` holds the weights
    (terms,) of the reward, the recall that is wanted for success, what is observed when
    all is judged (length,), `Sheets`, `Senses`, `Standing` and `Judgement`.
    """
    weights, wanted, nothing, sheets, senses, standing, j = unpack(arguments)
    for i in rows:
        answered, last = standing.steps[i], sheets.counts[i] - 1
        terms, tallies = standing.terms[i], j.tallies[i]
        terms[:] = 0.0
        if answered == 0:
            tallies[:] = 0
            j.revisits[i] = 0
        elif answered <= last:
            kind = _kind(sheets.same[i], answered, j.answers[i], j.right_answers[i])
            tallies[kind] += 1
            terms[kind] = weights[kind]
            j.revisits[i] += j.right_answers[i] > 0
        standing.rewards[i] = terms[0] + terms[1] + terms[2] + terms[3]
        j.ended[i] = answered > 0 and answered >= last
        _weigh(i, wanted, j)
        here = min(answered + 1, last)
        _show(i, here, sheets, senses, standing, j)
        j.right_answers[i] = 0 if j.ended[i] else _latest(sheets.same[i], here)
        observations[i] = nothing if j.ended[i] else sheets.questions[i, here]


@kernel()
def _kind(same: np.ndarray, here: int, answer: int, right: int) -> int:
    """What kind of answer it is, as `TERMS` go."""
    if answer == 0:
        return 3 if right > 0 else 1
    return 0 if answer <= here and same[here, answer - 1] else 2


@kernel()
def _latest(same: np.ndarray, here: int) -> int:
    """The latest earlier arrival at the place of the arrival `here`, from 1; 0 for none."""
    for k in range(here - 1, -1, -1):
        if same[here, k]:
            return k + 1
    return 0


@kernel()
def _weigh(i: int, wanted: float, j: Judgement) -> None:
    """Bring robot i's precision, recall and success up to date."""
    right, false = j.tallies[i, 0], j.tallies[i, 2]
    j.precision[i] = right / (right + false) if right + false > 0 else 1.0
    j.recall[i] = right / j.revisits[i] if j.revisits[i] > 0 else 1.0
    j.success[i] = j.ended[i] and false == 0 and j.recall[i] >= wanted


@kernel(arrays=True)
def _show(
    i: int, here: int, sheets: Sheets, senses: Senses, standing: Standing, j: Judgement
) -> None:
    """Let robot i stand at an arrival of its tour."""
    senses.poses[i] = sheets.poses[i, here]
    senses.beliefs[i] = sheets.beliefs[i, here]
    senses.ranges[i] = sheets.ranges[i, here]
    senses.echoes[i] = sheets.echoes[i, here]
    belief = senses.beliefs[i]
    turn = math.cos(belief[2]), math.sin(belief[2])
    find_home(belief, turn, senses.home_places[i], senses.homes[i])
    standing.position_errors[i] = sheets.errors[i, here]
    standing.path_lengths[i] = sheets.path_lengths[i, here]
    j.rooms[i] = sheets.rooms[i, here]
    j.arrivals[i] = here + 1
    j.collided[i] = sheets.collided[i, here]
    j.times[i] = sheets.times[i, here]


@dataclass(frozen=True, kw_only=True)
class PlaceWeights(Weights):
    """What the terms of the reward for judging places are worth. A reward is their sum."""

    terms: ClassVar[tuple[str, ...]] = TERMS

    right_known: float = 1.0
    """For a place known again as the one that it is."""
    right_new: float = 0.5
    """For a new place known as new."""
    false_known: float = -5.0
    """For a place taken for one that it is not: a false place spoils a map."""
    missed: float = -1.0
    """For a known place taken for new."""
