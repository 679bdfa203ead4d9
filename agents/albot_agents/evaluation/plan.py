"""Which episodes an evaluation consists of."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import gymnasium

import albot_env
from albot_core.errors import InputError
from albot_maps import World, load_world
from albot_maps.generators.spec import PREFIX, seeded

assert albot_env.__doc__  # Importing it registers the environments.


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One agent in one episode."""

    task: str
    """Id of the environment."""
    agent: str
    """The agent's name."""
    world: str
    """The world's spec."""
    seed: int
    """Seed of environment and agent."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """What else `gymnasium.make` is given."""

    def make(self) -> gymnasium.Env[Any, Any]:
        """Its environment.

        Raises:
            InputError: There is no such world, mapper or sensor.
        """
        settings = {"world": self.loaded_world, **self.settings}
        return gymnasium.make(self.task, disable_env_checker=True, **settings)

    @property
    def loaded_world(self) -> World:
        """Its world: for trials that follow each other in one world the same object.

        Raises:
            InputError: There is no such world.
        """
        return _loaded(self.world)


@lru_cache(maxsize=4)
def _loaded(spec: str) -> World:
    return load_world(spec)


MOST_SEEDS = 1_000_000
"""Episodes in more would fill the memory before the first begins."""


def parse_seeds(text: str) -> range:
    """The seeds of `A..B`, both included, or of one number.

    Raises:
        InputError: The text is neither, B is below A, or they are more than anyone waits for.
    """
    found = re.fullmatch(r"(\d{1,18})(?:\.\.(\d{1,18}))?", text.strip())
    if found is None:
        raise InputError("--seeds", "A..B, as 1000..1019, or one seed", text or "nothing")
    first, last = int(found[1]), int(found[2] or found[1])
    if last < first:
        raise InputError("--seeds", "a range A..B with B at least A", text)
    if last - first >= MOST_SEEDS:
        raise InputError("--seeds", f"at most {MOST_SEEDS:,} seeds", text)
    return range(first, last + 1)


def plan_trials(
    task: str, agent: str, worlds: Sequence[str], seeds: range, settings: Mapping[str, Any]
) -> list[Trial]:
    """Every world with every seed; of `random:KIND` each seed is a world of its own.

    Args:
        task: Id of the environment.
        agent: The agent's name.
        worlds: World specs, `random:KIND` and `random:KIND?…` among them, and patterns of
            files such as `plans/*.yaml`.
        seeds: The seeds.
        settings: What else environments are given.

    Raises:
        InputError: There is no such world. Of random ones the first and the last are made.
    """
    trials = [
        Trial(task=task, agent=agent, world=seeded(world, seed), seed=seed, settings=settings)
        for spec in worlds
        for world in _files(spec)
        for seed in seeds
    ]
    for spec in dict.fromkeys(trial.world for trial in (*trials[:1], *trials[-1:])):
        load_world(spec)
    return trials


def _files(spec: str) -> list[str]:
    """The files that a pattern stands for; another spec as it is."""
    if spec.startswith(PREFIX) or not any(sign in spec for sign in "*?["):
        return [spec]
    path = Path(spec)
    found = sorted(str(file) for file in Path(path.anchor).glob(str(path.relative_to(path.anchor))))
    if not found:
        raise InputError("--worlds", "a pattern of files that are there", spec)
    return found
