"""Coverage against the way driven, of curves whose area is known."""

from __future__ import annotations

import numpy as np
import pytest

from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.summary import summarise
from albot_agents.evaluation.trial import HORIZON, Outcome, area_under, run_trial, sample_curve


def _straight(driven: np.ndarray) -> np.ndarray:
    return np.stack((driven, np.zeros_like(driven)), axis=1)


def test_the_area_of_a_ramp_that_ends_is_a_triangle_and_a_rectangle() -> None:
    """Coverage grows evenly to 0.6 at 80 m and the robot drives no farther."""
    driven = np.linspace(0, 80, 1601)
    curve = sample_curve(_straight(driven), (0.6 * driven / 80).tolist())
    assert curve[40] == pytest.approx(0.3)
    assert curve[80:] == pytest.approx(np.full(HORIZON - 79, 0.6))
    by_hand = (80 * 0.6 / 2 + (HORIZON - 80) * 0.6) / HORIZON
    assert area_under(curve) == pytest.approx(by_hand)


def test_what_is_covered_beyond_the_horizon_does_not_count() -> None:
    driven = np.array((0.0, HORIZON, HORIZON + 0.5, 3 * HORIZON))
    assert area_under(sample_curve(_straight(driven), (0.0, 0.5, 1.0, 1.0))) == pytest.approx(0.25)


def test_looking_round_on_the_spot_costs_no_way() -> None:
    driven = np.array((0.0, 0.0, 0.0, 10.0, 10.0))
    curve = sample_curve(_straight(driven), (0.1, 0.2, 0.3, 0.4, 0.8))
    assert curve[0] == 0.3
    assert curve[9] == pytest.approx(0.3 + 0.9 * 0.5)
    assert curve[10:] == pytest.approx(np.full(HORIZON - 9, 0.8))
    assert area_under(sample_curve(np.zeros((3, 2)), (0.0, 0.1, 0.2))) == pytest.approx(0.2)


def _outcome(final: float, entered: int, driven: float = HORIZON) -> Outcome:
    return Outcome(
        trial=Trial(task="Albot/Explore-v0", agent="random", world="square-loop", seed=1),
        info={"coverage": final, "position_error": 0.0, "rooms_entered": entered},
        start=np.zeros(3),
        begin=np.array((1.0, 1.0, 0.0)),
        path=np.array(((0.0, 0.0), (driven, 0.0))),
        collisions=0,
        rooms=4,
        coverage_curve=np.full(HORIZON + 1, final),
    )


def test_a_summary_has_the_mean_area_and_its_confidence() -> None:
    figures = summarise([_outcome(0.2, 1), _outcome(0.4, 3), _outcome(0.6, 4), _outcome(0.4, 4)])
    assert figures["coverage_auc"] == pytest.approx(0.4)
    low, high = figures["coverage_auc_ci95"]
    assert 0.2 < low < 0.4 < high < 0.6
    assert figures["rooms_share"] == pytest.approx(0.75)
    assert figures["rooms_share_median"] == pytest.approx(0.875)
    assert figures["rooms_share_ci95"][0] < 0.75 < figures["rooms_share_ci95"][1]
    assert figures["worlds"][0]["coverage_auc"] == pytest.approx(0.4)


def test_no_average_is_over_metres_that_nobody_drove() -> None:
    short = [_outcome(0.2, 1, driven=30.0), _outcome(0.4, 1, driven=199.0)]
    figures = summarise(short)
    assert (figures["coverage_auc"], figures["coverage_auc_ci95"]) == (None, None)
    assert figures["coverage_episodes"] == 0
    figures = summarise([*short, _outcome(0.6, 1)])
    assert figures["coverage_auc"] == pytest.approx(0.4)
    assert figures["coverage_episodes"] == 1


def test_a_trial_brings_its_curve() -> None:
    settings = {"mapper": "none", "max_episode_steps": 30}
    trial = Trial(
        task="Albot/Explore-v0", agent="random", world="square-loop", seed=1, settings=settings
    )
    outcome = run_trial(trial)
    assert outcome.rooms >= 1
    assert (np.diff(outcome.coverage_curve) >= 0).all()
    assert outcome.coverage_curve[-1] == outcome.info["coverage"]
