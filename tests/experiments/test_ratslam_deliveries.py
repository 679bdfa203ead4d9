"""Deliveries by the experience map: a small office, the verdict, and what breaks it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from albot_core.evaluation.intervals import wilson
from albot_core.mappers.mapper import POINT, TRAVEL
from albot_core.mappers.ratslam.mapper import RatSlam
from albot_experiments import ratslam_courier as courier
from albot_experiments.ratslam_courier import (
    APART,
    BOUND,
    CAUSES,
    Delivery,
    by_pose,
    by_routes,
    deliver,
    draw_goals,
)
from albot_experiments.ratslam_deliveries import (
    BEATEN,
    OTHERS,
    PAPER,
    Trial,
    figures,
    is_reached,
    report,
    run_office,
)

OFFICE = "random:office:{seed}?rooms=4"


@pytest.fixture(scope="module")
def trial() -> Trial:
    """A robot that has explored a small office for 90 s, and delivered three times there."""
    return run_office(1, office=OFFICE, seconds=90.0, deliveries=3, compared=1)


def test_a_small_office_is_learned_and_delivered_in(trial: Trial):
    assert [each.cause for each in trial.deliveries] == [None] * 3
    assert all(each.away <= BOUND for each in trial.deliveries)
    assert trial.both_ways > 0.5
    assert set(trial.others) == set(OTHERS)
    made = report(range(1, 2), [trial])
    assert {name: made.measured[name] for name in PAPER} == {
        "deliveries": 3,
        "succeeded": 3,
        "share": 1.0,
    }
    assert not made.holds  # Three deliveries prove nothing: the interval is too wide.
    assert [len(axes.lines) for axes in made.pictures["deliveries"].axes] == [2, 2]


def test_goals_are_apart_and_known_by_the_reading_of_their_experience(trial: Trial):
    mapper = trial.robot.mapper
    goals = draw_goals(mapper, 50, np.random.default_rng(0))
    places = np.array([mapper.experiences.poses[goal.experience, :2] for goal in goals])
    assert np.hypot(*np.diff(places, axis=0).T).min() >= APART
    for goal in goals[:10]:
        assert mapper.place_at(goal.reading) == goal.experience


def no_way(mapper: RatSlam, point: np.ndarray) -> np.ndarray:
    return np.array((*[np.nan] * 6, np.inf))


WAY_TO = RatSlam.way_to


def reversed_way(mapper: RatSlam, point: np.ndarray) -> np.ndarray:
    """The way with its transitions reversed: it leads as far back as the true one leads on."""
    way, here = WAY_TO(mapper, point).copy(), mapper.estimate.pose[:2]
    way[TRAVEL] = max(way[TRAVEL], 1.0)
    way[POINT] = here - 2.0 if np.isnan(way[POINT]).any() else 2 * here - way[POINT]
    return way


@pytest.mark.parametrize(("recall", "cause"), [(no_way, "no way"), (reversed_way, "held up")])
def test_without_recall_nothing_is_delivered(
    trial: Trial, recall: Callable[..., np.ndarray], cause: str, monkeypatch: pytest.MonkeyPatch
):
    rng = np.random.default_rng(2)
    (goal,) = draw_goals(trial.robot.mapper, 1, rng)
    monkeypatch.setattr(courier, "LIMIT", 15.0)
    monkeypatch.setattr(RatSlam, "way_to", recall)
    broken = deliver(trial.robot, goal, by_routes, rng)
    assert broken.cause == cause
    assert broken.time == pytest.approx(15.0)
    monkeypatch.undo()
    assert deliver(trial.robot, goal, by_routes, rng).cause is None


def test_a_robot_that_stops_elsewhere_has_not_delivered(
    trial: Trial, monkeypatch: pytest.MonkeyPatch
):
    rng = np.random.default_rng(3)
    (goal,) = draw_goals(trial.robot.mapper, 1, rng)
    monkeypatch.setattr(courier, "ARRIVED", 100.0)  # It believes to be there at once.
    stopped = deliver(trial.robot, goal, by_pose, rng)
    assert (stopped.cause, stopped.time) == ("wrong place", 0.0)
    assert stopped.away > BOUND


def outcomes(succeeded: int, of: int) -> list[Delivery]:
    """So many deliveries, of which some succeeded; the others were held up."""
    return [
        Delivery(time=10.0 + k, away=0.2, cause=None if k < succeeded else "held up")
        for k in range(of)
    ]


def test_the_figures_are_shares_with_wilsons_interval():
    found = figures([*outcomes(8, 10), Delivery(time=1.0, away=3.0, cause="wrong place")])
    assert (found["deliveries"], found["succeeded"]) == (11, 8)
    assert (found["share"], found["low"], found["high"]) == pytest.approx(
        (8 / 11, *wilson(8, 11)), abs=1e-4
    )
    assert (found["median_time_s"], found["longest_time_s"]) == (13.5, 17.0)
    assert [found[cause.replace(" ", "_")] for cause in CAUSES] == [1, 0, 0, 2]
    assert figures(outcomes(0, 3))["median_time_s"] is None


def test_the_verdict_asks_for_99_percent_and_more_than_the_others_reach():
    poor = dict.fromkeys(OTHERS, figures(outcomes(40, 200)))
    assert is_reached(figures(outcomes(1089, 1100)), poor)
    assert not is_reached(figures(outcomes(1088, 1100)), poor)
    for name in BEATEN:
        assert not is_reached(
            figures(outcomes(1100, 1100)), poor | {name: figures(outcomes(198, 200))}
        )
