"""Claims, learnt as a classification: is this place known, by what is observed of its match?

Reinforcement learning tells a policy of one claim a visit, together with all else that it did. But
the simulator knows at each step what a claim would be. So when the policy has learnt to drive, it
drives once more, and a small network learns from these answers how probable it is that a claim is
right. It becomes a part of the policy's network: its layers stand beside the policy's, with zeros
between them, and in the last layer the number that claims is its own. What drives stays the same to
the last bit, because products with zeros add nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from jaxtyping import Bool, Float32, Int64
from torch import nn

from albot_agents.agent import EnvironmentConfigs
from albot_agents.trained.agent_file import AgentFile, read_agent
from albot_agents.training.journeys import prepare_journeys
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_file import claims_settings
from albot_agents.training.teachers import Teachers
from albot_core.errors import InputError
from albot_env.tasks.core.actions import FlaggingActionConfig

_STREAM = 2
"""Number of the random stream of claims; that of pretraining is 1."""
_REPORT_EVERY = 64
"""Steps between two reports."""
_MEASURED = 5
"""In each environment of which the number is divisible by this, claims are only measured."""
_ACTIVATIONS = {"tanh": nn.Tanh, "relu": nn.ReLU, "elu": nn.ELU}

Report = Callable[[str], None]


class Place(NamedTuple):
    """Where in observations and actions claims are."""

    columns: Int64[np.ndarray, "inputs"]
    """The numbers of an observation by which is decided."""
    said: int
    """The number of an action that claims."""
    threshold: float
    """It claims if it is above this."""


class Answers(NamedTuple):
    """What was observed at some steps, and whether a claim would have been right."""

    inputs: Float32[np.ndarray, "samples inputs"]
    """The numbers by which is decided."""
    right: Bool[np.ndarray, "samples"]
    """Whether a claim would have been right; it would have been false otherwise."""
    environments: Int64[np.ndarray, "samples"]
    """Number of the environment of each."""


class ClaimTraining:
    """Lets agents learn when to claim. The same plan and agent give the same result.

    Args:
        plan: The plan of the training, with `claims`.
    """

    def __init__(self, plan: TrainingPlan) -> None:
        assert plan.claims is not None
        self._plan, self._claims = plan, plan.claims
        self._settings = claims_settings(plan)
        self._seed, self._torch_seed = (
            int(number) for number in np.random.SeedSequence((plan.seed, _STREAM)).generate_state(2)
        )

    def teach(
        self, path: Path, report: Report = lambda note: None
    ) -> dict[str, float | int | None]:
        """Let the agent in a file learn when to claim, and replace the file.

        Args:
            path: The file of an agent that the plan trained, without such claims.
            report: Called with the progress as text.

        Returns:
            The number of `samples`; and of claims at all steps of the environments in which it was
            only measured, `precision` and `recall`, None without any.

        Raises:
            InputError: Claims would be right at no step, or false at none; or the file cannot be
                written.
        """
        file = read_agent(path)
        place, answers = self._ask(path, report)
        measured = answers.environments % _MEASURED == 0
        taught = answers.right[~measured]
        if taught.all() or not taught.any():
            kind = "false" if len(taught) and taught.all() else "right"
            expected = f"claims of both kinds in {self._claims.steps:,} samples; more steps help"
            raise InputError("TrainingPlan.claims", expected, f"none that would be {kind}")
        classifier = self._learn(answers.inputs[~measured], taught, file, report)
        with torch.no_grad():
            claims = (classifier(torch.from_numpy(answers.inputs[measured]))[:, 0] > 0).numpy()
        right = answers.right[measured]
        hits = int((claims & right).sum())
        with_claims(file, classifier, place).save(path)
        return {
            "samples": self._claims.steps_each * self._claims.n_envs,
            "precision": hits / int(claims.sum()) if claims.any() else None,
            "recall": hits / int(right.sum()) if right.any() else None,
        }

    def _ask(self, path: Path, report: Report) -> tuple[Place, Answers]:
        """Let the agent drive; return what a claim would have been at each step."""
        count, steps = self._claims.n_envs, self._claims.steps_each
        batch: Any = gymnasium.make_vec(
            self._plan.task,
            num_envs=count,
            autoreset_mode=AutoresetMode.SAME_STEP,
            **self._settings,
        ).unwrapped
        try:
            prepare_journeys(self._plan.task, batch, self._settings, report)
            names = "observation_config", "action_config", "robot_config"
            configs = EnvironmentConfigs(*(getattr(batch, name) for name in names))
            place = _place(configs, self._claims.parts)
            agents = Teachers(str(path), configs, batch.single_action_space, count)
            agents.begin(self._seed)
            observations, _ = batch.reset(seed=self._seed)
            robots, asked = np.arange(count), []
            for step in range(steps):
                if step % _REPORT_EVERY == 0:
                    report(f"claims, {step * count:,} of {steps * count:,} samples driven")
                outcomes = batch.claim_outcomes
                (counting,) = np.nonzero(outcomes)
                inputs = observations[counting][:, place.columns]
                asked.append((inputs, outcomes[counting] > 0, counting))
                shown = configs.observations.split_rows(observations)
                observations, _, ended, truncated, _ = batch.step(agents.act(shown, robots))
                agents.reset(ended | truncated)
        finally:
            batch.close()
        return place, Answers(*(np.concatenate(each) for each in zip(*asked, strict=True)))

    def _learn(
        self,
        inputs: Float32[np.ndarray, "samples inputs"],
        right: Bool[np.ndarray, "samples"],
        file: AgentFile,
        report: Report,
    ) -> nn.Sequential:
        """Return a classifier with one output, which is above 0 where it claims."""
        plan = self._claims
        torch.manual_seed(self._torch_seed)
        classifier = _classifier(inputs.shape[1], plan.units, file)
        optimizer = torch.optim.Adam(classifier.parameters(), lr=plan.learning_rate)
        schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.0, plan.n_epochs)
        seen, wanted = torch.from_numpy(inputs), torch.from_numpy(right.astype(np.float32))
        for epoch in range(plan.n_epochs):
            losses = []
            for rows in torch.split(torch.randperm(len(seen)), plan.batch_size):
                answers = classifier(seen[rows])[:, 0]
                loss = nn.functional.binary_cross_entropy_with_logits(answers, wanted[rows])
                optimizer.zero_grad()
                loss.backward()  # type: ignore[no-untyped-call]
                optimizer.step()
                losses.append(loss.item())
            schedule.step()
            report(f"claims, epoch {epoch + 1} of {plan.n_epochs}, loss {np.mean(losses):.3f}")
        last = classifier[-1]
        assert isinstance(last, nn.Linear)
        with torch.no_grad():  # Its output was the logarithm of the odds that a claim is right.
            last.bias.sub_(math.log(plan.probability / (1 - plan.probability)))
        return classifier


def with_claims(file: AgentFile, classifier: nn.Sequential, place: Place) -> AgentFile:
    """Return an agent whose claims are those of a classifier, which becomes part of its network.

    Args:
        file: The agent.
        classifier: Linear layers, as many as those of the agent, with its activation between them.
            It claims where its output is above 0.
        place: Where its inputs and its output are. No encoder takes its inputs.
    """
    network, weights = file.network, dict(file.weights)
    linear = [each for each in classifier if isinstance(each, nn.Linear)]
    beside = [(each.weight.detach().numpy(), each.bias.detach().numpy()) for each in linear]
    plain = np.ones(network.inputs, np.bool_)
    for encoder in network.encoders:
        plain[encoder.begin : encoder.begin + encoder.size] = False
    # The first layer takes the numbers that no encoder takes, then what the encoders put out.
    columns, before = (np.cumsum(plain) - 1)[place.columns], 0
    for k, (weight, bias) in enumerate(beside[:-1]):
        own = weights[f"layer{k}.weight"]
        units, width = own.shape
        joined = np.zeros((units + len(weight), width + before), np.float32)
        joined[:units, :width] = own
        joined[units:, columns] = weight
        weights[f"layer{k}.weight"] = joined
        weights[f"layer{k}.bias"] = np.concatenate((weights[f"layer{k}.bias"], bias))
        before = len(weight)
        columns = np.arange(before) + units
    own, (weight, bias) = weights["action.weight"], beside[-1]
    answers = np.concatenate((own, np.zeros((len(own), before), np.float32)), axis=1)
    answers[place.said] = 0.0
    answers[place.said, columns] = weight[0]
    biases = weights["action.bias"].copy()
    biases[place.said] = bias[0] + place.threshold
    weights |= {"action.weight": answers, "action.bias": biases}
    sizes = tuple(len(weights[f"layer{k}.bias"]) for k in range(len(network.layers)))
    return replace(file, network=replace(network, layers=sizes), weights=weights)


def _place(configs: EnvironmentConfigs, parts: tuple[str, ...]) -> Place:
    """Return where in an environment's observations and actions claims are."""
    observations, actions = configs.observations, configs.actions
    assert isinstance(actions, FlaggingActionConfig), "others are refused with the plan"
    numbers = np.arange(observations.flat_space.shape[0], dtype=np.float32)
    by_part = observations.split(numbers)
    columns = np.concatenate([by_part[part].ravel() for part in parts]).astype(np.int64)
    return Place(columns, actions.names.index("claim"), actions.threshold)


def _classifier(inputs: int, units: int, file: AgentFile) -> nn.Sequential:
    """Return a new classifier with as many layers as an agent's network, and its activation."""
    layers: list[nn.Module] = []
    for _ in file.network.layers:
        layers += nn.Linear(inputs, units), _ACTIVATIONS[file.network.activation]()
        inputs = units
    return nn.Sequential(*layers, nn.Linear(inputs, 1))
