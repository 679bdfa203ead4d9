"""The reward for recognising places: its terms, their weights, and when they are given."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.parts.beliefs import locate_home
from albot_env.tasks.core.reward import Weights
from albot_env.tasks.core.state import BatchState, EpisodeStats

RIGHT_KNOWN, RIGHT_NEW, FALSE_KNOWN, MISSED = range(4)
"""Kinds of answers: each is a term, an index into `PlaceRecognitionTerms`."""


class PlaceRecognitionTerms(NamedTuple):
    """The terms (see `PlaceRecognitionWeights`), in the order of `EpisodeStats.terms`."""

    right_known: float
    right_new: float
    false_known: float
    missed: float


@dataclass(frozen=True, kw_only=True)
class PlaceRecognitionWeights(Weights):
    """Weights of the terms of the reward for recognising places. The reward is their sum."""

    terms: ClassVar[Any] = PlaceRecognitionTerms

    right_known: float = 1.0
    """For recognising a known place as the right one."""
    right_new: float = 0.5
    """For calling a new place new."""
    false_known: float = -5.0
    """For naming a wrong place: a false match corrupts a map."""
    missed: float = -1.0
    """For calling a known place new."""


class TourTable(NamedTuple):
    """The tours of all robots, one row each; column k is the k-th arrival, column 0 the start."""

    counts: np.ndarray
    """(n,) int64: number of arrivals."""
    observations: np.ndarray
    """(n, arrivals, length) float32: observation at each arrival."""
    same: np.ndarray
    """(n, arrivals, arrivals) bool: which arrivals truly were at the same place."""
    rooms: np.ndarray
    """(n, arrivals) int64: index of the true room in its world; -1 between rooms."""
    poses: np.ndarray
    """(n, arrivals, 3) float64: true pose (world frame)."""
    beliefs: np.ndarray
    """(n, arrivals, 3) float64: believed pose (map frame)."""
    errors: np.ndarray
    """(n, arrivals) float64: distance between true and believed position (m)."""
    path_lengths: np.ndarray
    """(n, arrivals) float64: true path length (m)."""
    times: np.ndarray
    """(n, arrivals) float64: simulated time since the start (s)."""
    collided: np.ndarray
    """(n, arrivals) bool: whether the robot touched something since the previous arrival."""
    ranges: np.ndarray
    """(n, arrivals, beams) float64: laser ranges (m)."""
    echoes: np.ndarray
    """(n, arrivals, sonars) float64: sonar ranges (m)."""
    compasses: np.ndarray
    """(n, arrivals) float64: headings by the compass (rad); 0 without a compass."""


class AnswerStats(NamedTuple):
    """Statistics of the robots' answers, one row per robot."""

    answers: np.ndarray
    """(n,) int64: the latest answer."""
    right_answers: np.ndarray
    """(n,) int64: the latest earlier arrival at the present place, from 1; 0 if it is new."""
    arrivals: np.ndarray
    """(n,) int64: number of arrivals so far."""
    rooms: np.ndarray
    """(n,) int64: index of the robot's room in its world; -1 between rooms."""
    tallies: np.ndarray
    """(n, 4) int64: number of answers of each kind, in the order of the terms."""
    revisits: np.ndarray
    """(n,) int64: number of judged places that had been visited before."""
    precision: np.ndarray
    """(n,) float64: share of the places recognised that were right; 1 if there are none."""
    recall: np.ndarray
    """(n,) float64: share of the revisited places that were recognised; 1 if there are none."""
    success: np.ndarray
    """(n,) bool: whether all is judged, no place falsely recognised, and recall is high enough."""
    ended: np.ndarray
    """(n,) bool: whether all arrivals are judged."""
    collided: np.ndarray
    """(n,) bool: whether the robot touched something since the previous arrival."""
    times: np.ndarray
    """(n,) float64: simulated time since the start (s)."""


@KernelDispatcher
@kernel(arrays=True, nogil=True)
def judge_answers(rows: np.ndarray, arguments: KernelArguments, observations: np.ndarray) -> None:
    """Reward the answers of robots `rows`, and move each to its next arrival.

    The next observation goes into each robot's row of `observations`. `arguments` holds the weights
    (`PlaceRecognitionTerms`), the recall needed for success, the observation after the last answer
    (length,), `TourTable`, `BatchState`, `EpisodeStats` and `AnswerStats`.
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
        answers.success[i] = ended and is_success(false, answers.recall[i], wanted)
        here = min(answered + 1, last)
        _show_arrival(i, here, tours, state, stats, answers)
        answers.right_answers[i] = 0 if ended else _latest(tours.same[i], here)
        observations[i] = nothing if ended else tours.observations[i, here]


@kernel()
def is_success(false: int, recall: float, wanted: float) -> bool:
    """Return whether a whole tour was judged well: no place falsely known, `wanted` recall."""
    return false == 0 and recall >= wanted


@kernel()
def _kind(same: np.ndarray, here: int, answer: int, right: int) -> int:
    """Return the kind of an answer."""
    if answer == 0:
        return MISSED if right > 0 else RIGHT_NEW
    return RIGHT_KNOWN if answer <= here and same[here, answer - 1] else FALSE_KNOWN


@kernel()
def _latest(same: np.ndarray, here: int) -> int:
    """Return the latest earlier arrival at the place of arrival `here`, from 1; 0 for none."""
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
    """Put robot i at an arrival of its tour."""
    state.poses[i] = tours.poses[i, here]
    state.beliefs[i] = tours.beliefs[i, here]
    state.ranges[i] = tours.ranges[i, here]
    state.echoes[i] = tours.echoes[i, here]
    state.compasses[i] = tours.compasses[i, here]
    belief = state.beliefs[i]
    turn = math.cos(belief[2]), math.sin(belief[2])
    locate_home(belief, turn, state.homes_in_map[i], state.homes_in_robot[i])
    stats.position_errors[i] = tours.errors[i, here]
    stats.path_lengths[i] = tours.path_lengths[i, here]
    answers.rooms[i] = tours.rooms[i, here]
    answers.arrivals[i] = here + 1
    answers.collided[i] = tours.collided[i, here]
    answers.times[i] = tours.times[i, here]
