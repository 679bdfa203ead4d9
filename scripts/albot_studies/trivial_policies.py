"""Returns of trivial policies beside a scripted agent's, in every task in which the agent drives.

A reward is worth learning only if no trivial policy earns more of it than one that does the task.
Each policy meets the same episodes: the same worlds, starts, outward journeys and changes.

- *still*, *spin*, *to and fro*, *along walls*: drive so, and say nothing;
- *declare at once*: says that it is home in the first step;
- *home-vector*, *hint-follower*: the agents of these names;
- *wait, then scripted*: stands still for half of the time, then acts as the scripted agent;
- *scripted*: the scripted agent of the task;
- *scripted, no claims*, *all claims*, *flag claims*: the same, but it never claims to know a place,
  always does, or does so whenever the mapper says that the place is known.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
import gymnasium
import numpy as np

from albot_agents.agent import EnvironmentConfigs
from albot_agents.evaluation.plan import parse_seeds
from albot_agents.registry import make_agent
from albot_cli.outputs import JSON
from albot_cli.path_type import PathType
from albot_core.evaluation.intervals import bootstrap
from albot_core.files import write_text
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.parts.beliefs import PLACE, WAY
from albot_env.tasks.core.parts.sensors import LASER
from albot_maps import World, load_world

DISCOUNT = 0.995
"""Discount factor of the discounted returns."""
TASKS = {
    "Albot/Explore-v0": "gap-explorer",
    "Albot/Homing-v0": "albot1-homing",
    "Albot/HomingByMap-v0": "patch-homing",
    "Albot/ExploreAndHome-v1": "round-trip",
}
"""The tasks in which the agent drives, and the scripted agent of each."""
FOLLOWERS = ("home-vector", "hint-follower")
"""Policies that are agents."""
STEPS = {"Albot/Explore-v0": 3000}
"""Number of steps after which an episode is truncated, where not by the task's own limit."""

Act = Callable[[Any, int], np.ndarray]
"""Returns an action for an observation and the number of steps made."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Setting:
    """The environment of a policy."""

    configs: EnvironmentConfigs
    """Its configurations."""
    limit: int
    """Number of steps after which its episodes end."""
    scripted: Act
    """The policy, if it is an agent; else the task's scripted agent."""

    def action(self, speed: float, turn: float, *says: str) -> np.ndarray:
        """Return an action: shares of the greatest speed and turn rate, and what is said."""
        names = self.configs.actions.names
        numbers = np.full(len(names), -1.0, np.float32)
        numbers[:2] = np.clip((speed, turn), -1, 1)
        for name in says:
            if name in names:
                numbers[names.index(name)] = 1.0
        return numbers

    def decode(self, part: Any, observation: Any) -> Any:
        """Return what a part of an observation stands for."""
        return self.configs.observations.decode(part, observation)


def still(setting: Setting, observation: Any, step: int) -> np.ndarray:
    """Stand still."""
    return setting.action(0.0, 0.0)


def spin(setting: Setting, observation: Any, step: int) -> np.ndarray:
    """Turn on the spot."""
    return setting.action(0.0, 0.5)


def to_and_fro(setting: Setting, observation: Any, step: int) -> np.ndarray:
    """Drive four seconds forwards, then four backwards."""
    return setting.action(0.5 if step // 40 % 2 == 0 else -0.5, 0.0)


def along_walls(setting: Setting, observation: Any, step: int) -> np.ndarray:
    """Keep the wall on the right at half a metre."""
    ranges = setting.decode(LASER, observation)
    beams = len(ranges)
    right, ahead = ranges[: beams // 4].min(), ranges[beams // 3 : 2 * beams // 3].min()
    if ahead < 0.7:
        return setting.action(0.0, 0.5)
    return setting.action(0.4, float(np.clip(0.6 * (0.5 - right), -0.4, 0.4)))


def declare_at_once(setting: Setting, observation: Any, step: int) -> np.ndarray:
    """Say that home is here."""
    return setting.action(0.0, 0.0, "declare")


def wait_then_scripted(setting: Setting, observation: Any, step: int) -> np.ndarray:
    """Stand still for half of the time."""
    action = setting.scripted(observation, step)
    return action if step >= setting.limit // 2 else setting.action(0.0, 0.0)


def scripted(setting: Setting, observation: Any, step: int) -> np.ndarray:
    """Act as the scripted agent."""
    return setting.scripted(observation, step)


def claiming(rule: str, setting: Setting, observation: Any, step: int) -> np.ndarray:
    """Act as the scripted agent, but claim by a rule: `never`, `always` or `flag`."""
    action = setting.scripted(observation, step).copy()
    is_known = rule == "flag" and setting.decode(PLACE, observation).is_recognised
    action[setting.configs.actions.names.index("claim")] = (
        1.0 if rule == "always" or is_known else -1.0
    )
    return action


POLICIES: dict[str, Callable[[Setting, Any, int], np.ndarray]] = {
    "still": still,
    "spin": spin,
    "to and fro": to_and_fro,
    "along walls": along_walls,
    "declare at once": declare_at_once,
    **dict.fromkeys(FOLLOWERS, scripted),
    "wait, then scripted": wait_then_scripted,
    "scripted, no claims": partial(claiming, "never"),
    "scripted, all claims": partial(claiming, "always"),
    "scripted, flag claims": partial(claiming, "flag"),
    "scripted": scripted,
}
"""The policies by name."""


def policies_for(names: Sequence[str], parts: Sequence[str]) -> Iterator[str]:
    """Yield the policies that differ in a task whose actions and observations have these names."""
    for policy in POLICIES:
        if policy == "hint-follower" and WAY.name not in parts:
            continue
        if policy in ("declare at once", *FOLLOWERS) and "declare" not in names:
            continue
        if "claims" in policy and "claim" not in names:
            continue
        yield policy


@dataclass(frozen=True, kw_only=True)
class Episode:
    """What a policy earned in an episode."""

    earned: float
    """Plain sum of the rewards."""
    discounted: float
    """Sum of the rewards, each multiplied by `DISCOUNT` to the power of its step."""
    success: bool | None
    """Whether the task was done; None if the task has no end."""
    right_claims: int
    false_claims: int


def make_environment(task: str, world: World) -> Any:
    """Make the environment in which all policies of a task act, with `albot1`."""
    settings: dict[str, Any] = {}
    if task == "Albot/Explore-v0":
        parts = (*ObservationConfig().parts, "matches")
        settings["config"] = {"observations": {"parts": list(parts)}}
    return gymnasium.make(
        task, world=world, mapper="albot1", max_episode_steps=STEPS.get(task), **settings
    )


def run_episode(task: str, world: World, seed: int, policy: str) -> Episode:
    """Let a policy act in an episode.

    Args:
        task: Id of the environment.
        world: The world.
        seed: Seed of the episode.
        policy: One of `POLICIES`.
    """
    env = make_environment(task, world)
    configs = EnvironmentConfigs.of(env)
    agent = make_agent(policy if policy in FOLLOWERS else TASKS[task], configs)
    agent.reset(np.random.default_rng((seed, 1)), env.action_space)
    limit = env.spec.max_episode_steps or 3000
    setting = Setting(
        configs=configs,
        limit=limit,
        scripted=lambda observation, _: np.asarray(agent.act(observation, {})),
    )
    observation, info = env.reset(seed=seed)
    earned = discounted = 0.0
    step, is_over = 0, False
    while not is_over:
        action = POLICIES[policy](setting, observation, step)
        observation, reward, terminated, truncated, info = env.step(action)
        earned += float(reward)
        discounted += DISCOUNT**step * float(reward)
        step, is_over = step + 1, terminated or truncated
    env.close()
    return Episode(
        earned=earned,
        discounted=discounted,
        success=bool(info["is_success"]) if "is_success" in info else None,
        right_claims=int(info.get("right_claims", 0)),
        false_claims=int(info.get("false_claims", 0)),
    )


def measure(tasks: Sequence[str], worlds: str, seeds: range) -> list[dict[str, Any]]:
    """Let all policies act in an episode of each world; return one row per task and policy."""
    rows = []
    for task in tasks:
        episodes: dict[str, list[Episode]] = {}
        for seed in seeds:
            world = load_world(worlds.replace("SEED", str(seed)))
            env = make_environment(task, world)
            configs = EnvironmentConfigs.of(env)
            env.close()
            for policy in policies_for(configs.actions.names, configs.observations.parts):
                episode = run_episode(task, world, seed, policy)
                episodes.setdefault(policy, []).append(episode)
        rows += [_row(task, policy, done) for policy, done in episodes.items()]
    return rows


def _row(task: str, policy: str, episodes: list[Episode]) -> dict[str, Any]:
    earned = np.array([episode.earned for episode in episodes])
    low, high = bootstrap(earned, np.mean, np.random.default_rng(0))
    right = sum(episode.right_claims for episode in episodes)
    false = sum(episode.false_claims for episode in episodes)
    successes = [episode.success for episode in episodes if episode.success is not None]
    return {
        "task": task,
        "policy": policy,
        "episodes": len(episodes),
        "return": round(float(earned.mean()), 2),
        "low": round(low, 2),
        "high": round(high, 2),
        "discounted": round(float(np.mean([each.discounted for each in episodes])), 2),
        "success": round(float(np.mean(successes)), 3) if successes else None,
        "right_claims": right,
        "false_claims": false,
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows as Markdown, one table per task."""
    lines = []
    for task in dict.fromkeys(row["task"] for row in rows):
        lines += [
            f"### {task}",
            "",
            "| policy | return (95 %) | discounted | success | right and false claims |",
            "|---|---|---|---|---|",
        ]
        for row in rows:
            if row["task"] != task:
                continue
            success = "–" if row["success"] is None else f"{row['success']:.0%}"
            lines.append(
                f"| {row['policy']} | {row['return']:.1f} ({row['low']:.1f} to {row['high']:.1f}) "
                f"| {row['discounted']:.1f} | {success} "
                f"| {row['right_claims']}, {row['false_claims']} |"
            )
        lines.append("")
    return "\n".join(lines)


@click.command()
@click.option("--task", "tasks", multiple=True, type=click.Choice(list(TASKS)), help="Only this.")
@click.option("--worlds", default="random:office:SEED", show_default=True)
@click.option("--seeds", default="31000..31019", show_default=True)
@click.option("--out", type=PathType(), help="File for the table, as Markdown.")
@JSON
def command(
    tasks: tuple[str, ...], worlds: str, seeds: str, out: Path | None, as_json: bool
) -> None:
    """Measure what trivial policies earn in each task, beside a scripted agent."""
    rows = measure(tasks or tuple(TASKS), worlds, parse_seeds(seeds))
    if out is not None:
        write_text(out, table(rows))
    files = [] if out is None else [str(out)]
    click.echo(json.dumps({"rows": rows, "files": files}) if as_json else table(rows))
    if not as_json and files:
        click.echo(files[0])
