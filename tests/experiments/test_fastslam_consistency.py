"""FastSLAM's consistency: the measure in closed form, and a verdict that turns red."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from albot_core.mappers.slam import landmark_particles
from albot_experiments import fastslam_consistency
from albot_experiments.fastslam_consistency import (
    BEARING_NOISE,
    MOST,
    OURS,
    RANGE_NOISE,
    VARIANTS,
    WRONG,
    Variant,
    as_points,
    believe,
    consistent_way,
    drive,
    interval,
    moments,
)

SEEDS = range(12)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Two laps of 60 m, and filters with few particles."""
    monkeypatch.setattr(fastslam_consistency, "_LAP", 60)
    monkeypatch.setattr(fastslam_consistency, "LAPS", 2)
    monkeypatch.setattr(fastslam_consistency, "FIRST", 10.0)
    few = {
        name: Variant(
            particles={3000: 300, 500: 60, 100: 20, 20: 5}[v.particles],
            proposal=v.proposal,
            noise=v.noise,
        )
        for name, v in VARIANTS.items()
    }
    monkeypatch.setattr(fastslam_consistency, "VARIANTS", few)
    yield


def test_the_interval_is_that_of_the_chi_square_distribution() -> None:
    low, high = interval(50)
    assert low == pytest.approx(2.36, abs=0.005) and high == pytest.approx(3.72, abs=0.005)
    draws = np.random.default_rng(0).standard_normal((4000, 50, 3))
    means = (draws**2).sum(axis=2).mean(axis=1)
    assert ((means > low) & (means < high)).mean() == pytest.approx(0.95, abs=0.01)


def test_moments_of_headings_go_round() -> None:
    poses = np.array(((0.0, 0.0, np.pi - 0.1), (2.0, 0.0, -np.pi + 0.1)))
    mean, spread = moments(poses, np.array((0.5, 0.5)))
    assert abs(mean[2]) == pytest.approx(np.pi)
    np.testing.assert_allclose(mean[:2], (1.0, 0.0))
    np.testing.assert_allclose(spread[2, 2], 0.01, atol=1e-9)
    np.testing.assert_allclose(abs(spread[0, 2]), 0.1, atol=1e-9)


def test_the_way_ends_where_it_leaves_the_interval_for_good() -> None:
    assert consistent_way(np.array((3.0, 5.0, 3.0, 5.0, 6.0)), 4.0) == 3.0
    assert consistent_way(np.array((5.0, 5.0)), 4.0) == 0.0


def test_points_have_the_errors_of_range_and_bearing() -> None:
    rng, true = np.random.default_rng(0), np.array((8.0, 0.6))
    noise = np.array((RANGE_NOISE, BEARING_NOISE)) * rng.standard_normal((20_000, 2))
    points = as_points(true + noise, 1.0)
    row = as_points(true[None], 1.0)[0]
    np.testing.assert_allclose(
        np.cov(points[:, :2].T), [[row[2], row[3]], [row[3], row[4]]], rtol=0.05, atol=2e-4
    )
    np.testing.assert_allclose(as_points(true[None], 0.5)[0, 2:], 0.25 * row[2:])


def test_many_particles_have_the_nees_of_a_consistent_filter(monkeypatch) -> None:
    """The mean of a chi-square distribution with three degrees of freedom: 3."""
    monkeypatch.setattr(fastslam_consistency, "_LAP", 5)
    nees = [believe(drive(s), Variant(particles=1500), s).nees for s in range(40)]
    low, high = interval(40)
    assert low < np.mean(nees) < high
    wrong = [believe(drive(s), Variant(particles=1500, noise=0.5), s).nees for s in range(10)]
    assert np.mean(wrong) > 2 * high


@pytest.mark.usefixtures("short")
def test_the_verdict_turns_red_when_the_filter_is_told_a_wrong_noise(monkeypatch) -> None:
    good = fastslam_consistency.run(SEEDS)
    assert good.measured["consistent_at_first"] and good.measured["optimistic_in_the_end"]
    assert good.verdicts[MOST] == good.holds
    assert not good.verdicts[WRONG]
    assert set(good.pictures) == {"nees", "loop"}
    assert 1 <= good.measured["histories_after"] <= good.measured["histories_before"] <= 20
    told = fastslam_consistency.as_points
    monkeypatch.setattr(fastslam_consistency, "as_points", lambda seen, n: told(seen, 0.4 * n))
    off = fastslam_consistency.run(SEEDS)
    assert not off.holds and not off.verdicts[MOST] and not off.verdicts[OURS]


@pytest.mark.usefixtures("short")
def test_the_verdict_turns_red_when_particles_are_not_weighed(monkeypatch) -> None:
    """Then no particle is preferred, and their spread tells nothing of the error."""
    move = landmark_particles.move_and_weigh

    def unweighed(*args) -> None:
        weights = args[9].copy()
        move(*args)
        args[9][:] = weights

    monkeypatch.setattr(landmark_particles, "move_and_weigh", unweighed)
    report = fastslam_consistency.run(SEEDS)
    assert not report.holds
