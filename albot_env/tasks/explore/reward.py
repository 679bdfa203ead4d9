"""The compiled worth of exploring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.reward import Weights
from albot_env.tasks.core.state import follow
from albot_env.tasks.explore.claims import FALSE, RIGHT, forget_claims, judge_claim

TERMS = ("coverage", "room", "place_recognized", "place_mistaken", "collision", "time")
"""The reward's terms, in the order of the columns of `Standing.terms`."""


@KernelDispatcher
@kernel(nogil=True)
def appraise(rows: np.ndarray, arguments: KernelArguments, elapsed: float) -> None:
    """Bring the standing of robots up to date after a survey, at the end of a step (s).

    `arguments` holds the weights (terms,) of the reward, the area (m²) of a cell of ground,
    whether each robot touched something (n,), `Senses`, `Findings`, `Standing` and `Claims`.
    """
    weights, cell_area, collided, senses, findings, standing, claims = unpack(arguments)
    for i in rows:
        follow(i, cell_area, senses, findings, standing)
        terms = standing.terms[i]
        if standing.steps[i] == 0:
            forget_claims(i, claims)
        room, is_new = findings.room[i], findings.new_room[i]
        claim = judge_claim(i, room, is_new, standing.path_lengths[i], claims)
        if standing.steps[i] > 0:
            terms[0] = weights[0] * findings.new_ground[i] * cell_area
            terms[1] = weights[1] if findings.new_room[i] else 0.0
            terms[2] = weights[2] if claim == RIGHT else 0.0
            terms[3] = weights[3] if claim == FALSE else 0.0
            terms[4] = weights[4] if collided[i] else 0.0
            terms[5] = weights[5] * elapsed
        standing.rewards[i] = terms[0] + terms[1] + terms[2] + terms[3] + terms[4] + terms[5]


@dataclass(frozen=True, kw_only=True)
class ExploreWeights(Weights):
    """What the terms of the exploration reward are worth. A reward is their sum."""

    terms: ClassVar[tuple[str, ...]] = TERMS

    coverage: float = 0.02
    """For every square metre of ground truly covered for the first time (1/m²)."""
    room: float = 1.0
    """For every room truly entered for the first time."""
    place_recognized: float = 0.5
    """For the first right claim to have been in a room before; once for each room, or going in
    and out of one would be all there is to do."""
    place_mistaken: float = -1.0
    """For every false claim."""
    collision: float = -0.1
    """For every step in contact with something."""
    time: float = -0.01
    """For every second that passes (1/s)."""
