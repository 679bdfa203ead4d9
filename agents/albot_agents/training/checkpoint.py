"""Save a learner: its complete state in a checkpoint, or its policy alone in an agent file.

A checkpoint holds everything that a learner needs to continue as if it had never stopped, as arrays
and plain data: weights, Adam's moments, and the states of the random generators. Only the replay
buffer of an off-policy learner is not kept: it is a thousand times larger than the rest, and the
policy fills it again in minutes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from albot_agents.task import single_env_settings
from albot_agents.trained.agent_file import AgentFile, TrainingFacts, kept_settings
from albot_agents.trained.encoders import PartEncoder
from albot_agents.training.encoders import encoder_weights
from albot_agents.training.off_policy import continue_without_buffer
from albot_agents.training.plan import ON_POLICY, TrainingPlan
from albot_agents.training.plan_check import agent_network, check_algorithm, check_policy
from albot_agents.training.plan_file import stage_settings
from albot_core.archive import HEADER, ArchiveFormat
from albot_core.errors import InputError
from albot_core.plain_data import Location, read_record, read_value
from albot_core.ranges import COUNT

FORMAT = ArchiveFormat(name="albot-checkpoint", version=1, kind="checkpoint", largest=1 << 28)
SUFFIX = ".checkpoint"
KEPT = 2
"""Number of checkpoints kept; older ones are deleted."""

_WEIGHT = "weight."
"""Prefix of the names of weights."""
_LAYERS = {
    **dict.fromkeys(ON_POLICY, ("", "mlp_extractor.policy_net.{}", "action_net")),
    "sac": ("actor.", "latent_pi.{}", "mu"),
    "dqn": ("q_net.", "q_net.{}", "q_net.{}"),
    "qrdqn": ("quantile_net.", "quantile_net.{}", "quantile_net.{}"),
}
"""Names of the network that acts, of its hidden layers and of its output layer, in
stable-baselines3; {} is the number of the module, of which every second is an activation."""
_MOMENTS = ("exp_avg", "exp_avg_sq", "step")
"""Adam's state of each parameter."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Checkpoint:
    """The state of a learner and its run between two rollouts."""

    samples: int
    """Samples so far."""
    updates: int
    """Number of passes through the samples so far, or of gradient steps with a replay buffer, as
    counted by stable-baselines3."""
    run: Mapping[str, Any]
    """Other state of the run, as plain data."""
    numpy_state: tuple[float, ...]
    """State of numpy's generator: position, whether a normal number is left over, that number."""
    arrays: Mapping[str, np.ndarray]
    """Weights, Adam's moments, and the states of random generators."""

    @property
    def weights(self) -> dict[str, np.ndarray]:
        """The weights, under the names of stable-baselines3's policies."""
        return {
            name.removeprefix(_WEIGHT): array
            for name, array in self.arrays.items()
            if name.startswith(_WEIGHT)
        }

    def save(self, folder: Path) -> Path:
        """Write it, delete all but the newest `KEPT` checkpoints, and return its path.

        Raises:
            InputError: It cannot be written; the message names the last good checkpoint.
        """
        path = folder / f"{self.samples:012d}{SUFFIX}"
        header = {"samples": self.samples, "updates": self.updates, "run": dict(self.run)}
        try:
            FORMAT.write(path, header | {"random": list(self.numpy_state)}, self.arrays)
        except OSError as error:
            left = checkpoints(folder)
            good = f"; {left[-1]} is intact" if left else ""
            reason = error.strerror or str(error)
            raise InputError(path, "free disk space for a checkpoint", f"{reason}{good}") from None
        for old in checkpoints(folder)[:-KEPT]:
            old.unlink(missing_ok=True)
        return path


def checkpoints(folder: Path) -> list[Path]:
    """Return the checkpoints in a folder, the newest last."""
    return sorted(folder.glob(f"*{SUFFIX}"))


def newest_checkpoint(
    folder: Path, warn: Callable[[str], None] = lambda text: None
) -> tuple[Path, Checkpoint] | None:
    """Return the newest intact checkpoint in a folder and its path; None if there is none.

    Args:
        folder: The folder.
        warn: Called with a sentence about each damaged checkpoint that is newer.

    Raises:
        InputError: All checkpoints are damaged.
    """
    damaged: list[InputError] = []
    for path in reversed(checkpoints(folder)):
        try:
            checkpoint = read_checkpoint(path)
        except InputError as error:
            damaged.append(error)
            continue
        for damage in damaged:
            warn(f"{damage}; continuing from the one before")
        return path, checkpoint
    if damaged:
        raise damaged[-1]
    return None


def take_checkpoint(learner: BaseAlgorithm, run: Mapping[str, Any]) -> Checkpoint:
    """Return a checkpoint of a learner's current state; `run` is the run's other state."""
    arrays = {f"{_WEIGHT}{name}": _array(value) for name, value in learnt_tensors(learner).items()}
    for name, parameter, optimizer in _optimized(learner):
        for moment, value in optimizer.state.get(parameter, {}).items():
            arrays[f"adam.{moment}.{name}"] = _array(value)
    _, keys, *place = np.random.get_state()  # noqa: NPY002 - what stable-baselines3 draws from
    arrays["random.numpy"] = np.asarray(keys, np.uint32)
    arrays["random.torch"] = _array(torch.get_rng_state())
    if torch.cuda.is_available():
        arrays["random.cuda"] = _array(torch.cuda.get_rng_state())
    return Checkpoint(
        samples=learner.num_timesteps,
        updates=int(learner._n_updates),
        run=run,
        numpy_state=tuple(float(number) for number in place),
        arrays=arrays,
    )


def read_checkpoint(path: Path) -> Checkpoint:
    """Read the checkpoint in a file.

    Raises:
        InputError: The file is missing, truncated or not a checkpoint.
    """
    header, arrays = FORMAT.read(path)
    kinds = {"samples": int, "updates": int, "run": dict[str, Any], "random": tuple[float, ...]}
    where = Location(f"{path}, {HEADER}")
    fields = read_record(kinds, header, where)
    for name in ("samples", "updates"):
        if fields[name] not in COUNT:
            raise where.at(name).error(COUNT.expected, str(fields[name]))
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise InputError(path, "finite numbers", "NaN or infinity", place=f"{name}.npy")
    state = fields.pop("random")
    return Checkpoint(**fields, numpy_state=state, arrays=arrays)


def restore(learner: BaseAlgorithm, checkpoint: Checkpoint, path: Path) -> None:
    """Restore a learner's state from a checkpoint.

    Args:
        learner: A new learner of the same plan.
        checkpoint: The checkpoint.
        path: Path of the checkpoint, for errors.

    Raises:
        InputError: The arrays do not fit this learner.
    """
    arrays, tensors = dict(checkpoint.arrays), learnt_tensors(learner)
    weights = {
        name: _pop_tensor(arrays, f"{_WEIGHT}{name}", value, path)
        for name, value in tensors.items()
    }
    with torch.no_grad():
        for name, value in tensors.items():
            value.copy_(weights[name])
    for name, parameter, optimizer in _optimized(learner):
        if f"adam.step.{name}" not in arrays:
            continue  # No update was made yet.
        shapes = dict(zip(_MOMENTS, (parameter, parameter, torch.zeros(())), strict=True))
        optimizer.state[parameter] = {
            moment: _pop_tensor(arrays, f"adam.{moment}.{name}", like, path)
            for moment, like in shapes.items()
        }
    _restore_random(arrays, checkpoint.numpy_state, path)
    if arrays:
        raise InputError(path, "only this learner's arrays", min(arrays), place="members")
    learner.num_timesteps = checkpoint.samples
    learner._n_updates = checkpoint.updates
    if isinstance(learner, OffPolicyAlgorithm):
        continue_without_buffer(learner)


def learnt_tensors(learner: BaseAlgorithm) -> dict[str, torch.Tensor]:
    """Return all weights of a learner by name: those of its networks, and SAC's coefficient."""
    return learner.policy.state_dict() | _variables(learner)


def _variables(learner: BaseAlgorithm) -> dict[str, torch.Tensor]:
    """Return the weights outside the networks, as stable-baselines3 itself lists them."""
    _, names = learner._get_torch_save_params()
    return {name: attrgetter(name)(learner) for name in names}


def _optimized(
    learner: BaseAlgorithm,
) -> Iterator[tuple[str, torch.Tensor, torch.optim.Optimizer]]:
    """Yield name, tensor and optimizer of each weight that is learnt by gradients."""
    states, _ = learner._get_torch_save_params()
    optimizers = [attrgetter(name)(learner) for name in states if name.endswith("optimizer")]
    owners = {
        parameter: optimizer
        for optimizer in optimizers
        for group in optimizer.param_groups
        for parameter in group["params"]
    }
    for name, parameter in (*learner.policy.named_parameters(), *_variables(learner).items()):
        if parameter in owners:  # Others are copies, such as target networks.
            yield name, parameter, owners[parameter]


def _restore_random(arrays: dict[str, np.ndarray], place: tuple[float, ...], path: Path) -> None:
    """Restore the states of the random generators from which the learner draws."""
    keys = torch.zeros(624, dtype=torch.uint32)
    state = _pop_tensor(arrays, "random.numpy", keys, path).numpy()
    where = Location(f"{path}, {HEADER}").at("random")
    position, has_normal, normal = read_value(tuple[float, float, float], list(place), where)
    if not 0 <= position <= len(state) or has_normal not in (0, 1):
        raise where.error(f"a position up to {len(state)}, 0 or 1, a number", str(place))
    np.random.set_state(("MT19937", state, int(position), int(has_normal), normal))  # noqa: NPY002
    try:
        torch.set_rng_state(_pop_tensor(arrays, "random.torch", torch.get_rng_state(), path))
    except RuntimeError as error:
        raise InputError(path, "a generator's state", str(error), place="random.torch.npy") from (
            None
        )
    if torch.cuda.is_available() and "random.cuda" in arrays:
        like = torch.cuda.get_rng_state()
        torch.cuda.set_rng_state(_pop_tensor(arrays, "random.cuda", like, path))
    arrays.pop("random.cuda", None)


def _array(value: torch.Tensor) -> np.ndarray:
    return value.detach().cpu().numpy().copy()


def _pop_tensor(
    arrays: dict[str, np.ndarray], name: str, like: torch.Tensor, path: Path
) -> torch.Tensor:
    """Remove an array from `arrays`; return it as a tensor with the shape and type of `like`."""
    array = arrays.pop(name, None)
    if array is None:
        raise InputError(path, f"the array {name}", "none", place=f"{name}.npy")
    tensor = torch.from_numpy(array)
    if (tensor.shape, tensor.dtype) != (like.shape, like.dtype):
        expected = f"{list(like.shape)} of {like.dtype}"
        found = f"{list(tensor.shape)} of {tensor.dtype}"
        raise InputError(path, expected, found, place=f"{name}.npy")
    return tensor.to(like.device)


class AgentExporter:
    """Makes agent files from a learner's weights.

    Args:
        plan: The training plan.

    Raises:
        InputError: The environment cannot be made, or the policy does not fit it.
    """

    def __init__(self, plan: TrainingPlan) -> None:
        self._plan = plan
        settings = stage_settings(plan, plan.stages[-1])
        single = single_env_settings(plan.task, settings)
        if isinstance(single.get("world"), list):
            single["world"] = single["world"][0]
        env = gymnasium.make(plan.task, **single)
        observation_config = env.get_wrapper_attr("observation_config")
        check_algorithm(plan, env.observation_space, env.action_space)
        check_policy(plan.policy, observation_config, env.action_space)
        self.network = agent_network(
            plan, observation_config, env.observation_space, env.action_space
        )
        """Architecture of the agents' network."""
        self._settings = kept_settings(plan.task, settings, observation_config)
        self._discrete = isinstance(env.action_space, spaces.Discrete)
        env.close()

    def agent(self, state: Mapping[str, np.ndarray], training: TrainingFacts) -> AgentFile:
        """Return the agent with the policy's weights.

        Args:
            state: The weights, under the names of stable-baselines3's policies.
            training: Facts of the training.
        """
        plan = self._plan
        return AgentFile(
            task=plan.task,
            settings=self._settings,
            discrete=self._discrete,
            network=self.network,
            weights=policy_weights(state, plan, self.network.encoders),
            training=training,
        )


def policy_weights(
    state: Mapping[str, np.ndarray], plan: TrainingPlan, encoders: tuple[PartEncoder, ...] = ()
) -> dict[str, np.ndarray]:
    """Return the arrays of the policy's network under the names in `NetworkConfig.shapes`.

    Args:
        state: All weights, under the names of stable-baselines3's policies.
        plan: The training plan, with the architecture of the network.
        encoders: The encoders of the policy.
    """
    actor, hidden, output = _LAYERS[plan.algorithm]
    weights = encoder_weights(state, encoders, actor)
    if plan.recurrent:
        for k in range(plan.policy.lstm_layers):
            weights[f"lstm{k}.input"] = state[f"lstm_actor.weight_ih_l{k}"]
            weights[f"lstm{k}.hidden"] = state[f"lstm_actor.weight_hh_l{k}"]
            # PyTorch has two biases, of which only the sum matters.
            weights[f"lstm{k}.bias"] = (
                state[f"lstm_actor.bias_ih_l{k}"] + state[f"lstm_actor.bias_hh_l{k}"]
            )
    for part in ("weight", "bias"):
        for k in range(len(plan.policy.net_arch)):
            weights[f"layer{k}.{part}"] = state[f"{actor}{hidden.format(2 * k)}.{part}"]
        last = output.format(2 * len(plan.policy.net_arch))
        answer = state[f"{actor}{last}.{part}"]
        if plan.algorithm == "qrdqn":
            # The mean over the quantiles of a linear layer is a linear layer of the means.
            quantiles = plan.off_policy.n_quantiles
            answer = answer.reshape(quantiles, -1, *answer.shape[1:]).mean(axis=0)
        weights[f"action.{part}"] = answer
    if plan.policy.sampled:
        weights["action.log_std"] = state["log_std"]
    return weights
