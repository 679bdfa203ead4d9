"""Logistic regression of successes on one number, such as an error.

The estimates are those of Firth's penalised likelihood (Bias reduction of maximum likelihood
estimates, Biometrika 80, 1993), which are finite also where a threshold separates all successes
from all failures (Heinze and Schemper, Statistics in Medicine 21, 2002).
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.errors import InputError

_ROUNDS = 100
"""Largest number of Newton steps."""
_STEP = 2.0
"""Largest change of a coefficient in a step."""
_CLOSE = 1e-8
"""Change of the coefficients below which they count as found."""
_ROUNDING = 1e-12
"""Relative error of the likelihood."""
_RESAMPLES = 1000


@dataclass(frozen=True, kw_only=True)
class Logistic:
    """The probability of success as 1 / (1 + exp(-(intercept + slope x)))."""

    intercept: float
    """Logarithm of the odds at x = 0."""
    slope: float
    """Its change per unit of x."""

    def probability(self, x: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
        """Return the probability of success at each x."""
        return np.asarray(_sigmoid(self.intercept + self.slope * x))

    def x_at(self, probability: float) -> float:
        """Return the x with a probability of success; NaN if the slope is 0."""
        odds = np.log(probability / (1 - probability))
        return float((odds - self.intercept) / self.slope) if self.slope else float("nan")


def fit_logistic(
    x: Float64[np.ndarray, "n"],
    success: Bool[np.ndarray, "n"],
    weights: Float64[np.ndarray, "n"] | None = None,
) -> Logistic:
    """Fit the probability of success by Firth's penalised likelihood.

    Of several maxima, which a far x can make, it is the one uphill from equal chances for all.

    Args:
        x: The numbers.
        success: Whether each was a success.
        weights: How often each counts; once by default.

    Raises:
        InputError: There are not two different x that count.
    """
    weights = np.ones(len(x)) if weights is None else np.asarray(weights, np.float64)
    counted = weights > 0
    x, success, weights = x[counted], success[counted], weights[counted]
    if len(np.unique(x)) < 2:
        raise InputError("fit_logistic", "two different x or more", str(len(np.unique(x))))
    centre, scale = float(x.mean()), float(x.std())
    columns = np.stack((np.ones(len(x)), (x - centre) / scale), axis=-1)
    found = np.zeros(2)
    now = _likelihood(columns, success, weights, found)
    for _ in range(_ROUNDS):
        chances = _sigmoid(columns @ found)
        variances = chances * (1 - chances)
        information = (columns * (weights * variances)[:, None]).T @ columns
        inverse = np.linalg.inv(information)
        leverages = weights * variances * np.einsum("ij,jk,ik->i", columns, inverse, columns)
        # Firth 1993, eq. (3.1) for a logistic model: the score with h (1/2 - p) added. It is that
        # of data with h / 2 more successes and failures each, whose Newton step is taken.
        score = columns.T @ (weights * (success - chances) + leverages * (0.5 - chances))
        augmented = (weights + leverages) * variances
        step = np.linalg.solve((columns * augmented[:, None]).T @ columns, score)
        step *= min(1.0, _STEP / max(float(np.abs(step).max()), 1e-300))
        after = now
        # Half the step until it is no step down; the tolerance is that of rounding.
        while np.abs(step).max() >= _CLOSE and not (
            (after := _likelihood(columns, success, weights, found + step))
            >= now - _ROUNDING * abs(now)
        ):
            step = step / 2
        found, now = found + step, after
        if np.abs(step).max() < _CLOSE:
            break
    slope = float(found[1] / scale)
    return Logistic(intercept=float(found[0]) - slope * centre, slope=slope)


def bootstrap_logistic(
    x: Float64[np.ndarray, "n"],
    success: Bool[np.ndarray, "n"],
    clusters: Sequence[Hashable],
    rng: np.random.Generator,
) -> list[Logistic]:
    """Return fits to resamples in which clusters are drawn with all of their values.

    Quantiles of what they say are percentile bootstrap intervals (see `bootstrap_clusters`).
    Resamples in which all x are equal are left out.

    Args:
        x: The numbers.
        success: Whether each was a success.
        clusters: The cluster of each, such as the world of an episode.
        rng: Draws the resamples.
    """
    numbers = {cluster: k for k, cluster in enumerate(dict.fromkeys(clusters))}
    of = np.array([numbers[cluster] for cluster in clusters], np.int64)
    fits = []
    for _ in range(_RESAMPLES):
        drawn = rng.integers(len(numbers), size=len(numbers))
        weights = np.bincount(drawn, minlength=len(numbers))[of].astype(np.float64)
        if len(np.unique(x[weights > 0])) > 1:
            fits.append(fit_logistic(x, success, weights))
    return fits


def _likelihood(
    columns: Float64[np.ndarray, "n 2"],
    success: Bool[np.ndarray, "n"],
    weights: Float64[np.ndarray, "n"],
    found: Float64[np.ndarray, "2"],
) -> float:
    """Return the logarithm of Firth's penalised likelihood (Firth 1993, section 3)."""
    logits = columns @ found
    chances = _sigmoid(logits)
    information = (columns * (weights * chances * (1 - chances))[:, None]).T @ columns
    own = -(weights * np.logaddexp(0.0, np.where(success, -logits, logits))).sum()
    return float(own + 0.5 * np.linalg.slogdet(information)[1])


def _sigmoid(logit: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * logit)))
