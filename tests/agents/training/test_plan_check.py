"""Whether a policy fits the observations and actions of an environment."""

from __future__ import annotations

import pytest
from gymnasium import spaces

from albot_agents.training.plan import PolicyPlan, TrainingPlan
from albot_agents.training.plan_check import agent_network, check_policy
from albot_core.errors import InputError
from albot_env.tasks.core.observation import ObservationConfig
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


def test_a_network_that_no_file_could_hold_is_refused() -> None:
    seen, actions = ObservationConfig(parts=("motion",)), spaces.Box(-1, 1, (3,))
    for layers in ((2048, 1024), (2048, 2048)):
        plan = TrainingPlan(policy=PolicyPlan(net_arch=layers))
        if layers[1] == 1024:
            assert agent_network(plan, seen, seen.flat_space, actions).layers == layers
            continue
        with pytest.raises(InputError, match=r"policy: expected a network of 15,728,640 bytes at"):
            agent_network(plan, seen, seen.flat_space, actions)


def test_fields_of_other_kinds_of_policies_are_told() -> None:
    plan = TrainingPlan(policy=PolicyPlan(filters=(4,)))
    with pytest.raises(InputError, match=r"expected filters .* because mlp does not use it"):
        plan.check_unused_fields()
    TrainingPlan(policy=PolicyPlan(kind="cnn", filters=(4,))).check_unused_fields()
