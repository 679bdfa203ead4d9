"""The part of a training plan that tells which of its values are searched, and how."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any, Literal

import numpy as np

from albot_core.errors import InputError
from albot_core.ranges import FINITE, FROM_ONE, Range, check_fields

_TRIALS = Range("a whole number from 1 to 10000", 1.0, 1e4, whole=True)
_FACTOR = Range("a number above 1", 1.0, beyond=True)
METRICS = {"success_rate": "is_success", "spl": "spl"}
"""The name in an info of each metric but the return."""
_FIXED = ("task", "seed", "n_timesteps", "evaluation", "checkpoint_every", "sweep")
"""Fields that are the same in all trials, so that these can be compared."""


@dataclass(frozen=True, kw_only=True)
class SearchSpace:
    """The values that one field of the plan may take: some choices, or all between two numbers."""

    choices: tuple[Any, ...] | None = None
    """The values; None for those from `low` to `high`."""
    low: float | None = None
    """The smallest value."""
    high: float | None = None
    """The largest value."""
    log: bool = False
    """Whether the logarithm is drawn uniformly, and not the value."""
    whole: bool = False
    """Whether the values are whole numbers."""

    def __post_init__(self) -> None:
        bounds = (self.low, self.high)
        if self.choices is not None:
            if not self.choices:
                raise InputError("SearchSpace.choices", "one value or more", "none")
            if bounds != (None, None) or self.log or self.whole:
                expected = "choices alone, without low, high, log and whole"
                raise InputError("SearchSpace.choices", expected, "both")
            return
        for name, bound in (("low", self.low), ("high", self.high)):
            if bound is None or bound not in FINITE:
                raise InputError(f"SearchSpace.{name}", "a finite number, or choices", str(bound))
            if self.whole and not float(bound).is_integer():
                raise InputError(f"SearchSpace.{name}", "a whole number", f"{bound:g}")
        low, high = self.bounds
        if not math.isfinite(high - low):
            raise InputError("SearchSpace.high", "a finite distance from low", f"{high:g}")
        if not low < high:
            raise InputError("SearchSpace.high", f"more than low, {low:g}", f"{high:g}")
        if self.log and low <= 0:
            raise InputError("SearchSpace.low", "a number above 0, because of log", f"{low:g}")

    @property
    def bounds(self) -> tuple[float, float]:
        """The smallest and the largest value, where there are no choices."""
        assert self.low is not None
        assert self.high is not None
        return self.low, self.high

    def draw(self, rng: np.random.Generator) -> Any:
        """Draw a value."""
        if self.choices is not None:
            return self.choices[int(rng.integers(len(self.choices)))]
        low, high = self.bounds
        if self.whole:
            low, high = low - 0.5, high + 0.5  # Each whole number has an equal part.
        if self.log:
            value = math.exp(rng.uniform(math.log(low), math.log(high)))
        else:
            value = rng.uniform(low, high)
        low, high = self.bounds
        value = min(max(value, low), high)
        return round(value) if self.whole else value


@dataclass(frozen=True, kw_only=True)
class SweepPlan:
    """A search for the best values of some fields of the plan, by Ray Tune.

    Each trial is a training with values of its own, and with the seed of the plan. Its plan differs
    from this one in these values alone, and in that each evaluation comes with a checkpoint.
    """

    parameters: Mapping[str, SearchSpace] = field(default_factory=dict)
    """The values to try, by the name of the field: `learning_rate`, or with dots for one within
    another, as `policy.net_arch` and `env.config.weights.collision`."""
    trials: int | None = 16
    """Number of trials, with values drawn at random; None for each combination of the choices."""
    metric: Literal["success_rate", "spl", "return"] = "success_rate"
    """What makes a trial the best: its mean over the episodes of an evaluation. Those that the task
    does not have are an error."""
    scheduler: Literal["asha", "median", "none"] = "asha"
    """Which trials end early: by `asha`, asynchronous successive halving (Li et al.,
    arXiv:1810.05934), all but the best of those that came as far; by `median`, those whose best is
    below the median of the others' means (Golovin et al., KDD 2017); by `none`, no trial."""
    grace: int | None = None
    """Samples of each trial before it may be ended; None for those to its first evaluation."""
    reduction: float = 4.0
    """One of so many trials goes on at each rung of `asha`; rungs lie at `grace` samples, and at so
    many times the one before."""

    def __post_init__(self) -> None:
        if not self.parameters:
            raise InputError("SweepPlan.parameters", "a field to search, or more", "none")
        for name in self.parameters:
            if name.partition(".")[0] in _FIXED:
                expected = f"fields that may differ: not {', '.join(_FIXED)}"
                raise InputError("SweepPlan.parameters", expected, name)
            within = next((each for each in self.parameters if each.startswith(f"{name}.")), None)
            if within is not None:
                expected = "each field once, alone or within another"
                raise InputError("SweepPlan.parameters", expected, f"{name} and {within}")
        if self.grace is not None:
            check_fields(self, FROM_ONE, "grace")
        check_fields(self, _FACTOR, "reduction")
        if self.trials is not None:
            check_fields(self, _TRIALS, "trials")
            return
        for name, space in self.parameters.items():
            if space.choices is None:
                expected = f"a number of trials, because {name} has no choices"
                raise InputError("SweepPlan.trials", expected, "null")
        count = math.prod(len(space.choices or ()) for space in self.parameters.values())
        if count not in _TRIALS:
            raise InputError("SweepPlan.parameters", "at most 10000 combinations", f"{count:,}")

    def draw(self, seed: int) -> list[dict[str, Any]]:
        """Return the values of each trial, by the name of the field; a function of the seed."""
        if self.trials is None:
            each = [space.choices or () for space in self.parameters.values()]
            return [dict(zip(self.parameters, values, strict=True)) for values in product(*each)]
        rng = np.random.default_rng((seed, 0x53574550))  # No stream of the training's.
        return [
            {name: space.draw(rng) for name, space in self.parameters.items()}
            for _ in range(self.trials)
        ]
