"""Confidence intervals of figures measured in a sample of episodes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float64
from scipy.stats import binomtest

from albot_core.errors import InputError

_RESAMPLES = 10_000


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Return the 95 % score interval of a probability (Wilson, J. Am. Stat. Assoc. 22, 1927).

    Raises:
        InputError: There are no trials, or more successes than trials.
    """
    if not 0 <= successes <= trials or trials == 0:
        raise InputError("wilson", "successes out of at least one trial", f"{successes}/{trials}")
    interval = binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def bootstrap(
    values: Float64[np.ndarray, "n"],
    measure: Callable[..., np.ndarray],
    rng: np.random.Generator,
) -> tuple[float, float]:
    """Return the 95 % percentile bootstrap interval of a statistic.

    Source: Efron and Tibshirani, An introduction to the bootstrap, 1993, chapter 13.

    Args:
        values: The sample.
        measure: The statistic: `np.mean`, `np.median` or another function that takes `axis`.
        rng: Draws the resamples.

    Raises:
        InputError: There are no values.
    """
    if not len(values):
        raise InputError("bootstrap", "at least one value", "none")
    drawn = values[rng.integers(len(values), size=(_RESAMPLES, len(values)))]
    low, high = np.quantile(measure(drawn, axis=1), (0.025, 0.975)).tolist()
    return low, high
