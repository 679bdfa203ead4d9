"""Demonstrations: what was observed, what an agent would have done, and what came of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from jaxtyping import Bool, Float16, Float32, UInt8

from albot_core.archive import HEADER, ArchiveFormat
from albot_core.errors import InputError
from albot_core.plain_data import Location, differences, read_record, to_plain
from albot_core.ranges import FROM_ONE
from albot_env.tasks.core.actions import ActionConfig

LARGEST = 1 << 31
"""Largest size of all observations together (bytes): they are held in memory."""
FORMAT = ArchiveFormat(
    name="albot-demonstrations", version=1, kind="file of demonstrations", largest=2 * LARGEST
)
GOES_ON, CUT, FAILED, SUCCEEDED = range(4)
"""What came after a step: the next one; nothing that is known, because of the time limit or the end
of a round; or the end of the episode, without success or with it."""
_HEADER = {"task": str, "mapper": str, "agent": str, "seed": int, "rounds": int}
_ARRAYS = ("observations", "actions", "rewards", "begins", "after")
_UNKNOWN = 0.05
"""Largest weight of what is not known in a return that counts as known."""

Samples = Bool[np.ndarray, "sequences steps"]


@dataclass(frozen=True, kw_only=True)
class Lesson:
    """What demonstrations must agree in with the policy that learns from them."""

    task: str
    """Id of the task."""
    mapper: str
    """Name of the mapper, whose beliefs are observed."""
    observations: Mapping[str, Any]
    """The observation config, as plain data."""
    actions: Mapping[str, Any]
    """Scales, names and number of the actions, as plain data."""

    @classmethod
    def of(cls, task: str, settings: Mapping[str, Any], batch: Any) -> Lesson:
        """Return that of a batch of a task's environments, which has these settings."""
        space, config = batch.single_action_space, batch.action_config
        form = {"discrete": int(space.n)} if isinstance(space, spaces.Discrete) else {}
        scales = to_plain(config) | {"names": list(config.names)} | form
        return cls(
            task=task,
            mapper=settings.get("mapper", "albot1"),
            observations=to_plain(batch.observation_config),
            actions=scales,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Demonstrations:
    """Sequences of samples; each environment gives one in each round."""

    lesson: Lesson
    """Task, observations and actions."""
    agent: str
    """Name of the agent."""
    seed: int
    """Seed of the training."""
    rounds: int
    """Number of rounds."""
    observations: Float16[np.ndarray, "sequences steps length"]
    """What the learner would observe, in half precision."""
    actions: np.ndarray
    """What the agent would do: float32 (sequences, steps, numbers), or int64 (sequences, steps)."""
    rewards: Float32[np.ndarray, "sequences steps"]
    """Rewards of what was done."""
    begins: Samples
    """Whether an episode begins."""
    after: UInt8[np.ndarray, "sequences steps"]
    """`GOES_ON`, `CUT`, `FAILED` or `SUCCEEDED`."""

    @property
    def count(self) -> int:
        """Number of samples."""
        return self.rewards.size

    @property
    def success_rate(self) -> float | None:
        """Success rate of the agent alone, in the first round.

        None if no episode came to an end of its own, as in a task that only time ends.
        """
        after = self.first(1).after
        ended = (after >= FAILED).sum()
        episodes = ended + (after[:, :-1] == CUT).sum()
        return float((after == SUCCEEDED).sum() / episodes) if ended else None

    @property
    def shows_an_end(self) -> bool:
        """Whether any episode came to its end, be it by a time limit, before its round did."""
        return bool(self.begins[:, 1:].any() or (self.after >= FAILED).any())

    def returns(self, gamma: float) -> tuple[Float32[np.ndarray, "sequences steps"], Samples]:
        """Return the discounted returns, and which of them are known well enough.

        A return is not known if what came after a cut would have a weight in it of more than 0.05.
        """
        returns, unknown = np.zeros(self.rewards.shape), np.zeros(self.rewards.shape)
        later, weight = np.zeros(len(self.rewards)), np.ones(len(self.rewards))
        for step in reversed(range(self.rewards.shape[1])):
            after = self.after[:, step]
            later = self.rewards[:, step] + gamma * np.where(after == GOES_ON, later, 0.0)
            weight = gamma * np.where(after == GOES_ON, weight, after == CUT)
            returns[:, step], unknown[:, step] = later, weight
        return returns.astype(np.float32), unknown <= _UNKNOWN

    def said(self, config: ActionConfig) -> dict[str, Samples]:
        """Return for each statement, such as `declare`, in which samples the agent says it."""
        numbers = self.actions
        if "discrete" in self.lesson.actions:
            if "turn rate" not in config.names:
                return {}
            numbers = config.choices[self.actions]
        rows = numbers.reshape(self.count, -1).astype(np.float64)
        shape = self.rewards.shape
        return {name: config.flagged(rows, name).reshape(shape) for name in config.names[2:]}

    def first(self, rounds: int) -> Demonstrations:
        """Return those of the first rounds."""
        count = len(self.rewards) * rounds // self.rounds
        arrays: dict[str, Any] = {name: getattr(self, name)[:count] for name in _ARRAYS}
        return replace(self, rounds=rounds, **arrays)

    def joined(self, other: Demonstrations) -> Demonstrations:
        """Return these and others as one, of as many rounds as both."""
        arrays: dict[str, Any] = {
            name: np.concatenate((getattr(self, name), getattr(other, name))) for name in _ARRAYS
        }
        return replace(self, rounds=self.rounds + other.rounds, **arrays)

    def save(self, path: Path) -> None:
        """Write the file atomically.

        Raises:
            InputError: The file cannot be written.
            OSError: The disk is full.
        """
        header = {
            **to_plain(self.lesson),
            "agent": self.agent,
            "seed": self.seed,
            "rounds": self.rounds,
        }
        FORMAT.write(path, header, {name: getattr(self, name) for name in _ARRAYS})


def read_demonstrations(path: Path, lesson: Lesson, length: int) -> Demonstrations:
    """Read demonstrations for a policy.

    Args:
        path: The file.
        lesson: Task, observations and actions of the policy.
        length: Length of an observation.

    Raises:
        InputError: The file is missing, damaged or no such file, or its demonstrations are of
            another task, other observations or other actions; the message names the place.
    """
    header, arrays = FORMAT.read(path)
    where = Location(f"{path}, {HEADER}")
    plain = {"observations": dict[str, Any], "actions": dict[str, Any]}
    fields = read_record(_HEADER | plain, header, where)
    if fields["rounds"] not in FROM_ONE:
        raise where.at("rounds").error(FROM_ONE.expected, str(fields["rounds"]))
    for name in ("task", "mapper"):
        if fields.pop(name) != getattr(lesson, name):
            raise where.at(name).error(getattr(lesson, name), str(header[name]))
    for name in ("observations", "actions"):
        differing = differences(fields.pop(name), getattr(lesson, name))
        if differing:
            raise where.at(name).error(f"the {name} of the plan", "; ".join(differing))
    _check_arrays(path, arrays, lesson, length)
    content: dict[str, Any] = {**fields, **arrays}
    return Demonstrations(lesson=lesson, **content)


def _check_arrays(
    path: Path, arrays: Mapping[str, np.ndarray], lesson: Lesson, length: int
) -> None:
    """Raise InputError unless the arrays have the right names, shapes, types and values."""
    if arrays.keys() != set(_ARRAYS):
        raise InputError(path, f"the arrays {', '.join(_ARRAYS)}", ", ".join(sorted(arrays)))
    shape = arrays["rewards"].shape
    choices = lesson.actions.get("discrete", 0)
    acted = shape if choices else (*shape, len(lesson.actions["names"]))
    kinds: dict[str, tuple[tuple[int, ...], Any]] = {
        "observations": ((*shape, length), np.float16),
        "actions": (acted, np.int64 if choices else np.float32),
        "rewards": (shape, np.float32),
        "begins": (shape, np.bool_),
        "after": (shape, np.uint8),
    }
    for name, (expected, kind) in kinds.items():
        array, place = arrays[name], f"{name}.npy"
        if array.shape != expected or len(shape) != 2 or not array.size or array.dtype != kind:
            found = f"{array.shape} of {array.dtype}"
            raise InputError(path, f"{expected} of {np.dtype(kind)}", found, place=place)
        most = {"actions": choices - 1 if choices else 1, "after": SUCCEEDED, "rewards": np.inf}
        least = {"actions": 0 if choices else -1, "rewards": -np.inf}
        if not (
            np.isfinite(array) & (array >= least.get(name, -1)) & (array <= most.get(name, 1))
        ).all():
            raise InputError(path, "numbers within their range", "others", place=place)
