"""The values that a sweep tries, and which searches are refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_file import plan_text, read_plan
from albot_agents.training.sweep_folder import trial_plan
from albot_agents.training.sweep_plan import SearchSpace, SweepPlan
from albot_core.errors import InputError
from albot_core.plain_data import to_plain
from tests.agents.training.tiny import TINY, plan_file

RATES = SearchSpace(low=1e-5, high=1e-2, log=True)


@given(
    st.integers(0, 2**32 - 1),
    st.floats(1e-6, 1e3),
    st.floats(1.001, 1e3),
    st.booleans(),
)
def test_values_lie_between_the_bounds_and_are_a_function_of_the_seed(
    seed: int, low: float, factor: float, log: bool
) -> None:
    space = SearchSpace(low=low, high=low * factor, log=log)
    sweep = SweepPlan(parameters={"learning_rate": space, "gamma": space}, trials=5)
    found = sweep.draw(seed)
    assert found == sweep.draw(seed)
    assert len(found) == 5
    for values in found:
        assert list(values) == ["learning_rate", "gamma"]
        assert all(low <= value <= low * factor for value in values.values())


def test_whole_numbers_come_equally_often_and_logarithms_uniformly() -> None:
    sweep = SweepPlan(
        parameters={
            "n_steps": SearchSpace(low=1.0, high=4.0, whole=True),
            "learning_rate": RATES,
        },
        trials=4000,
    )
    found = sweep.draw(1)
    counts = [sum(values["n_steps"] == k for values in found) for k in (1, 2, 3, 4)]
    assert sum(counts) == 4000
    assert all(isinstance(values["n_steps"], int) for values in found)
    assert min(counts) > 900  # 1000 ± 27 expected.
    below = sum(values["learning_rate"] < math.sqrt(1e-5 * 1e-2) for values in found)
    assert 1900 < below < 2100


def test_without_a_number_of_trials_each_combination_is_one() -> None:
    parameters = {
        "gamma": SearchSpace(choices=(0.9, 0.99)),
        "policy.net_arch": SearchSpace(choices=([8], [8, 8], [4])),
    }
    found = SweepPlan(parameters=parameters, trials=None).draw(3)
    assert len(found) == 6
    assert {(each["gamma"], tuple(each["policy.net_arch"])) for each in found} == {
        (gamma, net) for gamma in (0.9, 0.99) for net in ((8,), (8, 8), (4,))
    }


def _read(tmp_path: Path, **sweep: Any) -> TrainingPlan:
    return read_plan(plan_file(tmp_path / "plan.yml", TINY, sweep=sweep), tried=False)


RATE = {"learning_rate": {"low": 1e-5, "high": 1e-2, "log": True}}


def test_a_plan_with_a_search_is_written_and_read_back(tmp_path: Path) -> None:
    plan = _read(tmp_path, parameters=RATE, metric="return", grace=32)
    (tmp_path / "again.yml").write_text(plan_text(plan))
    assert read_plan(tmp_path / "again.yml", tried=False) == plan
    assert plan.sweep is not None
    assert plan.sweep.parameters["learning_rate"] == RATES


@pytest.mark.parametrize(
    ("sweep", "message"),
    [
        ({}, r"sweep.parameters: expected a field to search, or more, found none"),
        ({"parameters": {"seed": {"choices": [1]}}}, "fields that may differ: .* found seed"),
        ({"parameters": {"gamma": {}}}, "low: expected a finite number, or choices, found None"),
        (
            {"parameters": {"gamma": {"choices": []}}},
            "choices: expected one value or more, found none",
        ),
        (
            {"parameters": {"gamma": {"choices": [0.9], "low": 0.1}}},
            "choices alone, without low, high, log and whole, found both",
        ),
        (
            {"parameters": {"gamma": {"low": 0.9, "high": 0.8}}},
            r"sweep.parameters.gamma.high: expected more than low, 0.9, found 0.8",
        ),
        (
            {"parameters": {"gamma": {"low": 0, "high": 1, "log": True}}},
            "a number above 0, because of log, found 0",
        ),
        (
            {"parameters": {"n_steps": {"low": 1.5, "high": 3, "whole": True}}},
            "expected a whole number, found 1.5",
        ),
        (
            {"parameters": RATE, "trials": None},
            "a number of trials, because learning_rate has no choices, found null",
        ),
        ({"parameters": RATE, "trials": 0}, "a whole number from 1 to 10000, found 0"),
        ({"parameters": RATE, "scheduler": "ashe"}, "one of asha, median, none, found .*ashe"),
        ({"parameters": RATE, "reduction": 1}, "a number above 1, found 1"),
        (
            {"parameters": {"policy": {"choices": [{}]}, "policy.net_arch": {"choices": [[4]]}}},
            "each field once, alone or within another, found policy and policy.net_arch",
        ),
        ({"parameters": {"gamma": {"low": -1e308, "high": 1e308}}}, "a finite distance from low"),
        ({"parameters": RATE, "grace": 65}, "a grace of at most n_timesteps, 64, found 65"),
    ],
)
def test_what_cannot_be_searched_is_refused(
    sweep: dict[str, Any], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message):
        _read(tmp_path, **sweep)


def test_without_evaluations_nothing_can_be_searched(tmp_path: Path) -> None:
    path = plan_file(tmp_path / "plan.yml", TINY, sweep={"parameters": RATE}, evaluation=None)
    with pytest.raises(InputError, match="null without evaluations, found a search"):
        read_plan(path, tried=False)


def test_a_trial_differs_in_its_values_alone(tmp_path: Path) -> None:
    plan = _read(tmp_path, parameters=RATE)
    values = {"learning_rate": 0.25, "policy.net_arch": [4], "env.config.outing.longest": 3}
    found, expected = to_plain(trial_plan(plan, 0, values, Path("a.yml"))), to_plain(plan)
    expected |= {"sweep": None, "learning_rate": 0.25}
    expected["policy"]["net_arch"] = [4]
    expected["env"]["config"]["outing"]["longest"] = 3
    assert found == expected


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"learning_rte": 0.1},
            r"a\.yml, sweep, trial 7 with learning_rte 0.1, learning_rte: expected one of .*, le",
        ),
        ({"n_steps": 7}, "trial 7 with n_steps 7, batch_size: expected a divisor of n_envs"),
        ({"policy.lstm_size": 16}, "lstm_size 128, the default, because ppo does not use it"),
        ({"env.config.outing.longest": -1}, "trial 7 with .*found -1"),
        ({"gamma": "much"}, "gamma: expected a number, found much"),
    ],
)
def test_values_that_do_not_fit_are_refused(
    values: dict[str, Any], message: str, tmp_path: Path
) -> None:
    plan = _read(tmp_path, parameters=RATE)
    with pytest.raises(InputError, match=message):
        trial_plan(plan, 7, values, Path("a.yml"))


def test_a_metric_that_the_task_lacks_is_refused_before_anything_runs(tmp_path: Path) -> None:
    explore = {"task": "Albot/Explore-v0", "env": {"world": "square-loop", "mapper": "none"}}
    evaluation = {"worlds": ["square-loop"], "seeds": 0, "every": 32}
    for metric in ("success_rate", "spl"):
        sweep = {"parameters": RATE, "metric": metric}
        path = plan_file(tmp_path / "plan.yml", TINY | explore, evaluation=evaluation, sweep=sweep)
        expected = f"line .*sweep.metric: expected one of .* give, return, found {metric}"
        with pytest.raises(InputError, match=expected):
            read_plan(path)
    path = plan_file(
        tmp_path / "plan.yml",
        TINY | explore,
        evaluation=evaluation,
        sweep={"parameters": RATE, "metric": "return"},
    )
    assert read_plan(path).sweep is not None
