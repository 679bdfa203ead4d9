"""From a learner to an agent's file."""

from __future__ import annotations

from collections.abc import Mapping

import gymnasium
import numpy as np
from gymnasium import spaces

from albot_agents.task import for_one
from albot_agents.trained.agent_file import AgentFile, TrainingFacts, kept_settings
from albot_agents.trained.network import CANDIDATES, NetworkConfig
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.reading import stage_settings
from albot_core.errors import InputError


class Exporter:
    """Makes agent files of a learner's weights.

    Args:
        plan: The training's plan.

    Raises:
        InputError: The environment cannot be made.
    """

    def __init__(self, plan: TrainingPlan) -> None:
        self._plan = plan
        settings = stage_settings(plan, plan.stages[-1])
        single = for_one(plan.task, settings)
        if isinstance(single.get("world"), list):
            single["world"] = single["world"][0]
        env = gymnasium.make(plan.task, **single)
        observing = env.get_wrapper_attr("observing")
        self._settings = kept_settings(plan.task, settings, observing)
        self._inputs = spaces.flatdim(env.observation_space)
        self._discrete = isinstance(env.action_space, spaces.Discrete)
        if plan.policy.sampled and self._discrete:
            raise InputError("PolicyPlan.sampled", "numbers as actions", "discrete ones")
        self._outputs = int(spaces.flatdim(env.action_space))
        self._candidates = 0
        if plan.policy.kind == "candidates":
            observing.require(CANDIDATES, "PolicyPlan.kind candidates")
            self._candidates = self._outputs - 1
        env.close()

    def agent(self, state: Mapping[str, np.ndarray], training: TrainingFacts) -> AgentFile:
        """The agent with the policy's weights.

        Args:
            state: The weights, under the names that stable-baselines3's policies give them.
            training: What is to be told of the training.
        """
        plan = self._plan
        return AgentFile(
            task=plan.task,
            settings=self._settings,
            discrete=self._discrete,
            network=NetworkConfig(
                inputs=self._inputs,
                layers=plan.policy.net_arch,
                activation=plan.policy.activation,
                outputs=self._outputs,
                lstm_size=plan.policy.lstm_size if plan.recurrent else 0,
                lstm_layers=plan.policy.lstm_layers if plan.recurrent else 0,
                sampled=plan.policy.sampled,
                candidates=self._candidates,
            ),
            weights=policy_weights(state, plan),
            training=training,
        )


def policy_weights(state: Mapping[str, np.ndarray], plan: TrainingPlan) -> dict[str, np.ndarray]:
    """The arrays of the policy's network under our names.

    Args:
        state: All weights, under the names that stable-baselines3's policies give them.
        plan: Says how the network is built.
    """
    weights: dict[str, np.ndarray] = {}
    if plan.recurrent:
        for k in range(plan.policy.lstm_layers):
            weights[f"lstm{k}.input"] = state[f"lstm_actor.weight_ih_l{k}"]
            weights[f"lstm{k}.hidden"] = state[f"lstm_actor.weight_hh_l{k}"]
            # PyTorch keeps two biases that are only ever added.
            weights[f"lstm{k}.bias"] = (
                state[f"lstm_actor.bias_ih_l{k}"] + state[f"lstm_actor.bias_hh_l{k}"]
            )
    for k in range(len(plan.policy.net_arch)):
        for part in ("weight", "bias"):
            # Between the layers stand their activations.
            weights[f"layer{k}.{part}"] = state[f"mlp_extractor.policy_net.{2 * k}.{part}"]
    if plan.policy.sampled:
        weights["action.log_std"] = state["log_std"]
    return weights | {f"action.{part}": state[f"action_net.{part}"] for part in ("weight", "bias")}
