"""`albot stress`: drive agents through many worlds and check every step."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from albot_cli import completion
from albot_cli.count_type import CountType
from albot_cli.engine_options import engine_options
from albot_cli.mappers import mapper_config_option, read_robots_config
from albot_cli.outputs import JSON
from albot_cli.progress import progress
from albot_cli.robots import robot_option
from albot_cli.signals import STOPPED
from albot_core.counts import many

if TYPE_CHECKING:
    from albot_agents.engine.engine import Engine
    from albot_agents.stress import Episode, Outcome

_LARGEST_SEED = 2**64 - 1
"""Largest seed of a random world."""


@click.command()
@click.option(
    "--worlds",
    default="random",
    show_default=True,
    metavar="SPEC",
    shell_complete=completion.world_names,
    help="random:KIND or random:KIND?KEY=VALUE&…; random for all kinds in turn; or one world.",
)
@click.option(
    "--count",
    default=100,
    show_default=True,
    type=CountType(1, 1_000_000),
    help="Worlds.",
)
@click.option(
    "--steps",
    default=300,
    show_default=True,
    type=CountType(1),
    help="Length of an episode, in steps of 0.1 s.",
)
@click.option(
    "--seed",
    default=0,
    show_default=True,
    type=CountType(0, _LARGEST_SEED),
    help="The first seed, of worlds and episodes.",
)
@click.option(
    "--agent",
    "agents",
    multiple=True,
    default=("gap-explorer", "random"),
    shell_complete=completion.agent_names,
    show_default=True,
    help="association-explorer, exploring (--mapper albot1), gap-explorer, nearest-frontier, "
    "onward-follower, random, ratslam-explorer, or the file of a trained agent; repeatable.",
)
@click.option(
    "--mapper",
    default="none",
    show_default=True,
    shell_complete=completion.robots_mapper_names,
    help="See `albot mappers`; or none.",
)
@mapper_config_option
@robot_option
@engine_options
@JSON
def command(
    worlds: str,
    count: int,
    steps: int,
    seed: int,
    agents: tuple[str, ...],
    mapper: str,
    mapper_config: Path | None,
    robot: str | None,
    engine: Engine,
    as_json: bool,
) -> int:
    """Drive agents through many worlds and check every step.

    No number may be NaN or outside its space. Each reward must be the sum of its terms. No robot
    may be inside or behind a wall, or inside a movable. Each laser beam must be as long as the
    distance to the nearest surface, and each sonar echo must come from a possible surface. Each
    violation is printed with the command that reproduces it. The exit status is 0 without
    violations, 1 with some, and 130 if Ctrl-C stops it.
    """
    from albot_agents.registry import EXPLORE, check_agent
    from albot_agents.stress import plan_episodes

    mapper_parameters = None if mapper_config is None else read_robots_config(mapper, mapper_config)
    chosen = tuple(dict.fromkeys(agents))
    for name in chosen:
        check_agent(name, EXPLORE)
    episodes = plan_episodes(
        worlds,
        chosen,
        count=count,
        first=seed,
        mapper=mapper,
        steps=steps,
        mapper_config=mapper_parameters,
        mapper_config_file=mapper_config,
        robot=robot,
    )
    tally = _Tally()
    _run(episodes, engine, tally)
    click.echo(json.dumps(tally.facts(chosen)) if as_json else tally.text())
    if tally.violations:
        return 1
    return STOPPED if tally.stopped else 0


class _Tally:
    """The results so far."""

    def __init__(self) -> None:
        self._began = time.perf_counter()
        self._worlds: set[tuple[str, int]] = set()
        self._episodes = 0
        self._steps = 0
        self._seconds = 0.0
        self._violations: dict[int, list[dict[str, Any]]] = {}
        self.stopped = False
        """Whether Ctrl-C ended the run."""

    @property
    def violations(self) -> list[dict[str, Any]]:
        """The violations in the order of the episodes, as rows of the JSON."""
        return [row for number in sorted(self._violations) for row in self._violations[number]]

    def add(self, number: int, outcome: Outcome) -> None:
        """Add the outcome of an episode, which has this number in the plan."""
        episode = outcome.episode
        self._worlds.add((episode.world, episode.seed))
        self._episodes += 1
        self._steps += outcome.steps
        self._seconds = time.perf_counter() - self._began
        if outcome.violations:
            self._violations[number] = [
                {
                    "world": episode.world,
                    "agent": episode.agent,
                    "seed": episode.seed,
                    "step": violation.step,
                    "what": violation.what,
                    "command": violation.command,
                }
                for violation in outcome.violations
            ]

    def facts(self, agents: Iterable[str]) -> dict[str, Any]:
        """Return the results as the JSON object."""
        return {
            "worlds": len(self._worlds),
            "agents": list(agents),
            "episodes": self._episodes,
            "steps": self._steps,
            "seconds": self._seconds,
            "steps_per_second": self._steps / self._seconds if self._seconds else 0.0,
            "stopped": self.stopped,
            "violations": self.violations,
        }

    def text(self) -> str:
        """Return the results as text."""
        facts = self.facts(())
        lines = [
            f"step {each['step']}: {each['what']}\n  {each['command']}" for each in self.violations
        ]
        found = len(self.violations)
        lines.append(
            f"{many(facts['worlds'], 'world')}, {many(facts['episodes'], 'episode')}, "
            f"{many(facts['steps'], 'step')} in {facts['seconds']:.0f} s "
            f"({facts['steps_per_second']:,.0f} steps/s): "
            f"{many(found, 'violation') if found else 'no violations'}"
            f"{', stopped before the end' if self.stopped else ''}"
        )
        return "\n".join(lines)


def _run(episodes: list[Episode], engine: Engine, tally: _Tally) -> None:
    """Run the episodes until all are done or Ctrl-C."""
    from albot_agents.engine.engine import Crash
    from albot_agents.stress import crashed_episode, run_episode

    length = episodes[0].steps
    results = engine.run(run_episode, episodes)
    try:
        with progress("stress", len(episodes) * length, "steps") as update, closing(results):
            for count, done in enumerate(results, start=1):
                result = done.result
                if isinstance(result, Crash):
                    result = crashed_episode(done.task, result)
                tally.add(done.number, result)
                update(count * length)
    except KeyboardInterrupt:
        tally.stopped = True
