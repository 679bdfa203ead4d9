"""What `albot play` runs: task, agent, and the settings of the environment."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from albot_cli.config import read_task_config
from albot_cli.evaluate import way_out
from albot_cli.mappers import read_robots_config
from albot_core.errors import InputError

if TYPE_CHECKING:
    from albot_agents.registry import AgentEntry

AGENTS = {
    "Albot/Explore-v0": "gap-explorer",
    "Albot/Homing-v0": "albot1-homing",
    "Albot/HomingByMap-v0": "patch-homing",
    "Albot/ExploreAndHome-v1": "round-trip",
    "Albot/PlaceRecognition-v0": "place-judge",
}
"""The default agent of each task."""
PROBED = "albot1-homing"
"""The default agent of the probes."""


def choose_agent(task: str | None, agent: str | None) -> tuple[str, str, AgentEntry]:
    """Return the id of a task, and the name and entry of its agent.

    Raises:
        InputError: There is no such task or agent, or the agent is not for the task.
    """
    from albot_agents.registry import agent_names, find_agent
    from albot_agents.task import find_task, is_probe, untwinned
    from albot_cli.keyboard import KEYBOARD, Keyboard

    task = None if task is None else find_task(task)
    if agent is None:
        agent = PROBED if task and is_probe(task) else AGENTS[untwinned(task or next(iter(AGENTS)))]
    entry = KEYBOARD if agent == Keyboard.name else find_agent(agent)
    task = task or entry.tasks[0]
    if not entry.attempts(task):
        names = (*agent_names(task), *([Keyboard.name] if KEYBOARD.attempts(task) else []))
        found = f"{agent}, which is for {' and '.join(entry.tasks)}"
        raise InputError("--agent", f"one for {task}: {', '.join(names)}", found)
    return task, agent, entry


def environment_settings(
    task: str,
    entry: AgentEntry,
    asked: dict[str, Any],
    config: Path | None,
    mapper_config: Path | None,
    outward: str | None,
) -> dict[str, Any]:
    """Return the settings of the environment; `asked` are those of options, None if not given."""
    settings = {name: value for name, value in asked.items() if value is not None}
    if config is not None:
        settings["config"] = read_task_config(task, config)
    if outward is not None:
        settings["config"] = way_out(task, outward, settings.get("config"))
    settings = entry.environment(task, settings)
    if mapper_config is not None:
        mapper = settings.get("mapper", entry.mapper)
        settings["mapper_config"] = read_robots_config(mapper, mapper_config)
    return settings
