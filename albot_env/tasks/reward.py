"""Rewards as named terms: what each is worth stands in one place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_env.tasks import exploration_kernel, homing_kernel, judging_kernel, round_trip_kernel


@dataclass(frozen=True, kw_only=True)
class Weights:
    """What a reward's terms are worth, each in the field of its name."""

    terms: ClassVar[tuple[str, ...]]
    """The terms, in their order."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not np.isfinite(value):
                raise InputError(f"{type(self).__name__}.{name}", "a finite number", str(value))

    @property
    def values(self) -> Float64[np.ndarray, "terms"]:
        """The weights in the order of the terms."""
        return np.array([float(getattr(self, name)) for name in self.terms])


@dataclass(frozen=True, kw_only=True)
class ExploreWeights(Weights):
    """What the terms of the exploration reward are worth. A reward is their sum."""

    terms: ClassVar[tuple[str, ...]] = exploration_kernel.TERMS

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


@dataclass(frozen=True, kw_only=True)
class HomingWeights(Weights):
    """What the terms of the homing reward are worth. A reward is their sum.

    Progress is shaped by a potential (Ng, Harada and Russell, Policy invariance under reward
    transformations, ICML 1999): Φ = -`progress` · true way home (m), and 0 once
    home was declared; and so is which way the robot looks, by Φ = -`facing` · (1 - cos α) / 2, α
    from its heading to where the true way home turns next. A step is worth `discount` · Φ after
    it - Φ before it, so that the discounted terms of an episode that ends with a declaration
    sum to -Φ of its beginning, whatever way the robot took, and the best policy is the one
    without shaping.
    """

    terms: ClassVar[tuple[str, ...]] = homing_kernel.TERMS

    success: float = 10.0
    """For declaring home where it is."""
    false_declaration: float = -5.0
    """For declaring home elsewhere."""
    progress: float = 0.1
    """For every metre that the way home gets shorter (1/m), see above."""
    facing: float = 0.5
    """For turning from right away from the way home to face it, see above: without it learners
    who set out the wrong way drive on rather than turn."""
    collision: float = -0.1
    """For every step in contact with something."""
    time: float = -0.01
    """For every second that passes (1/s)."""
    discount: float = 0.995
    """The learner's own discount factor γ, of a step: with another one the best policy may
    change."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_discount(self)


@dataclass(frozen=True, kw_only=True)
class RoundTripWeights(Weights):
    """What the terms of the reward for exploring and coming home are worth. A reward is their sum.

    Progress is shaped by a potential that grows with time (Devlin and Kudenko, Dynamic
    potential-based reward shaping, AAMAS 2012): Φ = -`progress` · true way home (m) · share of
    the budget that is spent, and 0 once the episode is over. It lets the robot go away
    at first and draws it home towards the end. As in `HomingWeights` the discounted terms sum
    to -Φ of the beginning, which is 0, whatever the robot did: the best policy is the one
    without shaping.
    """

    terms: ClassVar[tuple[str, ...]] = round_trip_kernel.TERMS

    coverage: float = 0.02
    """For every square metre of ground truly covered for the first time (1/m²)."""
    room: float = 1.0
    """For every room truly entered for the first time."""
    success: float = 10.0
    """For declaring home where it is, in time and with enough ground covered."""
    false_declaration: float = -5.0
    """For declaring home elsewhere, or having covered too little."""
    late: float = -5.0
    """For having declared nothing when the budget is spent."""
    progress: float = 0.1
    """For every metre that the way home gets shorter when time is up (1/m), see above."""
    collision: float = -0.1
    """For every step in contact with something."""
    time: float = 0.0
    """For every second that passes (1/s): the budget is what presses."""
    discount: float = 0.995
    """The learner's own discount factor γ, of a step: with another one the best policy may
    change."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_discount(self)


@dataclass(frozen=True, kw_only=True)
class PlaceWeights(Weights):
    """What the terms of the reward for judging places are worth. A reward is their sum."""

    terms: ClassVar[tuple[str, ...]] = judging_kernel.TERMS

    right_known: float = 1.0
    """For a place known again as the one that it is."""
    right_new: float = 0.5
    """For a new place known as new."""
    false_known: float = -5.0
    """For a place taken for one that it is not: a false place spoils a map."""
    missed: float = -1.0
    """For a known place taken for new."""


def _check_discount(weights: HomingWeights | RoundTripWeights) -> None:
    if not 0 < weights.discount <= 1:
        place = f"{type(weights).__name__}.discount"
        raise InputError(place, "within (0, 1]", str(weights.discount))
