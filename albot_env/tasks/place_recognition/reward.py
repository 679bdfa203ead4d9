"""The reward for recognising places: its terms, what each is worth, and when it is given."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.observation_parts import locate_home
from albot_env.tasks.core.reward import Weights
from albot_env.tasks.core.state import BatchState, EpisodeStats

RIGHT_KNOWN, RIGHT_NEW, FALSE_KNOWN, MISSED = range(4)
"""What an answer can be: each is a term, a place in `PlaceRecognitionTerms`."""


class PlaceRecognitionTerms(NamedTuple):
    """The terms (see `PlaceRecognitionWeights`), in the order of `EpisodeStats.terms`."""

    right_known: float
    right_new: float
    false_known: float
    missed: float


@dataclass(frozen=True, kw_only=True)
class PlaceRecognitionWeights(Weights):
    """What the terms of the reward for recognising places are worth. A reward is their sum."""

    terms: ClassVar[Any] = PlaceRecognitionTerms

    right_known: float = 1.0
    """For a place known again as the one that it is."""
    right_new: float = 0.5
    """For a new place known as new."""
    false_known: float = -5.0
    """For a place taken for one that it is not: a false place spoils a map."""
    missed: float = -1.0
    """For a known place taken for new."""


class TourTable(NamedTuple):
    """The tours of all robots, a row each; column k is the k-th arrival, the start the first."""

    counts: np.ndarray
    """(n,) int64: how many arrivals there are."""
    observations: np.ndarray
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


class AnswerStats(NamedTuple):
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
    """(n, 4) int64: how many answers were of which kind, in the order of the terms."""
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
def judge_answers(rows: np.ndarray, arguments: KernelArguments, observations: np.ndarray) -> None:
    """Reward the answers of robots `rows`, and show them where they have arrived next.

    Each one's observation goes into its row of `observations`. `arguments` holds the weights
    (`PlaceRecognitionTerms`) of the reward, the recall that is wanted for success, what is observed
    when all is judged (length,), `TourTable`, `BatchState`, `EpisodeStats` and `AnswerStats`.
    """
    weights, wanted, nothing, tours, state, stats, answers = unpack(arguments)
    for i in rows:
        answered, last = stats.steps[i], tours.counts[i] - 1
        terms, tallies = stats.terms[i], answers.tallies[i]
        terms[:] = 0.0
        if answered == 0:
            tallies[:] = 0
            answers.revisits[i] = 0
        elif answered <= last:
            right_answer = answers.right_answers[i]
            kind = _kind(tours.same[i], answered, answers.answers[i], right_answer)
            tallies[kind] += 1
            terms[kind] = weights[kind]
            answers.revisits[i] += right_answer > 0
        stats.rewards[i] = terms[0] + terms[1] + terms[2] + terms[3]  # All but one are 0.
        ended = answered > 0 and answered >= last
        right, false = tallies[RIGHT_KNOWN], tallies[FALSE_KNOWN]
        answers.ended[i] = ended
        answers.precision[i] = right / (right + false) if right + false > 0 else 1.0
        answers.recall[i] = right / answers.revisits[i] if answers.revisits[i] > 0 else 1.0
        answers.success[i] = ended and false == 0 and answers.recall[i] >= wanted
        here = min(answered + 1, last)
        _show_arrival(i, here, tours, state, stats, answers)
        answers.right_answers[i] = 0 if ended else _latest(tours.same[i], here)
        observations[i] = nothing if ended else tours.observations[i, here]


@kernel()
def _kind(same: np.ndarray, here: int, answer: int, right: int) -> int:
    """What kind of answer it is."""
    if answer == 0:
        return MISSED if right > 0 else RIGHT_NEW
    return RIGHT_KNOWN if answer <= here and same[here, answer - 1] else FALSE_KNOWN


@kernel()
def _latest(same: np.ndarray, here: int) -> int:
    """The latest earlier arrival at the place of the arrival `here`, from 1; 0 for none."""
    for k in range(here - 1, -1, -1):
        if same[here, k]:
            return k + 1
    return 0


@kernel(arrays=True)
def _show_arrival(
    i: int,
    here: int,
    tours: TourTable,
    state: BatchState,
    stats: EpisodeStats,
    answers: AnswerStats,
) -> None:
    """Let robot i stand at an arrival of its tour."""
    state.poses[i] = tours.poses[i, here]
    state.beliefs[i] = tours.beliefs[i, here]
    state.ranges[i] = tours.ranges[i, here]
    state.echoes[i] = tours.echoes[i, here]
    belief = state.beliefs[i]
    turn = math.cos(belief[2]), math.sin(belief[2])
    locate_home(belief, turn, state.home_places[i], state.homes[i])
    stats.position_errors[i] = tours.errors[i, here]
    stats.path_lengths[i] = tours.path_lengths[i, here]
    answers.rooms[i] = tours.rooms[i, here]
    answers.arrivals[i] = here + 1
    answers.collided[i] = tours.collided[i, here]
    answers.times[i] = tours.times[i, here]
