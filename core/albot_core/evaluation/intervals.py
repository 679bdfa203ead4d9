"""Confidence intervals of figures measured in a sample of episodes."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

import numpy as np
from jaxtyping import Bool, Float64
from scipy.special import ndtri, stdtrit

from albot_core.errors import InputError

_RESAMPLES = 10_000


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Return the 95 % score interval of a probability (Wilson, J. Am. Stat. Assoc. 22, 1927).

    Raises:
        InputError: There are no trials, or more successes than trials.
    """
    if not 0 <= successes <= trials or trials == 0:
        raise InputError("wilson", "successes out of at least one trial", f"{successes}/{trials}")
    return _score_interval(successes / trials, float(trials))


def wilson_clusters(
    successes: Bool[np.ndarray, "n"], clusters: Sequence[Hashable]
) -> tuple[float, float]:
    """Return the 95 % score interval of a probability from trials that come in clusters.

    It is Wilson's of fewer trials: their number is divided by the design effect, the variance of
    the share between clusters over that of independent trials, but not by less than 1 (Rao and
    Scott, Biometrics 48, 1992). As few clusters tell that variance roughly, the effect is enlarged
    by the square of Student's quantile over the normal one (Korn and Graubard, Survey Methodology
    24, 1998). If all trials are in one cluster, or each in its own, it is `wilson`'s.

    Args:
        successes: Whether each trial was a success.
        clusters: The cluster of each, such as the world of an episode.

    Raises:
        InputError: There are no trials.
    """
    trials = len(successes)
    numbers = {cluster: k for k, cluster in enumerate(dict.fromkeys(clusters))}
    if not 1 < len(numbers) < trials or successes.all() or not successes.any():
        return wilson(int(successes.sum()), trials)
    of = np.array([numbers[cluster] for cluster in clusters], np.int64)
    share, count = float(successes.mean()), len(numbers)
    # Rao and Scott 1992, section 2: the variance of a ratio of sums over clusters.
    residuals = np.bincount(of, successes - share)
    variance = count / (count - 1) * float((residuals**2).sum()) / trials**2
    effect = variance * trials / (share * (1 - share))
    effect *= float(stdtrit(count - 1, 0.975) / ndtri(0.975)) ** 2
    return _score_interval(share, trials / max(1.0, effect))


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
    return _percentiles(_resampled(values, measure, rng))


def bootstrap_ratio(
    values: Float64[np.ndarray, "n"],
    others: Float64[np.ndarray, "m"],
    measure: Callable[..., np.ndarray],
    rng: np.random.Generator,
) -> tuple[float, float]:
    """Return the 95 % percentile bootstrap interval of a statistic of values by that of others.

    The two samples are independent; for source and arguments see `bootstrap`.

    Raises:
        InputError: There are no values, or no others.
    """
    return _percentiles(_resampled(values, measure, rng) / _resampled(others, measure, rng))


def bootstrap_clusters(
    values: Float64[np.ndarray, "n"], clusters: Sequence[Hashable], rng: np.random.Generator
) -> tuple[float, float]:
    """Return the 95 % percentile bootstrap interval of a mean of values that come in clusters.

    Clusters are drawn with all of their values, because values of a cluster are not independent.
    Source: Davison and Hinkley, Bootstrap methods and their application, 1997, section 3.8.

    Args:
        values: The sample.
        clusters: The cluster of each value, such as the world of an episode.
        rng: Draws the resamples.

    Raises:
        InputError: There are no values.
    """
    if not len(values):
        raise InputError("bootstrap_clusters", "at least one value", "none")
    numbers = {cluster: k for k, cluster in enumerate(dict.fromkeys(clusters))}
    of = np.array([numbers[cluster] for cluster in clusters], np.int64)
    sums, counts = np.bincount(of, values), np.bincount(of)
    drawn = rng.integers(len(sums), size=(_RESAMPLES, len(sums)))
    return _percentiles(sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1))


def bootstrap_cluster_ratios(
    numerators: Float64[np.ndarray, "n figures"],
    denominators: Float64[np.ndarray, "n figures"],
    clusters: Sequence[Hashable],
    rng: np.random.Generator,
) -> list[tuple[float, float] | None]:
    """Return the 95 % percentile bootstrap intervals of ratios of sums over values in clusters.

    All ratios are of the same resamples. Resamples in which a ratio's denominators add up to 0 do
    not count for it; a ratio that is left without any has no interval. For source and the other
    arguments see `bootstrap_clusters`.

    Args:
        numerators: Of each value, the numerator of each ratio.
        denominators: Of each value, the denominator of each ratio, 0 or more; all ones for means.
        clusters: The cluster of each value.
        rng: Draws the resamples.

    Raises:
        InputError: There are no values.
    """
    if not len(numerators):
        raise InputError("bootstrap_cluster_ratios", "at least one value", "none")
    numbers = {cluster: k for k, cluster in enumerate(dict.fromkeys(clusters))}
    of = np.array([numbers[cluster] for cluster in clusters], np.int64)
    members = np.equal.outer(np.arange(len(numbers)), of).astype(np.float64)
    sums = members @ np.stack((numerators, denominators))
    shape = _RESAMPLES, len(numbers)
    drawn = rng.integers(len(numbers), size=shape) + len(numbers) * np.arange(_RESAMPLES)[:, None]
    times = np.bincount(drawn.ravel(), minlength=drawn.size).reshape(shape)  # A cluster is drawn.
    tops, bottoms = times.astype(np.float64) @ sums
    intervals: list[tuple[float, float] | None] = []
    for top, bottom in zip(tops.T, bottoms.T, strict=True):
        counts = bottom > 0
        intervals.append(_percentiles(top[counts] / bottom[counts]) if counts.any() else None)
    return intervals


def _score_interval(share: float, trials: float) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share of trials, whose number need not be whole."""
    square = float(ndtri(0.975)) ** 2 / trials
    middle = (share + square / 2) / (1 + square)
    half = np.sqrt(square * (share * (1 - share) + square / 4)) / (1 + square)
    # The ends are exact where rounding would miss them.
    return (
        float(middle - half) if share > 0 else 0.0,
        float(middle + half) if share < 1 else 1.0,
    )


def _resampled(
    values: Float64[np.ndarray, "n"], measure: Callable[..., np.ndarray], rng: np.random.Generator
) -> Float64[np.ndarray, "resamples"]:
    if not len(values):
        raise InputError("bootstrap", "at least one value", "none")
    drawn = values[rng.integers(len(values), size=(_RESAMPLES, len(values)))]
    return measure(drawn, axis=1)


def _percentiles(resampled: Float64[np.ndarray, "resamples"]) -> tuple[float, float]:
    low, high = np.quantile(resampled, (0.025, 0.975)).tolist()
    return low, high
