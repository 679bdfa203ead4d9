"""A training that judges places, end to end: from a plan to an agent that answers."""

from __future__ import annotations

from pathlib import Path

import gymnasium
import numpy as np
import pytest

from albot_agents.agent import EnvironmentConfigs, begin_episode, choose_action
from albot_agents.registry import find_agent, make_agent
from albot_agents.trained.agent_file import read_agent
from albot_agents.trained.card import write_card
from albot_agents.training.run import TrainingRun
from albot_core.errors import InputError
from albot_core.plain_data import deep_merge
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.observation import ObservationConfig
from tests.agents.training.tiny import SMALL, begun

TASK = "Albot/PlaceRecognition-v0"
PLAN = deep_merge(
    SMALL,
    {
        "task": TASK,
        "n_timesteps": 16,
        "n_steps": 4,
        "batch_size": 8,
        "gamma": 0.0,
        "policy": {"kind": "candidates", "initial_action": [1, 0]},
        "env": {"config": {"tour": {"arrivals": 3}}},
    },
)


def test_a_judge_is_trained_and_judges(tmp_path: Path) -> None:
    folder, plan = begun(tmp_path, PLAN)
    run = TrainingRun(folder, plan)
    assert run.run()["samples"] == 16
    network = read_agent(folder.last).network
    assert (network.candidates, network.outputs) == (2, 3)
    name = str(folder.last)
    env = gymnasium.make(TASK, world="square-loop", **find_agent(name).environment(TASK, {}))
    agent = make_agent(name, EnvironmentConfigs.of(env))
    observation, info = begin_episode(env, agent, 3)
    answer = choose_action(agent, observation, info)
    expected, _ = run.learner.predict(observation, deterministic=True)
    assert isinstance(answer, np.int64)
    assert answer == expected
    with pytest.raises(InputError, match="expected observations with the part arrivals"):
        make_agent(name, EnvironmentConfigs(ObservationConfig(), ActionConfig())).reset(
            np.random.default_rng(0), env.action_space
        )
    card, *_ = write_card(read_agent(folder.last), "judge", tmp_path / "judge.md")
    assert "2 candidates of 11 numbers each, 8 tanh, 3 discrete actions" in card.read_text()


def test_where_there_is_nothing_to_weigh_that_is_said(tmp_path: Path) -> None:
    policy = {"kind": "candidates", "initial_action": None}
    with pytest.raises(InputError, match=r"kind: expected .* part arrivals, found candidates and"):
        begun(tmp_path, policy=policy)
    with pytest.raises(InputError, match="expected another kind than candidates for an LSTM"):
        begun(tmp_path, policy=policy, algorithm="recurrent_ppo")
    with pytest.raises(InputError, match="did you mean candidates"):
        begun(tmp_path, policy={"kind": "candidate"})
