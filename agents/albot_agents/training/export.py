"""From a learner to an agent's file."""

from __future__ import annotations

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy

from albot_agents.task import for_one
from albot_agents.trained.agent_file import AgentFile, TrainingFacts, kept_settings
from albot_agents.trained.network import NetworkConfig
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.reading import stage_settings


class Exporter:
    """Makes agent files of a learner's policy.

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
        self._settings = kept_settings(settings, env.get_wrapper_attr("observing"))
        env.close()

    def agent(self, learner: OnPolicyAlgorithm, training: TrainingFacts) -> AgentFile:
        """The policy as it is now, with what is to be told of its training."""
        plan = self._plan
        (inputs,) = learner.observation_space.shape or ()
        weights = policy_weights(learner.policy, plan)
        return AgentFile(
            task=plan.task,
            settings=self._settings,
            discrete=isinstance(learner.action_space, Discrete),
            network=NetworkConfig(
                inputs=inputs,
                layers=plan.policy.net_arch,
                activation=plan.policy.activation,
                outputs=len(weights["action.bias"]),
                lstm_size=plan.policy.lstm_size if plan.recurrent else 0,
                lstm_layers=plan.policy.lstm_layers if plan.recurrent else 0,
            ),
            weights=weights,
            training=training,
        )


def policy_weights(policy: ActorCriticPolicy, plan: TrainingPlan) -> dict[str, np.ndarray]:
    """The arrays of a policy's network of stable-baselines3, under our names."""
    state = {
        name: value.detach().cpu().numpy().copy() for name, value in policy.state_dict().items()
    }
    weights: dict[str, np.ndarray] = {}
    if plan.recurrent:
        for k in range(plan.policy.lstm_layers):
            weights[f"lstm{k}.input"] = state[f"lstm_actor.weight_ih_l{k}"]
            weights[f"lstm{k}.hidden"] = state[f"lstm_actor.weight_hh_l{k}"]
            # PyTorch keeps two biases that are only ever added.
            biases = (state[f"lstm_actor.bias_{part}_l{k}"] for part in ("ih", "hh"))
            weights[f"lstm{k}.bias"] = sum(biases)
    for k in range(len(plan.policy.net_arch)):
        for part in ("weight", "bias"):
            # Between the layers stand their activations.
            weights[f"layer{k}.{part}"] = state[f"mlp_extractor.policy_net.{2 * k}.{part}"]
    return weights | {f"action.{part}": state[f"action_net.{part}"] for part in ("weight", "bias")}
