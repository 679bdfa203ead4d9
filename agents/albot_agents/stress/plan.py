"""Which episodes a stress run consists of."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass

from albot_core.errors import InputError
from albot_maps import load_world
from albot_maps.generators.spec import KINDS, PREFIX, seeded

ALL_KINDS = "random"
"""The spec that stands for all kinds of random worlds in turn."""


@dataclass(frozen=True, kw_only=True)
class Episode:
    """One agent in one world: the same as `albot play` with these options."""

    world: str
    """The world's spec."""
    agent: str
    """The agent's name."""
    mapper: str
    """Name of the mapper inside, or `none`."""
    seed: int
    """Seed of environment and agent."""
    steps: int
    """Its length, in control steps."""

    def command(self, steps: int) -> str:
        """The command that shows its first `steps` steps again."""
        options = {
            "world": self.world,
            "agent": self.agent,
            "mapper": self.mapper,
            "seed": self.seed,
            "steps": max(1, steps),
        }
        words = [word for name, value in options.items() for word in (f"--{name}", str(value))]
        return shlex.join(("albot", "play", *words))


@dataclass(frozen=True, kw_only=True)
class Violation:
    """Something that must not be, and where it was."""

    episode: Episode
    """The episode."""
    step: int
    """The step after which it was seen; 0 for the reset."""
    what: str
    """What is wrong, in one line."""

    @property
    def command(self) -> str:
        """The command that shows it again."""
        return self.episode.command(self.step)


def plan_episodes(
    spec: str, agents: Sequence[str], *, count: int, first: int, mapper: str, steps: int
) -> list[Episode]:
    """Every agent in every world.

    Args:
        spec: `random:KIND` or `random:KIND?…` for as many worlds of the kind, with seeds
            that count up from `first`; `random` for all kinds in turn; any other world
            spec for one world.
        agents: Names of the agents.
        count: How many worlds; of one world: how many seeds.
        first: The first seed; the seeds of the episodes count up from it.
        mapper: Name of the mapper inside.
        steps: Length of an episode.

    Raises:
        InputError: There is no such world. Of random worlds the first of each kind is
            made, to see.
    """
    worlds = _worlds(spec, count, first)
    for world in dict.fromkeys((*worlds[: len(KINDS)], worlds[-1])):
        load_world(world)
    return [
        Episode(world=world, agent=agent, mapper=mapper, seed=first + k, steps=steps)
        for k, world in enumerate(worlds)
        for agent in agents
    ]


def _worlds(spec: str, count: int, first: int) -> list[str]:
    """The worlds' specs, one for each seed."""
    body, _, query = spec.partition("?")
    if body == ALL_KINDS:
        if query:
            expected = f"parameters after a kind, as {PREFIX}{KINDS[0]}?{query}"
            raise InputError(spec, expected, "all kinds")
        turns = range(count)
        return [f"{PREFIX}{KINDS[k % len(KINDS)]}:{first + k // len(KINDS)}" for k in turns]
    return [seeded(spec, first + k) for k in range(count)]
