"""What a plan must fulfil beyond its own values: the learner's device, and the environments."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Collection
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv

from albot_agents.trained.agent_file import FORMAT
from albot_agents.trained.encoders import ATTENTION, CONVOLUTION, PLANNER, PartEncoder
from albot_agents.trained.network import CANDIDATES, NetworkConfig
from albot_agents.training.off_policy_plan import VALUE_BASED
from albot_agents.training.plan import ON_POLICY, PolicyPlan, TrainingPlan
from albot_agents.training.sweep_plan import METRICS
from albot_core.errors import InputError, did_you_mean
from albot_core.plain_data import Location
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.parts.ground import COVERAGE
from albot_env.tasks.core.parts.map_patch import MAP_PATCH
from albot_env.tasks.core.parts.place_graph import PLACE_GRAPH
from albot_env.tasks.core.parts.scales import Channels
from albot_env.tasks.core.parts.truth import TRUE_PATCH

Batch = VectorEnv[Any, Any, np.ndarray]
MEMORY = Location("training plan")
"""Location of a plan that was not read from a file."""
_PATCHES = (MAP_PATCH.name, TRUE_PATCH.name, COVERAGE.name)
"""Parts that convolutions encode."""
_HEADER_BYTES = 1 << 20
"""What an agent's file holds besides its network is less (bytes)."""
_ENCODED: dict[str, tuple[tuple[str, ...], ...]] = {
    "cnn": (_PATCHES,),
    "attention": ((PLACE_GRAPH.name,),),
    "planner": ((MAP_PATCH.name,),),
}
_ENCODED["multi_input"] = (*_ENCODED["cnn"], *_ENCODED["attention"])
"""For each kind of policy: groups of parts, of each of which it encodes those that are observed."""


def check_device(plan: TrainingPlan, where: Location = MEMORY) -> None:
    """Raise InputError if the plan requests a GPU and there is none.

    Args:
        plan: The plan.
        where: Location of the plan.
    """
    if plan.device != "cuda":
        return
    import torch  # Slow to load.

    if not torch.cuda.is_available():
        raise where.at("device").error("auto or cpu, since there is no GPU", "cuda")


def check_algorithm(
    plan: TrainingPlan,
    observations: spaces.Space[Any],
    actions: spaces.Space[Any],
    where: Location = MEMORY,
) -> None:
    """Raise InputError if an algorithm does not fit the actions, or its buffer the memory.

    Args:
        plan: The plan.
        observations: The environment's observation space.
        actions: The environment's action space.
        where: Location of the plan.
    """
    discrete = isinstance(actions, spaces.Discrete)
    fitting = (*ON_POLICY, *(VALUE_BASED if discrete else ("sac",)))
    numbers = spaces.flatdim(actions)
    if plan.algorithm not in fitting:
        its = f"{numbers} discrete actions" if discrete else f"actions of {numbers} numbers"
        # The actions of judging places are discrete whatever the settings.
        remedy = "" if discrete else "; dqn and qrdqn need env: {action: discrete}"
        expected = f"one of {', '.join(fitting)} for {its}{remedy}"
        raise where.at("algorithm").error(expected, plan.algorithm)
    start = plan.policy.initial_action or ()
    if plan.algorithm == "sac" and any(abs(number) >= 1 for number in start):
        expected = "numbers within (-1, 1) for sac, whose actions never leave it"
        raise where.at("policy", "initial_action").error(expected, str(list(start)))
    if plan.learns_off_policy:
        size = sample_bytes(spaces.flatdim(observations), 2 if discrete else numbers)
        most = memory_bytes() // 2 // size
        if plan.off_policy.buffer_size > most:
            expected = f"at most {most:,} samples of {size:,} bytes, half of this machine's memory"
            found = f"{plan.off_policy.buffer_size:,}"
            raise where.at("off_policy", "buffer_size").error(expected, found)


def sample_bytes(observation: int, action: int) -> int:
    """Return the size of a sample in stable-baselines3's replay buffer (bytes).

    Args:
        observation: Numbers in an observation; a sample has two.
        action: Numbers in an action, of 4 bytes; a discrete action takes two.
    """
    return 4 * (2 * observation + action + 3)  # Reward, end of the episode, end by time.


def memory_bytes() -> int:
    """Return the size of the machine's memory (bytes)."""
    if sys.platform == "win32":  # It does not tell; as much as most computers have.
        return 16 << 30
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def check_policy(
    policy: PolicyPlan,
    observation_config: ObservationConfig,
    actions: spaces.Space[Any],
    where: Location = MEMORY,
) -> None:
    """Raise InputError if a policy does not fit the observations and actions of an environment.

    Args:
        policy: The policy.
        observation_config: The environment's observation config.
        actions: The environment's action space.
        where: Location of the plan.
    """
    where = where.at("policy")
    discrete = isinstance(actions, spaces.Discrete)
    outputs = spaces.flatdim(actions)
    if policy.sampled and discrete:
        raise where.at("sampled").error("false for discrete actions", "true")
    if policy.kind == "candidates":
        outputs = 2  # Logits of "none" and of "this one".
        try:
            observation_config.require(CANDIDATES, "candidates")
        except InputError as error:
            expected = f"mlp, or {error.expected}"
            raise where.at("kind").error(expected, f"candidates and {error.found}") from None
    if policy.initial_action is not None and len(policy.initial_action) != outputs:
        found = str(len(policy.initial_action))
        raise where.at("initial_action").error(f"{outputs} numbers", found)


def agent_network(
    plan: TrainingPlan,
    observation_config: ObservationConfig,
    observations: spaces.Space[Any],
    actions: spaces.Space[Any],
    where: Location = MEMORY,
) -> NetworkConfig:
    """Return the network of the agents that a plan trains.

    Args:
        plan: The plan.
        observation_config: The environment's observation config.
        observations: The environment's observation space.
        actions: The environment's action space.
        where: Location of the plan.

    Raises:
        InputError: An agent's file cannot hold it, or the observation has no part to encode.
    """
    policy, outputs = plan.policy, int(spaces.flatdim(actions))
    network = NetworkConfig(
        inputs=spaces.flatdim(observations),
        layers=policy.net_arch,
        activation=policy.activation,
        outputs=outputs,
        lstm_size=policy.lstm_size if plan.recurrent else 0,
        lstm_layers=policy.lstm_layers if plan.recurrent else 0,
        sampled=policy.sampled,
        sampled_statements=policy.sampled_statements,
        candidates=outputs - 1 if policy.kind == "candidates" else 0,
        encoders=policy_encoders(policy, observation_config, where),
        squashed=plan.algorithm == "sac",
    )
    size = 4 * sum(math.prod(shape) for shape in network.shapes.values())
    most = FORMAT.largest - _HEADER_BYTES
    if size > most:
        expected = f"a network of {most:,} bytes at most, as an agent's file holds"
        raise where.at("policy").error(expected, f"one of {size:,} bytes")
    return network


def policy_encoders(
    policy: PolicyPlan, observation_config: ObservationConfig, where: Location = MEMORY
) -> tuple[PartEncoder, ...]:
    """Return the encoders of a policy, in the order of the observation's parts.

    Args:
        policy: The policy.
        observation_config: The environment's observation config.
        where: Location of the plan.

    Raises:
        InputError: The observation has no part that a policy of this kind encodes.
    """
    groups = _ENCODED.get(policy.kind, ())
    shapes = observation_config.shapes if groups else {}
    for group in groups:
        if not any(part in shapes for part in group):
            expected = f"mlp, or observations with the part {' or '.join(group)}"
            found = f"{policy.kind} and {', '.join(shapes)}"
            raise where.at("policy", "kind").error(expected, found)
    encoders = []
    for part, shape in shapes.items():
        if any(part in group for group in groups):
            sizes = _encoder_sizes(part, shape, policy, observation_config, where.at("policy"))
            begin = getattr(observation_config.layout, part)
            encoders.append(PartEncoder(part=part, begin=begin, shape=shape, **sizes))
    return tuple(encoders)


def _encoder_sizes(
    part: str,
    shape: tuple[int, ...],
    policy: PolicyPlan,
    observation_config: ObservationConfig,
    where: Location,
) -> dict[str, Any]:
    """Return kind and sizes of the encoder of a part; `where` is the location of the policy."""
    if part == PLACE_GRAPH.name:
        places = observation_config.place_graph.places
        graph = {"units": policy.graph_units, "heads": policy.graph_heads}
        return {"kind": ATTENTION, "places": places, **graph}
    if policy.kind != "planner":
        return {"kind": CONVOLUTION, "filters": policy.filters}
    patch = observation_config.map_patch
    goal = Channels.of(patch.shown).home
    if goal < 0 or len(patch.sides) > 1:
        expected = "mlp or cnn, or a map_patch of one square with the channel home"
        found = f"planner, {len(patch.sides)} squares and {', '.join(patch.shown)}"
        raise where.at("kind").error(expected, found)
    largest = (shape[1] - 1) // 2
    if policy.planner_radius > largest:
        expected = f"at most {largest}, half the side of map_patch"
        raise where.at("planner_radius").error(expected, str(policy.planner_radius))
    costs = policy.planner_costs
    if costs is not None and len(costs) != shape[0]:
        expected = f"{shape[0]} numbers, one for each of {', '.join(patch.shown)}"
        raise where.at("planner_costs").error(expected, str(len(costs)))
    return {"kind": PLANNER, "goal": goal, "radius": policy.planner_radius}


def check_claims(
    plan: TrainingPlan,
    observation_config: ObservationConfig,
    action_config: Any,
    where: Location = MEMORY,
) -> None:
    """Raise InputError if a plan's claims cannot be learnt in its environments.

    Args:
        plan: The plan.
        observation_config: The environment's observation config.
        action_config: The environment's action config; None for a task without one.
        where: Location of the plan.
    """
    if plan.claims is None:
        return
    place = where.at("claims")
    if "claim" not in getattr(action_config, "names", ()):
        expected = "null, or a task in which the agent claims to know places"
        raise place.error(expected, f"claims in {plan.task}")
    encoded = [each.part for each in policy_encoders(plan.policy, observation_config, where)]
    plain = [part for part in observation_config.shapes if part not in encoded]
    for k, part in enumerate(plan.claims.parts):
        if part not in plain:
            expected = f"a part that is observed, and not encoded: {', '.join(plain)}"
            raise place.at("parts", k).error(expected, f"{part}{did_you_mean(part, plain)}")


def check_spaces(before: Batch, after: Batch, where: Location) -> None:
    """Raise InputError if two batches differ in the observations or actions of one environment.

    Args:
        before: The batch whose spaces are expected.
        after: The batch to check.
        where: Location of its settings in the plan.
    """
    for name in ("single_observation_space", "single_action_space"):
        expected, found = getattr(before, name), getattr(after, name)
        if expected != found:
            kind = "observations" if "observation" in name else "actions"
            raise where.error(f"the same {kind} as before, {expected}", str(found))


def check_metric(plan: TrainingPlan, facts: Collection[str], where: Location) -> None:
    """Raise InputError if the task does not have what makes a trial of the sweep the best.

    Args:
        plan: The plan.
        facts: Names of what an info of the task tells.
        where: Location of the plan.
    """
    if plan.sweep is None:
        return
    known = ["return", *(name for name, fact in METRICS.items() if fact in facts)]
    if plan.sweep.metric not in known:
        expected = f"one of what evaluations of {plan.task} give, {', '.join(known)}"
        raise where.at("sweep", "metric").error(expected, plan.sweep.metric)
