"""What every agent promises, in every environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

import albot_env
from albot_agents.agent import Agent
from albot_agents.registry import agent_names, make_agent
from albot_core.errors import InputError

assert albot_env.__doc__  # Importing it registers the environments.
IDS = sorted(name for name in gymnasium.registry if name.startswith("Albot/"))


def _actions(agent: Agent, environment: str, form: str, seed: int, steps: int = 120) -> list[Any]:
    env = gymnasium.make(environment, world="square-loop", mapper="odometry", observation=form)
    agent.reset(np.random.default_rng(seed))
    observation, _ = env.reset(seed=0)
    actions = []
    for _ in range(steps):
        actions.append(agent.act(observation))
        assert actions[-1] in env.action_space
        observation = env.step(actions[-1])[0]
    return actions


def test_the_agents_are_these() -> None:
    assert agent_names() == ("gap-explorer", "random")


@pytest.mark.parametrize("name", agent_names())
def test_an_agent_is_found_by_its_name(name: str) -> None:
    agent = make_agent(name)
    assert isinstance(agent, Agent)
    assert agent.name == name
    assert make_agent(name) is not agent


def test_an_unknown_agent_is_refused_with_a_hint() -> None:
    with pytest.raises(InputError, match=r"gap_explorer.*did you mean gap-explorer"):
        make_agent("gap_explorer")


@pytest.mark.parametrize("environment", IDS)
@pytest.mark.parametrize("name", agent_names())
def test_actions_are_actions_whichever_form_observations_have(name: str, environment: str) -> None:
    flat = _actions(make_agent(name), environment, "flat", 1)
    parts = _actions(make_agent(name), environment, "dict", 1)
    assert np.array_equal(flat, parts)


@pytest.mark.parametrize("environment", IDS)
@pytest.mark.parametrize("name", agent_names())
def test_a_reset_forgets_everything(name: str, environment: str) -> None:
    agent = make_agent(name)
    first = _actions(agent, environment, "flat", 1)
    assert not np.array_equal(first, _actions(agent, environment, "flat", 2, steps=120))
    assert np.array_equal(first, _actions(agent, environment, "flat", 1))
