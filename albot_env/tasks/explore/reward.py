"""The reward for exploring: its terms, their weights, and when they are given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.claims import FALSE, RIGHT, judge_claim
from albot_env.tasks.core.reward import Weights, set_reward
from albot_env.tasks.core.state import update_stats


class ExploreTerms(NamedTuple):
    """The terms (see `ExploreWeights`), in the order of the columns of `EpisodeStats.terms`."""

    coverage: float
    room: float
    place_recognized: float
    place_mistaken: float
    collision: float
    time: float


@dataclass(frozen=True, kw_only=True)
class ExploreWeights(Weights):
    """Weights of the terms of the exploration reward. The reward is their sum."""

    terms: ClassVar[Any] = ExploreTerms

    coverage: float = 0.02
    """For every square metre of ground truly covered for the first time (1/m²)."""
    room: float = 1.0
    """For every room truly entered for the first time."""
    place_recognized: float = 1.0
    """For the first right claim in a room (see `claims`). It is paid once per room, since otherwise
    driving in and out of one room would be the best policy."""
    place_mistaken: float = -2.0
    """For every false claim: twice the pay of a right one, so that always claiming loses."""
    collision: float = -0.1
    """For every step in contact with something."""
    time: float = -0.01
    """For every second that passes (1/s)."""


@KernelDispatcher
@kernel(nogil=True)
def compute_reward(rows: np.ndarray, arguments: KernelArguments, elapsed: float) -> None:
    """Update statistics and rewards of robots at the end of a step of `elapsed` (s).

    `arguments` holds the weights (`ExploreTerms`), the area (m²) of a coverage cell, whether each
    robot touched something (n,), `BatchState`, `Progress`, `EpisodeStats` and `Claims`.
    """
    weights, cell_area, collided, state, progress, stats, claims = unpack(arguments)
    for i in rows:
        update_stats(i, cell_area, state, progress, stats)
        room, is_new = progress.room[i], progress.new_room[i]
        claim = judge_claim(
            i, stats.steps[i], stats.path_lengths[i], state.poses[i], room, is_new, claims
        )
        if stats.steps[i] > 0:
            terms = ExploreTerms(
                coverage=weights.coverage * progress.new_ground[i] * cell_area,
                room=weights.room if is_new else 0.0,
                place_recognized=weights.place_recognized if claim == RIGHT else 0.0,
                place_mistaken=weights.place_mistaken if claim == FALSE else 0.0,
                collision=weights.collision if collided[i] else 0.0,
                time=weights.time * elapsed,
            )
            set_reward(i, terms, stats)
