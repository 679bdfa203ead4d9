"""The file of a trained agent: its task and settings, its network, and facts of its training."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from albot_agents.task import config_kind, read_settings, single_env_settings, task_names
from albot_agents.trained.network import NetworkConfig
from albot_agents.training.plan import TrainingPlan
from albot_core.archive import HEADER, ArchiveFormat
from albot_core.errors import InputError
from albot_core.file_kinds import AGENT, kind_of
from albot_core.mappers.registry import NO_MAPPER, mapper_spec
from albot_core.plain_data import Location, read_config, read_record, to_plain
from albot_core.yaml_document import format_value
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.observation import ObservationConfig

FORMAT = ArchiveFormat(name="albot-agent", version=1, kind="agent file", largest=1 << 24)
SUFFIX = ".albot"
LARGEST_WEIGHT = 1e6
"""Largest absolute weight of a network; weights of trained networks are below ten."""
LARGEST_LOG_STD = 20.0
"""Largest absolute logarithm of a standard deviation."""

KEPT_SETTINGS = (
    "robot", "mapper", "mapper_config", "laser", "sonar", "scenes", "compass", "action", "config",
)  # fmt: skip
"""Settings of the environment that determine observations and actions; see `KEPT_CONFIG`."""
KEPT_CONFIG = ("observations", "actions", "claims", "hints", "tour")
"""Those fields of the setting `config` that determine observations and actions. A tour, whose
length does, is also what happens in an episode: see `AgentFile.environment`."""


@dataclass(frozen=True, kw_only=True)
class TrainingFacts:
    """Facts of an agent's training."""

    plan: TrainingPlan
    """The plan, including the seed."""
    command: str
    """The command that started the training."""
    samples: int
    """Samples so far."""
    episodes: int
    """Episodes so far."""
    seconds: float
    """Duration of the training (s)."""
    python: str
    """Version of Python."""
    machine: str
    """The machine that it ran on."""
    versions: Mapping[str, str]
    """Versions of the packages."""
    curve: Mapping[str, list[float]] = field(default_factory=dict)
    """Means of the evaluations so far: `samples`, `return` and, if known, `success_rate` and
    `spl`, all of one length; empty without evaluations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AgentFile:
    """The content of an agent's file."""

    task: str
    """Id of the environment that it was trained in."""
    settings: Mapping[str, Any]
    """Settings of the environment that determine observations and actions, as plain data."""
    discrete: bool
    """Whether its actions are discrete; otherwise they are numbers in [-1, 1]."""
    network: NetworkConfig
    """Architecture of its network."""
    weights: Mapping[str, np.ndarray]
    """The network's arrays, float32."""
    training: TrainingFacts
    """Facts of its training."""

    @property
    def observation_config(self) -> ObservationConfig | None:
        """The environment's observation config in training; None if the task has no such config."""
        data = self.settings["config"].get("observations")
        if data is None:
            return None
        return read_config(ObservationConfig, data, Location("the agent's observations"))

    @property
    def actions(self) -> ActionConfig:
        """What the numbers of an action stood for in training."""
        data = self.settings["config"].get("actions", {})
        names = (scale.name for scale in fields(ActionConfig))
        scales = {name: data[name] for name in names if name in data}
        return read_config(ActionConfig, scales, Location("the agent's actions"))

    @property
    def fingerprint(self) -> str:
        """SHA-256 hash of task and weights, which identifies the agent under any name."""
        digest = hashlib.sha256(self.task.encode())
        for name in sorted(self.weights):
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(self.weights[name]).tobytes())
        return digest.hexdigest()

    def save(self, path: Path) -> None:
        """Write the file atomically.

        Raises:
            InputError: The file cannot be written.
            OSError: The disk is full.
        """
        header = {
            "task": self.task,
            "settings": to_plain(self.settings),
            "discrete": self.discrete,
            "network": to_plain(self.network),
            "training": to_plain(self.training),
        }
        FORMAT.write(path, header, self.weights)

    def environment(self, task: str, settings: Mapping[str, Any]) -> dict[str, Any]:
        """Return the settings of a single environment in which the agent can act.

        Args:
            task: Id of the environment.
            settings: Settings that override the agent's own, except those that determine
                observations and actions. A `config` among them also decides on the tours.

        Raises:
            InputError: The task has no such settings, or the mapper cannot show what the agent saw.
        """
        self._check_mapper(settings.get("mapper"))
        its = dict(self.settings)
        config, kind = dict(its.pop("config", {})), config_kind(task)
        if settings.get("config") is not None:
            config.pop("tour", None)  # Episodes are the evaluation's, the same for all agents.
        where = Location(f"the agent's settings in {task}")
        if settings.get("mapper", its.get("mapper")) != its.get("mapper"):
            its.pop("mapper_config", None)  # They belong to the agent's own mapper.
        base = settings.get("config") or kind()
        seen = read_config(kind, config, where, base)
        return (
            single_env_settings(task, read_settings(task, its, where))
            | dict(settings)
            | {"config": seen}
        )

    def _check_mapper(self, mapper: str | None) -> None:
        """Raise InputError if a mapper (None: its own) cannot show what the agent saw."""
        seen = self.observation_config
        if mapper is None or seen is None:
            return
        spec = None if mapper == NO_MAPPER else mapper_spec(mapper)
        try:
            seen.fitted(seen.laser, seen.sonar, spec, has_compass=seen.has_compass)
        except InputError as error:
            expected = "one that shows what the agent saw in its training"
            raise InputError("mapper", expected, f"{mapper} ({error})") from None


def read_agent(path: Path) -> AgentFile:
    """Read the agent in a file.

    Raises:
        InputError: The file is missing, truncated, of another version, or has missing, invalid
            or extra content; the message names the place in the file.
    """
    kind = kind_of(path)
    if kind not in ("", AGENT):
        raise InputError(path, AGENT, kind)
    header, weights = FORMAT.read(path)
    where = Location(f"{path}, {HEADER}")
    kinds = {"task": str, "settings": dict[str, Any], "discrete": bool}
    kinds |= {"network": NetworkConfig, "training": TrainingFacts}
    fields = read_record(kinds, header, where)
    if fields["task"] not in task_names():
        raise where.at("task").error(f"one of {', '.join(task_names())}", fields["task"])
    _check_settings(fields["task"], fields["settings"], fields["network"], where.at("settings"))
    _check_curve(fields["training"].curve, where.at("training", "curve"))
    _check_weights(path, fields["network"], weights)
    return AgentFile(**fields, weights=weights)


def kept_settings(
    task: str, settings: Mapping[str, Any], observation_config: Any
) -> dict[str, Any]:
    """Return the settings that determine an agent's observations and actions, as plain data.

    Args:
        task: Id of the environment.
        settings: The settings.
        observation_config: The environment's observation config, adapted to its sensors.
    """
    kept = {name: to_plain(settings[name]) for name in KEPT_SETTINGS if name in settings}
    config = to_plain(settings.get("config") or config_kind(task)())
    if "observations" in config:
        config["observations"] = to_plain(observation_config)
    return kept | {"config": {key: config[key] for key in KEPT_CONFIG if key in config}}


def _check_settings(
    task: str, settings: Mapping[str, Any], network: NetworkConfig, where: Location
) -> None:
    """Raise InputError for invalid settings, or observations that do not fit the network."""
    unknown = sorted(settings.keys() - set(KEPT_SETTINGS))
    if unknown:
        raise where.error(f"only {', '.join(KEPT_SETTINGS)}", unknown[0])
    read_settings(task, settings, where)
    where = where.at("config")
    config = settings.get("config")
    if not isinstance(config, Mapping) or set(config) - set(KEPT_CONFIG):
        raise where.error(f"a mapping with {' and '.join(KEPT_CONFIG)}", format_value(config))
    if "observations" not in config:
        return
    where = where.at("observations")
    observation_config = read_config(ObservationConfig, config.get("observations"), where)
    # Compare before anything of this size is allocated: it must match the arrays in the file.
    length = sum(math.prod(shape) for shape in observation_config.shapes.values())
    if length != network.inputs:
        raise where.error(f"observations of {network.inputs} numbers", f"{length}")
    for encoder in network.encoders:
        begin = getattr(observation_config.layout, encoder.part, -1)
        shape = observation_config.shapes.get(encoder.part)
        if (begin, shape) != (encoder.begin, encoder.shape):
            expected = f"the part {encoder.part} of shape {encoder.shape} from {encoder.begin} on"
            raise where.error(
                expected, f"one of shape {shape} from {begin} on" if shape else "none"
            )


def _check_curve(curve: Mapping[str, list[float]], where: Location) -> None:
    """Raise InputError unless a learning curve is empty, or can be drawn over its samples."""
    lengths = {name: len(values) for name, values in curve.items()}
    if lengths and (len(set(lengths.values())) > 1 or not {"samples", "return"} <= set(lengths)):
        found = ", ".join(f"{count} in {name}" for name, count in lengths.items())
        raise where.error("lists of one length, samples and return among them", found)


def _check_weights(path: Path, network: NetworkConfig, weights: Mapping[str, np.ndarray]) -> None:
    """Raise InputError unless the arrays have the names, shapes and type of the network."""
    shapes = network.shapes
    for name in sorted(shapes.keys() | weights.keys()):
        place = f"{name}.npy"
        if name not in weights:
            raise InputError(path, f"the array {name}", "none", place=place)
        if name not in shapes:
            raise InputError(path, "only arrays of the network", name, place=place)
        array = weights[name]
        if array.shape != shapes[name] or array.dtype != np.float32:
            expected = f"shape {shapes[name]} of float32"
            raise InputError(path, expected, f"{array.shape} of {array.dtype}", place=place)
        # Larger values overflow in exponentials and sums of products.
        most = LARGEST_LOG_STD if name == "action.log_std" else LARGEST_WEIGHT
        if not (np.abs(array) <= most).all():
            raise InputError(
                path,
                f"finite numbers within ±{most:g}",
                "NaN, infinity or a larger number",
                place=place,
            )
