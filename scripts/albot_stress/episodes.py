"""The episodes of a stress run: what runs, and what came of it."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium

from albot_agents.registry import EXPLORE, find_agent
from albot_agents.task import short_name
from albot_core.errors import InputError
from albot_core.robot import DEFAULT_ROBOT, choose_robot
from albot_maps import World, load_world
from albot_maps.generators.spec import KINDS, PREFIX, seeded

ALL_KINDS = "random"
"""The spec that means all kinds of random worlds in turn."""
TOGETHER = 64
"""Number of worlds whose episodes one process steps together, at most."""


@dataclass(frozen=True, kw_only=True)
class Episode:
    """One agent in one world; the same episode as `albot play` with these options."""

    world: str
    """The world's spec."""
    agent: str
    """The agent's name."""
    mapper: str
    """Name of the mapper in the environment, or `none`."""
    seed: int
    """Seed of environment and agent."""
    steps: int
    """Length of the episode (control steps)."""
    task: str = EXPLORE
    """Id of the environment."""
    mapper_config: Any = None
    """The mapper's parameters; None for the defaults."""
    mapper_config_file: Path | None = None
    """The YAML file with these parameters."""
    robot: str | None = None
    """Name of the robot; None for the agent's own."""
    odometer: str | None = None
    """Name of the odometer's preset; None for the environment's own."""
    faults: str | None = None
    """Spec of the faults; None for none."""
    movables: bool = True
    """Whether doors, boxes and people are simulated in worlds that have them."""

    @property
    def radius(self) -> float:
        """Radius of the robot for which its world is made (m)."""
        return choose_robot(self.robot or DEFAULT_ROBOT, "robot").radius

    def load_world(self) -> World:
        """Load its world.

        Raises:
            InputError: There is no such world, or it is not valid for the robot.
        """
        return load_world(self.world, self.radius)

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of its environment but for the world.

        Raises:
            InputError: There is no such agent.
        """
        asked: dict[str, Any] = {"mapper": self.mapper, "max_episode_steps": self.steps}
        more = {
            "mapper_config": self.mapper_config,
            "robot": self.robot,
            "odometer": self.odometer,
            "faults": self.faults,
            "movables": None if self.movables else False,
        }
        asked |= {name: value for name, value in more.items() if value is not None}
        return find_agent(self.agent).environment(self.task, asked)

    def make(self) -> gymnasium.Env[Any, Any]:
        """Make its environment, for this robot alone.

        Raises:
            InputError: There is no such world, mapper or agent, or the robot lacks a sensor that
                the mapper needs.
        """
        settings = {"world": self.world, **self.settings}
        return gymnasium.make(self.task, disable_env_checker=True, **settings)

    def command(self, steps: int) -> str:
        """Return the command that replays the first `steps` steps."""
        options = {
            "world": self.world,
            "agent": self.agent,
            "mapper": self.mapper,
            "mapper-config": self.mapper_config_file,
            "robot": self.robot,
            "odometer": self.odometer,
            "faults": self.faults,
            "seed": self.seed,
            "steps": max(1, steps),
        }
        given = {name: str(value) for name, value in options.items() if value is not None}
        words = [word for name, value in given.items() for word in (f"--{name}", value)]
        task = () if self.task == EXPLORE else (short_name(self.task),)
        rest = () if self.movables else ("--no-movables",)
        return shlex.join(("albot", "play", *task, *words, *rest))


@dataclass(frozen=True, kw_only=True)
class Violation:
    """A failed check, and where it failed."""

    episode: Episode
    """The episode."""
    step: int
    """Number of the step after which the check failed; 0 for the reset."""
    what: str
    """What is wrong, in one line."""
    invariant: str = "error"
    """Name of what must hold (`albot_env.stress.checks.INVARIANTS`)."""

    @property
    def command(self) -> str:
        """The command that reproduces it."""
        return self.episode.command(self.step)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The result of an episode."""

    episode: Episode
    """The episode."""
    steps: int
    """Number of steps taken; the episode ends at the first violation."""
    violations: tuple[Violation, ...]
    """All violations of the last step."""


Job = tuple[tuple[Episode, ...], ...]
"""What one process runs at a time: groups of episodes with the same settings, which are stepped
together; all groups are in the same worlds."""


def world_specs(spec: str, count: int, first: int) -> list[str]:
    """Return the specs of worlds, one per seed.

    Args:
        spec: `random:KIND` or `random:KIND?…` for `count` worlds of the kind, with seeds that
            count up from `first`; `random` for all kinds in turn; any other world spec for
            one world.
        count: Number of worlds, or of seeds if there is one world.
        first: The first seed.

    Raises:
        InputError: The spec is not valid.
    """
    body, _, query = spec.partition("?")
    if body == ALL_KINDS:
        if query:
            expected = f"parameters after a kind, as {PREFIX}{KINDS[0]}?{query}"
            raise InputError(spec, expected, "all kinds")
        turns = range(count)
        return [f"{PREFIX}{KINDS[k % len(KINDS)]}:{first + k // len(KINDS)}" for k in turns]
    return [seeded(spec, first + k) for k in range(count)]


def plan_jobs(episodes: Iterable[Episode], processes: int) -> list[Job]:
    """Divide episodes among processes.

    Args:
        episodes: The episodes.
        processes: Number of processes that share them.
    """
    groups = _groups(episodes)
    places: dict[tuple[str, int], int] = {}
    for episode in (episode for group in groups for episode in group):
        places.setdefault((episode.world, episode.seed), len(places))
    size = max(1, min(TOGETHER, -(-len(places) // processes)))
    jobs: list[list[list[Episode]]] = [[[] for _ in groups] for _ in range(-(-len(places) // size))]
    for number, group in enumerate(groups):
        for episode in group:
            jobs[places[episode.world, episode.seed] // size][number].append(episode)
    return [tuple(tuple(group) for group in job if group) for job in jobs]


def _groups(episodes: Iterable[Episode]) -> list[list[Episode]]:
    """Return episodes by the settings of their environments, which agents may share."""
    groups: list[tuple[str, dict[str, Any], list[Episode]]] = []
    known: list[tuple[Episode, list[Episode]]] = []
    for episode in episodes:
        plain = replace(episode, world="", seed=0)
        own = next((group for kind, group in known if kind == plain), None)
        if own is None:
            settings = episode.settings
            alike = (g for task, s, g in groups if task == episode.task and s == settings)
            own = next(alike, None)
            if own is None:
                own = []
                groups.append((episode.task, settings, own))
            known.append((plain, own))
        own.append(episode)
    return [group for _, _, group in groups]


def alone(job: Job) -> Iterator[Job]:
    """Yield the episodes of a job as jobs of one each."""
    for group in job:
        for episode in group:
            yield ((episode,),)
