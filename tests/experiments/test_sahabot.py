"""The experiments of Sahabot 2: measures in closed form, short runs, and verdicts that turn red."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.mappers.sahabot.config import SahabotConfig
from albot_core.planning import systematic_search
from albot_experiments import ants, sahabot_1, sahabot_2
from albot_experiments.desert import desert, drawn_posts, posts


def test_posts_stand_where_they_should() -> None:
    places = drawn_posts(27, *sahabot_2.ARRAYS[27], np.random.default_rng(1))
    apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) + 9 * np.eye(27)
    assert apart.min() >= 1.2
    assert np.hypot(*places.T).min() >= 1.5 and np.hypot(*places.T).max() <= 8.0
    corners = posts(places).reshape(27, -1, 2)
    np.testing.assert_allclose(np.hypot(*(corners - places[:, None]).T), 0.2)
    assert desert(places).free_space.clearance(np.zeros(2)) > 1.0


# sahabot-1


def test_a_trajectory_has_its_segments_and_its_length() -> None:
    for seed in range(5):
        legs = np.hypot(*np.diff(sahabot_1.trajectory(np.random.default_rng(seed)), axis=0).T)
        assert len(legs) == 30 and legs.sum() == pytest.approx(255.0)


def test_the_compass_keeps_the_error_small_and_without_it_the_verdict_is_red(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sahabot_1, "LENGTH", 100.0)
    monkeypatch.setattr(sahabot_1, "LEAST_RATIO", 3.0)
    run = sahabot_1.integrate(sahabot_1.drive(501))
    good = sahabot_1.report([run, run], range(2))
    assert run.error("sahabot") < 0.5 < run.error("sahabot-wheels")
    assert good.holds and good.verdicts == {"sahabot": True, "sahabot-wheels": False}
    beliefs = dict.fromkeys(sahabot_1.MAPPERS, run.beliefs["sahabot-wheels"])  # The compass is off.
    off = sahabot_1.Run(truth=run.truth, beliefs=beliefs)
    assert not sahabot_1.report([off, off], range(2)).holds


# sahabot-2


def test_angular_errors_in_closed_form() -> None:
    points = np.array(((1.0, 0.0), (0.0, 2.0), (-1.0, 0.0), (1.0, 1.0)))
    vectors = np.array(((-3.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 0.0)))
    found = sahabot_2.HomeVectors(posts=points, points=points, vectors=vectors)
    np.testing.assert_allclose(found.errors, (0.0, 90.0, 180.0, 90.0), atol=1e-9)


def test_landmarks_lead_home_and_without_a_compass_the_verdict_is_red() -> None:
    found = [
        {count: sahabot_2.home_vectors(count, seed) for count in (4, 27)} for seed in (500, 501)
    ]
    report = sahabot_2.report(found, range(2))
    assert report.holds
    for models in found[0].values():
        assert models["alv"].errors.mean() < 25 and models[sahabot_2.NO_COMPASS].errors.mean() > 60
    off = [
        {count: models | {"alv": models[sahabot_2.NO_COMPASS]} for count, models in each.items()}
        for each in found
    ]
    assert not sahabot_2.report(off, range(2)).holds


# ants


def test_the_mapper_has_the_published_error_and_exact_integration_none() -> None:
    turn = math.radians(90)
    approximate = SahabotConfig(integration="approximate")
    published = ants.published_direction(turn)
    assert ants.believed_direction(turn, approximate) == pytest.approx(published, abs=0.01)
    exact = ants.believed_direction(turn, SahabotConfig())
    assert exact == pytest.approx(ants.true_direction(turn), abs=1e-9)
    assert published - ants.true_direction(turn) > math.radians(5)


def test_the_mean_direction_in_closed_form() -> None:
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    round_about = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    assert ants.mean_direction(round_about) == pytest.approx(0.0, abs=1e-12)
    assert ants.mean_direction(round_about[:1]) == pytest.approx(1.0)


def test_a_search_in_one_direction_turns_the_verdict_red(monkeypatch) -> None:
    monkeypatch.setattr(ants, "TURNS", np.array((0, 90)))
    assert ants.report([ants.search_path(seed) for seed in range(3)], range(3)).holds
    monkeypatch.setattr(systematic_search, "GOLDEN_ANGLE", 0.0)
    paths = [ants.search_path(0)] * 3
    assert not ants.report(paths, range(3)).holds
