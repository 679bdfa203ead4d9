"""Confidence intervals against published figures and by what they promise."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.evaluation.intervals import (
    bootstrap,
    bootstrap_cluster_ratios,
    bootstrap_clusters,
    bootstrap_ratio,
    wilson,
    wilson_clusters,
)


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        # Newcombe, Two-sided confidence intervals for the single proportion, Statistics in
        # Medicine 17 (1998), table I, method 3.
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_gives_the_published_limits(
    successes: int, trials: int, low: float, high: float
) -> None:
    assert wilson(successes, trials) == pytest.approx((low, high), abs=6e-5)


def test_all_or_nothing_is_not_certainty() -> None:
    assert wilson(20, 20)[1] == 1.0
    assert wilson(20, 20)[0] == pytest.approx(1 - wilson(0, 20)[1])


@pytest.mark.parametrize(("successes", "trials"), [(0, 0), (3, 2), (-1, 2)])
def test_what_is_no_share_is_refused(successes: int, trials: int) -> None:
    with pytest.raises(InputError, match="wilson"):
        wilson(successes, trials)


@pytest.mark.parametrize("mean", [0.5, 0.8, 0.9])
@pytest.mark.parametrize("likeness", [0.1, 0.3])
def test_trials_in_clusters_are_covered_as_promised(mean: float, likeness: float) -> None:
    """Of 14 worlds with 8 alike episodes each; Wilson's own interval covers 70 to 90 %."""
    rng = np.random.default_rng(3)
    alpha = 1 / likeness - 1  # Beta-binomial successes with this correlation within a world.
    worlds = np.repeat(np.arange(14), 8)
    covered, plain = np.zeros(400), np.zeros(400)
    for k in range(400):
        chances = rng.beta(mean * alpha, (1 - mean) * alpha, 14)
        successes = rng.random(112) < chances[worlds]
        low, high = wilson_clusters(successes, worlds.tolist())
        covered[k] = low <= mean <= high
        low, high = wilson(int(successes.sum()), 112)
        plain[k] = low <= mean <= high
    assert covered.mean() > 0.92
    assert plain.mean() < 0.91


def test_clusters_that_are_all_alike_count_once() -> None:
    """Each world a copy of one episode: as many trials as worlds, but for Student's quantile."""
    one = np.arange(400) % 4 > 0
    found = wilson_clusters(np.repeat(one, 8), np.repeat(np.arange(400), 8).tolist())
    assert found == pytest.approx(wilson(300, 400), abs=1e-3)


def test_trials_without_shared_clusters_are_wilsons() -> None:
    some = np.arange(20) % 3 > 0
    wanted = wilson(int(some.sum()), 20)
    assert wilson_clusters(some, range(20)) == wanted
    assert wilson_clusters(some, [0] * 20) == wanted
    # Clusters with the same share each are no reason for a narrower interval.
    even = np.tile((True, False), 10)
    assert wilson_clusters(even, (np.arange(20) // 2).tolist()) == wilson(10, 20)
    assert wilson_clusters(np.ones(20, np.bool_), (np.arange(20) // 2).tolist()) == wilson(20, 20)
    with pytest.raises(InputError, match="wilson"):
        wilson_clusters(some[:0], [])


def test_a_bootstrapped_mean_has_the_width_of_the_normal_one() -> None:
    values = np.random.default_rng(1).normal(3.0, 2.0, 400)
    low, high = bootstrap(values, np.mean, np.random.default_rng(2))
    half = 1.96 * values.std() / np.sqrt(400)
    assert (low, high) == pytest.approx((values.mean() - half, values.mean() + half), abs=0.03)
    assert (low, high) == bootstrap(values, np.mean, np.random.default_rng(2))


def test_a_bootstrap_of_nothing_is_refused() -> None:
    assert bootstrap(np.full(5, 0.25), np.median, np.random.default_rng(0)) == (0.25, 0.25)
    with pytest.raises(InputError, match="bootstrap"):
        bootstrap(np.empty(0), np.mean, np.random.default_rng(0))


def test_a_bootstrapped_ratio_has_the_width_of_the_normal_one() -> None:
    rng = np.random.default_rng(1)
    values, others = rng.normal(6.0, 1.0, 400), rng.normal(3.0, 1.0, 300)
    low, high = bootstrap_ratio(values, others, np.mean, np.random.default_rng(2))
    ratio = values.mean() / others.mean()
    half = 1.96 * ratio * np.hypot(1 / values.mean() / 20, 1 / others.mean() / np.sqrt(300))
    assert (low, high) == pytest.approx((ratio - half, ratio + half), abs=0.02)


@pytest.mark.parametrize(("values", "others"), [(0, 3), (3, 0)])
def test_a_ratio_to_nothing_is_refused(values: int, others: int) -> None:
    with pytest.raises(InputError, match="bootstrap"):
        bootstrap_ratio(np.ones(values), np.ones(others), np.median, np.random.default_rng(0))


def _cluster_ratios(
    tops: np.ndarray, bottoms: np.ndarray, clusters: list[int]
) -> list[tuple[float, float] | None]:
    return bootstrap_cluster_ratios(tops, bottoms, clusters, np.random.default_rng(2))


def test_a_ratio_of_sums_has_the_width_of_the_normal_one() -> None:
    rng = np.random.default_rng(1)
    tops, bottoms = rng.normal(6.0, 1.0, (400, 1)), rng.normal(3.0, 0.5, (400, 1))
    ratio = tops.sum() / bottoms.sum()
    # The delta method: the residuals of the ratio, by the mean of the denominators.
    half = 1.96 * (tops - ratio * bottoms).std() / bottoms.mean() / np.sqrt(400)
    (found,) = _cluster_ratios(tops, bottoms, list(range(400)))
    assert found == pytest.approx((ratio - half, ratio + half), abs=0.01)


def test_ratios_to_ones_are_means_of_clusters() -> None:
    rng = np.random.default_rng(1)
    clusters = [k // 4 for k in range(200)]
    values = np.repeat(rng.normal(size=50), 4)  # As one value of each cluster, four times.
    (found,) = _cluster_ratios(values[:, None], np.ones((200, 1)), clusters)
    wanted = bootstrap_clusters(values, clusters, np.random.default_rng(2))
    assert found == pytest.approx(wanted, rel=1e-9)
    (alone,) = _cluster_ratios(values[:, None], np.ones((200, 1)), list(range(200)))
    assert found is not None
    assert alone is not None
    assert (found[1] - found[0]) / (alone[1] - alone[0]) == pytest.approx(2, abs=0.1)


def test_resamples_without_a_denominator_do_not_count() -> None:
    tops, bottoms = np.array([[0.5, 0.0], [0.0, 0.0]]), np.array([[1.0, 0.0], [0.0, 0.0]])
    assert _cluster_ratios(tops, bottoms, [0, 1]) == [(0.5, 0.5), None]
    with pytest.raises(InputError, match="bootstrap_cluster_ratios"):
        _cluster_ratios(tops[:0], bottoms[:0], [])
