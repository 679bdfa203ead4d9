"""Confidence intervals against published figures and by what they promise."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.evaluation.intervals import bootstrap, bootstrap_ratio, wilson


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
