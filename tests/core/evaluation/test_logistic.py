"""Logistic regression: closed forms, known limits, and the interval's coverage of the truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from albot_core.errors import InputError
from albot_core.evaluation.logistic import Logistic, bootstrap_logistic, fit_logistic


def test_two_groups_have_the_closed_form_of_firth() -> None:
    """With one x per group, Firth's estimate adds half a success and half a failure to each."""
    x = np.repeat((0.0, 1.0), (12, 20))
    success = np.concatenate((np.arange(12) < 9, np.arange(20) < 5))
    found = fit_logistic(x, success)
    first, second = np.log(9.5 / 3.5), np.log(5.5 / 15.5)
    assert found.intercept == pytest.approx(first, abs=1e-6)
    assert found.slope == pytest.approx(second - first, abs=1e-6)


def _penalised(
    two: np.ndarray, x: np.ndarray, success: np.ndarray, weights: np.ndarray
) -> tuple[float, np.ndarray]:
    """Firth's penalised likelihood and its score, written out."""
    columns = np.stack((np.ones(len(x)), x), -1)
    logits = columns @ two
    p = 1 / (1 + np.exp(-logits))
    information = sum(
        w * each * (1 - each) * np.outer(c, c)
        for w, each, c in zip(weights, p, columns, strict=True)
    )
    own = sum(
        w * -np.logaddexp(0, -z if s else z)
        for w, z, s in zip(weights, logits, success, strict=True)
    )
    sign, log_determinant = np.linalg.slogdet(information)
    inverse = np.linalg.inv(information)
    score = sum(
        (w * (s - each) + w * each * (1 - each) * (c @ inverse @ c) * (0.5 - each)) * c
        for w, each, c, s in zip(weights, p, columns, success, strict=True)
    )
    return (own + 0.5 * log_determinant if sign > 0 else -np.inf), score


def test_an_outlier_among_equal_successes() -> None:
    """One far x: a step of the plain information overshoots it and never settles."""
    x = np.array([-2.0] * 12 + [3.0])
    found = fit_logistic(x, np.arange(13) < 10)
    # As two groups, each with half a success and half a failure more.
    first, second = np.log(10.5 / 2.5), np.log(0.5 / 1.5)
    assert found.slope == pytest.approx((second - first) / 5, abs=1e-6)
    assert found.intercept == pytest.approx(second - 3 * found.slope, abs=1e-6)


@st.composite
def _sets(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sets of x, successes and weights: random, equal or far x, one class, separated classes."""
    count = draw(st.integers(3, 40))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    x = rng.normal(size=count)
    if draw(st.booleans()):
        x = np.round(x)
    x[0] = x[1] + draw(st.sampled_from((0.5, 5.0, 30.0)))
    kinds = {
        "random": rng.random(count) < rng.random(),
        "one class": np.full(count, draw(st.booleans())),
        "separated": x < np.median(x),
        "outlier": np.arange(count) > 0,
    }
    success = kinds[draw(st.sampled_from(sorted(kinds)))]
    weights = rng.integers(0, 4, count) if draw(st.booleans()) else np.ones(count)
    weights[:2] = 1
    return x, success, weights.astype(np.float64)


@given(_sets())
@settings(max_examples=60)
def test_it_ends_on_a_maximum_whatever_the_data(
    some: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    x, success, weights = some
    x = (x - x.mean()) / x.std()
    fit = fit_logistic(x, success, weights)
    found = np.array((fit.intercept, fit.slope))
    highest, score = _penalised(found, x, success, weights)
    assert np.abs(score).max() < 1e-5
    assert highest >= _penalised(np.zeros(2), x, success, weights)[0] - 1e-9
    for angle in np.arange(0, 2 * np.pi, np.pi / 8):
        beside = found + 0.01 * np.array((np.cos(angle), np.sin(angle)))
        assert _penalised(beside, x, success, weights)[0] < highest + 1e-9


def test_it_maximises_the_penalised_likelihood() -> None:
    rng = np.random.default_rng(3)
    x = rng.normal(size=60)
    success = rng.random(60) < 1 / (1 + np.exp(2 * x - 0.5))

    def cost(two: np.ndarray) -> float:
        p = 1 / (1 + np.exp(-(two[0] + two[1] * x)))
        columns = np.stack((np.ones(60), x), -1)
        information = (columns * (p * (1 - p))[:, None]).T @ columns
        likelihood = np.log(np.where(success, p, 1 - p)).sum()
        return -float(likelihood + 0.5 * np.linalg.slogdet(information)[1])

    best = minimize(cost, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-9})
    found = fit_logistic(x, success)
    assert (found.intercept, found.slope) == pytest.approx(tuple(best.x), abs=1e-3)


def test_separated_successes_have_a_finite_slope_between_them() -> None:
    x = np.array((-3.0, -2.0, -1.0, 1.0, 2.0, 3.0))
    found = fit_logistic(x, x < 0)
    assert np.isfinite(found.slope) and found.slope < 0
    assert found.x_at(0.5) == pytest.approx(0.0, abs=1e-6)


@given(st.floats(-3, 3), st.floats(0.2, 4), st.integers(0, 1000))
def test_a_change_of_units_changes_the_curve_with_them(
    shift: float, factor: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    x, success = rng.normal(size=30), rng.random(30) < 0.5
    one, other = fit_logistic(x, success), fit_logistic(shift + factor * x, success)
    assert one.probability(x) == pytest.approx(other.probability(shift + factor * x), abs=1e-5)


def test_a_weight_is_a_repetition() -> None:
    rng = np.random.default_rng(5)
    x, success = rng.normal(size=20), rng.random(20) < 0.4
    weights = rng.integers(0, 4, 20)
    repeated = fit_logistic(np.repeat(x, weights), np.repeat(success, weights))
    weighted = fit_logistic(x, success, weights.astype(float))
    assert weighted.slope == pytest.approx(repeated.slope, abs=1e-6)
    assert weighted.intercept == pytest.approx(repeated.intercept, abs=1e-6)


def test_the_bootstrap_draws_whole_clusters_about_the_truth(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("albot_core.evaluation.logistic._RESAMPLES", 200)
    rng = np.random.default_rng(7)
    truth = Logistic(intercept=1.0, slope=-3.0)
    x = rng.uniform(-1, 1.5, 400)
    success = rng.random(400) < truth.probability(x)
    middles = [fit.x_at(0.5) for fit in bootstrap_logistic(x, success, range(400), rng)]
    low, high = np.quantile(middles, (0.025, 0.975))
    assert low < truth.x_at(0.5) < high
    # Copies of one cluster tell nothing new: the interval of twice the same data is as wide.
    twice = np.tile(x, 2), np.tile(success, 2), [*range(400), *range(400)]
    again = [fit.x_at(0.5) for fit in bootstrap_logistic(*twice, np.random.default_rng(7))]
    wide = np.diff(np.quantile(again, (0.025, 0.975)))[0]
    assert wide == pytest.approx(high - low, rel=0.3)


def test_a_curve_needs_two_points() -> None:
    with pytest.raises(InputError, match="two different x"):
        fit_logistic(np.ones(3), np.array((True, False, True)))
