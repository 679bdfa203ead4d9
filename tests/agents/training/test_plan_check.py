"""Whether a policy fits the observations and actions of an environment."""

from __future__ import annotations

import pytest
from gymnasium import spaces

from albot_agents.training.plan import PolicyPlan
from albot_agents.training.plan_check import check_policy
from albot_core.errors import InputError
from albot_env.tasks.place_recognition.spaces import ArrivalsObservationConfig


def test_a_policy_of_candidates_begins_with_two_numbers_however_many_there_are() -> None:
    seen, answers = ArrivalsObservationConfig(most=7), spaces.Discrete(8)
    check_policy(PolicyPlan(kind="candidates", initial_action=(1.0, 0.0)), seen, answers)
    with pytest.raises(InputError, match="initial_action: expected 2 numbers, found 3"):
        check_policy(PolicyPlan(kind="candidates", initial_action=(1.0, 0.0, 0.0)), seen, answers)


def test_any_other_policy_begins_with_as_many_as_actions_have() -> None:
    seen, answers = ArrivalsObservationConfig(most=7), spaces.Discrete(8)
    check_policy(PolicyPlan(initial_action=(0.0,) * 8), seen, answers)
    with pytest.raises(InputError, match="initial_action: expected 8 numbers, found 2"):
        check_policy(PolicyPlan(initial_action=(1.0, 0.0)), seen, answers)
